"""Lower, higher and even sampling rates."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from .._support.arrays import MOST_SAMPLES
from ..errors import ParameterError

if TYPE_CHECKING:
    from collections.abc import Set as AbstractSet

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = ["even_times", "evened", "interpolated", "low_passed"]

STOP_DB = 80.0
# Half the width of the transition, in new Nyquist frequencies.
TRANSITION = 0.2


def low_passed(signal: Array, factor: int) -> Array:
    """Filter out the frequencies that a rate lower by `factor` cannot represent, without lag.

    Parameters
    ----------
    signal : ndarray, shape (n,)
        Evenly sampled.
    factor : int
        Old over new sampling rate.

    Returns
    -------
    ndarray, shape (n,)
        At the old rate. Ends are continued point-symmetrically.
    """
    from scipy.signal import fftconvolve, firwin, kaiserord

    taps, beta = kaiserord(STOP_DB, 2.0 * TRANSITION / factor)
    half = min(taps // 2 + 1, signal.size - 1)
    weights = firwin(2 * half + 1, 1.0 / factor, window=("kaiser", beta))
    # What leaves float64 is infinite or NaN then, and refused where it is used.
    with np.errstate(over="ignore", invalid="ignore"):
        padded = np.pad(signal, half, mode="reflect", reflect_type="odd")
        filtered: Array = fftconvolve(padded, weights, mode="valid")
    return filtered


def interpolated(signal: Array, factor: int) -> Array:
    """Insert samples between the given ones, band-limited.

    Parameters
    ----------
    signal : ndarray, shape (n,)
        Evenly sampled.
    factor : int
        New over old sampling rate.

    Returns
    -------
    ndarray, shape ((n - 1) * factor + 1,)
        The given samples are kept as they are. Ends are continued point-symmetrically.
    """
    from scipy.signal import firwin, kaiserord, upfirdn

    taps, beta = kaiserord(STOP_DB, 2.0 * TRANSITION / factor)
    # Whole old intervals to either side: at the given samples all weights but one are then 0.
    half = min(taps // (2 * factor) + 1, signal.size - 1)
    weights = factor * firwin(2 * half * factor + 1, 1.0 / factor, window=("kaiser", beta))
    with np.errstate(over="ignore", invalid="ignore"):
        padded = np.pad(signal, half, mode="reflect", reflect_type="odd")
        filled = upfirdn(weights, padded, up=factor)
    first = 2 * half * factor
    between: Array = filled[first : first + (signal.size - 1) * factor + 1]
    between[::factor] = signal
    return between


def even_times(t: Array, interval: float) -> Array:
    """Even times from the first to the last of uneven ones.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Increasing times [s].
    interval : float
        Interval of the even ones [s].

    Returns
    -------
    ndarray, shape (m,)
        Times [s].

    Raises
    ------
    ParameterError
        `interval` is longer than most of those in `t`, or so short that there are too many.
    """
    length, longest = float(t[-1] - t[0]), float(np.median(np.diff(t))) if t.size > 1 else interval
    shortest = length / MOST_SAMPLES
    if not shortest < interval <= longest * (1.0 + 1e-6):
        raise ParameterError(
            "resample",
            f"{interval:g} s",
            f"{shortest:.3g} s to {longest:.6g} s, the median interval of the log; a lower rate "
            "is that of log.decimate(N)",
        )
    count = math.floor(length / interval * (1.0 + 1e-12)) + 1
    times: Array = np.minimum(t[0] + interval * np.arange(count), t[-1])
    return times


def evened(
    t: Array, table: Array, times: Array, *, constant: AbstractSet[int] = frozenset()
) -> Array:
    """Values at other times than they were sampled at, on straight lines between the samples.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Times of the samples [s], increasing.
    table : ndarray, shape (n, columns)
        The samples.
    times : ndarray, shape (m,)
        Times [s] from the first to the last sample.
    constant : set of int, optional
        Columns that stay constant from each sample to the next instead.

    Returns
    -------
    ndarray, shape (m, columns)
        Values at `times`.

    Examples
    --------
    >>> import numpy as np
    >>> t, table = np.array([0.0, 1.0, 3.0]), np.array([[0.0, 0.0], [1.0, 1.0], [3.0, 3.0]])
    >>> evened(t, table, np.array([0.0, 1.5, 3.0]), constant={1})
    array([[0. , 0. ],
           [1.5, 1. ],
           [3. , 3. ]])
    """
    before = np.searchsorted(t, times, side="right") - 1
    columns = [
        column[before] if k in constant else np.interp(times, t, column)
        for k, column in enumerate(table.T)
    ]
    return np.column_stack(columns)
