"""Python and commands that do what was done in the page."""

from __future__ import annotations

import shlex
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

__all__ = ["call", "command", "plain"]

# Columns of a line.
WIDTH = 88


def plain(value: float) -> str:
    """Write a number as short as its bits allow, without a final ``.0``."""
    text = repr(float(value))
    return text.removesuffix(".0")


def call(function: str, /, *arguments: str, **keywords: object) -> str:
    """Write a call of Python; keywords that are None are left out.

    Parameters
    ----------
    function : str
        The function, and what its result is assigned to.
    *arguments : str
        Arguments as code.
    **keywords : object
        Values, or code in a `Code`.

    Returns
    -------
    str
        One line, or one for each argument where that is too long.
    """
    given = [*arguments, *(f"{k}={v!r}" for k, v in keywords.items() if v is not None)]
    line = f"{function}({', '.join(given)})"
    if len(line) <= WIDTH:
        return line
    inside = "".join(f"    {one},\n" for one in given)
    return f"{function}(\n{inside})"


class Code(str):
    """Code as the value of a keyword."""

    __slots__ = ()

    def __repr__(self) -> str:
        return str(self)


def command(name: str, /, *arguments: str, **options: object) -> str:
    """Write a command for a shell; options that are None, False or empty are left out.

    Parameters
    ----------
    name : str
        The command.
    *arguments : str
        Its arguments.
    **options : object
        Values with their units, True for a flag, or a list for an option that is repeated.

    Returns
    -------
    str
        One line.
    """
    words = ["piezotrack", name, *arguments]
    for key, value in options.items():
        flag = f"--{key.replace('_', '-')}"
        values: Sequence[Any] = value if isinstance(value, list) else [value]
        for one in values:
            if one is True:
                words.append(flag)
            elif one is not None and one is not False and one != "":
                words += [flag, str(one)]
    return shlex.join(words)


def given(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values that are set: neither None nor empty."""
    return {name: value for name, value in values.items() if value not in (None, {}, "", ())}
