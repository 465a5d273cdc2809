"""`model="auto"`: the model that is best on a part of the record that was not fitted."""

from __future__ import annotations

import math
import time
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from threading import Event
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..._support.display.progress_parts import Parts
from ..._support.two_threads import two_threads, waited_for
from ...errors import DataError, NumericalError
from ...stages.registry import model_named
from ..fitted.selection import Selection, Trial
from ..fitted.start import GAIN
from ..methods.least_squares import LeastSquares
from .judging import is_white, judged, noise_of, period_of, two_parts
from .jump import rest_of
from .one_model import identify_model, weights_of
from .variants.creep import MOST, with_slow_parts
from .variants.drift import turns_often, with_drifts
from .weights import Structure

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from concurrent.futures import Future, ThreadPoolExecutor

    from numpy.typing import NDArray

    from ...data.dataset import Dataset
    from ...stages.model_info import ModelInfo
    from ..fitted.identification import Identification
    from ..fitted.start import Rest
    from ..methods.choice import MethodChoice
    from ..problem.problem import Problem
    from .run import Run

    Array = NDArray[np.float64]

__all__ = ["identify_best", "models_tried"]

# Models whose weights follow by least squares, the simpler first; and models that are searched.
LEAST_SQUARES = (
    "prandtl-ishlinskii",
    "rate-dependent-prandtl-ishlinskii",
    "polynomial-prandtl-ishlinskii",
    "generalised-prandtl-ishlinskii",
    "asymmetric-prandtl-ishlinskii",
    "preisach",
    "duhem",
)
SEARCHED = ("first-order-dahl", "parallel-dahl", "bouc-wen")
# Of these, one of few values predicts other motions where plays describe only the record: tried
# where those leave more than so many times the noise.
FEW_VALUES, MORE_THAN_NOISE = "bouc-wen", 1.02
# What it may leave relative to a fit of many weights, each of which takes some noise away, and in
# multiples of the noise where no other fit is looked for.
AS_WELL, ONLY_NOISE = 1.01, 1.1
# Models that contain another one, whose search costs less: tried where it is near the best.
CONTAINED = {"parallel-dahl": "first-order-dahl"}
NEAR_BEST = 1.5
OF_FORCE = ("bouc-wen-oscillator", "prandtl-ishlinskii")
# A residual of so many times the noise has nothing but noise in it: no further model of many
# weights is tried, and a fit to whole records is not made anew. One of so many times, on what was
# not fitted, is good enough to search none.
NOTHING_BUT_NOISE, NEAR_NOISE = 1.2, 2.0
# Another model has to be better by this share than one before it in the list; where the record
# has one loop, on which all are judged that were fitted to it, by more.
BETTER, BETTER_ON_ONE_LOOP = 0.03, 0.1
# One that leaves more than noise on the whole record gives way to one of so many others, the best
# on what was not fitted, that leaves less by this share there; or to one of many weights, which a
# drive that repeats does not determine. One of many weights has to leave less than others by it.
OTHERS, BETTER_ON_WHOLE, MANY_WEIGHTS = 3, 0.25, "preisach"
# Time that a search takes beside that of least squares, for the progress.
SLOWER = 5.0


def identify_best(problem: Problem, methods: MethodChoice, run: Run) -> Identification:
    """Identify the model that describes records best.

    Models whose weights follow by least squares come first, and all of them, unless one leaves
    nothing but noise; those after the first begin with its history, creep, drift and dynamics.
    Models that are searched are tried where none of these comes near the noise, Bouc-Wen wherever
    they leave more than noise.

    Parameters
    ----------
    problem : Problem
        The records, of any model.
    methods : MethodChoice
        The methods.
    run : Run
        How it is run.

    Returns
    -------
    Identification
        The best model, fitted to the whole windows. The trials were fitted to the first part of
        each window and judged on the rest of each.

    Raises
    ------
    ParameterError, DataError, NumericalError, Interrupted
        As for `identify`.
    """
    parts = [two_parts(record.data) for record in problem.records]
    one_loop = any(few for _, _, few in parts)
    halves = zip(problem.records, parts, strict=True)
    first = replace(
        problem, records=tuple(replace(record, data=part) for record, (part, _, _) in halves)
    )
    trials = _Trials(first, methods.of_trials(), run, [rest for _, rest, _ in parts])
    infos = models_tried(problem.records[0].data, problem.parameters)
    # About how long each takes; the best is fitted once more at the end.
    shares = Parts([*(SLOWER if info.searched else 1.0 for info in infos), 1.0])
    enough = False
    with trials.side_by_side([info for info in infos if not info.searched]):
        for i, info in enumerate(infos):
            if enough and info.name != FEW_VALUES:
                continue
            if info.searched and not trials.worth_searching(info.name):
                continue
            if not trials.near_best(CONTAINED.get(info.name)):
                continue
            with shares.begin(i):
                enough = trials.run(info) or enough
    if not trials.found:
        raise trials.refused or DataError("no model could be fitted")
    best = best_of(trials.found, BETTER_ON_ONE_LOOP if one_loop else BETTER)

    with shares.begin(len(infos)):
        fit = _OnWholes(problem, methods, run, trials).fit(best)
    return with_trials(fit, trials.found, float(first.records[0].data.t[-1]))


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
class _Trials:
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
            problem = _with_delays(problem, shown)
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
        # On first parts, what is worse than least squares lacks more than a jump.
        start = shown if problem is self.problem else None

        def search(one: Problem) -> Identification:
            return identify_model(one.of_model(info), self.methods.method(info), how, start, rest)

        if shown is None:
            return search(problem)
        if info.name != FEW_VALUES or problem.creep is not None:
            return search(_as_shown(problem, shown))
        creep = next((one.creep for one in self.found if one.info is info), ())
        own = with_slow_parts(_with_delays(problem, shown), search, creep)
        slow = shown.creep_times or any(time is not None for time in shown.drifts)
        if slow and own.cost > MORE_THAN_NOISE * max(own.noises):
            with suppress(DataError, NumericalError):
                fit = search(_as_shown(problem, shown))
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


class _Whole(NamedTuple):
    """A model, and its fit to whole records."""

    best: Tried
    fit: Identification


@dataclass(frozen=True)
class _OnWholes:
    """Fits to whole records, of which the first parts do not show all."""

    problem: Problem
    methods: MethodChoice
    how: Run
    trials: _Trials

    def fit(self, best: Tried) -> Identification:
        """Fit the best model, or another one that leaves far less on the whole records."""
        found = whole = _Whole(best, self.fitted(best, best.start, best.rest))
        noises, left, few = max(whole.fit.noises), whole.fit.cost, None
        if left < NEAR_NOISE * noises:
            few = self.of_few_values(whole)
            if few is not None and few.cost <= min(ONLY_NOISE * noises, AS_WELL * left):
                return few
        noise = max(noise_of(record.data) for record in self.problem.records)
        if best.info.name == MANY_WEIGHTS or found.fit.cost > NOTHING_BUT_NOISE * noise:
            found = self.least(found)
        # The structure of the first part is that of the whole where nothing but noise is left.
        if found.fit.cost >= NOTHING_BUT_NOISE * min(found.fit.noises):
            found = self.anew(found)
        if few is None or _begun(found.fit) != _begun(whole.fit):
            few = self.of_few_values(found)
        explains = few is not None and few.cost < AS_WELL * found.fit.cost
        return few if few is not None and explains else found.fit

    def fitted(
        self, one: Tried, start: Structure | None = None, rest: Rest | None = None
    ) -> Identification:
        """Fit a model, from a structure or anew."""
        kept = None if start is None else replace(start, kept=True)
        return self.trials.identified(self.problem, one.info, self.how, kept, rest)

    def least(self, found: _Whole, shown: Structure | None = None) -> _Whole:
        """Return what was found, or another model that leaves far less.

        Others begin with the structures of their first parts, or with what the whole has shown.
        """
        (best, fit), share = found, 1.0 - BETTER_ON_WHOLE
        enough = fit.cost / share if best.info.name == MANY_WEIGHTS else share * fit.cost
        for one in self.trials.others(best):
            with suppress(DataError, NumericalError):
                start, rest = (shown, rest_of(fit)) if shown else (one.start, one.rest)
                if (other := self.fitted(one, start, rest)).cost < enough:
                    found, enough = _Whole(one, other), other.cost
        return found

    def anew(self, found: _Whole) -> _Whole:
        """Fit the best model of many weights anew, and others where it shows further dynamics."""
        best, fit = found
        one = next((one for one in [best, *self.trials.others(best)] if one.start), None)
        if one is None or one.start is None or not self.methods.weights._resumes:
            return found
        with suppress(DataError, NumericalError):
            anew = self.fitted(one)
            if anew.cost < (1.0 if one is best else 1.0 - BETTER_ON_WHOLE) * fit.cost:
                found, shown = _Whole(one, anew), Structure.of(anew)
                if len(shown.dynamics) > len(one.start.dynamics):
                    return self.least(found, shown)
        return found

    def of_few_values(self, found: _Whole) -> Identification | None:
        """Fit the model of few values, where it may explain as much: it predicts more."""
        best, fit = found
        few = self.trials.of_few_values(best, fit)
        if few is not None and fit.cost > MORE_THAN_NOISE * min(fit.noises):
            with suppress(DataError, NumericalError):
                shown, rest = Structure.of(fit), rest_of(fit)
                return self.trials.searched(self.problem, few.info, self.how, shown, rest)
        return None


def _begun(fit: Identification) -> tuple[list[bool], Rest | None]:
    """Return which records are read late, and the rest before a jump."""
    return [one.delay != 0.0 for one in fit.records], rest_of(fit)


def _with_delays(problem: Problem, start: Structure) -> Problem:
    """Fit a delay where nothing is given and a fit has one, and none elsewhere."""
    records = tuple(
        replace(record, delay=delayed) if record.delay is None else record
        for record, delayed in zip(problem.records, start.delayed, strict=True)
    )
    return replace(problem, records=records)


def _as_shown(problem: Problem, start: Structure) -> Problem:
    """Return a problem with the creep, drifts and delays of a fit where none are given."""
    if problem.creep is None and start.creep_times:
        problem = replace(problem, creep=_few(start.creep_times))
    drifting = with_drifts(problem, [time is not None for time in start.drifts])
    return _with_delays(drifting, start)


def _few(times: Sequence[float]) -> tuple[float, ...]:
    """Return as many time constants as a search has, from the shortest to the longest."""
    places = np.linspace(0, len(times) - 1, min(len(times), MOST))
    return tuple(times[round(place)] for place in places)


def best_of(tried: Sequence[Tried], better: float = BETTER) -> Tried:
    """Return the best trial, or one before it in the list that is hardly worse.

    Parameters
    ----------
    tried : sequence of Tried
        At least one, in the order in which they were tried. One whose inverse is ill-conditioned
        is taken only where those of all are.
    better : float, optional
        Share by which another has to be better than one before it.

    Returns
    -------
    Tried
        The one to take.
    """
    well = [one for one in tried if not one.ill] or list(tried)
    best = well[0]
    for other in well[1:]:
        if other.trial.rms < (1.0 - better) * best.trial.rms:
            best = other
    return best


def with_trials(fit: Identification, tried: Sequence[Tried], until: float) -> Identification:
    """Put into a result what was tried before it.

    Parameters
    ----------
    fit : Identification
        The best model.
    tried : sequence of Tried
        What was tried.
    until : float
        End of the part that the trials were fitted to [s].

    Returns
    -------
    Identification
        The same with its trials, in its file too.
    """
    trials = tuple(sorted((one.trial for one in tried), key=lambda trial: trial.rms))
    models = {trial.model: {"rms": trial.rms, "unit": "m"} for trial in trials}
    details = {"selection": {"fitted_until_s": until, "models": models}}
    selection = Selection(trials=trials, fitted_until=until)
    return replace(fit, selection=selection, details={**fit.details, **details})


def models_tried(data: Dataset, parameters: Mapping[str, object]) -> list[ModelInfo]:
    """Return the models that can be fitted with what the caller gives.

    Parameters
    ----------
    data : Dataset
        The record, or the first of several.
    parameters : mapping
        The parameters of which something is said.

    Returns
    -------
    list of ModelInfo
        In the order in which they are tried; where a parameter is given, those that are searched.
    """
    names = OF_FORCE if data.drive_unit == "N" else (*LEAST_SQUARES, *SEARCHED)
    infos = [model_named(name) for name in names]
    return [info for info in infos if info.searched or not parameters]
