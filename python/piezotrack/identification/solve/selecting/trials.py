"""Trials of models on the first parts of records, judged on the rests."""

from __future__ import annotations

import math
import time
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from threading import Event
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...._support.two_threads import two_threads, waited_for
from ....errors import DataError, NumericalError
from ...fitted.selection import Trial
from ...fitted.start import GAIN
from ...methods.least_squares import LeastSquares
from ..judging import NOISY, is_white, judged, noise_of, period_of
from ..jump import rest_of
from ..one_model import identify_model, weights_of
from ..variants.drift import turns_often
from ..variants.slow_parts import with_slow_parts
from ..weights import Structure
from .shown import as_shown, with_delays

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from concurrent.futures import Future, ThreadPoolExecutor

    from numpy.typing import NDArray

    from ....data.dataset import Dataset
    from ....stages.model_info import ModelInfo
    from ...fitted.identification import Identification
    from ...fitted.start import Rest
    from ...methods.choice import MethodChoice
    from ...problem.problem import Problem
    from ..run import Run

    Array = NDArray[np.float64]

__all__ = [
    "AS_WELL",
    "MANY_WEIGHTS",
    "MORE_THAN_NOISE",
    "NEAR_NOISE",
    "NOTHING_BUT_NOISE",
    "Trials",
    "Tried",
]

# Of these, one of few values predicts other motions where plays describe only the record: tried
# where those leave more than so many times the noise.
FEW_VALUES, MORE_THAN_NOISE = "bouc-wen", 1.02
# What it may leave relative to a fit of many weights, each of which takes some noise away; how far
# above the best trial it is near that.
AS_WELL, NEAR_BEST = 1.01, 1.5
# A residual of so many times the noise has nothing but noise in it: no further model of many
# weights is tried, and a fit to whole records is not made anew. One of so many times, on what was
# not fitted, is good enough to search none.
NOTHING_BUT_NOISE, NEAR_NOISE = 1.2, 2.0
# So many others are fitted to the whole records, the best on what was not fitted; and the one of
# many weights, which a drive that repeats does not determine.
OTHERS, MANY_WEIGHTS = 3, "preisach"


@dataclass(frozen=True)
class Tried:
    """A model that was tried."""

    trial: Trial
    info: ModelInfo
    # Whether its inverse is ill-conditioned.
    ill: bool
    # Its structure, where least squares have found it, and its rest before a jump.
    start: Structure | None
    rest: Rest | None = None
    # Time constants of its creep [s], and what it leaves of what was fitted [m].
    creep: Sequence[float] = ()
    cost: float = math.inf


class _Attempt(NamedTuple):
    """A fit to first parts."""

    fit: Identification
    # What it leaves of the rests [m], whether its inverse is ill-conditioned, and how long it took.
    left: list[Array]
    ill: bool
    seconds: float


@dataclass
class Trials:
    """Trials on the first parts of records, judged on the rests."""

    problem: Problem
    methods: MethodChoice
    how: Run
    rests: list[Dataset]
    found: list[Tried] = field(default_factory=list)
    refused: Exception | None = None
    # Least residual so far, in multiples of the noise, on what was not fitted and on what was.
    least: float = math.inf
    fitted: float = math.inf
    # Structure of the first fit by least squares, and its rest before a jump.
    start: Structure | None = None
    rest: Rest | None = None
    # Models found by least squares, and those of them that are fitted in threads.
    by_weights: list[ModelInfo] = field(default_factory=list)
    pool: ThreadPoolExecutor | None = None
    begun: dict[str, Future[_Attempt | DataError | NumericalError]] = field(default_factory=dict)
    ended: Event = field(default_factory=Event)

    def near_best(self, name: str | None) -> bool:
        """Return whether a model, if it was tried, comes near the best one."""
        rms = {tried.info.name: tried.trial.rms for tried in self.found}
        return name not in rms or rms[name] <= NEAR_BEST * min(rms.values())

    def worth_searching(self, name: str) -> bool:
        """Return whether a model that is searched may be better than what was found so far."""
        if name == FEW_VALUES:
            return self.least > MORE_THAN_NOISE
        return self.least >= NEAR_NOISE and self.fitted >= NOTHING_BUT_NOISE

    def identified(
        self,
        problem: Problem,
        info: ModelInfo,
        how: Run,
        start: Structure | None,
        rest: Rest | None,
    ) -> Identification:
        """Fit a model, by least squares from a structure, with what the first fit has shown."""
        if info.searched:
            return self.searched(problem, info, how, self.start, rest)
        # The whole records may show a delay that the first parts do not.
        first, shown = problem is self.problem, self.start
        if shown is not None and (first or any(shown.delayed)):
            problem = with_delays(problem, shown)
        of_model, method = problem.of_model(info), self.methods.method(info)
        return identify_model(of_model, method, how, start, rest)

    def searched(
        self,
        problem: Problem,
        info: ModelInfo,
        how: Run,
        shown: Structure | None,
        rest: Rest | None,
    ) -> Identification:
        """Search a model with the slow parts that least squares have shown; Bouc-Wen with its own.

        A drift or creep beside plays may stand for what the plays do not describe: Bouc-Wen has
        them only where it leaves more without.
        """
        start = None
        if problem is self.problem:
            # On first parts, what is worse than least squares lacks more than a jump.
            start, least = shown, min(self.found, key=lambda one: one.cost, default=None)
            # Each voltage of rest takes a search.
            rest = rest or (least.rest if least else None)

        def search(one: Problem) -> Identification:
            return identify_model(one.of_model(info), self.methods.method(info), how, start, rest)

        if shown is None:
            return search(problem)
        if info.name != FEW_VALUES or problem.creep is not None:
            return search(as_shown(problem, shown))
        creep = next((one.creep for one in self.found if one.info is info), ())
        own = with_slow_parts(with_delays(problem, shown), search, creep)
        slow = shown.creep_times or any(time is not None for time in shown.drifts)
        if slow and own.cost > NOISY * max(own.noises):
            with suppress(DataError, NumericalError):
                fit = search(as_shown(problem, shown))
                return fit if fit.cost < (1.0 - GAIN) * own.cost else own
        return own

    def of_few_values(self, best: Tried, whole: Identification) -> Tried | None:
        """Return the trial of the model of few values, where it may be better than one of many.

        It is near the best one, or leaves as little of what was fitted, or was judged with a drift
        in what was not fitted, or a drift may be in what was, of which least squares find none.
        """
        few = next((one for one in self.found if one.info.name == FEW_VALUES), None)
        if few is None or best.start is None or self.least <= MORE_THAN_NOISE:
            return None
        pairs = zip(whole.records, best.start.drifts, strict=True)
        drifts = any(record.drift and not before for record, before in pairs)
        drifts = drifts or not all(turns_often(record) for record in self.problem.records)
        near = self.near_best(FEW_VALUES) or few.cost < AS_WELL * best.cost
        return few if near or drifts else None

    def others(self, best: Tried) -> list[Tried]:
        """Return the models that are fitted to the whole records beside the best one."""
        others = [
            one
            for one in sorted(self.found, key=lambda one: one.trial.rms)
            if one is not best and one.start is not None and (best.ill or not one.ill)
        ]
        few = [one for one in others if one.info.name != MANY_WEIGHTS][:OTHERS]
        if any(period_of(record.data) for record in self.problem.records):
            return few
        return [*few, *(one for one in others if one.info.name == MANY_WEIGHTS)]

    @contextmanager
    def side_by_side(self, infos: list[ModelInfo]) -> Iterator[None]:
        """Begin to fit all other models by least squares in two threads when the first is there."""
        self.by_weights = infos
        with two_threads() as pool:
            self.pool = pool if self.how.threads != 1 else None
            try:
                yield
            finally:
                self.ended.set()
                pool.shutdown(wait=False, cancel_futures=True)

    def run(self, info: ModelInfo) -> bool:
        """Try a model; return whether it leaves nothing but noise."""
        if info.name in self.begun:
            with weights_of(info.name, self.how):
                attempt = waited_for(self.begun[info.name])
        else:
            attempt = self.attempt(info, self.how)
        if not isinstance(attempt, _Attempt):
            self.refused = self.refused or attempt
            return False
        fit, left = attempt.fit, attempt.left
        weights = isinstance(fit.method, LeastSquares)
        start = Structure.of(fit) if weights else None
        if weights and self.start is None:
            self.start = start
            # The first model decides whether others have a delay and, where it is near the noise,
            # whether they begin with a jump: one that is not may take for a jump what it lacks.
            if fit.cost < NEAR_NOISE * min(fit.noises):
                self.rest = rest_of(fit)
        records = self.problem.records
        counts = np.array(
            [one.weight * len(rest) for one, rest in zip(records, self.rests, strict=True)]
        )
        pairs = list(zip(self.rests, left, strict=True))
        squares = np.array([judged(rest, one) for rest, one in pairs])
        rms = math.sqrt(float(counts @ squares) / float(counts.sum()))
        trial = Trial(info.name, info.title, rms, attempt.seconds)
        creep, cost = fit.model.creep_times, fit.cost
        self.found.append(Tried(trial, info, attempt.ill, start, rest_of(fit), creep, cost))
        self.fitted = min(self.fitted, fit.cost / max(min(fit.noises), 1e-300))
        # Of a quick motion, differences from sample to sample are not the noise's alone.
        noise = np.array([noise_of(rest.measured) for rest in self.rests])
        counted = [rest.counted(one) for rest, one in pairs]
        plain = np.array([math.sqrt(float(np.mean(one**2))) for one in counted])
        self.least = min(self.least, float(np.max(plain / np.maximum(noise, 1e-300))))
        low = bool(np.all(plain < NOTHING_BUT_NOISE * noise))
        enough = low and all(is_white(one) for one in counted)
        if weights and not enough and not self.begun and self.pool:
            quiet = replace(self.how, progress=False, stopped=self.ended.is_set)
            others = self.by_weights[self.by_weights.index(info) + 1 :]
            self.begun = {one.name: self.pool.submit(self.attempt, one, quiet) for one in others}
        return enough

    def attempt(self, info: ModelInfo, how: Run) -> _Attempt | DataError | NumericalError:
        """Fit a model to the first parts, and say what it leaves of the rests."""
        begun = time.perf_counter()
        try:
            fit = self.identified(self.problem, info, how, self.start, self.rest)
            left = [
                rest.y - fit.simulate(rest, offset=record.offset).x
                for rest, record in zip(self.rests, fit.records, strict=True)
            ]
        except (DataError, NumericalError) as error:
            return error
        ill = bool(fit.model._notes(lambda: fit._responses[0]))
        return _Attempt(fit, left, ill, time.perf_counter() - begun)
