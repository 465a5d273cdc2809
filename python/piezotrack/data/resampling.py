"""Lower and higher sampling rates."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = ["interpolated", "low_passed"]

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
