"""The exceptions that piezotrack raises on purpose, and nothing else.

The Rust core raises the same classes (`rust/py/src/errors.rs`), so one ``except`` serves
both languages.
"""

from __future__ import annotations

import re
from copy import copy
from typing import Any, Self

__all__ = [
    "DataError",
    "DeviceError",
    "ExecutorError",
    "Interrupted",
    "NumericalError",
    "ParameterError",
    "PiezotrackError",
    "ShapeError",
]


# Characters of a message, at most; what it quotes may be a file in one line.
LONGEST = 480
# The name in the subject of a sentence: "log.csv: thresholds[2]", "bounds of mass".
_ARGUMENT = re.compile(r"(?s)(?:.*: )?([^ \[]*).*")


class PiezotrackError(Exception):
    """Base class of the exceptions of piezotrack, except `Interrupted`.

    The message is one sentence. Its middle is left out where it is long, and control characters,
    which a quoted value may have, are shown as Python writes them.
    """

    def __init__(self, message: str = "") -> None:
        super().__init__(_printable(message))

    def of(self, label: str, **attributes: Any) -> Self:
        """Return the same error with a label before its sentence, as the name of a file.

        Parameters
        ----------
        label : str
            Name of a file, or of one of several; the error stays as it is where it is empty.
        **attributes : object
            Attributes that it has in place of those of the error, as ``argument``.

        Returns
        -------
        PiezotrackError
            Of the same class.
        """
        labelled = copy(self)
        vars(labelled).update(attributes)
        labelled.args = (_printable(f"{label}: {self}" if label else str(self)),)
        return labelled


def _printable(message: str) -> str:
    shown = (c if c.isprintable() else repr(c)[1:-1] for c in _shortened(message))
    return _shortened("".join(shown))


def _shortened(text: str) -> str:
    half = (LONGEST - 5) // 2
    return text if len(text) <= LONGEST else f"{text[:half]} ... {text[-half:]}"


class _ArgumentError(PiezotrackError, ValueError):
    verb = "is"

    def __init__(
        self,
        subject: str = "",
        value: object = None,
        expected: str = "",
        *,
        verb: str = "",
        argument: str | None = None,
    ) -> None:
        if expected:
            argument = argument or _ARGUMENT.sub(r"\1", subject)
            subject = f"{subject} {verb or self.verb} {value}: expected {expected}"
        super().__init__(subject)
        self.argument = argument


class ParameterError(_ArgumentError):
    """An argument has a value that cannot be used: names it, its value, what was expected.

    Its sentence is composed as that of the core's errors, "dt is 0 s: expected a time above 0", of
    the argument, its value as text and what was expected; or it is given whole.

    Attributes
    ----------
    argument : str or None
        Name of the argument, where the error is about one.

    Examples
    --------
    >>> error = ParameterError("dt", "0 s", "a time above 0")
    >>> error.argument, str(error)
    ('dt', 'dt is 0 s: expected a time above 0')
    """


class ShapeError(_ArgumentError):
    """An array has the wrong number of dimensions or entries.

    Attributes
    ----------
    argument : str or None
        Name of the argument, where the error is about one.
    """

    verb = "has"


class DataError(PiezotrackError, ValueError):
    """A file or a record cannot be used: names the file and line, or the sample.

    Attributes
    ----------
    partial : piezotrack.control.Learning or None
        Of a learning on a device, what was learnt up to then.
    """

    partial: Any = None


class NumericalError(PiezotrackError, ArithmeticError):
    """A computation with valid input did not reach a usable result."""


class DeviceError(PiezotrackError, RuntimeError):
    """A device did not do what it was asked, or does not answer: says which, and what it said.

    Attributes
    ----------
    partial : piezotrack.control.loop.tracking.Tracking or piezotrack.control.Learning or None
        Of a loop that was closed on it, the run up to then; of a learning, what was learnt.
    """

    partial: Any = None


class ExecutorError(PiezotrackError, RuntimeError):
    """An executor did not return the tasks that it was given: names how many, and why."""


class Interrupted(KeyboardInterrupt):
    """A search, a loop on a device or a learning was stopped by Ctrl-C or by its callback.

    Attributes
    ----------
    partial : piezotrack.Identification, Comparison, Tracking or Learning, or None
        The best result up to then, the models compared, the run or what was learnt; None where
        there is nothing yet.
    """

    def __init__(self, message: str = "interrupted", partial: Any = None) -> None:
        super().__init__(message)
        self.partial = partial
