"""The record that a model was identified from, as far as its file has it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple, Self

from ... import _core
from ...errors import ParameterError

if TYPE_CHECKING:
    from ..fitted.identified_model import IdentifiedModel

__all__ = ["Known"]

# Residual in parts of the stroke below which a model is exact.
EXACT = 1e-6


class Known(NamedTuple):
    """Residual of a model on its own record.

    Attributes
    ----------
    rms : float
        Its root mean square [m].
    noise : float or None
        Part of it from sample to sample [m]; None where the file has none.
    duration : float or None
        Length of the record, or of all of several [s].
    drive_range : (float, float)
        Lowest and highest drive [V].
    dt : float
        Sampling interval [s].
    """

    rms: float
    noise: float | None
    duration: float | None
    drive_range: tuple[float, float]
    dt: float

    @classmethod
    def of(cls, model: IdentifiedModel) -> Self:
        """Read it from a model.

        Parameters
        ----------
        model : IdentifiedModel
            The model.

        Returns
        -------
        Known
            The residual and the record.

        Raises
        ------
        ParameterError
            The model has no residual, or no record.
        """
        fit = model.document().get("fit") or {}
        cost = (fit.get("cost") or {}).get("value")
        reached, dt = model.drive_range, model.dt
        if cost is None or reached is None or dt is None:
            missing = "residual (fit: cost)" if cost is None else "record (provenance: data)"
            raise ParameterError("model", f"no {missing}", "one that was identified", verb="has")
        rms, noise = _core.as_number("fit: cost", cost), (fit.get("noise") or {}).get("value")
        parts = [(one.get("samples"), one.get("dt_s")) for one in model._origins]
        lengths = [count * interval for count, interval in parts if count and interval]
        return cls(
            rms=max(rms, EXACT * model.stroke),
            noise=None if not noise else _core.as_number("fit: noise", noise),
            duration=math.fsum(lengths) or None,
            drive_range=reached,
            dt=dt,
        )

    @property
    def model_error(self) -> float:
        """Part of the residual that is not noise [m]: all of it where the noise is not known."""
        return math.sqrt(max(self.rms**2 - (self.noise or 0.0) ** 2, 0.0))
