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

    Array = NDArray[np.float64]

__all__ = ["run_closed_loop", "stepped"]


def run_closed_loop(
    stage: VirtualStage,
    controller: Controller,
    reference: Array,
    feedforward: Array,
    sampling: tuple[float, float, int],
    visited: tuple[float, ...] = (),
) -> _core.TrackingRun:
    """Simulate a closed loop, with reference [m] and feedforward [V] at the samples.

    The stage is where its experiments start, or in equilibrium after slow visits to the voltages
    `visited` [V]. `sampling` is delay and jitter [s], and the substeps kept in each sampling
    interval.
    """
    stage = stepped(stage, controller)
    return stage._core.track(controller._core, reference, feedforward, sampling, visited)


def stepped(stage: VirtualStage, controller: Controller) -> VirtualStage:
    """Return the stage with four steps at least in each sampling interval of a controller."""
    step = min(stage.step, controller.dt / 4)
    return stage if step == stage.step else replace(stage, step=step)
