"""Motion of a model on a record with factors of its gain, hysteresis and dynamics."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.interpolate import CubicSpline

from ..fitted.identified_model import IdentifiedModel
from ..fitted.start import start_after, start_at_jump

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from ...data.dataset import Dataset
    from ...stages.motion import StageState
    from ..fitted.start import Start

    Array = NDArray[np.float64]

__all__ = ["HYSTERESIS", "Motion"]

# Parameters that are proportional to the part of the motion that hysteresis makes. The width of a
# Duhem loop is not proportional to any.
HYSTERESIS: Mapping[str, tuple[str, ...]] = {
    "dahl": ("b1", "b0"),
    "bouc-wen": ("alpha",),
    "asymmetric-bouc-wen": ("alpha",),
    "first-order-dahl": ("rest_stiffness", "coulomb_force"),
    "parallel-dahl": ("rest_stiffness_1", "rest_stiffness_2", "rest_stiffness_3"),
    "lugre": ("rest_stiffness", "micro_damping", "coulomb_force", "viscous_friction"),
    "bouc-wen-oscillator": ("alpha",),
    "prandtl-ishlinskii": ("weights",),
    "maxwell-slip": ("stiffness_ratios",),
    "generalised-prandtl-ishlinskii": ("weights",),
    "rate-dependent-prandtl-ishlinskii": ("weights",),
    "polynomial-prandtl-ishlinskii": ("weights",),
    "asymmetric-prandtl-ishlinskii": ("weights", "concave_weights", "convex_weights"),
    "preisach": ("masses",),
    "duhem": (),
}
# Change for a difference quotient; of the delay in sampling intervals.
STEP = 1e-3


class Motion:
    """Motion of a model on a record, with some changes.

    Changes of ``hysteresis``, ``mode`` and ``lag`` are relative ones of the parameters; ``gain``
    multiplies the displacement by 1 + gain, which comes ``delay`` seconds later.

    Parameters
    ----------
    model : IdentifiedModel
        The model.
    data : Dataset
        The record.
    start : Start
        Where the record begins.
    """

    def __init__(self, model: IdentifiedModel, data: Dataset, start: Start) -> None:
        self.stage, self.data, self.start = model.model, data, start
        self._sensor = IdentifiedModel(
            model=model.model,
            offset=0.0,
            offset_fitted=False,
            stroke=model.stroke,
            delay=model._delay_on(data),
            interpolation=model.interpolation,
        )
        # Creep that was there at the beginning stays as it was.
        self._begun = self.read(self.stage, start.state) - self._after_history(self.stage)

    def knows(self, name: str) -> bool:
        """Return whether the model has what changes.

        Parameters
        ----------
        name : str
            Name of a change.

        Returns
        -------
        bool
            False for a mode or a lag that it has not.
        """
        if name not in ("hysteresis", "mode", "lag"):
            return True
        return any(np.any(value) for value in _changed(self.stage, name, 0.0).values())

    def displacement(self, changes: Mapping[str, float]) -> Array:
        """Displacement in the window without offset and drift.

        Parameters
        ----------
        changes : mapping of str to float
            Changes by name; those that are left out are 0.

        Returns
        -------
        ndarray, shape (n,)
            The displacement [m].
        """
        altered: dict[str, Any] = {}
        for name in ("hysteresis", "mode", "lag"):
            if change := changes.get(name, 0.0):
                altered |= _changed(self.stage, name, change)
        stage = replace(self.stage, **altered) if altered else self.stage
        x = self._after_history(stage) + self._begun
        if late := changes.get("delay", 0.0):
            x = CubicSpline(self.data.t, x)(np.maximum(self.data.t - late, self.data.t[0]))
        moved: Array = (1.0 + changes.get("gain", 0.0)) * x
        return moved

    def derivatives(self, names: Sequence[str], at: Mapping[str, float]) -> tuple[Array, Array]:
        """Displacement with some changes, and its derivatives by changes.

        Parameters
        ----------
        names : sequence of str
            Changes, all but that of the drift.
        at : mapping of str to float
            Changes that there are already.

        Returns
        -------
        x : ndarray, shape (n,)
            Displacement in the window [m].
        columns : ndarray, shape (n, p)
            Its derivatives [m; by the delay m/s].
        """
        x = self.displacement(at)
        columns = np.empty((x.size, len(names)))
        for i, name in enumerate(names):
            step = STEP * (self.data.dt if name == "delay" else 1.0)
            moved = self.displacement({**at, name: at.get(name, 0.0) + step})
            columns[:, i] = (moved - x) / step
        return x, columns

    def _after_history(self, stage: Any) -> Array:
        """Displacement of a stage that went through what the stage did before the record [m]."""
        start, data = self.start, self.data
        if start.rest is not None:
            begun = start_at_jump(stage, data, start.rest)
        else:
            begun = start_after(stage, data, start.history, start.voltage)
        return self.read(stage, begun.state)

    def read(self, stage: Any, state: StageState, data: Dataset | None = None) -> Array:
        """Displacement of a stage from a state at the first sample, without offset and drift.

        Parameters
        ----------
        stage : Stage
            The stage.
        state : StageState
            Its state.
        data : Dataset, optional
            A part of the record; all of it where not given.

        Returns
        -------
        ndarray, shape (n,)
            The displacement in the window [m].
        """
        sensor = replace(self._sensor, model=stage)
        return sensor.simulate(data or self.data, offset=0.0, initial=state).x


def _changed(stage: Any, name: str, change: float) -> dict[str, Any]:
    """Parameters of a stage with a relative change of one kind; none where it has not that."""
    factor = 1.0 + change
    if name == "hysteresis":
        names = HYSTERESIS[stage.info.name]
        values = ((one, getattr(stage, one)) for one in names)
        return {one: _times(value, factor) for one, value in values if value is not None}
    if hasattr(stage, "mass"):
        mode = name == "mode"
        return {"mass": stage.mass / factor**2} if mode else {"damping": stage.damping * factor}
    if name == "lag":
        names = ("time_constant", "damping_ratio")
        known = [one for one in names if getattr(stage, one) is not None]
        return {one: getattr(stage, one) * factor for one in known[:1]}
    if stage.frequency is None:
        return {}
    return {
        "frequency": stage.frequency * factor,
        "mode_frequencies": _times(stage.mode_frequencies, factor),
    }


def _times(value: Any, factor: float) -> Any:
    return tuple(factor * one for one in value) if isinstance(value, tuple) else factor * value
