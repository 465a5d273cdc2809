"""The stages that a search simulates along the references."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ....references.reference import Reference
from ....stages.virtual import VirtualStage
from ...loop.tracking import feedforward_of
from ...plant import linearised_plants, plant_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...controller.controller import Controller
    from ..problem import Axis, TuningProblem

    Array = NDArray[np.float64]

__all__ = ["followers_of", "middle_gain", "open_loop", "start_of", "with_zero"]


def followers_of(axis: Axis) -> list[VirtualStage]:
    """Return the stages of an axis, each with the zero of the first.

    A model without an apparatus gets amplifier, sensor and preconditioning of the first; the delay
    of its sensor is its own.
    """
    return [plant_of(axis.stages[0]), *(with_zero(axis, stage) for stage in axis.stages[1:])]


def with_zero(axis: Axis, stage: Any) -> VirtualStage:
    """Return a stage with the zero of the first of an axis, and a model with its apparatus."""
    first, plant = plant_of(axis.stages[0]), plant_of(stage)
    if not isinstance(stage, VirtualStage):
        sensor = replace(first.sensor, delay=plant.sensor.delay, offset=plant.sensor.offset)
        plant = replace(first, stage=plant.stage, sensor=sensor)
    offset = plant.sensor.offset + start_of(axis, first) - start_of(axis, plant)
    return replace(plant, sensor=replace(plant.sensor, offset=offset))


def start_of(axis: Axis, stage: VirtualStage) -> float:
    """Return the reading [m] of a stage at which the loops of an axis begin."""
    before = axis.timing.voltages_before
    return stage.sensor.offset + (float(stage.stage.equilibrium(before).x) if before else 0.0)


def middle_gain(stage: VirtualStage, limits: tuple[float, float]) -> float:
    """Return the static gain [m/V] of a stage between its lowest and its highest."""
    _, middle, _ = linearised_plants(stage, limits, 0.0)
    return middle.static_gain


def open_loop(problem: TuningProblem, base: Controller) -> Array:
    """Displacement of the stages of an axis under the voltage that suits the first [m].

    That is its feedforward or, without one, the reference in volts.

    Returns
    -------
    ndarray, shape (stages, samples)
        Along all references, from the start of each.
    """
    (axis,) = problem.axes
    followers = followers_of(axis)
    gain = middle_gain(followers[0], problem.limits)
    motions = []
    for reference in problem.references:
        if not isinstance(reference, Reference):
            continue
        samples = reference.sample(base.dt)
        if base.feedforward is None:
            volts = (samples.x - start_of(axis, followers[0])) / gain
        else:
            volts = feedforward_of(base, reference, samples).voltage
        volts = np.clip(volts, *problem.limits)
        runs = [one.stage.simulate(volts, base.dt, hold="zoh").x for one in followers]
        motions.append(np.array(runs))
    return np.hstack(motions)
