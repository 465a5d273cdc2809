"""Change of the displacement of a record with the values that were fitted to it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..._support.two_threads import one_by_one, two_threads
from ..fitted.start import same_beginning, start_after, start_at_jump
from .values import DELAY, Value, fitted_values, moved, without_search

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import ArrayLike, NDArray

    from ...data.dataset import Dataset
    from ...stages.motion import StageState
    from ..fitted.identified_model import IdentifiedModel
    from ..fitted.start import Start

    Array = NDArray[np.float64]

__all__ = ["LinearisedRecord", "Sensitivity", "changes", "gradient", "sensitivity"]

# Share of a value by which it is moved to see its effect.
STEP = 1e-4
# The same of an entry that is 0, in the mean of its list: a weight, in which the motion is linear.
FROM_ZERO = 0.1
# The same of a delay in sampling intervals, and of a voltage before the record in its range.
LATER, BEFORE = 1e-2, 1e-4


@dataclass(frozen=True, kw_only=True, eq=False)
class Sensitivity:
    """A record about a fit, linearised.

    Attributes
    ----------
    columns : ndarray, shape (p, n)
        Change of the displacement with each value, in the unit of the value [m/...].
    nuisance : ndarray, shape (q, n)
        The same of what belongs to the record alone, a row each of `alone`.
    alone : tuple of str
        What belongs to the record alone: ``"offset"``, ``"drift"``, ``"drift_time"``,
        ``"voltage_before"``, and of one of several records its ``"delay"``.
    sizes : ndarray, shape (q,)
        Sizes of these, in their units; infinite for an offset.
    residual : ndarray, shape (n,)
        Measured less simulated displacement [m].
    """

    columns: Array
    nuisance: Array
    alone: tuple[str, ...]
    sizes: Array
    residual: Array


def gradient(model: IdentifiedModel, quantity: Callable[[IdentifiedModel], ArrayLike]) -> Array:
    """Differentiate quantities of an identified model by the values that were fitted.

    Parameters
    ----------
    model : IdentifiedModel
        The model.
    quantity : callable
        Of a model beside it, one or m of them.

    Returns
    -------
    ndarray, shape (p,) or (p, m)
        Change with each of `fitted_values`; 0 where there is no such stage beside it.
    """
    slopes = []
    for value in fitted_values(model):
        size = STEP * abs(value.of(model))
        ends = [moved(model, [value], np.array([way * size])) for way in (1.0, -1.0)]
        up, down = (np.asarray(np.nan if one is None else quantity(one)) for one in ends)
        slopes.append((up - down) / (2.0 * size) if size else 0.0 * up)
    return np.asarray(np.nan_to_num(np.array(slopes, dtype=np.float64)))


def sensitivity(model: IdentifiedModel, data: Dataset, values: list[Value]) -> Sensitivity:
    """Linearise the displacement of a record about an identified model, by differences.

    Parameters
    ----------
    model : IdentifiedModel
        The model.
    data : Dataset
        The record, in the window that was fitted.
    values : list of Value
        What is moved.

    Returns
    -------
    Sensitivity
        Of the readings that count.
    """
    record = LinearisedRecord(model, data)
    count, nuisance = record.residual.size, record.nuisance()
    return Sensitivity(
        columns=record.columns(model, values),
        nuisance=np.array(list(nuisance.values())).reshape(-1, count),
        alone=tuple(nuisance),
        sizes=np.array([record.size_of(name) for name in nuisance]),
        residual=record.residual,
    )


def changes(
    model: IdentifiedModel,
    values: list[Value],
    motion: Callable[[IdentifiedModel], Array],
    dt: float,
) -> Array:
    """Differentiate a motion by values of an identified model, by differences.

    Parameters
    ----------
    model : IdentifiedModel
        The model.
    values : list of Value
        What is moved.
    motion : callable
        The motion of a model beside it [m], shape (n,).
    dt : float
        Sampling interval [s].

    Returns
    -------
    ndarray, shape (p, n)
        Change with each value, in the unit of the value [m/...]; 0 where there is no such stage
        beside it.
    """
    still = motion(model)

    def change(value: Value) -> Array:
        share = FROM_ZERO if value.of(model) == 0.0 else STEP
        size = LATER * dt if value.parameter == DELAY else share * value.size_in(model)
        # The motion is linear in each weight but for the few samples at the edge of a dead zone.
        both_sides = [] if value.parameter.endswith("weights") else [(1.0, -1.0)]
        for ways in (*both_sides, (1.0, 0.0), (0.0, -1.0)):
            ends = [moved(model, [value], np.array([size * way])) if way else model for way in ways]
            moves = [still if end is model else motion(end) for end in ends if end is not None]
            if len(moves) == 2:
                return (moves[0] - moves[1]) / (size * (ways[0] - ways[1]))
        return np.zeros_like(still)

    with two_threads() as pool:
        return np.array(list(one_by_one(pool, change, values)))


class LinearisedRecord:
    """A record, the state in which it begins, and its residual about an identified model.

    Parameters
    ----------
    model : IdentifiedModel
        The model.
    data : Dataset
        The record, in the window that was fitted.

    Attributes
    ----------
    residual : ndarray, shape (n,)
        Measured less simulated displacement of the readings that count [m].
    """

    def __init__(self, model: IdentifiedModel, data: Dataset) -> None:
        self.model, self.data = model, data.without_faulty_readings()
        self.start = model.start_on(self.data)
        known: list[Any] = [model, *model.records]
        mine = [one for one in known if same_beginning(one.start, self.data)]
        self.record: Any = mine[-1] if mine else model
        # A model found by least squares creeps before its record; one that is searched is at rest.
        self.creeps = not model.model.info.searched
        self.residual = self._rest(self._counted(model, self.start.state), {})

    def residual_of(self, model: IdentifiedModel, alone: Mapping[str, float]) -> Array:
        """Return the residual of a model beside the one that was fitted.

        Parameters
        ----------
        model : IdentifiedModel
            The model; its offset and the size of its drift suit the record best.
        alone : dict of str to float
            Changes of what belongs to the record alone, of ``"drift_time"`` [s],
            ``"voltage_before"`` [V] and ``"delay"`` [s].

        Returns
        -------
        ndarray, shape (n,)
            As `residual` [m].
        """
        start = self.start.voltage
        voltage = None if start is None else start + alone.get("voltage_before", 0.0)
        later = alone.get(DELAY, 0.0)
        moved = self._later(model, later) if later else model
        return self._rest(self._counted(moved, self._begun(moved, voltage)), alone)

    def _rest(self, reading: Array, alone: Mapping[str, float]) -> Array:
        """Measured displacement less a reading, with the offset and drift that suit it best."""
        left = np.asarray(self.data.counted(self.data.y)) - reading
        columns = list(self._sensor(alone.get("drift_time", 0.0)).values())
        if not columns:
            return left
        basis = np.array(columns).T
        return np.asarray(left - basis @ np.linalg.lstsq(basis, left, rcond=1e-12)[0])

    def _sensor(self, longer: float = 0.0) -> dict[str, Array]:
        """Columns of the offset and of the size of the drift, of a changed time constant."""
        t = self.data.counted(self.data.t)
        drift = self.record.drift
        columns = {"offset": np.ones(t.size)} if self.record.offset_fitted or drift else {}
        if drift:
            columns["drift"] = np.exp(-(t - drift.begin) / (drift.time + longer))
        return columns

    def nuisance(self) -> dict[str, Array]:
        """Columns of what belongs to the record alone."""
        columns = self._sensor()
        drift = self.record.drift
        if drift and drift.time_fitted:
            t = self.data.counted(self.data.t)
            ends = [np.exp(-(t - drift.begin) / (s * drift.time)) for s in (1 + STEP, 1 - STEP)]
            columns["drift_time"] = (
                drift.amplitude * (ends[0] - ends[1]) / (2.0 * STEP * drift.time)
            )
        if self.start.history == "fit" and self.start.voltage is not None:
            reach = BEFORE * float(np.ptp(self.data.full.u))
            states = [self._begun(self.model, self.start.voltage + s) for s in (reach, -reach)]
            up, down = (self._counted(self.model, state) for state in states)
            columns["voltage_before"] = (up - down) / (2.0 * reach)
        several = len(self.model.records) > 1
        if several and "delay" in self.record.parameters:
            columns["delay"] = self._delayed()
        return columns

    def size_of(self, alone: str) -> float:
        """Size of what belongs to the record alone; infinite for an offset."""
        drift = self.record.drift
        sizes = {
            "drift": abs(drift.amplitude) if drift else 0.0,
            "drift_time": drift.time if drift else 0.0,
            "voltage_before": float(np.ptp(self.data.full.u)),
            "delay": max(abs(self.model._delay_on(self.data)), self.data.dt),
        }
        return sizes.get(alone, math.inf)

    def _delayed(self) -> Array:
        """Change with the delay of one of several records [m/s]."""
        step = LATER * self.data.dt
        ends = (self._later(self.model, s) for s in (step, -step))
        up, down = (self._counted(model, self.start.state) for model in ends)
        return np.asarray((up - down) / (2.0 * step))

    def _later(self, model: IdentifiedModel, by: float) -> IdentifiedModel:
        """Model whose reading of this record is later [s]."""
        records = tuple(
            replace(one, delay=one.delay + by) if one is self.record else one
            for one in model.records
        )
        return replace(without_search(model), records=records)

    def columns(self, model: IdentifiedModel, values: list[Value]) -> Array:
        """Change of the readings of a model with each value, shape (p, n) [m/...]."""
        columns = changes(model, values, self.begun, self.data.dt)
        return columns.reshape(-1, self.residual.size)

    def begun(self, model: IdentifiedModel) -> Array:
        """Return the reading of a model that begins as the record does [m]."""
        return self._counted(model, self._begun(model))

    def _counted(self, model: IdentifiedModel, state: StageState) -> Array:
        return np.asarray(self.data.counted(self._reading(model, state)))

    def _reading(self, model: IdentifiedModel, state: StageState) -> Array:
        """Displacement as it is read, without offset and drift [m]."""
        return np.asarray(model.simulate(self.data, offset=0.0, initial=state).x) - (
            model._drift_on(self.data)
        )

    def _begun(self, model: IdentifiedModel, voltage: float | None = None) -> StageState:
        """State at the first sample of a model beside the one that was fitted."""
        start, stage = self.start, model.model
        if start.rest is not None:
            return start_at_jump(stage, self.data, start.rest).state
        volts = start.voltage if voltage is None else voltage
        if start.history == "fit" and volts is None:
            return start.state
        begun: Start = start_after(stage, self.data, start.history, volts, creeps=self.creeps)
        return begun.state
