"""One stage, many controllers: each tuned under the same margins, judged by the same motions."""

from __future__ import annotations

import math
from dataclasses import replace
from statistics import fmean, median
from typing import TYPE_CHECKING, Any

from ... import _core
from ..._support.arguments import expect, given_or, number_pair, one_of
from ..._support.arrays import check_dt
from ...errors import ParameterError, PiezotrackError
from ...identification.fitted.identified_model import IdentifiedModel
from ...references.reference import Reference
from ...stages.base import Stage
from ..loop.chatter import chatter_of
from ..loop.closed_loop import run_closed_loop, stepped
from ..loop.preconditions import check_delay
from ..loop.settling import settled_moves
from ..loop.tracking import can_be_learnt, feedforward_of, first_counted
from ..plant import plant_of, timing_on
from ..tuning.margins import Margins, Spread, plants_of
from .comparison import Cell, ControllerComparison, Row
from .contenders import CONTENDERS, TUNED, Entry, Task
from .variants import Variant, usual_references, variants

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import numpy as np
    from numpy.typing import NDArray

    from ...data.dataset import Dataset
    from ...stages.virtual import VirtualStage
    from ..controller.controller import Controller
    from ..plant import Plant
    from ..timing import Timing

    Array = NDArray[np.float64]

__all__ = ["compare_controllers"]

# Samples over which the time of a step is measured.
TIMED = 20_000
# Share of a step within which it has settled.
SETTLED = 0.02
# Seeds of the draws that controllers are judged by, after that of the sensor: beyond those of the
# tuning and of the trials of learning.
OTHER_DRAWS = 1000


def compare_controllers(
    stage: Plant | IdentifiedModel,
    model: Stage | IdentifiedModel,
    *,
    dt: float,
    limits: tuple[float, float],
    references: Sequence[Reference] | None = None,
    rates: tuple[float, float, float] = (1.0, 5.0, 20.0),
    controllers: Sequence[str] | None = None,
    models: Mapping[str, Stage | IdentifiedModel] | None = None,
    record: Dataset | None = None,
    margins: Margins | None = None,
    spread: Spread | None = None,
    timing: Timing | None = None,
    seeds: int = 3,
    searches: int = 3,
    **options: Any,
) -> ControllerComparison:
    """Compare controllers on one stage.

    Every controller is tuned by `tune` under the same margins for the same references, each in
    shares of the error that the inverse alone leaves there, and then judged by its true error on
    the stage, on stages with 1.3 and 0.7 times the gain and with 10 % slower dynamics, and with
    1 ms more delay, by draws of the sensor's noise other than those that it was tuned with. Of
    several searches, which begin with other seeds, the gains of the median are taken.

    Parameters
    ----------
    stage : Stage, VirtualStage or IdentifiedModel
        The stage, simulated.
    model : Stage or IdentifiedModel
        The model whose inverse is the feedforward.
    dt : float
        Sampling interval [s].
    limits : (float, float)
        Lowest and highest voltage [V].
    references : sequence of Reference, optional
        What is followed; default a sine at three rates, a triangle, a staircase and a random
        motion over 60 % of the stroke. The scheduled PID takes the first three, which have to
        be sines.
    rates : (float, float, float), optional
        Rates of the default references [Hz].
    controllers : sequence of str, optional
        Names of those that are compared; default all for which there is what they need.
    models : mapping of str to Stage or IdentifiedModel, optional
        Models under the names ``"dahl"`` and ``"bouc-wen"``, for their inverses.
    record : Dataset, optional
        To train the network with.
    margins, spread, timing : optional
        As of `tune`.
    seeds : int, optional
        Draws of the sensor's noise that each controller is judged by; it is tuned with one.
    searches : int, optional
        Seeds of the search that each is tuned with, from that of `search` on.
    **options
        Further arguments of `tune`, as `search`; `goal` is the rms of the true error by default.

    Returns
    -------
    ControllerComparison
        A row for each controller; printed, a table.

    Raises
    ------
    ParameterError
        An argument cannot be used, or not one controller could be made.

    Examples
    --------
    >>> import piezotrack as pt
    >>> plays = pt.stages.PrandtlIshlinskiiStage(
    ...     linear=1e-6, thresholds=(10.0,), weights=(0.2e-6,), frequency=300.0, damping_ratio=0.1
    ... )
    >>> found = pt.compare_controllers(
    ...     pt.VirtualStage.of(plays, noise=5e-9), plays, dt=1e-3, limits=(0.0, 75.0),
    ...     references=[pt.sine(frequency=5.0, low=20e-6, high=60e-6, duration=1.2)],
    ...     controllers=["inverse", "inverse + PID"],
    ...     search=pt.TuningSearch(particles=12, iterations=8), searches=1,
    ... )
    >>> [row.name for row in found.rows]
    ['inverse', 'inverse + PID']
    """
    plant = plant_of(stage)
    low, high = number_pair("limits", limits, "V")
    expect("model", model, (Stage, IdentifiedModel), "a stage or identified model")
    interval = check_dt(dt)
    timing = timing_on(plant, timing, (low, high))
    check_delay(plant, timing.delay, interval)
    task = Task(
        stage=plant,
        inverse=model.inverse(),
        models=models or {},
        record=record,
        references=_references(references) or usual_references(plant, (low, high), rates, interval),
        dt=interval,
        limits=(low, high),
        margins=given_or("margins", margins, Margins()),
        spread=given_or("spread", spread, Spread()),
        timing=timing,
        options=options,
    )
    draws, tries = _counted("seeds", seeds), _counted("searches", searches)
    task = task.relative_to(_alone(task, draws))
    rows, refused = [], {}
    for name in _names(controllers, task):
        try:
            rows.append(_row(name, task, draws, tries))
        except PiezotrackError as error:
            refused[name] = str(error)
    if not rows:
        name, words = next(iter(refused.items()))
        words = f"controllers: not one could be made; {name}: {words}"
        raise ParameterError(words, argument="controllers")
    return ControllerComparison(
        rows=tuple(rows),
        references=tuple(one.name for one in task.references),
        variants=tuple(one.name for one in variants(plant)),
        refused=refused,
        dt=task.dt,
        margins=task.margins,
        seeds=draws,
        searches=tries,
    )


def _counted(name: str, count: int) -> int:
    if not 1 <= _core.as_count(name, count) <= 100:
        raise ParameterError(name, count, "1 to 100")
    return count


def _references(given: Sequence[Reference] | None) -> list[Reference]:
    listed = [] if given is None else list(given)
    for one in listed:
        if not isinstance(one, Reference):
            raise ParameterError("references", type(one).__name__, "pt.Reference", verb="has")
    if given is not None and not listed:
        raise ParameterError("references", "empty", "one or more")
    return listed


def _names(controllers: Sequence[str] | None, task: Task) -> list[str]:
    if controllers is not None:
        for i, one in enumerate(controllers):
            one_of(f"controllers[{i}]", one, CONTENDERS)
        if not controllers:
            raise ParameterError("controllers", "empty", "one or more")
        return list(controllers)
    missing = set()
    if task.record is None:
        missing.add("network")
    for model, name in (
        ("dahl", "Dahl inverse + PID"),
        ("bouc-wen", "Bouc-Wen inverse + PID"),
        ("dahl", "PID + hysteresis-observer"),
    ):
        if model not in task.models:
            missing.add(name)
    return [name for name in CONTENDERS if name not in missing]


def _alone(task: Task, draws: int) -> list[float]:
    """Errors of the inverse alone along each reference, rms [m]; NaN where it is refused."""
    variant, controller = variants(task.stage)[0], task.alone(task.inverse)
    errors = []
    for reference in task.references:
        try:
            cell = _cell(Entry(controller, reference), variant, task, draws, 1.0, chatters=False)
        except PiezotrackError:
            cell = None
        errors.append(math.nan if cell is None else cell.rms)
    return errors


def _row(name: str, task: Task, draws: int, tries: int) -> Row:
    """Tune a controller with several seeds, and take that of the median."""
    rows = [_judged(name, task.searched(k), draws) for k in range(tries if name in TUNED else 1)]
    rows.sort(key=Row.relative)
    best = rows[(len(rows) - 1) // 2]
    return best._replace(searches=tuple(row.relative() for row in rows))


def _judged(name: str, task: Task, draws: int) -> Row:
    """Judge a controller by all references, on all variants of the stage."""
    entries = CONTENDERS[name](task)
    first = next((entry for entry in entries if entry is not None), None)
    if first is None:
        words = "references: expected one at least that it can learn, which repeats"
        raise ParameterError(words, argument="references")
    cells = [
        tuple(
            _cell(entry, variant, task, draws, alone, chatters=i == 0)
            for entry, alone in zip(entries, task.errors_alone, strict=True)
        )
        for i, variant in enumerate(variants(task.stage))
    ]
    sensitivity, margin = _robustness(first.controller, task)
    return Row(
        name=name,
        controller=first.controller,
        cells=tuple(cells),
        sensitivity=sensitivity,
        gain_margin=margin,
        step_time=first.controller._core.step_time(TIMED),
        searches=(),
    )


def _cell(
    entry: Entry | None,
    variant: Variant,
    task: Task,
    draws: int,
    alone: float,
    *,
    chatters: bool,
) -> Cell | None:
    """Simulate a controller along a reference: its true errors once it has settled."""
    if entry is None:
        return None
    samples = entry.reference.sample(entry.controller.dt)
    voltage = entry.voltage
    if voltage is None:
        voltage = feedforward_of(entry.controller, entry.reference, samples).voltage
    # The same samples for all of them, whether they learn or not.
    first = first_counted(entry.reference, samples, learns=can_be_learnt(entry.reference))
    stages = [_drawn(variant.stage, k) for k in range(draws)]
    timing = replace(task.timing, delay=task.timing.delay + variant.delay)
    found = [_figures(entry, one, timing, (samples.x, voltage), first) for one in stages]
    rms, largest, effort, _, clipped = zip(*found, strict=True)
    chatter = settled = None
    if chatters and all(map(math.isfinite, rms)):
        run = run_closed_loop(stages[0], entry.controller, samples.x, voltage, timing, 1)
        chatter = chatter_of(run.part("volts")[first:]).fast_change
        _, displacement, _ = run.motion()
        moves = settled_moves(samples.t, samples.x, displacement, SETTLED)
        settled = median(one.time for one in moves) if moves else None
    return Cell(rms, max(largest), fmean(effort), fmean(clipped), chatter, alone, settled)


def _drawn(stage: VirtualStage, k: int) -> VirtualStage:
    """Give the sensor a draw of its noise that no controller was tuned with."""
    sensor = stage.sensor
    return replace(stage, sensor=replace(sensor, seed=(sensor.seed + OTHER_DRAWS + k) % 2**63))


def _figures(
    entry: Entry, stage: VirtualStage, timing: Timing, motion: tuple[Array, Array], first: int
) -> tuple[float, ...]:
    """Rms and largest error [m], effort [V], slew [V/s] and clipped share of a loop."""
    reference, feedforward = motion
    plant = stepped(stage, entry.controller)
    task = _core.Task(
        stage=plant._core,
        timing=timing,
        dt=entry.controller.dt,
        reference=reference,
        feedforward=feedforward,
        beside=(),
        first=first,
        measured=False,
    )
    return task.figures([entry.controller._core], 1)[0]


def _robustness(controller: Controller, task: Task) -> tuple[float | None, float | None]:
    """Largest sensitivity and least gain margin over the plants; None without feedback."""
    if controller.feedback is None:
        return None, None
    plants = plants_of([task.stage], task.limits, task.timing.delay, task.spread)
    checks = [_core.check_loop(controller._core, one.plant) for one in plants]
    gains = [one["gain_margin"] for one in checks if one["gain_margin"] is not None]
    return max(one["sensitivity"] for one in checks), min(gains, default=math.inf)
