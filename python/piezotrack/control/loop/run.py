"""Run of one axis along a reference: checked, sampled, simulated, and collected."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from ...stages.inverse import PlayedVoltage
from .closed_loop import run_closed_loop
from .preconditions import check_period, check_stable, check_within_reach
from .tracking import Tracking, feedforward_of

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ... import _core
    from ...references.reference import Reference, SampledReference
    from ...stages.virtual import VirtualStage
    from ..controller.controller import Controller
    from ..timing import Timing

    Array = NDArray[np.float64]

__all__ = ["Run"]


@dataclass(frozen=True)
class Run:
    """Controller and reference of one axis; what is computed of them is computed once.

    Attributes
    ----------
    controller : Controller
        The controller.
    reference : Reference
        The reference.
    injected : ndarray or None, shape (n,)
        Voltage that is added to the feedforward at the samples [V].
    """

    controller: Controller
    reference: Reference
    injected: Array | None = None

    @cached_property
    def samples(self) -> SampledReference:
        """The reference at the control samples."""
        return self.reference.sample(self.controller.dt)

    @cached_property
    def feedforward(self) -> PlayedVoltage:
        """Feedforward of the whole run [V], and a note of how it was computed."""
        volts, note = feedforward_of(self.controller, self.reference, self.samples)
        if self.injected is None:
            return PlayedVoltage(volts, note)
        return PlayedVoltage(volts + self.injected, f"{note}, with a voltage injected")

    def check(
        self, plant: VirtualStage, delay: float, *, unstable: bool = False, beyond_reach: bool
    ) -> None:
        """Refuse another period, an unstable loop, and a reference beyond the reach of a stage."""
        samples = self.samples
        check_period(self.controller, self.reference)
        if not unstable:
            check_stable(plant, self.controller, delay)
        if not beyond_reach:
            limits, unit = self.controller.limits, self.controller.drive_unit
            check_within_reach(plant, limits, samples, unit, model=self.controller.feedforward)

    def simulate(
        self,
        plant: VirtualStage,
        feedforward: PlayedVoltage,
        timing: Timing,
        substeps: int,
    ) -> Tracking:
        """Simulate the closed loop with a feedforward."""
        volts, note = feedforward
        run = run_closed_loop(plant, self.controller, self.samples.x, volts, timing, substeps)
        return self.collect(run, note, substeps)

    def collect(self, run: _core.TrackingRun, note: str, substeps: int) -> Tracking:
        """Collect what the core has simulated."""
        fine_t, fine_displacement, fine_voltage = run.motion()
        return Tracking(
            reference=self.reference,
            controller=self.controller,
            t=self.samples.t,
            desired=self.samples.x,
            measured=run.measured,
            displacement=fine_displacement[::substeps],
            loop_error=run.part("error"),
            voltage=run.part("volts"),
            feedforward=run.part("feedforward"),
            feedback=run.part("feedback"),
            repetitive=run.part("repetitive"),
            saturated=run.saturated,
            fine_t=fine_t,
            fine_displacement=fine_displacement,
            fine_voltage=fine_voltage,
            note=note,
        )
