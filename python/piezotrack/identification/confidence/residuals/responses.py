"""Responses of linear filters to a motion that is linear between samples."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = ["late", "relaxed", "ringing"]


def late(x: Array, samples: float) -> Array:
    """Delay motions, which stood still before.

    Parameters
    ----------
    x : ndarray, shape (n,) or (n, m)
        Motions, one a column.
    samples : float
        Delay in sampling intervals, 0 or above.

    Returns
    -------
    ndarray, as `x`
        The motions.
    """
    whole = int(samples)
    part, rows = samples - whole, np.maximum(np.arange(x.shape[0]) - whole, 0)
    delayed: Array = (1.0 - part) * x[rows] + part * x[np.maximum(rows - 1, 0)]
    return delayed


def relaxed(x: Array, samples: float) -> Array:
    """Response of a first-order lag, in equilibrium at the first sample.

    Parameters
    ----------
    x : ndarray, shape (n,) or (n, m)
        Motions, one a column.
    samples : float
        Time constant in sampling intervals.

    Returns
    -------
    ndarray, as `x`
        The responses.

    Examples
    --------
    >>> [f"{x:.3f}" for x in relaxed(np.array([0.0, 1.0, 1.0]), 1.0)]
    ['0.000', '0.368', '0.767']
    """
    from scipy.signal import lfilter

    a = float(np.exp(-1.0 / samples))
    # Weight of this sample of the motion; the rest is that of the last one.
    this = 1.0 - samples * (1.0 - a)
    response: Array = lfilter([this, 1.0 - a - this], [1.0, -a], x - x[:1], axis=0)
    return x[:1] + response


def ringing(x: Array, cycles: float, damping_ratio: float) -> Array:
    """Response of a mode, at rest at the first sample.

    Parameters
    ----------
    x : ndarray, shape (n,) or (n, m)
        Motions, one a column.
    cycles : float
        Undamped frequency in cycles a sampling interval.
    damping_ratio : float
        Damping ratio, above 0 and below 1.

    Returns
    -------
    ndarray, as `x`
        The responses.

    Examples
    --------
    >>> [f"{x:.3f}" for x in ringing(np.array([0.0, 1.0, 1.0, 1.0]), 0.5, 0.05)]
    ['0.000', '0.940', '1.053', '0.953']
    """
    from scipy.signal import lfilter

    w, zeta = 2.0 * np.pi * cycles, damping_ratio
    root = float(np.sqrt(1.0 - zeta**2))
    pole = np.exp(w * (-zeta + 1j * root))
    a = np.array([1.0, -2.0 * pole.real, abs(pole) ** 2])
    # Response to a ramp that begins at 0.
    t = np.arange(4.0)
    waves = 2.0 * zeta * np.cos(w * root * t) + (2.0 * zeta**2 - 1.0) / root * np.sin(w * root * t)
    ramp = t + (np.exp(-zeta * w * t) * waves - 2.0 * zeta) / w
    # A motion that is 1 at one sample is the second difference of ramps.
    peak = np.array([ramp[1], ramp[2] - 2.0 * ramp[1], ramp[3] - 2.0 * ramp[2] + ramp[1]])
    b = np.convolve(a, peak)[:3]
    response: Array = lfilter(b, a, x - x[:1], axis=0)
    return x[:1] + response
