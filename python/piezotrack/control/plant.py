"""Plants that a controller can drive: reach, rest and linearisation of each stage."""

from __future__ import annotations

import copyreg
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import _core
from .._support.arguments import expect, given_or
from ..errors import ParameterError
from ..identification.fitted.identified_model import IdentifiedModel
from ..stages.base import Stage
from ..stages.virtual import VirtualStage
from .timing import Timing

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..stages.inverse import Inverse, InvertibleStage

    Array = NDArray[np.float64]

__all__ = [
    "Plant",
    "displacement_range",
    "initial_displacement",
    "linearised_plants",
    "lowest_settled_displacement",
    "plant_of",
    "plant_of_inverse",
    "shifted",
    "simulated_rest",
    "timing_on",
]

# A linearised stage is pickled as its matrices.
copyreg.pickle(_core.LoopPlant, lambda one: (_core.LoopPlant.from_matrices, one.matrices()))

# What a controller can drive; an identified model stands for its stage, with offset and delay.
Plant = VirtualStage | Stage


def plant_of(stage: Plant | IdentifiedModel) -> VirtualStage:
    """Return a stage as a virtual stage: an identified one with its offset and delay.

    Raises
    ------
    ParameterError
        It is neither a stage model nor an identified one.
    """
    if isinstance(stage, VirtualStage):
        return stage
    expect(
        "stage",
        stage,
        (Stage, IdentifiedModel),
        "a stage or an identified model",
    )
    return VirtualStage.of(stage)


def plant_of_inverse(inverse: Inverse, **parts: Any) -> VirtualStage:
    """Return the stage that an inverse inverts, with its offset and delay.

    `parts` are those of ``VirtualStage.of``, as its noise.
    """
    plant = VirtualStage.of(inverse.stage, delay=inverse.delay, **parts)
    return replace(plant, sensor=replace(plant.sensor, offset=inverse.offset))


def simulated_rest(stage: VirtualStage) -> float:
    """Return the voltage at which a stage rests [V]: 0 V, or the amplifier's nearest to it."""
    low, high = stage.amplifier.limits
    return min(max(0.0, low), high)


def shifted(stage: VirtualStage, shift: float) -> VirtualStage:
    """Return a stage whose readings are less by `shift` [m]."""
    sensor = stage.sensor
    return replace(stage, sensor=replace(sensor, offset=sensor.offset - shift))


def displacement_range(
    stage: VirtualStage | InvertibleStage, limits: tuple[float, float], dt: float
) -> tuple[float, float]:
    """Simulate the lowest and the highest displacement [m] between two voltages [V].

    The voltage goes to the lower limit, then slowly to the upper one and back: 4 s each way, with
    rests, in samples of `dt` seconds.
    """
    low, high = limits
    t, _, x = _slow_cycle(stage, low, high, dt)
    x = x[t >= 1.0]
    return float(x.min()), float(x.max())


def initial_displacement(stage: VirtualStage, limits: tuple[float, float]) -> float:
    """Return the displacement [m] in which a run between limits [V] begins."""
    before = timing_on(stage, None, limits).voltages_before
    moved = float(stage.stage.equilibrium(before).x) if before else 0.0
    return moved + stage.sensor.offset


def timing_on(plant: VirtualStage, timing: Timing | None, limits: tuple[float, float]) -> Timing:
    """Return the timing of a run with the voltages before it.

    Where none are given and 0 V is not between the limits [V], that is the limit nearest to 0 V.
    """
    given = given_or("timing", timing, Timing())
    before = given.voltages_before
    if plant.preconditioning is not None:
        if before:
            raise ParameterError(
                "voltages_before", before, "none, this virtual stage has its preconditioning"
            )
        return given
    low, high = limits
    if before or low <= 0.0 <= high:
        return given
    return replace(given, voltages_before=(low if low > 0.0 else high,))


def lowest_settled_displacement(
    stage: VirtualStage, limits: tuple[float, float], top: float, dt: float
) -> float:
    """Simulate the lowest displacement [m] at the lower of two voltages [V], from `top` [m] down.

    The voltage takes the course of `displacement_range`, but only up to where the displacement is
    `top`. A stage that falls as the voltage rises is lowest at the upper one, which it reaches
    again.
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


# A loop is run on one stage again and again, and each run asks for its reach twice.
@lru_cache(maxsize=16)
def _slow_cycle(
    stage: VirtualStage | InvertibleStage, low: float, high: float, dt: float
) -> tuple[Array, Array, Array]:
    """Simulate from `low` slowly to `high` and back [V]: times [s], voltages and displacements."""
    t = np.arange(0.0, 11.0, dt)
    u = np.interp(t, [0, 0.5, 1, 5, 6, 10], [0.0, low, low, high, high, low])
    if isinstance(stage, VirtualStage) and stage.preconditioning is None:
        # An amplifier that lags changes nothing here, and the model alone takes fewer steps.
        applied = np.clip(u, *stage.amplifier.limits)
        x = stage.stage.simulate(applied, dt).x + stage.sensor.offset
    else:
        x = stage.simulate(u, dt).x
    for array in (t, u, x):
        array.setflags(write=False)
    return t, u, x


def linearised_plants(
    stage: VirtualStage, limits: tuple[float, float], delay: float
) -> list[_core.LoopPlant]:
    """Linearise a stage for small motions: at its lowest, a middle and its highest gain."""
    low, high = (float(limit) for limit in limits)
    return stage._core.loop_plants(low, high, delay)
