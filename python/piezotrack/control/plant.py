"""Plants that a controller can drive: reach, rest and linearisation of each stage."""

from __future__ import annotations

import copyreg
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from .. import _core
from .._support.arguments import one_or_more_numbers
from ..errors import ParameterError
from ..identification.fitted.identified_model import IdentifiedModel
from ..stages.base import Stage
from ..stages.virtual import VirtualStage

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = [
    "Plant",
    "displacement_range",
    "initial_displacement",
    "linearised_plants",
    "lowest_settled_displacement",
    "plant_of",
    "voltages_before",
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
    if not isinstance(stage, (Stage, IdentifiedModel)):
        raise ParameterError(
            f"stage is {type(stage).__name__}: expected a pt.VirtualStage, a stage of a model, as "
            "a pt.DahlStage, or an identified one"
        )
    return VirtualStage.of(stage)


def displacement_range(
    stage: VirtualStage | Stage, limits: tuple[float, float], dt: float
) -> tuple[float, float]:
    """Simulate the lowest and the highest displacement [m] between two voltages [V].

    The voltage goes to the lower limit, then slowly to the upper one and back: 4 s each way, with
    rests, in samples of `dt` seconds.
    """
    low, high = limits
    t, _, x = _slow_cycle(stage, low, high, dt)
    x = x[t >= 1.0]
    return float(x.min()), float(x.max())


def initial_displacement(stage: VirtualStage, visited: tuple[float, ...]) -> float:
    """Return the displacement [m] in which a run begins, after slow visits to voltages [V]."""
    moved = float(stage.stage.equilibrium(visited).x) if visited else 0.0
    return moved + stage.sensor.offset


def voltages_before(
    plant: VirtualStage, visited: float | Sequence[float], limits: tuple[float, float]
) -> tuple[float, ...]:
    """Voltages before a run [V]: those given, or the limit nearest to 0 V where 0 V is outside."""
    before = one_or_more_numbers("visited", visited)
    if plant.preconditioning is not None:
        if before:
            raise ParameterError(
                f"visited is {before}: expected none, this virtual stage has its preconditioning"
            )
        return ()
    low, high = limits
    return before or (() if low <= 0.0 <= high else (low if low > 0.0 else high,))


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
    stage: VirtualStage | Stage, low: float, high: float, dt: float
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
