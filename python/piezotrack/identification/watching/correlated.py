"""Independent samples that a correlated residual is worth, by an autoregression of it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.fft import next_fast_len

from ... import _core

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = ["Autoregression"]

# Bound of the spectrum's resolution beside which it is nothing but rounding.
FLOOR = 1e-12


class Autoregression:
    r"""An autoregression of a residual, for the spread of its rms and of its mean.

    .. math:: e_i = \sum_{k=1}^p a_k e_{i-k} + \epsilon_i, \qquad
        S(\omega) = \sigma^2 / |1 - \sum_k a_k e^{-i k \omega}|^2

    as for `Covariance`.

    Parameters
    ----------
    residual : ndarray, shape (n,)
        The residual, in any unit.
    fitted : int
        Number of values that were fitted to it.

    Examples
    --------
    >>> from scipy.signal import lfilter
    >>> white = np.random.default_rng(1).standard_normal(20000)
    >>> red = Autoregression(lfilter([1.0], [1.0, -0.8], white), 0)
    >>> bool(abs(red.coefficients[0] - 0.8) < 0.03)
    True
    """

    def __init__(self, residual: Array, fitted: int) -> None:
        rest = residual - residual.mean()
        coefficients, innovation = _core.autoregression(rest)
        self.count = residual.size
        self.coefficients = np.array(coefficients)
        self.innovation = innovation * residual.size / max(residual.size - fitted, 1)

    def _spectrum(self, size: int) -> Array:
        """Spectrum at the frequencies of a real transform of so many samples."""
        transfer = np.fft.rfft(np.concatenate([[1.0], -self.coefficients]), size)
        gain: Array = np.abs(transfer) ** 2
        spectrum: Array = self.innovation / np.maximum(gain, FLOOR)
        return spectrum

    @property
    def effective(self) -> float:
        r"""Number of independent samples with the same spread of their rms.

        :math:`n / \sum_k \rho_k^2` with the autocorrelations :math:`\rho_k` of the autoregression
        (Bayley and Hammersley 1946, doi 10.2307/2983560).

        Returns
        -------
        float
            From 2 to n.
        """
        size = next_fast_len(2 * self.count)
        correlation = np.fft.irfft(self._spectrum(size), size)
        if not correlation[0] > 0.0:
            return float(self.count)
        squares = float(np.sum((correlation / correlation[0]) ** 2))
        return min(max(self.count / squares, 2.0), float(self.count))

    @property
    def of_mean(self) -> float:
        """Standard deviation of the mean of all samples.

        Returns
        -------
        float
            In the unit of the residual.
        """
        return float(np.sqrt(self._spectrum(2)[0] / self.count))
