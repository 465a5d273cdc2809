"""Plants that a controller can drive: closed-loop simulation and linearisation of each stage."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .. import _core
from ..errors import ParameterError
from ..identification.identified import Identified
from ..stages.base import MODEL_STEP
from ..stages.bouc_wen import BoucWenStage
from ..stages.dahl import DahlStage
from ..stages.first_order_dahl import FirstOrderDahlStage
from ..stages.prandtl_ishlinskii import PrandtlIshlinskiiStage
from ..stages.registry import kind_of
from ..stages.virtual import VirtualStage

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from .controller import Controller

    Array = NDArray[np.float64]

__all__ = ["Plant", "linearised_plants", "run_closed_loop", "unwrap"]

Plant = VirtualStage | DahlStage | BoucWenStage | PrandtlIshlinskiiStage | FirstOrderDahlStage
PLANTS = (VirtualStage, DahlStage, BoucWenStage, PrandtlIshlinskiiStage, FirstOrderDahlStage)


def unwrap(stage: Plant | Identified[Any]) -> tuple[Plant, float, float]:
    """Return the stage itself, and the offset [m] and delay [s] that its sensor shows.

    Raises
    ------
    ParameterError
        It is neither a stage model nor an identified one.
    """
    offset = delay = 0.0
    if isinstance(stage, Identified):
        offset, delay, stage = stage.offset, stage.delay, stage.model
    if not isinstance(stage, PLANTS):
        expected = ", ".join(f"pt.{one.__name__}" for one in PLANTS)
        raise ParameterError(
            f"stage is {type(stage).__name__}: expected {expected} or an identified one"
        )
    return stage, offset, delay


def run_closed_loop(
    stage: Plant,
    controller: Controller,
    reference: Array,
    feedforward: Array,
    sampling: tuple[float, float, int],
) -> _core.Tracked:
    """Simulate a closed loop from rest, with reference [m] and feedforward [V] at the samples.

    `sampling` is delay and jitter [s], and the substeps kept in each sampling interval.
    """
    run = (controller._core, reference, feedforward, sampling)
    if isinstance(stage, VirtualStage):
        return stage.core().track(*run)
    step = min(MODEL_STEP, controller.dt / 4)
    if isinstance(stage, PrandtlIshlinskiiStage):
        return stage.core.track(step, *run)
    return _core.track_model(kind_of(stage).name, stage.theta, step, *run)


def linearised_plants(
    stage: Plant, limits: tuple[float, float], delay: float
) -> list[_core.LoopPlant]:
    """Linearise a stage for small motions: at its lowest, a middle and its highest gain."""
    low, high = (float(limit) for limit in limits)
    if isinstance(stage, VirtualStage):
        mode = (stage.frequency, stage.damping_ratio, stage.bandwidth, delay)
        return [_core.LoopPlant.mode(gain, *mode) for gain in stage.core().gains()]
    if isinstance(stage, BoucWenStage):
        return _core.LoopPlant.bouc_wen(stage.theta, low, high, delay)
    if isinstance(stage, FirstOrderDahlStage):
        return _core.LoopPlant.first_order_dahl(stage.theta, low, high, delay)
    if isinstance(stage, PrandtlIshlinskiiStage):
        return stage.core.loop_plants(low, high, delay)
    ends = [stage.piezo_coefficient * limit / stage.stiffness for limit in (low, high)]
    soft, stiff = _core.LoopPlant.dahl(stage.theta, min(ends), max(ends), delay)
    half = 0.5 * sum(ends)
    return [stiff, _core.LoopPlant.dahl(stage.theta, half, half, delay)[0], soft]
