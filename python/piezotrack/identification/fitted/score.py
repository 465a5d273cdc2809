"""The deviation of a model from a record."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..._support.display.table import words
from .notes import fit_percent

__all__ = ["Score", "share_fitted"]


@dataclass(frozen=True, kw_only=True, repr=False)
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
    max_error_time : float
        When the largest deviation occurs, on the time axis of the record [s].
    fitted_share : float
        Share of the samples scored that the model was fitted to, 0 to 1.
    """

    rms: float
    max_error: float
    stroke: float
    offset: float
    spread: float = math.nan
    notes: tuple[str, ...] = ()
    max_error_time: float = math.nan
    fitted_share: float = 0.0

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
        """Share of the motion that the model explains, ``100 (1 - |y - x| / |y - mean y|)`` [%].

        100 for an exact model; 0 for one that is no better than the mean of the record.
        """
        return fit_percent(self.rms, self.spread)

    def __repr__(self) -> str:
        return f"<Score, {self}>"

    def _repr_html_(self) -> str:
        micro = "\N{MICRO SIGN}m"
        stroke = "% of stroke"
        rows = [
            ("rms error", f"{1e6 * self.rms:.4g} {micro}, {self.rms_percent:.3g} {stroke}"),
            (
                "largest error",
                f"{1e6 * self.max_error:.4g} {micro}, {self.max_percent:.3g} {stroke}",
            ),
            ("at", f"{self.max_error_time:.6g} s"),
            ("fit", f"{self.fit_percent:.4g} %"),
            ("offset", f"{1e6 * self.offset:.4g} {micro}"),
            ("record", share_fitted(self.fitted_share)),
            *(("note", note) for note in self.notes),
        ]
        return words("Score", [row for row in rows if not row[1].startswith("nan")]).html()

    def __str__(self) -> str:
        fit = "" if math.isnan(self.spread) else f", fit {self.fit_percent:.4g} %"
        when = "" if math.isnan(self.max_error_time) else f" at {self.max_error_time:.6g} s"
        return (
            f"rms {1e6 * self.rms:.4g} um ({self.rms_percent:.3g} % of stroke), "
            f"max {1e6 * self.max_error:.4g} um ({self.max_percent:.3g} %){when}{fit}"
        )


def share_fitted(share: float) -> str:
    """Write which share of a record was fitted.

    Parameters
    ----------
    share : float
        `Score.fitted_share`.

    Returns
    -------
    str
        Such as ``50 % of it fitted``.

    Examples
    --------
    >>> share_fitted(0.0), share_fitted(0.5), share_fitted(1.0)
    ('not fitted', '50 % of it fitted', 'fitted')
    """
    if share in (0.0, 1.0):
        return "fitted" if share else "not fitted"
    return f"{min(max(100.0 * share, 0.1), 99.9):.3g} % of it fitted"
