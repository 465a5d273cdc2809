"""Best linear approximation of periodic records, with its two uncertainties.

Pintelon and Schoukens, System Identification, 2nd ed., 2012, section 4.3.1, the robust method.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Complex = NDArray[np.complex128]

__all__ = ["LinearApproximation", "approximate", "spectra", "without_drift"]

# Highest power of time in a drift.
DEGREE = 3


class LinearApproximation(NamedTuple):
    """Ratio of two signals at the excited lines, with variances of circular complex errors.

    Attributes
    ----------
    value : ndarray of complex, shape (n,)
        The ratio.
    variance : ndarray, shape (n,)
        Expectation of its squared error: noise and, of several realisations, distortion.
    degrees : int
        Real degrees of freedom of that estimate.
    noise : ndarray or None, shape (n,)
        The part of the noise in it; None of one period.
    distortion : ndarray or None, shape (n,)
        Variance of the nonlinear distortion of one realisation; None of one realisation or period.
    """

    value: Complex
    variance: Array
    degrees: int
    noise: Array | None
    distortion: Array | None


def without_drift(signal: Array) -> Array:
    """Remove a slow drift, which the periods of a periodic signal show by their differences.

    A polynomial q of time is fitted to y(t + T) - y(t) = q(t + T) - q(t), which holds no periodic
    part: a trend within a period would leak into all lines, and alike in every period.

    Parameters
    ----------
    signal : ndarray, shape (periods, samples)
        Periods after each other.

    Returns
    -------
    ndarray, shape (periods, samples)
        Without q; of a single period as it is.
    """
    periods, count = signal.shape
    if periods < 2:
        return signal
    # In periods; the powers from 1 on.
    time = np.arange(periods * count).reshape(periods, count) / count
    powers = [time**k for k in range(1, min(DEGREE, periods) + 1)]
    columns = np.stack([np.diff(one, axis=0).ravel() for one in powers], axis=1)
    weights = np.linalg.lstsq(columns, np.diff(signal, axis=0).ravel(), rcond=None)[0]
    drift = sum(weight * one for weight, one in zip(weights, powers, strict=True))
    return np.asarray(signal - drift)


def spectra(signals: Array, lines: NDArray[np.intp]) -> Complex:
    """Return the Fourier coefficients of whole periods at some lines.

    Parameters
    ----------
    signals : ndarray, shape (realisations, periods, samples)
        The signals, of which a drift is removed.
    lines : ndarray of int, shape (n,)
        Multiples of the inverse of the period.

    Returns
    -------
    ndarray of complex, shape (realisations, periods, n)
        Amplitudes of cosines, with their phases.
    """
    steady = np.stack([without_drift(one) for one in signals])
    found = np.fft.rfft(steady, axis=-1)[..., lines] * (2.0 / signals.shape[-1])
    return np.asarray(found, dtype=np.complex128)


def approximate(output: Complex, drive: Complex, reference: Complex) -> LinearApproximation:
    """Estimate the ratio of two signals that a known reference excites.

    With G = mean(Y R*) / mean(U R*), the error of a realisation is (Y - G U) R*, and its spread
    over periods that of the noise. In open loop R is U itself; in a loop it is the reference, and
    what the loop excites by itself, which R does not have, is averaged out.

    Parameters
    ----------
    output, drive : ndarray of complex, shape (realisations, periods, n)
        Y and U.
    reference : ndarray of complex, shape (realisations, n)
        R.

    Returns
    -------
    LinearApproximation
        Of Y over U.
    """
    realisations, periods, _ = output.shape
    y, u = (signal * reference[:, np.newaxis, :].conj() for signal in (output, drive))
    size = u.mean(axis=(0, 1))
    value = y.mean(axis=(0, 1)) / size
    errors = (y - value * u) / size
    noise = distortion = None
    if periods > 1:
        spread = np.square(np.abs(errors - errors.mean(axis=1, keepdims=True))).sum(axis=(0, 1))
        noise = spread / (realisations * (periods - 1)) / (realisations * periods)
    if realisations == 1 and noise is not None:
        return LinearApproximation(value, noise, 2 * (periods - 1), noise, None)
    means = errors.mean(axis=1)
    variance = np.square(np.abs(means)).sum(axis=0) / (realisations - 1) / realisations
    if noise is not None:
        distortion = realisations * np.maximum(variance - noise, 0.0)
    return LinearApproximation(value, variance, 2 * (realisations - 1), noise, distortion)
