"""Information that a record of a drive has of the values of a stage."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ....errors import NumericalError, ParameterError
from ...fitted.identified_model import IdentifiedModel
from ...linearised.sensitivity import sensitivity
from ...linearised.values import free_values, moved
from ...solve.weights import CHOSEN

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ....stages.base import Stage
    from ....stages.motion import StageState
    from ...fitted.identification import Identification
    from ...linearised.values import Value

    Array = NDArray[np.float64]

__all__ = ["Truth", "information", "spread"]

# Share of a value by which it is moved to see its effect.
MOVE = 1e-3
# Relative deviation of a value of which a record tells nothing, for the determinant.
WIDEST = 10.0
# Accuracy of the displacement for the deviations [m].
FINE = 1e-10


@dataclass(frozen=True, kw_only=True)
class Truth:
    """A stage with the values that are fitted, and the stages that differ in one of them.

    Attributes
    ----------
    stage : Stage
        The stage.
    fitted : tuple of Value
        The values.
    values : tuple of (str, float, str)
        Name, value and unit of each.
    stages : tuple of Stage
        The stage and those that differ in one value.
    pairs : tuple of (int, int, float)
        For each value the stages with more and with less of it, and their relative difference.
    offset : bool
        Whether an offset is fitted.
    drift : float or None
        Time constant of a drift that is fitted [s].
    """

    stage: Any
    fitted: tuple[Value, ...]
    values: tuple[tuple[str, float, str], ...]
    stages: tuple[Any, ...]
    pairs: tuple[tuple[int, int, float], ...]
    offset: bool
    drift: float | None

    @classmethod
    def of(cls, model: IdentifiedModel | Stage) -> Truth:
        """Return the truth that a model is taken for."""
        base = model if isinstance(model, IdentifiedModel) else _of_stage(model)
        fitted: list[Value] = []
        stages: list[Any] = [base.model]
        pairs: list[tuple[int, int, float]] = []
        entries = base.details.get("parameters", {})
        units = {one.name: one.unit for one in base.model.info.parameters}
        free = {name for name, entry in entries.items() if entry.get("free", False)}
        for value in free_values(base.model, free):
            size = np.array([value.of(base)])
            for ways in ((MOVE, -MOVE), (MOVE, 0.0), (0.0, -MOVE)):
                both = [moved(base, [value], way * size) for way in ways]
                if None not in both:
                    fitted.append(value)
                    pairs.append((len(stages), len(stages) + 1, ways[0] - ways[1]))
                    stages += [one.model for one in both if one is not None]
                    break
        if not fitted:
            raise ParameterError("model", "no values that are fitted", "some", verb="has")
        return cls(
            stage=base.model,
            values=tuple((str(value), value.of(base), units[value.parameter]) for value in fitted),
            fitted=tuple(fitted),
            stages=tuple(stages),
            pairs=tuple(pairs),
            offset=base.offset_fitted,
            drift=None if base.drift is None else base.drift.time,
        )

    def one_sided(self) -> Truth:
        """Differences from the stage itself, at half the number of simulations."""
        moved, pairs = [], []
        for j, (up, down, apart) in enumerate(self.pairs):
            is_central = apart > 1.5 * MOVE
            which = up if is_central or self.stages[up] != self.stage else down
            way = MOVE if which == up else -MOVE
            moved.append(self.stages[which])
            pairs.append((j + 1, 0, way))
        return replace(self, stages=(self.stage, *moved), pairs=tuple(pairs))

    def beginning(self, volts: float) -> list[StageState | None]:
        """State of each stage in equilibrium under a voltage, from never moved."""
        states: list[StageState | None] = []
        for stage in self.stages:
            try:
                states.append(stage.equilibrium(volts))
            except NumericalError:
                states.append(None)
        return states

    def after(
        self,
        states: Sequence[StageState | None],
        volts: float,
        u: Array,
        dt: float,
        accuracy: float = FINE,
    ) -> tuple[Array, list[StageState | None]]:
        """Sensitivities [m] at samples that follow a voltage, and the states at the last one."""
        drive = np.concatenate([[volts], u])
        runs = [
            stage.simulate(drive, dt, initial=state, accuracy=accuracy)
            for stage, state in zip(self.stages, states, strict=True)
        ]
        columns = self.columns_of([run.x[1:] for run in runs])
        return columns, [run.final for run in runs]

    def columns_of(self, x: Sequence[Array]) -> Array:
        """Sensitivities, of the displacements of the stages [m]."""
        return np.column_stack([(x[up] - x[down]) / apart for up, down, apart in self.pairs])

    def gram_of(self, columns: Array, t: Array) -> Array:
        """Products of the sensitivities and the columns of the sensor at some instants."""
        sensor = [np.ones(t.size)] if self.offset else []
        sensor += [np.exp(-t / self.drift)] if self.drift is not None else []
        whole = np.column_stack([columns, *sensor])
        return np.asarray(whole.T @ whole)

    def gram_at_rest(self, states: Sequence[StageState | None]) -> Array:
        """Products at the first sample, where the stages are in these states."""
        x = [np.array([0.0 if one is None else float(one.x)]) for one in states]
        return self.gram_of(self.columns_of(x), np.zeros(1))

    def gram(self, u: Array, dt: float) -> Array:
        """Products over a whole drive, from equilibrium under its first sample."""
        states = self.beginning(float(u[0]))
        columns, _ = self.after(states, float(u[0]), u[1:], dt)
        t = dt * np.arange(1, u.size, dtype=np.float64)
        return self.gram_at_rest(states) + self.gram_of(columns, t)

    def information(self, gram: Array) -> Array:
        """J^T J after the columns of the sensor are projected out."""
        return information(gram, len(self.pairs))

    def score(self, gram: Array, noise: float) -> float:
        """Logarithm of the determinant of a design."""
        sign, log = np.linalg.slogdet(_ridged(self.information(gram), noise))
        return float(log) if sign > 0.0 else -math.inf

    def spread(self, gram: Array, noise: float) -> Array:
        """Relative standard deviation of each value; infinite where it is not determined."""
        return spread(self.information(gram), noise)

    def spread_of_records(self, fit: Identification, noise: float) -> Array:
        """Relative standard deviations that the records of a fit leave."""
        count, whole = len(self.fitted), np.zeros((len(self.fitted), len(self.fitted)))
        sizes = np.array([value.of(fit) for value in self.fitted])
        for data, _ in fit._fitted:
            record = sensitivity(fit, data, list(self.fitted))
            columns = np.concatenate([sizes[:, None] * record.columns, record.nuisance])
            whole += information(columns @ columns.T, count)
        return spread(whole, noise)


def information(gram: Array, count: int) -> Array:
    """Return J^T J of the first columns after the others are projected out.

    Parameters
    ----------
    gram : ndarray, shape (p + q, p + q)
        Products of all columns.
    count : int
        Number p of the first ones.

    Returns
    -------
    ndarray, shape (p, p)
        The products.
    """
    of_all, mixed, sensor = gram[:count, :count], gram[:count, count:], gram[count:, count:]
    if sensor.size == 0:
        return of_all
    rest = of_all - mixed @ np.linalg.pinv(sensor, hermitian=True) @ mixed.T
    return np.asarray(0.5 * (rest + rest.T))


def spread(products: Array, noise: float) -> Array:
    """Return the relative standard deviation of each value, infinite where it is not determined.

    Parameters
    ----------
    products : ndarray, shape (p, p)
        J^T J [m^2].
    noise : float
        Noise of the displacement [m].

    Returns
    -------
    ndarray, shape (p,)
        The deviations.
    """
    deviation = np.sqrt(np.diagonal(np.linalg.inv(_ridged(products, noise))))
    return np.where(deviation < 0.5 * WIDEST, deviation, math.inf)


def _ridged(products: Array, noise: float) -> Array:
    return np.asarray(products / noise**2 + np.eye(len(products)) / WIDEST**2)


def _of_stage(stage: Any) -> IdentifiedModel:
    """Return a stage as if `identify` had fitted what it fits of one."""
    free = {
        one.name: {"free": True}
        for one in stage.info.parameters
        if one.name not in CHOSEN
        and one.held is None
        and not (one.name == "stiffness" and stage.info.drive_unit == "V")
    }
    return IdentifiedModel(
        model=stage, offset=0.0, offset_fitted=True, stroke=1.0, details={"parameters": free}
    )
