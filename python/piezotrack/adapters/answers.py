"""Numbers and texts that devices answer with, none of which is to be believed."""

from __future__ import annotations

from .._support.messages import quoted

__all__ = ["number", "printable", "shown"]

# IEEE 488.2 and SCPI write infinity as 9.9e37 and not-a-number as 9.91e37.
OVERLOAD = 9.9e37
# Most characters of an answer in a message, and of a name.
LENGTH, NAME = 105, 60


def number(text: str) -> float:
    """Read a number; NaN for an overload.

    Raises
    ------
    ValueError
        It is none.

    Examples
    --------
    >>> number("+1.5E+00"), number("9.91e37"), number("1e400")
    (1.5, nan, nan)
    """
    # Python would read 1_0 as 10.
    if "_" in text:
        raise ValueError(text)
    value = float(text)
    return value if abs(value) < OVERLOAD else float("nan")


def shown(answer: str) -> str:
    r"""Quote an answer, shortened, with no more characters where it has to be escaped.

    Examples
    --------
    >>> shown("1=0.5"), len(shown("\x1b" * 1000))
    ("'1=0.5'", 108)
    """
    text = quoted(answer)
    return text if len(text) <= LENGTH else f"{text[:LENGTH]}..."


def printable(name: str) -> str:
    r"""Return the beginning of a device's name, without control characters.

    Examples
    --------
    >>> printable("E-727\x1b[2J, 1.0")
    'E-727[2J, 1.0'
    """
    return "".join(one for one in name[:NAME] if one.isprintable())
