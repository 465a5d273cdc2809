"""Checked arguments of a record: factors, windows and further columns."""

from __future__ import annotations

import math
from collections.abc import Mapping
from numbers import Integral
from typing import TYPE_CHECKING

import numpy as np

from .._support.arrays import real, signal_of
from .._support.messages import listed, quoted
from ..errors import ParameterError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]

__all__ = [
    "MIN_SAMPLES",
    "decimation_factor",
    "further_columns",
    "interpolation_factor",
    "window_samples",
]

MIN_SAMPLES = 3
# Most samples of an interpolated record.
MOST_SAMPLES = 50_000_000


def decimation_factor(value: object, count: int) -> int:
    """Check how many of `count` samples become one."""
    factor = _factor(value)
    if count < MIN_SAMPLES * factor:
        raise ParameterError(
            "factor", quoted(factor), f"one that leaves {MIN_SAMPLES} of {count} samples or more"
        )
    return factor


def interpolation_factor(value: object, count: int, hold: str) -> int:
    """Check how many samples each of `count` becomes, and that there is something between them."""
    factor = _factor(value)
    if hold == "zoh":
        raise ParameterError("hold", "'zoh'", "'foh', as nothing is between the samples")
    if (count - 1) * factor + 1 > MOST_SAMPLES:
        raise ParameterError(
            "factor",
            quoted(factor),
            f"at most {(MOST_SAMPLES - 1) // (count - 1)}, with which {count} samples become "
            f"{MOST_SAMPLES}",
        )
    return factor


def _factor(value: object) -> int:
    if isinstance(value, bool) or not isinstance(value, Integral) or value < 2:
        raise ParameterError("factor", quoted(value), "a whole number, 2 or more")
    return int(value)


def _time_limit(name: str, value: object) -> float:
    """Check a limit of a window of time [s]."""
    number = real(value)
    if not math.isfinite(number):
        raise ParameterError(name, quoted(value), "a finite number of seconds or None")
    return number


def further_columns(
    columns: Mapping[str, ArrayLike] | None, units: Mapping[str, str] | None, u: Array
) -> tuple[dict[str, Array], dict[str, str]]:
    """Check the further columns and their units; a missing unit becomes an empty text."""
    columns, units = columns or {}, units or {}
    for argument, mapping in (("columns", columns), ("column_units", units)):
        if not isinstance(mapping, Mapping):
            raise ParameterError(argument, quoted(mapping), "a mapping by name")
    for name in (*columns, *units):
        if name not in columns or not isinstance(name, str):
            known = listed(list(columns)) or "none"
            raise ParameterError(
                f"{quoted(name)} is not the name of a column: the names are {known}",
                argument="column_units" if name in units else "columns",
            )
    for name, unit in units.items():
        if not isinstance(unit, str):
            raise ParameterError(
                "column_units", f"{quoted(unit)} for {quoted(name)}", "text", verb="has"
            )
    kept = {
        name: signal_of(f"column {quoted(name)}", values, like=u, finite=False)
        for name, values in columns.items()
    }
    return kept, {name: units.get(name, "") for name in kept}


def window_samples(t: Array, dt: float, start: float | None, stop: float | None) -> tuple[int, int]:
    """Turn the bounds of a window [s] into indices of its times."""
    # Times and bounds are decimal numbers rounded to binary: equal ones may differ a little.
    slack = max(1e-6 * dt, 4.0 * float(np.spacing(np.abs(t).max())))
    low, high = float(t[0]), float(t[-1]) + dt
    begin = low if start is None else _time_limit("start", start)
    end = high if stop is None else _time_limit("stop", stop)
    window = f"the window from {begin:.10g} s to {end:.10g} s"
    record = f"the record, whose samples go from {low:.10g} s to {float(t[-1]):.10g} s"
    if begin < low - dt / 2 or end > high + dt / 2:
        raise ParameterError(f"{window} reaches out of {record}", argument="window")
    if begin >= end:
        expected = f"start < stop within {record}"
        raise ParameterError(window, "empty", expected, argument="window")
    first, last = (int(np.searchsorted(t, bound - slack)) for bound in (begin, end))
    if last - first < MIN_SAMPLES:
        few = f"holds {last - first} samples: expected at least {MIN_SAMPLES}"
        raise ParameterError(f"{window} {few}, within {record}", argument="window")
    return first, last
