"""The motions that a search for gains judges controllers by."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ... import _core
from ...errors import ParameterError
from ...references.xy_reference import XYReference
from ..loop.closed_loop import stepped
from ..loop.preconditions import check_drive_unit, check_within_reach
from ..loop.tracking import feedforward_of, first_counted
from ..plant import plant_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ...references.reference import Reference, SampledReference
    from ...stages.virtual import VirtualStage
    from ..controller.controller import Controller
    from .problem import Axis, TuningProblem

    Array = NDArray[np.float64]

__all__ = ["tasks_of"]

NOTHING = np.empty(0)


def tasks_of(
    problem: TuningProblem, bases: Sequence[Controller], repeats: bool
) -> list[_core.Task | _core.PathTask]:
    """Make a task of each reference and draw of the noise; `bases` have the feedforward."""
    tasks: list[_core.Task | _core.PathTask] = []
    for axis, base in zip(problem.axes, bases, strict=True):
        check_drive_unit(axis.stages[0], base)
    for reference in problem.references:
        for draw in range(problem.search.draws):
            if isinstance(reference, XYReference):
                tasks.append(_path_task(problem, bases, reference, draw, repeats))
            else:
                (axis,), (base,) = problem.axes, bases
                samples = _samples(problem, axis, reference, base.dt)
                tasks.append(
                    _task(problem, axis, base, (reference, samples, NOTHING), draw, repeats)
                )
    return tasks


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
        _task(problem, axis, base, motion, draw, repeats)
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
    motion: tuple[Reference, SampledReference, Array],
    draw: int,
    repeats: bool,
) -> _core.Task:
    reference, samples, beside = motion
    plant = plant_of(axis.stages[0])
    sensor = replace(plant.sensor, seed=plant.sensor.seed + draw)
    seeded: VirtualStage = stepped(replace(plant, sensor=sensor), base)
    first = first_counted(reference, samples, learns=repeats)
    if problem.stage is not None:
        # The smooth start has no path to compare with.
        first = max(first, int(np.searchsorted(samples.t, reference.ramp - 1e-9)))
    return _core.Task(
        stage=seeded._core,
        timing=axis.timing,
        dt=base.dt,
        reference=samples.x,
        feedforward=feedforward_of(base, reference, samples).voltage,
        beside=beside,
        first=first,
        measured=problem.goal.error == "measured",
    )


def _samples(
    problem: TuningProblem, axis: Axis, reference: Reference, dt: float
) -> SampledReference:
    """Sample a reference; refuse one beyond the reach of a model, with the argument for that."""
    samples = reference.sample(dt)
    if problem.goal.largest_saturation >= 0.5:
        return samples
    for i, stage in enumerate(axis.stages, 1):
        try:
            check_within_reach(plant_of(stage), problem.limits, samples, problem.drive_unit)
        except ParameterError as error:
            error.args = (
                str(error).replace("beyond_reach=True", "largest_saturation=0.5 or more"),
            )
            which = f"model {i}" if len(axis.stages) > 1 else axis.name
            raise error.of(which) from None
    return samples
