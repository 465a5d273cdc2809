"""The exceptions that piezotrack raises on purpose, and nothing else.

The Rust core raises the same classes (`rust/py/src/errors.rs`), so one ``except`` serves
both languages.
"""

from __future__ import annotations

from typing import Any

__all__ = [
    "DataError",
    "Interrupted",
    "NumericalError",
    "ParameterError",
    "PiezotrackError",
    "ShapeError",
]


class PiezotrackError(Exception):
    """Base class of the exceptions of piezotrack, except `Interrupted`."""


class ParameterError(PiezotrackError, ValueError):
    """An argument has a value that cannot be used: names it, its value, what was expected."""


class ShapeError(PiezotrackError, ValueError):
    """An array has the wrong number of dimensions or entries."""


class DataError(PiezotrackError, ValueError):
    """A file or a record cannot be used: names the file and line, or the sample."""


class NumericalError(PiezotrackError, ArithmeticError):
    """A computation with valid input did not reach a usable result."""


class Interrupted(KeyboardInterrupt):
    """A search was stopped by Ctrl-C or by its callback.

    Attributes
    ----------
    partial : piezotrack.Identification or None
        The best result up to then; None where not one cost had been computed.
    """

    def __init__(self, message: str = "interrupted", partial: Any = None) -> None:
        super().__init__(message)
        self.partial = partial
