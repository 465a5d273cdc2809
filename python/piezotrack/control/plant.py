"""Plants that a controller can drive: closed-loop simulation and linearisation of each stage."""

from __future__ import annotations

import copyreg
from typing import TYPE_CHECKING

import numpy as np

from .. import _core
from ..errors import ParameterError
from ..identification.identified import IdentifiedModel
from ..stages.base import MODEL_STEP, Stage
from ..stages.virtual import VirtualStage

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .controller import Controller

    Array = NDArray[np.float64]

__all__ = ["Plant", "linearised_plants", "reach", "run_closed_loop", "settled_bottom", "unwrap"]

# A linearised stage is pickled as its matrices.
copyreg.pickle(_core.LoopPlant, lambda one: (_core.LoopPlant.from_matrices, one.matrices()))

# What a controller can drive; an identified model stands for its stage, with offset and delay.
Plant = VirtualStage | Stage


def unwrap(stage: Plant | IdentifiedModel) -> tuple[Plant, float, float]:
    """Return the stage itself, and the offset [m] and delay [s] that its sensor shows.

    Raises
    ------
    ParameterError
        It is neither a stage model nor an identified one.
    """
    offset = delay = 0.0
    if isinstance(stage, IdentifiedModel):
        offset, delay, stage = stage.offset, stage.delay, stage.model
    if not isinstance(stage, Plant):
        raise ParameterError(
            f"stage is {type(stage).__name__}: expected a pt.VirtualStage, a stage of a model, as "
            "a pt.DahlStage, or an identified one"
        )
    return stage, offset, delay


def run_closed_loop(
    stage: Plant,
    controller: Controller,
    reference: Array,
    feedforward: Array,
    sampling: tuple[float, float, int],
    visited: tuple[float, ...] = (),
) -> _core.TrackingRun:
    """Simulate a closed loop, with reference [m] and feedforward [V] at the samples.

    The stage is at rest, or in equilibrium after slow visits to the voltages `visited` [V].
    `sampling` is delay and jitter [s], and the substeps kept in each sampling interval.
    """
    run = (controller._core, reference, feedforward, sampling)
    if isinstance(stage, VirtualStage):
        return stage._core.track(*run)
    return stage._core.track(min(MODEL_STEP, controller.dt / 4), *run, visited)


def reach(stage: Plant, limits: tuple[float, float], dt: float) -> tuple[float, float]:
    """Simulate the lowest and the highest displacement [m] between two voltages [V].

    The voltage goes to the lower limit, then slowly to the upper one and back: 4 s each way, with
    rests, in samples of `dt` seconds.
    """
    low, high = limits
    t, _, x = _slow_cycle(stage, low, high, dt)
    x = x[t >= 1.0]
    return float(x.min()), float(x.max())


def settled_bottom(stage: Plant, limits: tuple[float, float], top: float, dt: float) -> float:
    """Simulate the lowest displacement [m] at the lower of two voltages [V], from `top` [m] down.

    The voltage takes the course of `reach`, but only up to where the displacement is `top`. A stage
    that falls as the voltage rises is lowest at the upper one, which it reaches again.
    """
    low, high = limits
    t, u, x = _slow_cycle(stage, low, high, dt)
    if x[np.searchsorted(t, 5.5)] < x[np.searchsorted(t, 1.0)]:
        return float(x[t >= 1.0].min())
    rising = (t >= 1.0) & (t < 6.0)
    there = np.flatnonzero(x[rising] >= top)
    if there.size:
        high = float(u[rising][there[0]])
        t, u, x = _slow_cycle(stage, low, high, dt)
    return float(x[t >= 6.0].min())


def _slow_cycle(stage: Plant, low: float, high: float, dt: float) -> tuple[Array, Array, Array]:
    """Simulate from `low` slowly to `high` and back [V]: times [s], voltages and displacements."""
    t = np.arange(0.0, 11.0, dt)
    u = np.interp(t, [0, 0.5, 1, 5, 6, 10], [0.0, low, low, high, high, low])
    return t, u, stage.simulate(u, dt).x


def linearised_plants(
    stage: Plant, limits: tuple[float, float], delay: float
) -> list[_core.LoopPlant]:
    """Linearise a stage for small motions: at its lowest, a middle and its highest gain."""
    low, high = (float(limit) for limit in limits)
    if isinstance(stage, VirtualStage):
        mode = (stage.frequency, stage.damping_ratio, stage.bandwidth, delay)
        return [_core.LoopPlant.mode(gain, *mode) for gain in stage._core.gains()]
    return stage._core.loop_plants(low, high, delay)
