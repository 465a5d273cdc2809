"""How the tables of a learning are played and recorded: on a simulated stage, or on a device."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..loop.closed_loop import run_closed_loop
from ..loop.tracking import collected
from ..on_device.playing import played_on

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...hardware.device import Device
    from ...references.reference import Reference
    from ...stages.virtual import VirtualStage
    from ..loop.tracking import Tracking
    from ..timing import Timing
    from .iterative_learning import IterativeLearning

    Array = NDArray[np.float64]

__all__ = ["PlayedTrials", "SimulatedTrials", "Trials"]

# Instants kept in each sampling interval of a simulated trial.
SUBSTEPS = 4
NOTE = "feedforward learnt"


@dataclass(frozen=True, kw_only=True, eq=False)
class Trials(ABC):
    """How a table is played and recorded.

    Attributes
    ----------
    learner : IterativeLearning
        What learns.
    settle, repeats : int
        Periods before the recorded ones, and recorded periods or runs.
    """

    learner: IterativeLearning
    settle: int
    repeats: int

    @abstractmethod
    def run(self, table: Array, trial: int, repeat: int = 0) -> Tracking:
        """Return the run of a trial with a table [V]."""

    def record(self, run: Tracking) -> Array:
        """Return the readings of the trial in a run [m], of shape (records, n)."""
        count = self.learner.t.size
        kept = 1 if self.learner.method == "lifted" else self.repeats
        return run.measured[run.measured.size - kept * count :].reshape(kept, count)

    def whole(self) -> Reference:
        """Return the reference of a run."""
        reference = self.learner.reference
        if self.learner.method == "lifted" or reference.period is None:
            return reference
        inverse = self.learner.controller.feedforward
        started = int(np.ceil(reference.ramp / reference.period - 1e-9))
        # Until the table begins to repeat, and as many periods for the stage to follow.
        head = max(1 if inverse is None else inverse.settle, started) + self.settle
        return replace(reference, duration=(head + self.repeats) * reference.period)

    def voltage(self, whole: Reference, table: Array) -> Array:
        """Return the voltage along a run [V]: the feedforward with what was learnt."""
        learner = self.learner
        t = whole.sample(learner.controller.dt).t
        learnt, played = table - learner.feedforward, np.zeros(t.size)
        if learner.controller.feedforward is not None:
            played = self._feedforward(whole)
        if learner.method == "lifted":
            return played + learnt
        total: Array = played + np.resize(learnt, played.size) * _start(t, whole.ramp)
        return total

    def _feedforward(self, whole: Reference) -> Array:
        """Return the controller's own feedforward along a run [V]."""
        inverse, dt = self.learner.controller.feedforward, self.learner.controller.dt
        assert inverse is not None
        if self.learner.method == "lifted":
            return self.learner.feedforward
        # Always from a table: what is learnt is added to the same voltage in each period.
        as_table = replace(inverse, playback="table")
        return as_table.played(whole, dt, limits=self.learner.controller.limits).voltage


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulatedTrials(Trials):
    """Trials on a virtual stage, each with noise of its own.

    Attributes
    ----------
    plant : VirtualStage
        The stage.
    timing : Timing
        Timing of the loop, with the voltages before each trial.
    """

    plant: VirtualStage
    timing: Timing

    def run(self, table: Array, trial: int, repeat: int = 0) -> Tracking:
        """Simulate a trial with noise of its own."""
        sensor, controller = self.plant.sensor, self.learner.controller
        seed = (sensor.seed + trial * self.repeats + repeat) % 2**63
        plant = replace(self.plant, sensor=replace(sensor, seed=seed))
        whole = self.whole()
        samples = whole.sample(controller.dt)
        volts = self.voltage(whole, table)
        run = run_closed_loop(plant, controller, samples.x, volts, self.timing, SUBSTEPS)
        return collected(run, controller, whole, samples, NOTE, SUBSTEPS)


@dataclass(frozen=True, kw_only=True, eq=False)
class PlayedTrials(Trials):
    """Trials on a device, each a table that it plays.

    Attributes
    ----------
    device : Device
        The device.
    rest : float
        Voltage before and after each trial [V].
    """

    device: Device
    rest: float

    def run(self, table: Array, trial: int, repeat: int = 0) -> Tracking:
        """Play a trial; what is random is the device's own."""
        del trial, repeat
        whole = self.whole()
        volts = np.clip(self.voltage(whole, table), *self.learner.controller.limits)
        return played_on(self.device, self.learner.controller, whole, volts, NOTE, rest=self.rest)


def _start(t: Array, ramp: float) -> Array:
    """Share of the learnt voltage during the smooth start: that of the motion."""
    u = np.clip(t / ramp, 0.0, 1.0) if ramp > 0.0 else np.ones_like(t)
    share: Array = u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
    return share
