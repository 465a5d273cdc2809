"""Closed loop of a controller and a virtual stage, as the core simulates it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ... import _core
    from ...stages.virtual import VirtualStage
    from ..controller.controller import Controller
    from ..timing import Timing

    Array = NDArray[np.float64]

__all__ = ["run_closed_loop", "stepped"]


def run_closed_loop(
    stage: VirtualStage,
    controller: Controller,
    reference: Array,
    feedforward: Array,
    timing: Timing,
    substeps: int,
) -> _core.TrackingRun:
    """Simulate a closed loop, with reference [m] and feedforward [V] at the samples.

    The stage is where its experiments start, or in equilibrium after the voltages before the run.
    `substeps` are kept in each sampling interval.
    """
    stage = stepped(stage, controller)
    return stage._core.track(controller._core, reference, feedforward, timing, substeps)


def stepped(stage: VirtualStage, controller: Controller) -> VirtualStage:
    """Return the stage with four steps at least in each sampling interval of a controller."""
    step = min(stage.step, controller.dt / 4)
    return stage if step == stage.step else replace(stage, step=step)
