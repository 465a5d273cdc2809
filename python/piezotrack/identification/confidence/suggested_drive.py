"""Choice of the drive to measure next, whose record determines the parameters best."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

from ... import _core
from ..._support.arguments import expect, number_pair, plain, positive
from ..._support.arrays import check_dt
from ..._support.display.result import Result
from ..._support.files.writing import write_columns
from ..._support.units import drive_word, of_drive, shown_unit
from ...errors import NumericalError, ParameterError, PiezotrackError
from ...stages.base import Stage
from ..fitted.identification import Identification
from ..fitted.identified_model import IdentifiedModel
from ..solve.weights import CHOSEN
from .drive_blocks import SHORTEST, Block, Span, blocks_of, reach

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from ...stages.motion import StageState

    Array = NDArray[np.float64]

__all__ = ["ExpectedDeviation", "SuggestedDrive", "suggest_drive"]

# Share of a value by which it is moved to see its effect.
MOVE = 1e-3
# Relative deviation of a value of which a record tells nothing, for the determinant.
WIDEST = 10.0
# Accuracy of the displacement in the choice of blocks, and of the deviations [m].
ROUGH, FINE = 1e-8, 1e-10
# Numbers of blocks that are tried, and the least samples of a block.
COUNTS, FEWEST = (4, 8, 16), 25
# Samples times values from which on blocks are judged by every second sample, and so on.
BUDGET, THINNEST = 60_000, 10
# Blocks of a place that are tried again after the others are chosen, and times that it is done.
AGAIN, SWEEPS = 5, 2
# Cycles of the plain sine.
CYCLES = 4.0
# Deviations of a 95 % interval.
NORMAL_95 = 1.959963984540054
# Correlation of neighbouring residuals from which on they are not taken for independent.
CORRELATED = 0.3


class ExpectedDeviation(NamedTuple):
    """Spread of one parameter that a record would leave.

    Attributes
    ----------
    value : float
        The value taken for true, in `unit`.
    unit : str
        SI; empty where there is none.
    deviation : float
        Standard deviation with the suggested drive; infinite above five times the value.
    of_sine : float
        With a plain sine over the limits, of the same length.
    of_record : float or None
        With the record that was fitted; None where there is none.
    """

    value: float
    unit: str
    deviation: float
    of_sine: float
    of_record: float | None = None

    @property
    def interval(self) -> tuple[float, float]:
        """Ends of the 95 % interval, of a normal distribution."""
        half = NORMAL_95 * self.deviation
        return self.value - half, self.value + half


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class SuggestedDrive(Result):
    """A drive, and what a record of it would tell of a stage.

    Attributes
    ----------
    u : ndarray, shape (n,)
        Drive [V].
    dt : float
        Sampling interval [s].
    limits : (float, float)
        Lowest and highest drive [V].
    slew : float
        Largest rate [V/s].
    blocks : tuple of str
        What it is composed of, in turn.
    sine : ndarray, shape (n,)
        The plain sine that it is compared with [V].
    parameters : dict of str to ExpectedDeviation
        Spread of each parameter that would be fitted, entries of a list by their number.
    noise : float
        Noise of the displacement taken for the deviations [m rms]; white.
    drive_unit : str
        Unit of the drive, SI.
    seed : int
        Of the random steps.
    notes : tuple of str
        Remarks on a drive beyond the record identified.
    """

    views: ClassVar[Mapping[str, str]] = {
        "summary": "identification.views.confidence.suggested_drive_report:suggested_text",
        "plot": "identification.views.confidence.suggested_drive_plot:plot_suggested",
    }

    u: Array
    dt: float
    limits: tuple[float, float]
    slew: float
    blocks: tuple[str, ...]
    sine: Array
    parameters: Mapping[str, ExpectedDeviation]
    noise: float
    drive_unit: str
    seed: int
    notes: tuple[str, ...]

    def __repr__(self) -> str:
        return f"<SuggestedDrive, {self.u.size} samples in {plain(self.u.size * self.dt)} s>"

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write time and drive as a CSV file, which ``piezotrack measure --drive`` plays.

        Parameters
        ----------
        path : path-like
            The file.

        Returns
        -------
        pathlib.Path
            The file.

        Raises
        ------
        DataError
            The file cannot be written.
        """
        name, scale = shown_unit(self.drive_unit)
        time = self.dt * np.arange(self.u.size)
        drive = f"{drive_word(self.drive_unit)}_{name}"
        return write_columns(path, {"time_s": time, drive: scale * self.u})

    def document(self) -> dict[str, Any]:
        """Content of the JSON file.

        Returns
        -------
        dict
            Of numbers, texts, lists and dicts only.
        """
        return {
            "format": "piezotrack-suggested-drive",
            "schema_version": 1,
            "samples": self.u.size,
            "dt": {"value": self.dt, "unit": "s"},
            "limits": {"value": list(self.limits), "unit": self.drive_unit},
            "slew": {"value": self.slew, "unit": f"{self.drive_unit}/s"},
            "noise": {"value": self.noise, "unit": "m"},
            "blocks": list(self.blocks),
            "parameters": {
                name: {
                    "value": one.value,
                    "unit": one.unit,
                    "standard_deviation": one.deviation,
                    "interval_95": list(one.interval),
                    "standard_deviation_of_sine": one.of_sine,
                    "standard_deviation_of_record": one.of_record,
                }
                for name, one in self.parameters.items()
            },
            "notes": list(self.notes),
            "provenance": {
                "package": "piezotrack",
                "version": _core.__version__,
                "seed": self.seed,
            },
        }


def suggest_drive(
    model: IdentifiedModel | Stage,
    *,
    limits: tuple[float, float],
    slew: float,
    seconds: float,
    dt: float,
    noise: float | None = None,
    seed: int = 0,
) -> SuggestedDrive:
    r"""Choose the drive of which a record determines the parameters of a model best.

    With the sensitivities :math:`J_{tj} = \partial x_t / \partial \ln \theta_j` of the displacement
    to the values that are fitted, by central differences, and after offset and drift of the sensor
    are projected out of them, the determinant

    .. math:: \log \det \left(\frac{J^T J}{\sigma^2} + \frac{I}{10^2}\right)

    is maximised (D-optimality: Goodwin and Payne 1977, Dynamic System Identification, section 6.2).
    The drive is a sequence of blocks, 4, 8 or 16 of equal length: sines, growing and shrinking
    triangles, a fast sine upon a slow one, sweeps, random steps, ramps and rests. They are chosen
    one after the other, each for the largest determinant so far, and then exchanged one by one
    (Fedorov 1972, Theory of Optimal Experiments, chapter 3). With many samples and
    values the blocks are judged by every second to tenth sample. The deviations are
    :math:`\sigma \sqrt{[(J^T J)^{-1}]_{jj}}`: the Cramer-Rao bound under white noise, as far as the
    model is right.

    Parameters
    ----------
    model : IdentifiedModel or Stage
        What is taken for true: a fit, whose free values count, or a stage, of which those count
        that `identify` fits: a stage with a voltage at its input has a nominal stiffness, and
        thresholds and times of creep are chosen beforehand. Values of 0 are left out.
    limits : (float, float)
        Lowest and highest drive [V].
    slew : float
        Largest rate of the drive [V/s].
    seconds : float
        Length [s].
    dt : float
        Sampling interval [s].
    noise : float, optional
        Noise of the displacement [m rms]. Of a fit it is that of the residual; where neighbouring
        residuals correlate by r above 0.3, times ``sqrt((1 + r) / (1 - r))``.
    seed : int, optional
        Of the random steps among the blocks.

    Returns
    -------
    SuggestedDrive
        It begins and ends at 0 V, or the limit nearest to it.

    Raises
    ------
    ParameterError
        `model` is neither, or has nothing to fit; `limits` are reversed; `slew` does not lead over
        the range and back in `seconds`; `seconds` are too few samples; or a stage has no `noise`.
    NumericalError
        The stage cannot be simulated under any of the blocks.

    Examples
    --------
    >>> import piezotrack as pt
    >>> stage = pt.stages.PrandtlIshlinskiiStage(
    ...     linear=1e-6, thresholds=[10.0, 20.0], weights=[0.2e-6, 0.1e-6], time_constant=2e-3
    ... )
    >>> found = pt.suggest_drive(
    ...     stage, limits=(0.0, 75.0), slew=2000.0, seconds=4.0, dt=2e-3, noise=20e-9
    ... )
    >>> lag = found.parameters["time_constant"]
    >>> lag.deviation < 0.2 * lag.of_sine
    True
    """
    expect("model", model, (IdentifiedModel, Stage), "what pt.identify or pt.load returns, a stage")
    unit = model.drive_unit if isinstance(model, IdentifiedModel) else model.info.drive_unit
    low, high = number_pair("limits", limits, unit)
    slew, seconds = positive("slew", slew, f"{unit}/s"), positive("seconds", seconds, "s")
    dt, seed = check_dt(dt), _core.as_count("seed", seed)
    if seconds < (shortest := COUNTS[0] * FEWEST * dt):
        raise ParameterError(
            "seconds", f"{seconds:g} s", f"{shortest:g} s or more at intervals of {dt:g} s"
        )
    if slew * seconds < 4.0 * (high - low):
        raise ParameterError(
            "slew",
            f"{slew:g} {unit}/s",
            f"{4.0 * (high - low) / seconds:g} {unit}/s or more: twice over the limits and back "
            f"in {seconds:g} s",
        )
    span = Span(low, high, slew * dt)
    truth = _Truth.of(model)
    sigma = _noise_of(model, noise)
    search = _Search(truth, span, round(seconds / dt), dt, sigma, seed)
    plan = max((search.plan(count) for count in search.counts()), key=lambda one: one.score)
    u = search.whole(plan)
    sine = search.sine()
    spreads = [truth.spread(truth.gram(one, dt), sigma) for one in (u, sine)]
    earlier = _record_spread(model, truth, sigma)
    parameters = {
        name: ExpectedDeviation(
            value,
            of_drive(unit_of, unit),
            abs(value) * float(spreads[0][j]),
            abs(value) * float(spreads[1][j]),
            None if earlier is None else abs(value) * float(earlier[j]),
        )
        for j, (name, value, unit_of) in enumerate(truth.values())
    }
    beyond = model.extrapolation_notes(u, dt) if isinstance(model, IdentifiedModel) else []
    return SuggestedDrive(
        u=u,
        dt=dt,
        limits=(low, high),
        slew=slew,
        blocks=tuple(search.blocks[len(plan.chosen)][k].text for k in plan.chosen),
        sine=sine,
        parameters=parameters,
        noise=sigma,
        drive_unit=unit,
        seed=seed,
        notes=tuple(beyond),
    )


def _noise_of(model: IdentifiedModel | Stage, noise: float | None) -> float:
    """Return the noise given, or that of the residual of a fit [m]."""
    if noise is not None:
        return positive("noise", noise, "m")
    if isinstance(model, Stage):
        raise ParameterError(
            "noise", "None", "that of the sensor, in m rms, as the model is a stage"
        )
    if isinstance(model, Identification):
        r = min(max(model.autocorrelations), 1.0 - 1e-9)
        return model.cost * (math.sqrt((1.0 + r) / (1.0 - r)) if r > CORRELATED else 1.0)
    cost = model.details.get("fit", {}).get("cost", {}).get("value")
    if not (isinstance(cost, float) and cost > 0.0):
        raise ParameterError("noise", "None", "a number in m, as the model file has no residual")
    return cost


class _Value(NamedTuple):
    """A number of a stage: the parameter, and which entry of a list."""

    name: str
    entry: int | None

    def of(self, stage: Any) -> float:
        """Return it [SI]."""
        value = getattr(stage, self.name)
        return float(value if self.entry is None else value[self.entry])

    def moved(self, stage: Any, share: float) -> Any:
        """Return a stage with another one; None where that leaves its range."""
        now = getattr(stage, self.name)
        if self.entry is None:
            changed = now * (1.0 + share)
        else:
            changed = (*now[: self.entry], now[self.entry] * (1.0 + share), *now[self.entry + 1 :])
        try:
            return replace(stage, **{self.name: changed})
        except PiezotrackError:
            return None


@dataclass(frozen=True, kw_only=True)
class _Truth:
    """A stage with the values that are fitted, and the stages that differ in one of them.

    Attributes
    ----------
    stage : Stage
        The stage.
    fitted : tuple of _Value
        The values.
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
    fitted: tuple[_Value, ...]
    stages: tuple[Any, ...]
    pairs: tuple[tuple[int, int, float], ...]
    offset: bool = True
    drift: float | None = None

    @classmethod
    def of(cls, model: IdentifiedModel | Stage) -> _Truth:
        """Return the truth that a model is taken for."""
        stage: Any = model.model if isinstance(model, IdentifiedModel) else model
        fitted: list[_Value] = []
        stages: list[Any] = [stage]
        pairs: list[tuple[int, int, float]] = []
        for value in _fitted(model, stage):
            for ways in ((MOVE, -MOVE), (MOVE, 0.0), (0.0, -MOVE)):
                both = [value.moved(stage, way) for way in ways]
                if None not in both:
                    fitted.append(value)
                    pairs.append((len(stages), len(stages) + 1, ways[0] - ways[1]))
                    stages += both
                    break
        if not fitted:
            raise ParameterError("model", "no values that are fitted", "some", verb="has")
        of_sensor: dict[str, Any] = {}
        if isinstance(model, IdentifiedModel):
            drift = None if model.drift is None else model.drift.time
            of_sensor = {"offset": model.offset_fitted, "drift": drift}
        return cls(
            stage=stage,
            fitted=tuple(fitted),
            stages=tuple(stages),
            pairs=tuple(pairs),
            **of_sensor,
        )

    def one_sided(self) -> _Truth:
        """Differences from the stage itself, at half the number of simulations."""
        moved, pairs = [], []
        for j, (up, down, apart) in enumerate(self.pairs):
            is_central = apart > 1.5 * MOVE
            which = up if is_central or self.stages[up] != self.stage else down
            way = MOVE if which == up else -MOVE
            moved.append(self.stages[which])
            pairs.append((j + 1, 0, way))
        return replace(self, stages=(self.stage, *moved), pairs=tuple(pairs))

    def values(self) -> list[tuple[str, float, str]]:
        """Name, value and unit of each."""
        units = {one.name: one.unit for one in self.stage.info.parameters}
        return [
            (
                one.name if one.entry is None else f"{one.name}[{one.entry}]",
                one.of(self.stage),
                units[one.name],
            )
            for one in self.fitted
        ]

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
        count = len(self.pairs)
        of_all, mixed, sensor = gram[:count, :count], gram[:count, count:], gram[count:, count:]
        if sensor.size == 0:
            return of_all
        rest = of_all - mixed @ np.linalg.pinv(sensor, hermitian=True) @ mixed.T
        return np.asarray(0.5 * (rest + rest.T))

    def score(self, gram: Array, noise: float) -> float:
        """Logarithm of the determinant of a design."""
        whole = self.information(gram) / noise**2 + np.eye(len(self.pairs)) / WIDEST**2
        sign, log = np.linalg.slogdet(whole)
        return float(log) if sign > 0.0 else -math.inf

    def spread(self, gram: Array, noise: float) -> Array:
        """Relative standard deviation of each value; infinite where it is not determined."""
        whole = self.information(gram) / noise**2 + np.eye(len(self.pairs)) / WIDEST**2
        deviation = np.sqrt(np.diagonal(np.linalg.inv(whole)))
        return np.where(deviation < 0.5 * WIDEST, deviation, math.inf)


def _fitted(model: IdentifiedModel | Stage, stage: Any) -> list[_Value]:
    """Name the values that were fitted, or of a stage would be, and are not 0."""
    free = {
        one.name
        for one in stage.info.parameters
        if one.name not in CHOSEN
        and one.held is None
        and not (one.name == "stiffness" and stage.info.drive_unit == "V")
    }
    if isinstance(model, IdentifiedModel):
        entries = model.document()["parameters"]
        free = {name for name in entries if entries[name].get("free", False)}
    values = []
    for name in stage.parameter_names():
        value = getattr(stage, name)
        if name not in free or value is None:
            continue
        if isinstance(value, tuple):
            values += [_Value(name, k) for k, one in enumerate(value) if one != 0.0]
        elif value != 0.0:
            values.append(_Value(name, None))
    return values


class _Place(NamedTuple):
    """Where a drive has come to: voltage, states, products so far, and time [s]."""

    volts: float
    states: Sequence[StageState | None]
    gram: Array
    samples: int


class _Plan(NamedTuple):
    """Blocks by their numbers, and the logarithm of the determinant."""

    chosen: tuple[int, ...]
    score: float


class _Search:
    """The choice of blocks."""

    def __init__(
        self, truth: _Truth, span: Span, samples: int, dt: float, noise: float, seed: int
    ) -> None:
        self.truth, self.span, self.dt, self.noise = truth.one_sided(), span, dt, noise
        self.thin = min(THINNEST, -(-samples * len(truth.pairs) // BUDGET))
        self.home = min(max(0.0, span.low), span.high)
        self.samples = samples
        # The way back is kept free at the end.
        way = max(abs(self.home - span.low), abs(span.high - self.home)) / span.step
        self.room = samples - 1 - math.ceil(way)
        self.blocks = {
            count: blocks_of(span, self._length(count), dt, seed, max(SHORTEST, 4 * self.thin))
            for count in self.counts()
        }
        states = self.truth.beginning(self.home)
        self.begin = _Place(self.home, states, self.truth.gram_at_rest(states), 1)

    def counts(self) -> list[int]:
        """Numbers of blocks that leave enough samples for each."""
        return [n for n in COUNTS if self.room // n >= FEWEST] or [COUNTS[0]]

    def _length(self, count: int) -> int:
        """Return the samples of each of so many blocks, a multiple of the thinning."""
        return self.room // count // self.thin * self.thin

    def plan(self, count: int) -> _Plan:
        """Choose the blocks of a drive of so many."""
        place, chosen, ranks = self.begin, [], []
        for _ in range(count):
            after = [self._after(place, block, count) for block in self.blocks[count]]
            scores = [self._score(one) for one in after]
            rank = sorted(range(len(scores)), key=lambda k: (-scores[k], k))
            best = after[rank[0]]
            if best is None:
                raise NumericalError("the stage cannot be simulated under any of the blocks")
            place = best
            chosen.append(rank[0])
            ranks.append(rank[1 : 1 + AGAIN])
        plan = _Plan(tuple(chosen), self._score(place))
        for _ in range(SWEEPS):
            exchanged = self._exchanged(plan, ranks)
            if exchanged.chosen == plan.chosen:
                break
            plan = exchanged
        return plan

    def _exchanged(self, plan: _Plan, ranks: list[list[int]]) -> _Plan:
        """Try other blocks in each place in turn, and keep those that are better."""
        count, place = len(plan.chosen), self.begin
        for k in range(count):
            for other in ranks[k]:
                chosen = (*plan.chosen[:k], other, *plan.chosen[k + 1 :])
                found = self._score(self._through(place, chosen[k:], count))
                if found > plan.score + 1e-9:
                    plan = _Plan(chosen, found)
            following = self._through(place, plan.chosen[k : k + 1], count)
            assert following is not None
            place = following
        return plan

    def _through(self, place: _Place, chosen: Sequence[int], count: int) -> _Place | None:
        following: _Place | None = place
        for k in chosen:
            if following is None:
                return None
            following = self._after(following, self.blocks[count][k], count)
        return following

    def _after(self, place: _Place, block: Block, count: int) -> _Place | None:
        """Where a block leads to; None where it is too fast from there, or cannot be simulated."""
        u = block.after(place.volts, self._length(count), self.span)
        if u is None:
            return None
        judged, dt = u[self.thin - 1 :: self.thin], self.thin * self.dt
        try:
            columns, states = self.truth.after(place.states, place.volts, judged, dt, ROUGH)
        except NumericalError:
            return None
        t = self.dt * (place.samples - 1) + dt * np.arange(1, judged.size + 1, dtype=np.float64)
        gram = place.gram + self.thin * self.truth.gram_of(columns, t)
        return _Place(float(u[-1]), states, gram, place.samples + u.size)

    def _score(self, place: _Place | None) -> float:
        return -math.inf if place is None else self.truth.score(place.gram, self.noise)

    def whole(self, plan: _Plan) -> Array:
        """Drive of a plan, from home and back [V]."""
        count = len(plan.chosen)
        return self._whole([self.blocks[count][k] for k in plan.chosen], self._length(count))

    def _whole(self, blocks: Sequence[Block], length: int) -> Array:
        parts = [np.array([self.home])]
        for block in blocks:
            part = block.after(float(parts[-1][-1]), length, self.span)
            assert part is not None
            parts.append(part)
        parts.append(reach(float(parts[-1][-1]), self.home, self.span.step))
        u = np.concatenate(parts)
        rest = np.full(self.samples - u.size, self.home)
        whole: Array = np.concatenate([u, rest])
        return whole.clip(self.span.low, self.span.high)

    def sine(self) -> Array:
        """Plain sine over the whole range [V]."""
        half = 0.5 * (self.span.high - self.span.low)
        cycles = min(CYCLES, 0.9 * self.room * self.span.step / (2.0 * math.pi * half))
        rate = 2.0 * math.pi * cycles / self.room

        def shape(count: int) -> Array:
            return np.asarray(self.span.at(0.5) - half * np.cos(rate * np.arange(count)))

        return self._whole([Block("sine", shape)], self.room)


def _record_spread(model: IdentifiedModel | Stage, truth: _Truth, noise: float) -> Array | None:
    """Relative standard deviations that the records of a fit leave; None without a record."""
    if not isinstance(model, Identification):
        return None
    grams = np.zeros((len(truth.pairs), len(truth.pairs)))
    kept = {one.name: getattr(model, one.name) for one in fields(IdentifiedModel)}
    kept |= {"details": model.document()}
    for data, _ in model._fitted:
        start = model.start_on(data)
        how: dict[str, Any] = (
            {"initial": start.state} if start.history == "fit" else {"history": start.history}
        )
        runs = [
            IdentifiedModel(**{**kept, "model": one}).simulate(data, offset=0.0, **how)
            for one in truth.stages
        ]
        columns = truth.columns_of([data.counted(run.x) for run in runs])
        gram: Any = truth.gram_of(columns, data.counted(data.t - data.t[0]))
        grams = grams + truth.information(gram)
    bare: _Truth = replace(truth, offset=False, drift=None)
    return bare.spread(grams, noise)
