"""The deviation of a model from a record."""

from __future__ import annotations

import math
from dataclasses import dataclass

from .notes import fit_percent

__all__ = ["Score"]


@dataclass(frozen=True, kw_only=True)
class Score:
    """Deviation of a simulated displacement from the measured one.

    Attributes
    ----------
    rms, max_error : float
        Root mean square and largest absolute deviation [m].
    stroke : float
        Stroke that the percentages refer to [m].
    offset : float
        Offset added to the simulated displacement [m].
    spread : float
        Standard deviation of the measured displacement [m], to which `fit_percent` refers.
    notes : tuple of str
        Remarks on a record that goes beyond the one identified.
    """

    rms: float
    max_error: float
    stroke: float
    offset: float
    spread: float = math.nan
    notes: tuple[str, ...] = ()

    @property
    def rms_percent(self) -> float:
        """`rms` in per cent of the stroke."""
        return 100.0 * self.rms / self.stroke

    @property
    def max_percent(self) -> float:
        """`max_error` in per cent of the stroke."""
        return 100.0 * self.max_error / self.stroke

    @property
    def fit_percent(self) -> float:
        """Share of the motion that the model explains, 100 (1 - |y - x| / |y - mean y|) [%].

        100 for an exact model; 0 for one that is no better than the mean of the record.
        """
        return fit_percent(self.rms, self.spread)

    def __str__(self) -> str:
        fit = "" if math.isnan(self.spread) else f", fit {self.fit_percent:.4g} %"
        return (
            f"rms {1e6 * self.rms:.4g} um ({self.rms_percent:.3g} % of stroke), "
            f"max {1e6 * self.max_error:.4g} um ({self.max_percent:.3g} %){fit}"
        )
