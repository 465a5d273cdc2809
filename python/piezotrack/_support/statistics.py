"""Statistics of a signed error."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["FIGURES", "ErrorStatistics"]


@dataclass(frozen=True, kw_only=True)
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


FIGURES = tuple(field.name for field in fields(ErrorStatistics))
