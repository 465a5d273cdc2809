"""Statistics of a signed error, and the noise of a signal."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np

from .display.table import words

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

__all__ = ["FIGURES", "ErrorStatistics", "sample_noise"]


@dataclass(frozen=True, kw_only=True, repr=False)
class ErrorStatistics:
    """Statistics of a signed error.

    Attributes
    ----------
    max_error, rms_error : float
        Largest absolute error and root mean square [m].
    mean_error, sd_error : float
        Mean of the signed error and standard deviation about it [m].
    peak_to_peak : float
        Largest less smallest error [m].
    """

    max_error: float
    rms_error: float
    mean_error: float
    sd_error: float
    peak_to_peak: float

    @classmethod
    def of(cls, figures: Sequence[float]) -> ErrorStatistics:
        """Make the statistics from the tuple of the core.

        Parameters
        ----------
        figures : sequence of 5 float
            In the order of the attributes [m].

        Returns
        -------
        ErrorStatistics
            With named fields.
        """
        return cls(**dict(zip(FIGURES, figures, strict=True)))

    def __repr__(self) -> str:
        return f"<{type(self).__name__}, {self}>"

    def _repr_html_(self) -> str:
        return words("Errors", self._rows()).html()

    def _rows(self) -> list[tuple[str, str]]:
        names = ("largest", "rms", "mean", "standard deviation", "peak to peak")
        values = (getattr(self, name) for name in FIGURES)
        return [(name, f"{1e6 * one:.4g} \N{MICRO SIGN}m")
                for name, one in zip(names, values, strict=True)]  # fmt: skip

    def __str__(self) -> str:
        return f"max {1e6 * self.max_error:.3f} um, rms {1e6 * self.rms_error:.3f} um"


FIGURES = tuple(field.name for field in fields(ErrorStatistics))


def sample_noise(y: NDArray[np.float64]) -> float:
    """Noise of a signal from sample to sample, from its third differences.

    A slow motion hardly shows in them, and the median is blind to steps.

    Parameters
    ----------
    y : ndarray, shape (n,)
        The signal.

    Returns
    -------
    float
        Standard deviation, in the unit of `y`; 0 for fewer than 16 samples.

    Examples
    --------
    >>> y = np.sin(np.arange(4000) / 500.0) + 1e-3 * np.random.default_rng(0).normal(size=4000)
    >>> f"{sample_noise(y):.1g}"
    '0.001'
    """
    if y.size < 16:
        return 0.0
    # The squares of 1, 3, 3 and 1 add up to 20; 1.4826 is for a normal distribution.
    return float(1.4826 * np.median(np.abs(np.diff(y, 3))) / np.sqrt(20.0))
