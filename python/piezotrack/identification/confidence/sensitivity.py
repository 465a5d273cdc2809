"""Change of the displacement of a record with the values that were fitted to it."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ... import _core
from ..._support.two_threads import one_by_one, two_threads
from ...errors import ParameterError, PiezotrackError
from ..fitted.identified_model import IdentifiedModel
from ..fitted.start import same_beginning, start_after, start_at_jump

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Mapping, Sequence

    from numpy.typing import ArrayLike, NDArray

    from ...data.dataset import Dataset
    from ...stages.motion import StageState
    from ..fitted.start import Start

    Array = NDArray[np.float64]

__all__ = [
    "DELAY",
    "LinearisedRecord",
    "Sensitivity",
    "Value",
    "changes",
    "fitted_values",
    "free_values",
    "gradient",
    "moved",
    "sensitivity",
    "sizes_of",
]

# Share of a value by which it is moved to see its effect.
STEP = 1e-4
# The same of an entry that is 0, in the mean of its list: a weight, in which the motion is linear.
FROM_ZERO = 0.1
# The same of a delay in sampling intervals, and of a voltage before the record in its range.
LATER, BEFORE = 1e-2, 1e-4
DELAY = "delay"


class Value(NamedTuple):
    """A number that was fitted.

    Attributes
    ----------
    parameter : str
        The parameter of the stage, or ``"delay"``.
    entry : int or None
        Which entry of a list.
    """

    parameter: str
    entry: int | None = None

    def __str__(self) -> str:
        return self.parameter if self.entry is None else f"{self.parameter}[{self.entry}]"

    @classmethod
    def named(cls, name: str) -> Value:
        """Return the number that is written as ``"weights[2]"``."""
        parameter, _, entry = name.removesuffix("]").partition("[")
        return cls(parameter, int(entry) if entry else None)

    def of(self, model: IdentifiedModel) -> float:
        """Return the number in a model, SI."""
        if self.parameter == DELAY:
            return model.delay
        value = getattr(model.model, self.parameter)
        return float(value if self.entry is None else value[self.entry])


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
    residual : ndarray, shape (n,)
        Measured less simulated displacement [m].
    """

    columns: Array
    nuisance: Array
    alone: tuple[str, ...]
    residual: Array


def fitted_values(model: IdentifiedModel) -> list[Value]:
    """List the numbers that were fitted and are not 0, on a bound or on a constraint.

    Parameters
    ----------
    model : IdentifiedModel
        The model.

    Returns
    -------
    list of Value
        Entries of lists one by one; the delay of one record last. Where the covariance is known,
        those that it has.
    """
    if model.covariance is not None:
        return [Value.named(name) for name in model.covariance.names]
    entries = _entries(model)
    free = {name for name, entry in entries.items() if entry.get("free", False)}
    bounded = {name for name in free if entries[name].get("at_bound", False)}
    values = free_values(model.model, free - bounded)
    if len(model.records) <= 1 and model.details.get(DELAY, {}).get("free", False):
        values.append(Value(DELAY))
    return values


def free_values(stage: Any, free: Collection[str]) -> list[Value]:
    """List the numbers of some parameters of a stage that are not 0.

    Parameters
    ----------
    stage : Stage
        The stage.
    free : collection of str
        The parameters.

    Returns
    -------
    list of Value
        Entries of lists one by one.
    """
    values: list[Value] = []
    for name in stage.parameter_names():
        value = getattr(stage, name)
        if name not in free or value is None:
            continue
        if isinstance(value, tuple):
            values += [Value(name, k) for k, number in enumerate(value) if number != 0.0]
        elif value != 0.0:
            values.append(Value(name))
    return values


def sizes_of(model: IdentifiedModel, values: list[Value], dt: float) -> Array:
    """Return the sizes of values, to count changes in shares of them.

    Parameters
    ----------
    model : IdentifiedModel
        The model.
    values : list of Value
        Its values.
    dt : float
        Size of a delay of 0 [s].

    Returns
    -------
    ndarray, shape (p,)
        SI, above 0.
    """
    return np.array([_size(model, value) or dt for value in values], dtype=np.float64)


def _size(model: IdentifiedModel, value: Value) -> float:
    """Size of a value, of an entry that is 0 the mean of those of its list, or 1 of its unit."""
    size = abs(value.of(model))
    if size == 0.0 and value.entry is not None:
        size = float(np.mean(np.abs(getattr(model.model, value.parameter)))) or 1.0
    return size


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


def _entries(model: IdentifiedModel) -> Mapping[str, Any]:
    entries: Mapping[str, Any] = model.details.get("parameters", {})
    return entries


def moved(model: IdentifiedModel, values: list[Value], changes: Array) -> IdentifiedModel | None:
    """Return a model some of whose values are changed, with those that are tied to them.

    Parameters
    ----------
    model : IdentifiedModel
        The model.
    values : list of Value
        What is changed.
    changes : ndarray, shape (p,)
        By how much, SI.

    Returns
    -------
    IdentifiedModel or None
        None where a value leaves the range in which there is such a stage.
    """
    changed: dict[str, Any] = {}
    delay = model.delay
    for value, change in zip(values, changes, strict=True):
        if value.parameter == DELAY:
            delay += change
            continue
        now = changed.get(value.parameter, getattr(model.model, value.parameter))
        if value.entry is None:
            changed[value.parameter] = now + change
        else:
            numbers = list(now)
            numbers[value.entry] += change
            changed[value.parameter] = tuple(numbers)
    try:
        changed |= _tied(model, changed) | _normalised(model, changed)
        stage = replace(model.model, **changed)
    except PiezotrackError:
        return None
    return replace(_without_search(model), model=stage, delay=delay)


def _tied(model: IdentifiedModel, changed: Mapping[str, Any]) -> dict[str, float]:
    """Values of the parameters that are tied to others."""
    entries = _entries(model)
    if not any("tie" in entry for entry in entries.values()):
        return {}
    scalars = [one.name for one in model.model.info.parameters if not one.is_list]
    ties = [(k, entries[n]["tie"]) for k, n in enumerate(scalars) if "tie" in entries.get(n, {})]
    values = [changed.get(name, getattr(model.model, name)) for name in scalars]
    known = [0.0 if value is None else float(value) for value in values]
    tied = _core.tied_values(model.model.info.name, known, ties)
    return {scalars[place]: tied[place] for place, _ in ties}


def _normalised(model: IdentifiedModel, changed: Mapping[str, Any]) -> dict[str, Any]:
    """Values that follow from others in a fit by least squares."""
    stage = model.model
    if stage.info.searched or not changed:
        return {}
    now = {name: changed.get(name, getattr(stage, name)) for name in stage.parameter_names()}
    if "slip_displacements" in now:
        # The thresholds stay where they are.
        known = (stage.piezo_coefficient, stage.stiffness_ratios)
        drive = _slips(*known, stage.slip_displacements, inverse=True)
        slips = _slips(now["piezo_coefficient"], now["stiffness_ratios"], drive)
        return {"slip_displacements": slips}
    if now.get("scale") is None or stage.falling_scale is not None or model.drive_range is None:
        return {}
    # The envelope is 0 at 0 V and rises by as much as the drive.
    ends = np.array(model.drive_range)
    rise = float(np.diff(np.tanh(stage.slope * ends + stage.shift))[0]) * stage.scale
    steep = float(np.diff(np.tanh(now["slope"] * ends + now["shift"]))[0])
    if steep == 0.0:
        raise ParameterError("slope", now["slope"], "one with which the envelope rises")
    scale = rise / steep
    middle = stage.level + stage.scale * np.tanh(stage.shift)
    return {"scale": scale, "level": float(middle - scale * np.tanh(now["shift"]))}


def _slips(
    gain: float, ratios: Sequence[float], at: Sequence[float], *, inverse: bool = False
) -> tuple[float, ...]:
    """Displacements at which elements slip [m], of thresholds of the drive [V]; or the inverse."""
    stiffness = 1.0 + np.append(np.cumsum(ratios[::-1])[::-1], 0.0)[: len(at)]
    slopes = abs(gain) / stiffness
    steps = np.diff(np.array(at), prepend=0.0)
    return tuple(np.cumsum(steps / slopes if inverse else steps * slopes).tolist())


def _without_search(model: IdentifiedModel) -> IdentifiedModel:
    """Return an identified model without the search that found it."""
    return IdentifiedModel(
        **{field.name: getattr(model, field.name) for field in fields(IdentifiedModel)}
    )


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
        size = LATER * dt if value.parameter == DELAY else share * _size(model, value)
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
        return replace(_without_search(model), records=records)

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
        if start.history == "rest":
            return start_at_jump(stage, self.data, start.voltage or 0.0).state
        volts = start.voltage if voltage is None else voltage
        if start.history == "fit" and volts is None:
            return start.state
        begun: Start = start_after(stage, self.data, start.history, volts, creeps=self.creeps)
        return begun.state
