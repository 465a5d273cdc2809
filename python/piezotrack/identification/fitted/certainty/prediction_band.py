"""Predicted displacement under any drive, with the errors that it has."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from ...._support.display.result import Result

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = ["PredictionBand"]


@dataclass(frozen=True, kw_only=True, eq=False)
class PredictionBand(Result):
    r"""Predicted displacement under a drive, and what is expected to lie around it.

    A reading is within `half` of `x` with the probability `level`,

    .. math:: h^2 = h_n^2 + h_p^2 + h_m^2

    with the parts of noise, parameters and error of the model, each the half width that it would
    give alone. Noise and error of the model, :math:`h_n^2 + h_m^2`, are the errors of the model on
    cycles of its records that it does not know, in the class of amplitude and rate of the drive:
    the probability is that of cycles as the records have them.

    Attributes
    ----------
    t, u, x : ndarray, shape (n,)
        Time [s], drive [V] and predicted displacement [m].
    level : float
        Probability with which a reading is in the band.
    noise, parameters, model_error : ndarray, shape (n,)
        Half widths by the noise of the sensor, by what is not known of the parameters, and by what
        the model does not have [m].
    unlike : ndarray of bool, shape (n,)
        Where the records have no such amplitude or rate, so that the band is a guess. Above all of
        theirs the error of the model is taken to grow in proportion.
    cycles : int
        Cycles of the records, which were left out of the fit one by one for their errors; fewer
        than 2 are those of the fit itself.
    measured : ndarray, shape (n,), or None
        Displacement of the record, where the drive is that of one [m]; NaN where it does not count.
    drive_unit : str
        Unit of the drive, SI.
    """

    views: ClassVar[Mapping[str, str]] = {
        "summary": "identification.views.confidence.prediction_band_report:band_text",
        "plot": "identification.views.confidence.prediction_band_plot:plot_band",
    }

    t: Array
    u: Array
    x: Array
    level: float
    noise: Array
    parameters: Array
    model_error: Array
    unlike: NDArray[np.bool_]
    cycles: int
    measured: Array | None = None
    drive_unit: str = "V"

    def __repr__(self) -> str:
        return f"<PredictionBand, {100 * self.level:g} % within {1e9 * self.typical:.3g} nm>"

    @property
    def half(self) -> Array:
        """Half width of the band, shape (n,) [m]."""
        return np.asarray(np.sqrt(self.noise**2 + self.parameters**2 + self.model_error**2))

    @property
    def lower(self) -> Array:
        """Lower end of the band, shape (n,) [m]."""
        return self.x - self.half

    @property
    def upper(self) -> Array:
        """Upper end of the band, shape (n,) [m]."""
        return self.x + self.half

    @property
    def typical(self) -> float:
        """Median of the half width [m]."""
        return float(np.median(self.half))

    @property
    def coverage(self) -> float | None:
        """Share of the readings of a record that are in the band; None without readings."""
        if self.measured is None:
            return None
        error = np.abs(self.measured - self.x)
        return float(np.mean((error <= self.half)[np.isfinite(error)]))
