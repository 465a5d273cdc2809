"""Checks of arrays of samples and of their times."""

from __future__ import annotations

import math
from numbers import Real
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import _core
from ..errors import DataError, ParameterError, ShapeError
from .messages import quoted

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]

__all__ = [
    "MOST_SAMPLES",
    "backward",
    "check_dt",
    "real",
    "real_array",
    "runs",
    "signal_of",
    "time_axis",
    "time_fault",
    "unmasked",
]

# Largest departure of a time from the even grid, in sampling intervals.
UNEVEN = 0.05
# Most samples of a record.
MOST_SAMPLES = _core.MOST_SAMPLES
# Sampling intervals beyond which numbers derived from them leave float64 [s].
SHORTEST, LONGEST = _core.INTERVALS
# Size beyond which no sample makes sense, and its square leaves float64 soon.
LARGEST = _core.LARGEST
USE_DT = (
    "an evenly sampled record whose times are coarse or jittery can be given with dt=, "
    "which is used in place of the times"
)
# Largest departure of the times of an evenly sampled record from a straight line, in its
# intervals: jitter does not add up, other intervals do.
JITTER = 1.0


def runs(mask: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return the first sample, and that after the last, of each run of true entries."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def check_dt(dt: float, name: str = "dt") -> float:
    """Return `dt` [s] as a float, or raise ParameterError unless it is an interval."""
    number = real(dt)
    if not 0.0 < number < math.inf:
        raise ParameterError(name, quoted(dt), "a finite number of seconds above 0")
    if not SHORTEST <= number <= LONGEST:
        raise ParameterError(name, f"{number:g} s", f"{SHORTEST:g} to {LONGEST:g} s")
    return number


def time_fault(
    t: Array, resampling: str = "put it on even times with numpy.interp"
) -> tuple[int, str] | None:
    """Return the first sample at which times [s] are not increasing or even, with a message.

    Return None if there is none. `resampling` says how such a record can be used all the same.
    """
    if (fault := backward(t)) is not None or t.size < 2:
        return fault
    with np.errstate(all="ignore"):
        steps = np.diff(t)
        typical = np.median(steps)
        dt = (t[-1] - t[0]) / steps.size
        departure = np.abs(t - (t[0] + dt * np.arange(t.size)))
        # In place of the times of a log with several rates or gaps, dt= would distort it.
        remedy = f"{resampling}; {USE_DT}" if departure.max() <= JITTER * dt else resampling
        if (uneven := _first(~(np.abs(steps - typical) <= UNEVEN * typical))) is not None:
            return uneven + 1, (
                f"t is not even: it goes {steps[uneven]:.6g} s forward to sample {uneven + 1}, "
                f"where most steps are {typical:.6g} s: expected even times; {remedy}"
            )
        if (drifted := _first(~(departure <= UNEVEN * dt))) is not None:
            return drifted, (
                f"t is not even: {t[drifted]:.10g} s at sample {drifted} is "
                f"{departure[drifted]:.3g} s off an even grid of {dt:.6g} s; {remedy}"
            )
    return None


def backward(t: Array) -> tuple[int, str] | None:
    """Return the first sample at which times [s] are not increasing, with a message, or None."""
    with np.errstate(all="ignore"):
        steps = np.diff(t)
    if (place := _first(~(steps > 0.0))) is None:
        return None
    k = place + 1
    hint = f"; {USE_DT}" if steps[place] == 0.0 else ""
    return k, (
        f"t goes from {t[k - 1]:.10g} s to {t[k]:.10g} s at sample {k}: "
        f"expected increasing times{hint}"
    )


def _first(mask: NDArray[np.bool_]) -> int | None:
    """Return the place of the first true entry, or None."""
    return int(np.argmax(mask)) if mask.any() else None


def real(value: object) -> float:
    """Return a real number as a float, and NaN for anything else (a bool, a str)."""
    if isinstance(value, bool) or not isinstance(value, Real):
        return math.nan
    try:
        return float(value)
    except OverflowError:
        return math.inf


def time_axis(t: ArrayLike | None, dt: float | None, u: Array) -> tuple[Array, float]:
    """Return the times of the samples of `u` and their interval [s], given either."""
    if (t is None) == (dt is None):
        given = "neither is" if t is None else "both are"
        raise ParameterError(
            f"t and dt: expected exactly one of them, {given} given", argument="dt"
        )
    if t is None and dt is not None:
        interval = check_dt(dt)
        return signal_of("t", interval * np.arange(u.size)), interval
    times = signal_of("t", t, like=u)
    if (fault := time_fault(times)) is not None:
        raise DataError(fault[1])
    return times, float(times[-1] - times[0]) / (times.size - 1)


def unmasked(values: Any) -> Any:
    """Return masked numbers as NaN, and anything else as it is.

    A masked sample is missing; NumPy's conversions would restore its value.

    Examples
    --------
    >>> unmasked(np.ma.array([1.0, 2.0], mask=[False, True]))
    array([ 1., nan])
    """
    if isinstance(values, np.ma.MaskedArray) and values.dtype.kind in "biuf":
        return np.ma.filled(values.astype(np.float64), np.nan)
    return values


def real_array(name: str, values: object) -> Array:
    """Return real numbers of any shape as float64: `values` themselves where they are that.

    Raises
    ------
    ShapeError
        They are no array, or more than memory should hold.
    DataError
        They are not real numbers.

    Examples
    --------
    >>> real_array("t", [[1, 2]])
    array([[1., 2.]])
    """
    try:
        array = np.asarray(unmasked(values))
    except (TypeError, ValueError, OverflowError):
        raise ShapeError(name, "not an array", "one number for each sample", verb="is") from None
    if array.dtype.kind not in "biuf":
        raise DataError(f"{name} holds values of type {array.dtype}: expected real numbers")
    if array.size > MOST_SAMPLES:
        raise ShapeError(name, f"{array.size} samples", f"{MOST_SAMPLES} at most")
    with np.errstate(over="ignore"):
        return array.astype(np.float64, copy=False)


def signal_of(
    name: str,
    values: ArrayLike | None,
    *,
    like: Array | None = None,
    finite: bool = True,
    remedy: str = "",
) -> Array:
    """Return a read-only float64 copy of one-dimensional `values`, as long as `like`.

    `remedy` is said to a value that is NaN.
    """
    array = real_array(name, values)
    if array.ndim != 1:
        raise ShapeError(name, f"the shape {array.shape}", "one dimension")
    if like is not None and array.size != like.size:
        raise ShapeError("u", f"{like.size} samples and {name} has {array.size}", "equally many")
    signal = np.array(array)
    if finite and (bad := _first(~(np.abs(signal) < LARGEST))) is not None:
        value = signal[bad]
        expected = f"numbers below {LARGEST:g}" if np.isfinite(value) else "finite numbers"
        remedy = remedy if np.isnan(value) else ""
        raise DataError(f"{name} is {value} at sample {bad}: expected {expected}{remedy}")
    signal.setflags(write=False)
    return signal
