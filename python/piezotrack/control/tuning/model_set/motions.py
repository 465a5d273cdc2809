"""The motions that a search for gains judges controllers by."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from .... import _core
from ....errors import ParameterError
from ....references.reference import Reference
from ....references.xy_reference import XYReference
from ...loop.closed_loop import stepped
from ...loop.preconditions import check_drive_unit, check_within_reach
from ...loop.tracking import feedforward_of, first_counted
from ...plant import plant_of
from .followers import followers_of, middle_gain, start_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ....references.reference import SampledReference
    from ....stages.virtual import VirtualStage
    from ...controller.controller import Controller
    from ..problem import Axis, TuningProblem

    Array = NDArray[np.float64]

__all__ = ["tasks_of"]

NOTHING = np.empty(0)


def tasks_of(
    problem: TuningProblem, bases: Sequence[Controller], repeats: bool
) -> list[list[_core.Task | _core.PathTask]]:
    """Make a task of each reference and draw of the noise, for every stage of the set.

    Each stage follows with the feedforward of the first, which `bases` have. That is off by the
    offset of the spread, and drifts to as much on the other side.
    """
    for axis, base in zip(problem.axes, bases, strict=True):
        check_drive_unit(axis.stages[0], base)
    draws = range(problem.search.draws)
    if problem.stage is not None:
        both: list[_core.Task | _core.PathTask] = [
            _path_task(problem, bases, path, draw, repeats)
            for path in problem.references
            if isinstance(path, XYReference)
            for draw in draws
        ]
        return [both]
    (axis,), (base,) = problem.axes, bases
    motions = [
        (one, _samples(problem, axis, one, base.dt), NOTHING)
        for one in problem.references
        if isinstance(one, Reference)
    ]
    return [
        [
            _task(problem, axis, base, stage, motion, draw, repeats)
            for motion in motions
            for draw in draws
        ]
        for stage in followers_of(axis)
    ]


def _path_task(
    problem: TuningProblem, bases: Sequence[Controller], path: XYReference, draw: int, repeats: bool
) -> _core.PathTask:
    stage: Any = problem.stage
    pairs = zip(problem.axes, path.axes, bases, strict=True)
    x, y = (_samples(problem, axis, one, base.dt) for axis, one, base in pairs)
    # Cross-talk as if the other axis were where it is to be at that time.
    xy, yx = stage.cross_talk
    beside = (xy * _moved(y, -stage.lag), yx * _moved(x, stage.lag))
    motions = zip(path.axes, (x, y), beside, strict=True)
    both = [
        _task(problem, axis, base, plant_of(axis.stages[0]), motion, draw, repeats)
        for axis, base, motion in zip(problem.axes, bases, motions, strict=True)
    ]
    circle = None
    if path.radius is not None and path.centre is not None:
        circle = (*path.centre, path.radius)
    outline = (NOTHING, NOTHING) if circle else path.outline
    return _core.PathTask(*both, lag=stage.lag, circle=circle, path=outline)


def _moved(samples: SampledReference, later: float) -> Array:
    """Displacement from the start at times that are later by so many seconds [m]."""
    moved = samples.x - samples.x[0]
    return np.asarray(np.interp(samples.t + later, samples.t, moved), dtype=np.float64)


def _task(
    problem: TuningProblem,
    axis: Axis,
    base: Controller,
    plant: VirtualStage,
    motion: tuple[Reference, SampledReference, Array],
    draw: int,
    repeats: bool,
) -> _core.Task:
    reference, samples, beside = motion
    sensor = replace(plant.sensor, seed=plant.sensor.seed + draw)
    seeded: VirtualStage = stepped(replace(plant, sensor=sensor), base)
    first = first_counted(reference, samples, learns=repeats)
    if problem.stage is not None:
        # The smooth start has no path to compare with.
        first = max(first, int(np.searchsorted(samples.t, reference.ramp - 1e-9)))
    off = problem.spread.offset * _voltages(axis, samples, problem.limits)
    return _core.Task(
        stage=seeded._core,
        timing=axis.timing,
        dt=base.dt,
        reference=samples.x,
        feedforward=feedforward_of(base, reference, samples).voltage + off,
        beside=beside,
        first=first,
        measured=problem.goal.error == "measured",
    )


def _voltages(axis: Axis, samples: SampledReference, limits: tuple[float, float]) -> Array:
    """Voltage of the travel of a reference from the start of the run, falling to its negative.

    An error of the feedforward by a share of it is an offset that drifts to as much on the other
    side: its mean is 0, so that no gains can make another error up with it.
    """
    first = plant_of(axis.stages[0])
    x = np.append(samples.x, start_of(axis, first))
    volts = float(np.ptp(x)) / middle_gain(first, limits)
    return volts * np.linspace(1.0, -1.0, len(samples))


def _samples(
    problem: TuningProblem, axis: Axis, reference: Reference, dt: float
) -> SampledReference:
    """Sample a reference; refuse one beyond the reach of a model, with the argument for that."""
    samples = reference.sample(dt)
    if problem.goal.largest_saturation >= 0.5:
        return samples
    for i, stage in enumerate(followers_of(axis), 1):
        try:
            check_within_reach(stage, problem.limits, samples, problem.drive_unit)
        except ParameterError as error:
            error.args = (
                str(error).replace("beyond_reach=True", "largest_saturation=0.5 or more"),
            )
            which = f"model {i}" if len(axis.stages) > 1 else axis.name
            raise error.of(which) from None
    return samples
