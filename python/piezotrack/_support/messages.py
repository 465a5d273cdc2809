"""Foreign values in messages."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["listed", "quoted"]

# Most characters of a value, and most values of a list, in a message.
LENGTH, VALUES = 100, 20


def quoted(value: object) -> str:
    """Write a value as `repr` does, shortened: a field of a file may have millions of letters.

    Examples
    --------
    >>> quoted("x_um"), len(quoted("x" * 1000000))
    ("'x_um'", 105)
    """
    if isinstance(value, (str, bytes)) and len(value) > LENGTH:
        return f"{value[:LENGTH]!r}..."
    try:
        text = repr(value)
    except Exception:
        # A number of thousands of digits; a class of the caller's may raise anything.
        return f"an unprintable {type(value).__name__}"
    return text if len(text) <= LENGTH else f"{text[:LENGTH]}..."


def listed(values: Sequence[object]) -> str:
    """Write values separated by commas, the first ones of many.

    Examples
    --------
    >>> listed(["t", "u"]), listed(range(22))[-17:]
    ("'t', 'u'", '18, 19 and 2 more')
    """
    shown = ", ".join(map(quoted, values[:VALUES]))
    more = len(values) - VALUES
    return f"{shown} and {more} more" if more > 0 else shown
