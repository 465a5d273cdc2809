"""How the tables of a learning are played and recorded: on a simulated stage, or on a device."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ...stages.inverse import PlayedVoltage
from ..loop.run import Run
from ..on_device.playing import played_on

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...hardware.device import Device
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
        The learning control.
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

    @cached_property
    def whole(self) -> Run:
        """The run of a trial: of the motion, or of as many periods as are played."""
        reference, controller = self.learner.reference, self.learner.controller
        if self.learner.method == "lifted" or reference.period is None:
            return Run(controller, reference)
        inverse = controller.feedforward
        started = int(np.ceil(reference.ramp / reference.period - 1e-9))
        # Until the table begins to repeat, and as many periods for the stage to follow.
        head = max(1 if inverse is None else inverse.settle, started) + self.settle
        duration = (head + self.repeats) * reference.period
        return Run(controller, replace(reference, duration=duration))

    def voltage(self, table: Array) -> Array:
        """Return the voltage along a run [V]: the feedforward with what was learnt."""
        learnt, played = table - self.learner.feedforward, self._feedforward
        if self.learner.method == "lifted":
            return played + learnt
        start = _start(self.whole.samples.t, self.whole.reference.ramp)
        total: Array = played + np.resize(learnt, played.size) * start
        return total

    @cached_property
    def _feedforward(self) -> Array:
        """The controller's feedforward along a run [V]."""
        controller, samples = self.learner.controller, self.whole.samples
        if controller.feedforward is None:
            return np.zeros(len(samples))
        if self.learner.method == "lifted":
            return self.learner.feedforward
        # Always from a table: what is learnt is added to the same voltage in each period.
        as_table = replace(controller.feedforward, playback="table")
        return as_table.played(
            self.whole.reference, controller.dt, samples=samples, limits=controller.limits
        ).voltage


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
        sensor = self.plant.sensor
        seed = (sensor.seed + trial * self.repeats + repeat) % 2**63
        plant = replace(self.plant, sensor=replace(sensor, seed=seed))
        feedforward = PlayedVoltage(self.voltage(table), NOTE)
        return self.whole.simulate(plant, feedforward, self.timing, SUBSTEPS)


@dataclass(frozen=True, kw_only=True, eq=False)
class PlayedTrials(Trials):
    """Trials on a device, each a table that it plays.

    Attributes
    ----------
    device : Device
        The device.
    rest : float
        Voltage before and after each trial [V].
    shift : float
        What is subtracted from every reading [m].
    """

    device: Device
    rest: float
    shift: float

    def run(self, table: Array, trial: int, repeat: int = 0) -> Tracking:
        """Play a trial; what is random is the device's own."""
        del trial, repeat
        volts = np.clip(self.voltage(table), *self.learner.controller.limits)
        return played_on(self.device, self.whole, volts, NOTE, rest=self.rest, shift=self.shift)


def _start(t: Array, ramp: float) -> Array:
    """Share of the learnt voltage during the smooth start: that of the motion."""
    u = np.clip(t / ramp, 0.0, 1.0) if ramp > 0.0 else np.ones_like(t)
    share: Array = u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
    return share
