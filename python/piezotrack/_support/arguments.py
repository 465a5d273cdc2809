"""Checks of numeric arguments, with error messages that name argument, value and unit."""

from __future__ import annotations

import math
import os
from collections.abc import Collection, Iterable, Sequence
from itertools import islice
from typing import TYPE_CHECKING, Any, TypeGuard, TypeVar

import numpy as np

from .. import _core
from ..errors import ParameterError
from .arrays import unmasked
from .messages import quoted

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = [
    "as_numbers",
    "bounds",
    "check_length",
    "check_reach",
    "expect",
    "finite",
    "given_or",
    "has_entries",
    "hertz",
    "in_range",
    "not_negative",
    "number_pair",
    "numbers",
    "one_of",
    "one_or_more_numbers",
    "plain",
    "positive",
]

Settings = TypeVar("Settings")
# A displacement [m] that only a wrong unit explains.
TOO_FAR = 1.0
# Frequencies of references [Hz]: beyond them numbers derived from them leave float64.
SLOWEST, FASTEST = 1e-9, 1e12
# Most entries of a list of settings.
MOST_ENTRIES = 1_000_000


def expect(name: str, value: object, kinds: type | tuple[type, ...], expected: str) -> None:
    """Raise ParameterError where a value is of none of the classes `kinds`.

    Examples
    --------
    >>> expect("data", 1.0, str, "a text")
    Traceback (most recent call last):
    piezotrack.errors.ParameterError: data is 1.0: expected a text
    """
    if not isinstance(value, kinds):
        raise ParameterError(name, quoted(value), expected)


def one_of(name: str, value: object, words: Collection[str]) -> None:
    """Raise ParameterError where a value is none of some words; it may be of any class.

    Examples
    --------
    >>> one_of("hold", [0.0, 1.0], ("foh", "zoh"))
    Traceback (most recent call last):
    piezotrack.errors.ParameterError: hold is [0.0, 1.0]: expected 'foh' or 'zoh'
    """
    if not isinstance(value, str) or value not in words:
        *first, last = map(repr, words)
        expected = f"{', '.join(first)} or {last}" if first else last
        raise ParameterError(name, quoted(value), expected)


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
        raise ParameterError(name, number, f"a finite number, in {unit}")
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
        raise ParameterError(name, f"{number:g}", f"a finite number above 0, in {unit}")
    return number


def hertz(name: str, value: object) -> float:
    """Return a frequency from 1e-9 to 1e12 Hz as a float; arguments and errors as in `finite`.

    Examples
    --------
    >>> hertz("frequency", 5)
    5.0
    """
    number = positive(name, value, "Hz")
    if not SLOWEST <= number <= FASTEST:
        raise ParameterError(name, f"{number:g} Hz", f"{SLOWEST:g} to {FASTEST:g} Hz")
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
        raise ParameterError(name, f"{number:g}", f"a finite number {end}, in {unit}")
    return number


def plain(number: float) -> str:
    """Write a number with up to six digits, and zero without a sign or an exponent.

    Examples
    --------
    >>> plain(110.00000000000001), plain(-1e-15)
    ('110', '0')
    """
    return f"{round(number, 9) + 0.0:.6g}"


def bounds(low: object, high: object) -> tuple[float, float]:
    """Return the lowest and the highest displacement [m] of a motion, checked.

    Examples
    --------
    >>> bounds(0, 110e-6)
    (0.0, 0.00011)
    """
    bottom, top = finite("low", low, "m"), finite("high", high, "m")
    check_reach(bottom, top)
    if not bottom < top:
        raise ParameterError("low", f"{bottom:g}", f"less than high, which is {top:g} m")
    return bottom, top


def check_reach(low: float, high: float) -> None:
    """Raise ParameterError if a displacement [m] is so large that it must be in another unit."""
    check_length("low", low)
    check_length("high", high)


def check_length(name: str, value: float) -> None:
    """Raise ParameterError if a length [m] is so large that it must be in another unit."""
    if abs(value) >= TOO_FAR:
        raise ParameterError(
            name,
            f"{value:g}",
            f"metres, and no piezo stage goes so far; {plain(value)} um is {plain(value)}e-6",
        )


def numbers(
    name: str, values: ArrayLike, unit: str, *, least: int = 1, above: float = -math.inf
) -> NDArray[np.float64]:
    """Return one or several finite numbers above `above` as an array of one dimension.

    Examples
    --------
    >>> numbers("levels", [0, 1e-5], "m")
    array([0.e+00, 1.e-05])
    """
    values = unmasked(values)
    several = isinstance(values, Sequence) or (isinstance(values, np.ndarray) and values.ndim > 0)
    entries = _entries(name, values) if several else [values]  # type: ignore[arg-type]
    array = np.array([_core.as_number(name, value) for value in entries])
    if array.size < least:
        raise ParameterError(name, f"{array.size} entries", f"at least {least}", verb="has")
    for number in array:
        if not (math.isfinite(number) and number > above):
            limit = "" if above == -math.inf else f" above {above:g}"
            raise ParameterError(
                name, f"{number:g}", f"finite numbers{limit}, in {unit}", verb="has"
            )
    return array


def number_pair(name: str, ends: object, unit: str) -> tuple[float, float]:
    """Return two finite numbers, of which the first is the lower one.

    Examples
    --------
    >>> number_pair("limits", [0, 75], "V")
    (0.0, 75.0)
    """
    # An array is accepted too, and a column of a table.
    several = isinstance(ends, Sequence) or hasattr(type(ends), "tolist")
    pair = list(islice(ends, 3)) if several and has_entries(ends) else []
    verb = "are" if name.endswith("s") else "is"
    if len(pair) != 2:
        raise ParameterError(name, quoted(ends), f"(low, high) in {unit}", verb=verb)
    low, high = (finite(f"{name}[{i}]", value, unit) for i, value in enumerate(pair))
    if not low < high:
        raise ParameterError(name, f"({low:g}, {high:g}) {unit}", "the lower one first", verb=verb)
    return low, high


def has_entries(value: object) -> TypeGuard[Iterable[Any]]:
    """Whether a value is several: texts are one, and so is an array of no dimension.

    Examples
    --------
    >>> has_entries([1.0]), has_entries("mass"), has_entries(np.array(1.0))
    (True, False, False)
    """
    if isinstance(value, (str, bytes, os.PathLike)) or getattr(value, "ndim", 1) == 0:
        return False
    return isinstance(value, Iterable)


def as_numbers(name: str, values: object) -> tuple[float, ...]:
    """Return a sequence of numbers as a tuple of floats.

    Examples
    --------
    >>> as_numbers("thresholds", [1, 2.5])
    (1.0, 2.5)
    """
    if not has_entries(values):
        raise ParameterError(name, quoted(values), "numbers in a list")
    entries = _entries(name, values)
    return tuple(_core.as_number(f"{name}[{i}]", value) for i, value in enumerate(entries))


def _entries(name: str, values: Iterable[object]) -> list[object]:
    """Return the entries of a list of settings, of which there are never many."""
    entries = list(islice(values, MOST_ENTRIES + 1))
    if len(entries) > MOST_ENTRIES:
        raise ParameterError(name, "more entries", f"{MOST_ENTRIES} at most", verb="has")
    return entries


def one_or_more_numbers(name: str, values: object) -> tuple[float, ...]:
    """Return a number, or a sequence of numbers, as a tuple of floats.

    Examples
    --------
    >>> one_or_more_numbers("weights", 1)
    (1.0,)
    """
    entries = np.atleast_1d(np.asarray(values, dtype=object)).tolist()
    return tuple(_core.as_number(f"{name}[{i}]", value) for i, value in enumerate(entries))


def given_or(name: str, value: Settings | None, default: Settings) -> Settings:
    """Return settings of the type of the default, which stands for None.

    Examples
    --------
    >>> given_or("limits", None, (0.0, 75.0))
    (0.0, 75.0)
    """
    kind = type(default)
    if value is not None and not isinstance(value, kind):
        raise ParameterError(name, type(value).__name__, f"pt.{kind.__name__}")
    return default if value is None else value
