"""Learning on a stage: trials are simulated until the error is noise."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

from ... import _core
from ..._support.arguments import given_or
from ..._support.display.result import Result
from ..._support.files.writing import write_columns
from ..._support.units import drive_word, shown_unit
from ...errors import DataError, DeviceError, Interrupted, ParameterError
from ...hardware.device import Device
from ...hardware.measuring import rest_of
from ...references.parse import reference_of
from ..controller.controller import Controller
from ..loop.preconditions import check_drive_unit
from ..loop.run import Run
from ..loop.stability import check_loop
from ..on_device.playing import check_playable, shift_of
from ..plant import plant_of, plant_of_inverse, shifted, simulated_rest, timing_on
from ..timing import Timing
from .iterative_learning import IterativeLearning
from .trials import PlayedTrials, SimulatedTrials

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from ...identification.fitted.identified_model import IdentifiedModel
    from ...references.reference import Reference
    from ...stages.virtual import VirtualStage
    from ..loop.tracking import Tracking
    from ..plant import Plant
    from .iterative_learning import LearningTrial, Method
    from .rules import Convergence
    from .trials import Trials

    Array = NDArray[np.float64]

__all__ = ["Learning", "learn"]

MOST_TRIALS = 10_000
# Periods of a run, at most; those before the record, at least; what is left of a transient then.
MOST_PERIODS, FEWEST_PERIODS, LEFT = 1000, 2, 1e-4


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Learning(Result):
    """A voltage table that was learnt; printed, a table of the trials.

    Attributes
    ----------
    learner : IterativeLearning
        The learning: its `update` goes on from here with records of your own.
    trials : tuple of LearningTrial
        Errors, trial by trial.
    tables : ndarray, shape (trials, n)
        Table of each trial [V].
    best : int
        Place of the trial with the smallest rms error.
    stopped : str
        "noise", "no change", "not settled", "grows" or "trials"; "interrupted" of what an error has
        as `partial`.
    first, final : Tracking
        The runs of the first trial and of the best.
    """

    views: ClassVar[Mapping[str, str]] = {
        "summary": "control.views.learning_text:learning_text",
        "plot": "control.views.learning_plot:plot_learning",
    }

    learner: IterativeLearning
    trials: tuple[LearningTrial, ...]
    tables: Array
    best: int
    stopped: str
    first: Tracking
    final: Tracking

    def __repr__(self) -> str:
        before, after = self.trials[0], self.trials[self.best]
        return (
            f"<Learning in {len(self.trials)} trials: rms {1e9 * before.rms_error:.4g} to "
            f"{1e9 * after.rms_error:.4g} nm>"
        )

    @property
    def table(self) -> Array:
        """Table of the best trial [V], shape (n,)."""
        table: Array = self.tables[self.best].copy()
        return table

    @property
    def errors(self) -> Array:
        """Rms error of each trial [m]."""
        return np.array([one.rms_error for one in self.trials])

    @property
    def convergence(self) -> Convergence:
        """Share of the distance to the final table that remains after a trial, by model."""
        return self.learner.convergence

    def document(self) -> dict[str, Any]:
        """Content of the JSON file.

        Returns
        -------
        dict
            Of numbers, texts, lists and dicts only.
        """
        learner, convergence = self.learner, self.convergence
        return {
            "format": "piezotrack-learning",
            "schema_version": 1,
            "reference": repr(learner.reference),
            "dt": {"value": learner.controller.dt, "unit": "s"},
            "limits": {
                "value": list(learner.controller.limits),
                "unit": learner.controller.drive_unit,
            },
            "method": learner.method,
            "cutoff": {"value": learner.cutoff, "unit": "Hz"},
            "convergence": {
                "factor": convergence.factor,
                "models": [
                    {"model": name, "factor": factor, "frequency": frequency}
                    for name, factor, frequency in convergence.cases
                ],
            },
            "unit": "errors in m, frequencies in Hz",
            "trials": [
                {
                    "rms_error": trial.rms_error,
                    "max_error": trial.max_error,
                    "noise": trial.noise,
                    "clipped": trial.clipped,
                    "unsettled": trial.unsettled,
                }
                for trial in self.trials
            ],
            "best": self.best,
            "feedforward": self.final.note,
            "stopped": self.stopped,
            "provenance": {"package": "piezotrack", "version": _core.__version__},
        }

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the best table as a CSV file: time, desired displacement, voltage.

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
            It cannot be written.
        """
        unit, scale = shown_unit(self.learner.controller.drive_unit)
        word = drive_word(self.learner.controller.drive_unit)
        return write_columns(
            path,
            {
                "time_s": self.learner.t,
                "desired_um": 1e6 * self.learner.desired,
                f"{word}_{unit}": scale * self.table,
                f"feedforward_{unit}": scale * self.learner.feedforward,
            },
        )


def learn(
    stage: Plant | IdentifiedModel | Device,
    reference: Reference | str,
    controller: Controller,
    *,
    model: Plant | IdentifiedModel | None = None,
    trials: int = 30,
    settle: int | None = None,
    repeats: int = 2,
    method: Method = "frequency",
    models: Sequence[Plant | IdentifiedModel] = (),
    timing: Timing | None = None,
    more_delays: float | Sequence[float] | None = None,
    mode_scales: float | Sequence[float] = (0.9, 1.0, 1.1),
    gain: float = 0.7,
    cutoff: float | None = None,
    forgetting_factor: float = 1.0,
    change_weight: float = 0.01,
    noise: float | None = None,
    rest: float | None = None,
    offset: float | None = None,
    beyond_reach: bool = False,
    progress: Callable[[IterativeLearning], None] | None = None,
) -> Learning:
    r"""Learn the voltage with which a stage follows a reference, from trial to trial.

    A trial plays the feedforward of the controller's inverse with what was learnt added to it,
    beside the feedback if there is any; the record of its errors gives the next table. Before the
    first is played, monotone convergence is tested on a set of models. It ends where what repeats
    in the error is not distinguishable from what does not, or where the error falls no further.
    For a stage of your own: a device (`hardware.Device`), which plays each trial as a table, or
    `control.IterativeLearning`, which this runs.

    Parameters
    ----------
    stage : Stage, VirtualStage, IdentifiedModel or Device
        The plant. Each trial begins where its experiments begin, with noise of its own; on a device
        it begins and ends at `rest`, and the controller has no feedback.
    reference : Reference or str
        The reference, or its text as of `track`; of one that repeats, a settled period is
        learnt, however long it lasts.
    controller : Controller
        As of `control.IterativeLearning`.
    model : Stage, VirtualStage or IdentifiedModel, optional
        The model to learn with; default that of the controller's feedforward, or else the stage;
        a device needs one of them.
    trials : int, optional
        Trials at most, the one without learning included.
    settle : int, optional
        Periods before the recorded ones, after the smooth start and the first period of the table.
        Default 2, or as many as the slowest root of the loop with a feedback takes to a
        ten-thousandth; at most 1000.
    repeats : int, optional
        Records of each trial: periods, or runs of method ``"lifted"``. Two show what is noise.
    method, models, more_delays, mode_scales, gain, cutoff : optional
        As of `control.IterativeLearning`.
    timing : Timing, optional
        Delay and jitter of the loop, and the voltages before each trial. On a device only the
        delay, which the learning expects.
    forgetting_factor, change_weight, noise : optional
        As there.
    beyond_reach : optional
        As of `track`.
    rest : float, optional
        Voltage of a device before and after each trial [V]; default 0 V, or the limit nearest to
        it.
    offset : float, optional
        Reading of the stage at rest [m], as of `track`.
    progress : callable, optional
        Called with the learner before the first trial and after each.

    Returns
    -------
    Learning
        Tables, errors, and the runs before and after.

    Raises
    ------
    ParameterError
        As of `control.IterativeLearning` and `track`.
    NumericalError
        The loop diverges.
    DeviceError, DataError
        The device failed, or did not read enough; the output is at `rest`, or the message says
        where it may be. `partial` is what was learnt up to then.
    Interrupted
        Ctrl-C or SIGTERM came; the output of a device is at `rest`. `partial` is what was learnt.

    Examples
    --------
    >>> import piezotrack as pt
    >>> plays = pt.PrandtlIshlinskiiStage(linear=1e-6, thresholds=(5.0,), weights=(5e-7,))
    >>> stage = pt.VirtualStage.of(plays, noise=5e-9, mode=(160.0, 0.065))
    >>> loop = pt.Controller(dt=1e-3, limits=(0.0, 75.0), feedforward=plays.inverse())
    >>> reference = pt.triangle(frequency=10.0, low=10e-6, high=50e-6, duration=0.5)
    >>> found = pt.learn(stage, reference, loop, model=stage, mode_scales=1.0)
    >>> found.errors[found.best] < 0.1 * found.errors[0]
    np.True_
    """
    reference = reference_of(reference)
    known = _model_of(stage, controller) if model is None else model
    timing = given_or("timing", timing, Timing())
    home = _rest_on(stage, controller, rest, timing)
    # What is behind a device is what its model says.
    behind = known if isinstance(stage, Device) else stage
    plant = plant_of(behind)
    shift = shift_of(
        controller, offset, home if isinstance(stage, Device) else simulated_rest(plant)
    )
    if shift and not isinstance(stage, Device):
        plant = shifted(plant, shift)
    learner = IterativeLearning(
        known,
        reference,
        controller,
        method=method,
        models=models,
        delay=timing.delay,
        more_delays=more_delays,
        mode_scales=mode_scales,
        gain=gain,
        cutoff=cutoff,
        forgetting_factor=forgetting_factor,
        change_weight=change_weight,
        noise=noise,
    )
    check_drive_unit(behind, controller)
    Run(controller, reference).check(
        plant, timing.delay, beyond_reach=_core.as_truth("beyond_reach", beyond_reach)
    )
    most = _counted("trials", trials, MOST_TRIALS)
    periods = {
        "settle": _settling(plant_of(known), learner, timing.delay)
        if settle is None
        else _counted("settle", settle, MOST_PERIODS),
        "repeats": _counted("repeats", repeats, MOST_PERIODS),
    }
    runs: Trials
    if isinstance(stage, Device):
        runs = PlayedTrials(device=stage, rest=home, shift=shift, learner=learner, **periods)
    else:
        timing = timing_on(plant, timing, controller.limits)
        runs = SimulatedTrials(plant=plant, learner=learner, timing=timing, **periods)
    return _learnt(runs, most, progress or _unseen)


def _unseen(_: IterativeLearning) -> None:
    """Show nothing."""


class _Done(NamedTuple):
    """Trials that are complete: how many, the best of them, the runs of the first and the best."""

    trials: int
    best: int
    first: Tracking
    final: Tracking


def _learnt(runs: Trials, most: int, progress: Callable[[IterativeLearning], None]) -> Learning:
    """Play and learn until it ends; what ends it early has what was learnt."""
    learner, done = runs.learner, None
    try:
        progress(learner)
        while True:
            run, best = _played(runs), learner.best
            count = len(learner.trials)
            first, final = (done.first, done.final) if done else (run, run)
            done = _Done(count, best, first, run if best == count - 1 else final)
            progress(learner)
            stopped = learner.stopped or ("trials" if count >= most else None)
            if stopped is not None:
                return _learning(learner, done, stopped)
    except (DeviceError, DataError) as error:
        error.partial = _learning(learner, done, "interrupted") if done else None
        raise
    except KeyboardInterrupt as error:
        part = _learning(learner, done, "interrupted") if done else None
        raise Interrupted(str(error) or "the learning was interrupted", part) from None


def _played(runs: Trials) -> Tracking:
    """Play the table of a trial and learn from it; return the run, the first of several."""
    learner = runs.learner
    trial = len(learner.trials)
    made = [runs.run(learner.table, trial)]
    if learner.method == "lifted":
        made += [runs.run(learner.table, trial, i) for i in range(1, runs.repeats)]
    learner.update(np.concatenate([runs.record(one) for one in made]))
    return made[0]


def _learning(learner: IterativeLearning, done: _Done, stopped: str) -> Learning:
    return Learning(
        learner=learner,
        trials=learner.trials[: done.trials],
        tables=learner.tables[: done.trials],
        best=done.best,
        stopped=stopped,
        first=done.first,
        final=done.final,
    )


def _model_of(
    stage: Plant | IdentifiedModel | Device, controller: Controller
) -> Plant | IdentifiedModel:
    """Return the model of the controller's feedforward with its delay, or else the stage."""
    if not isinstance(controller, Controller) or controller.feedforward is None:
        if isinstance(stage, Device):
            raise ParameterError(
                "model",
                "not given, and the controller has no feedforward",
                "a model of the stage behind the device, as pt.identify gives it",
            )
        return stage
    return plant_of_inverse(controller.feedforward)


def _rest_on(
    stage: Plant | IdentifiedModel | Device,
    controller: Controller,
    rest: float | None,
    timing: Timing,
) -> float:
    """Return the voltage at which a device rests [V], after what it needs is checked."""
    if not isinstance(stage, Device):
        if rest is not None:
            raise ParameterError("rest", f"{rest!r}", "none, as the stage is simulated")
        return 0.0
    check_playable(stage, controller)
    if timing != Timing(delay=timing.delay):
        raise ParameterError(
            "timing", "jitter or voltages_before", "none on a device, which has its own", verb="has"
        )
    return rest_of(stage, rest)


def _settling(plant: VirtualStage, learner: IterativeLearning, delay: float) -> int:
    """Return the periods in which the slowest root of a loop falls to `LEFT`."""
    if learner.controller.feedback is None:
        return FEWEST_PERIODS
    report = check_loop(plant, learner.controller, delay=delay)
    slowest = max(case.slowest_root or 0.0 for _, case in report.cases)
    if not 0.0 < slowest < 1.0:
        return MOST_PERIODS if slowest >= 1.0 else FEWEST_PERIODS
    samples = math.log(LEFT) / math.log(slowest)
    return min(MOST_PERIODS, max(FEWEST_PERIODS, math.ceil(samples / learner.t.size)))


def _counted(name: str, value: object, most: int) -> int:
    count = _core.as_count(name, value)
    if not 1 <= count <= most:
        raise ParameterError(name, count, f"1 to {most}")
    return count
