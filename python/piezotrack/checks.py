"""Numbers that come in as arguments: what they have to be, and the words when they are not."""

from __future__ import annotations

import math

from . import _core
from .errors import ParameterError

__all__ = ["finite", "in_range", "not_negative", "plain", "positive"]


def finite(name: str, value: object, unit: str) -> float:
    """Return a finite number as a float.

    Parameters
    ----------
    name : str
        The argument.
    value : object
        Its value.
    unit : str
        Its unit, for the message.

    Returns
    -------
    float
        The number.

    Raises
    ------
    ParameterError
        It is not a number, or NaN, or infinite.

    Examples
    --------
    >>> finite("low", 3, "m")
    3.0
    """
    number = _core.as_number(name, value)
    if not math.isfinite(number):
        raise ParameterError(f"{name} is {number}: expected a finite number, in {unit}")
    return number


def positive(name: str, value: object, unit: str) -> float:
    """Return a finite number above 0 as a float; arguments and errors as in `finite`.

    Examples
    --------
    >>> positive("frequency", 5, "Hz")
    5.0
    """
    number = _core.as_number(name, value)
    if not 0.0 < number < math.inf:
        raise ParameterError(f"{name} is {number:g}: expected a finite number above 0, in {unit}")
    return number


def not_negative(name: str, value: object, unit: str) -> float:
    """Return a finite number of 0 or above as a float; arguments and errors as in `finite`.

    Examples
    --------
    >>> not_negative("ramp", 0, "s")
    0.0
    """
    return in_range(name, value, math.inf, unit)


def in_range(name: str, value: object, highest: float, unit: str) -> float:
    """Return a finite number from 0 to `highest` as a float.

    Examples
    --------
    >>> in_range("rounding", 1, 1.0, "parts of the period")
    1.0
    """
    number = _core.as_number(name, value)
    if not 0.0 <= number <= highest or number == math.inf:
        end = f"from 0 to {highest:g}" if highest < math.inf else "of 0 or above"
        raise ParameterError(f"{name} is {number:g}: expected a finite number {end}, in {unit}")
    return number


def plain(number: float) -> str:
    """Write a number with up to six digits, and zero without a sign or an exponent.

    Examples
    --------
    >>> plain(110.00000000000001), plain(-1e-15)
    ('110', '0')
    """
    return f"{round(number, 9) + 0.0:.6g}"
