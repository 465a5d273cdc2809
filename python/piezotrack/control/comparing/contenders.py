"""The controllers that are compared, and how each is made for a stage."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

from ... import _core
from ...errors import ParameterError
from ...stages.feedback.dahl import DahlStage
from ..controller.controller import Controller
from ..laws.hysteresis_observer import HysteresisObserver
from ..laws.neural_network import train_network
from ..learning.learn import learn
from ..loop.tracking import can_be_learnt
from ..tuning.goal import Goal, TuningSearch
from ..tuning.linear.h_infinity import mixed_sensitivity
from ..tuning.margins import Margins, Spread, plants_of
from ..tuning.schedule import schedule
from ..tuning.tune import tune

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import numpy as np
    from numpy.typing import NDArray

    from ...data.dataset import Dataset
    from ...identification.fitted.identified_model import IdentifiedModel
    from ...references.reference import Reference
    from ...stages.base import Stage
    from ...stages.inverse import Inverse
    from ...stages.virtual import VirtualStage
    from ..timing import Timing

    Array = NDArray[np.float64]

__all__ = ["CONTENDERS", "TUNED", "Entry", "Task"]

# Shares of the gains of a PID alone that one around an observer is tried with.
SHARES = (1.0, 0.8, 0.6, 0.4, 0.25, 0.1, 0.03)
# Bandwidths that a design by H-infinity is tried with, as parts of the sampling rate.
BANDWIDTHS = (0.002, 0.005, 0.01, 0.02, 0.03, 0.05, 0.08, 0.12)
# What controllers are tuned for where nothing else is asked for: what they are judged by.
TRUE_ERROR = Goal(error="true")


class Entry(NamedTuple):
    """A controller for one reference.

    Attributes
    ----------
    controller : Controller
        With its feedforward.
    reference : Reference
        Reference to follow: the given one, or one with more periods.
    voltage : ndarray or None
        Feedforward in place of that of the controller [V].
    """

    controller: Controller
    reference: Reference
    voltage: Array | None = None


@dataclass(frozen=True, kw_only=True)
class Task:
    """Task of all controllers of a comparison.

    Attributes
    ----------
    stage : VirtualStage
        The stage, simulated with its noise.
    inverse : Inverse
        Of the model.
    models : mapping of str to Stage or IdentifiedModel
        Other models.
    record : Dataset or None
        To train a network with.
    references : list of Reference
        References to follow.
    dt : float
        Sampling interval [s].
    limits : (float, float)
        Of the voltage [V].
    margins, spread : Margins, Spread
        The same for all.
    timing : Timing
        Of the loop.
    options : dict
        Further arguments of `tune`.
    errors_alone : tuple of float
        True rms error with the inverse alone along each reference [m].
    """

    stage: VirtualStage
    inverse: Inverse
    models: Mapping[str, Stage | IdentifiedModel]
    record: Dataset | None
    references: list[Reference]
    dt: float
    limits: tuple[float, float]
    margins: Margins
    spread: Spread
    timing: Timing
    options: dict[str, Any]
    errors_alone: tuple[float, ...] = ()

    def relative_to(self, errors: Sequence[float]) -> Task:
        """Count the error along each reference in shares of that with the inverse alone [m]."""
        goal = self.options.get("goal", TRUE_ERROR)
        if not goal.tolerances and all(0.0 < one < math.inf for one in errors):
            goal = replace(goal, tolerances=tuple(errors))
        return replace(self, errors_alone=tuple(errors), options={**self.options, "goal": goal})

    def searched(self, k: int) -> Task:
        """Take another seed for the search."""
        search = self.options.get("search") or TuningSearch()
        search = replace(search, seed=search.seed + k)
        return replace(self, options={**self.options, "search": search})

    def tuned(self, references: Any = None, inverse: Any = "model", **changes: Any) -> Controller:
        """Tune a controller for the references: for all of them by default."""
        if references is not None:
            # Of one, all of the error counts.
            goal = self.options["goal"]
            changes = {"goal": replace(goal, tolerances=()), **changes}
        return tune(
            self.stage,
            self.references if references is None else references,
            dt=self.dt,
            limits=self.limits,
            feedforward=self.inverse if inverse == "model" else inverse,
            margins=self.margins,
            spread=self.spread,
            timing=self.timing,
            **{"parts": ("pid", "low-pass"), **self.options, **changes},
        ).controller

    def alone(self, inverse: Inverse) -> Controller:
        """Make a controller without feedback."""
        return Controller(dt=self.dt, limits=self.limits, feedforward=inverse)

    def each(self, controller: Controller) -> list[Entry | None]:
        """Take the same controller for every reference."""
        return [Entry(controller, reference) for reference in self.references]


Maker = Callable[[Task], list[Entry | None]]


def _inverse(task: Task) -> list[Entry | None]:
    return task.each(task.alone(task.inverse))


def _other(name: str) -> Maker:
    def make(task: Task) -> list[Entry | None]:
        return task.each(task.tuned(inverse=task.models[name].inverse()))

    return make


def _network(task: Task) -> list[Entry | None]:
    if task.record is None:
        raise ParameterError("record", "missing", "one to train the network with")
    return task.each(task.alone(train_network(task.record)))


def _law(law: str) -> Maker:
    def make(task: Task) -> list[Entry | None]:
        return task.each(task.tuned(law=law))

    return make


def _pid_alone(task: Task) -> list[Entry | None]:
    return task.each(task.tuned(inverse=None))


def _observed(task: Task) -> list[Entry | None]:
    """Compensate an observed hysteresis on top of a PID with as much gain as the margins allow."""
    model = task.models["dahl"]
    stage = model if isinstance(model, DahlStage) else getattr(model, "model", None)
    if not isinstance(stage, DahlStage):
        raise ParameterError("models['dahl']", "no Dahl stage", "one to observe")
    tuned = task.tuned(inverse=None)
    tuned_pid: Any = tuned.feedback
    plants = plants_of([task.stage], task.limits, task.timing.delay, task.spread)
    for share in SHARES:
        pid = replace(tuned_pid, kp=share * tuned_pid.kp)
        controller = replace(tuned, feedback=HysteresisObserver(stage=stage, pid=pid))
        if all(_keeps(controller, one.plant, task.margins) for one in plants):
            return task.each(controller)
    raise ParameterError(
        "margins: expected some that a PID around the observer keeps, of which its gains of 1 to "
        f"{SHARES[-1]:g} times those of the PID alone do not",
        argument="margins",
    )


def _keeps(controller: Controller, plant: _core.LoopPlant, margins: Margins) -> bool:
    """Check the margins that every controller keeps."""
    loop = _core.check_loop(controller._core, plant)
    return bool(
        loop["stable"]
        and loop["sensitivity"] <= margins.sensitivity
        and (loop["gain_margin"] or math.inf) >= margins.gain
        and (loop["phase_margin"] or math.inf) >= margins.phase
    )


def _notched(task: Task) -> list[Entry | None]:
    return task.each(task.tuned(parts=("pid", "low-pass", "notch")))


def _scheduled(task: Task) -> list[Entry | None]:
    sines = task.references[:3]
    half = 0.5 * (sines[0].high - sines[0].low)
    made = {(half, 1.0 / one.period): one for one in sines if one.period is not None}
    rates = sorted(rate for _, rate in made)
    scheduled = schedule(
        task.stage,
        [half],
        rates,
        centre=0.5 * (sines[0].high + sines[0].low),
        waveform=lambda amplitude, rate: made[amplitude, rate],
        dt=task.dt,
        limits=task.limits,
        feedforward=task.inverse,
        margins=task.margins,
        spread=task.spread,
        timing=task.timing,
        **{**task.options, "goal": replace(task.options["goal"], tolerances=())},
    )
    return task.each(scheduled.controller)


def _repetitive(task: Task) -> list[Entry | None]:
    return [
        Entry(task.tuned(reference, parts=("pid", "low-pass", "repetitive")), reference)
        if can_be_learnt(reference)
        else None
        for reference in task.references
    ]


def _learnt(task: Task) -> list[Entry | None]:
    controller = task.tuned()
    entries: list[Entry | None] = []
    for reference in task.references:
        if not can_be_learnt(reference):
            entries.append(None)
            continue
        try:
            learning = learn(task.stage, reference, controller, timing=task.timing, trials=12)
        except ParameterError:
            # No table of this period converges on the set of models.
            entries.append(None)
            continue
        entries.append(Entry(controller, learning.final.reference, learning.final.feedforward))
    return entries


def _h_infinity(task: Task) -> list[Entry | None]:
    """Take the highest bandwidth that keeps the margins for all plants."""
    plants = plants_of([task.stage], task.limits, task.timing.delay, task.spread)
    base, best = task.alone(task.inverse), None
    why = "no bandwidth tried keeps the margins for all plants"
    for share in BANDWIDTHS:
        try:
            law = mixed_sensitivity(
                task.stage,
                dt=task.dt,
                bandwidth=share / task.dt,
                limits=task.limits,
                largest_sensitivity=task.margins.sensitivity,
                delay=task.timing.delay,
            )
        except ParameterError as error:
            why = str(error)
            continue
        controller = replace(base, feedback=law)
        if all(_keeps(controller, one.plant, task.margins) for one in plants):
            best = controller
    if best is None:
        words = f"margins: expected some that a law by H-infinity keeps; {why}"
        raise ParameterError(words, argument="margins")
    return task.each(best)


CONTENDERS: dict[str, Maker] = {
    "inverse": _inverse,
    "network": _network,
    "PID": _pid_alone,
    "PID + hysteresis-observer": _observed,
    "inverse + PD": _law("pd"),
    "inverse + lead-lag": _law("lead-lag"),
    "inverse + integral-resonant": _law("integral-resonant"),
    "inverse + positive-position": _law("positive-position"),
    "inverse + positive-velocity-position": _law("positive-velocity-position"),
    "inverse + PID": _law("pid"),
    "inverse + PID + notch": _notched,
    "Dahl inverse + PID": _other("dahl"),
    "Bouc-Wen inverse + PID": _other("bouc-wen"),
    "inverse + sliding-mode": _law("sliding-mode"),
    "inverse + perturbation-estimator": _law("perturbation-estimator"),
    "inverse + disturbance-observer": _law("disturbance-observer"),
    "inverse + H-infinity": _h_infinity,
    "inverse + scheduled-pid": _scheduled,
    "inverse + PID + repetitive": _repetitive,
    "inverse + PID + learning": _learnt,
}
# Those that a search tunes.
TUNED = frozenset(CONTENDERS) - {"inverse", "network", "inverse + H-infinity"}
