"""Search for gains at one sampling interval, with an exact check of the margins."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

from ... import _core
from ...errors import ParameterError
from ...references.xy_reference import XYReference
from ..controller.controller import Controller
from ..loop.tracking import can_be_learnt
from .box import Box, box_of, resonance
from .goal import Goal
from .margins import NamedPlant, plants_of
from .motions import tasks_of
from .starts import place_of, simc
from .tuned import MarginReport

if TYPE_CHECKING:
    from .margins import Margins
    from .problem import Axis, TuningProblem

__all__ = ["Solution", "search_at"]

# The grid of the search is accurate to this; where the exact margins are beyond, it is searched
# again.
SLACK = 0.003
# Searches with more and more in reserve.
ROUNDS = 4
# Budget of the search for gains from margins alone that a search along references begins with.
ALONE = {"particles": 24, "iterations": 12}


class AxisSearch(NamedTuple):
    """Controller of an axis, with the ranges of its settings and the plants of the set."""

    name: str
    box: Box
    base: Controller
    plants: list[NamedPlant]

    def controller(self, settings: dict[str, float]) -> Controller:
        """Return the controller with these settings."""
        parts = self.box.parts(settings)
        return replace(
            self.base,
            feedback=parts.feedback,
            filters=(*self.base.filters, *parts.filters),
            repetitive=parts.repetitive,
        )

    @property
    def _core(self) -> _core.SoughtController:
        return _core.SoughtController(
            controller=self.base._core,
            period=self.box.period,
            sign=self.box.sign,
            law=(self.box.law, *self.box.nominal),
            sought=self.box.ranges,
            plants=[one.plant for one in self.plants],
        )


class Solution(NamedTuple):
    """Best settings at one sampling interval.

    Attributes
    ----------
    outcome : dict
        Settings, figures and counts of the core.
    axes : list of AxisSearch
        Controllers that were searched.
    kept : list of MarginReport
        The margins of the settings, exact.
    """

    outcome: dict[str, Any]
    axes: list[AxisSearch]
    kept: list[MarginReport]

    @property
    def excess(self) -> float:
        """Largest ratio to a requirement, above 1 where it is not met."""
        beyond = max((one.share for one in self.kept), default=0.0)
        return max(float(self.outcome["excess"]), beyond / (1.0 + SLACK))

    @property
    def feasible(self) -> bool:
        """Whether all requirements are met."""
        return self.excess <= 1.0 + 1e-9

    @property
    def names(self) -> list[str]:
        """The plants, as the core numbers them."""
        return [one.name for axis in self.axes for one in axis.plants]

    @property
    def controllers(self) -> tuple[Controller, ...]:
        """The controller of each axis."""
        pairs = zip(self.axes, self.outcome["settings"], strict=True)
        return tuple(axis.controller(dict(settings)) for axis, settings in pairs)

    def edges(self) -> list[str]:
        """Name the settings that are at an end of their range."""
        edges = []
        for axis, settings in zip(self.axes, self.outcome["settings"], strict=True):
            prefix = f"{axis.name}: " if axis.name else ""
            edges += [
                f"{prefix}{text}" for text in axis.box.edges(dict(settings), axis.base.drive_unit)
            ]
        return edges


def search_at(problem: TuningProblem, dt: float) -> Solution:
    """Search at one sampling interval; where the exact margins are beyond, with some in reserve."""
    axes = [_axis_search(problem, axis, dt) for axis in problem.axes]
    repeats = any(axis.box.period is not None for axis in axes)
    tasks = tasks_of(problem, [axis.base for axis in axes], repeats)
    cores = [axis._core for axis in axes]
    starts = _starts(problem, axes, cores) if tasks else []
    reserve = 1.0
    solution: Solution | None = None
    for _ in range(ROUNDS):
        outcome = _core.tune(
            problem,
            margins=_with_reserve(problem.margins, reserve),
            axes=cores,
            tasks=tasks,
            starts=starts,
        )
        if outcome["excess"] > 1.0 and solution is not None:
            # Nothing keeps what is in reserve.
            return solution
        solution = Solution(outcome, axes, [])
        if outcome["excess"] > 1.0:
            return solution
        solution = solution._replace(kept=_margin_reports(problem, solution))
        if solution.feasible:
            return solution
        reserve *= 1.0 + 1.2 * (solution.excess - 1.0)
    assert solution is not None
    return solution


def _starts(
    problem: TuningProblem, axes: list[AxisSearch], cores: list[_core.SoughtController]
) -> list[list[float]]:
    """Gains of the tuning rule, and those from margins alone."""
    ranges = [one for axis in axes for one in axis.box.ranges]
    if not any(name == "ki" for name, *_ in ranges):
        return []
    rules = [simc([one.plant for one in axis.plants], axis.base.dt) for axis in axes]
    starts = [
        [at for axis, one in zip(axes, gains, strict=True) for at in place_of(one, axis.box.ranges)]
        for gains in zip(*rules, strict=True)
    ]
    alone = replace(problem, goal=Goal(), search=replace(problem.search, **ALONE))
    outcome = _core.tune(
        alone,
        margins=_with_reserve(problem.margins, 1.0),
        axes=cores,
        tasks=[],
        starts=starts,
    )
    pairs = zip(axes, outcome["settings"], strict=True)
    return [*starts, [at for axis, one in pairs for at in place_of(dict(one), axis.box.ranges)]]


def _axis_search(problem: TuningProblem, axis: Axis, dt: float) -> AxisSearch:
    plants = [
        NamedPlant(f"{axis.name}, {plant.name}" if axis.name else plant.name, plant.plant)
        for plant in plants_of(axis.stages, problem.limits, axis.timing.delay, problem.spread)
    ]
    cores = [one.plant for one in plants]
    parts = problem.parts or _usual_parts(problem, cores, dt)
    of_parts = sum(one in parts for one in ("low-pass", "notch"))
    if len(axis.filters) + of_parts > 2:
        raise ParameterError(
            "filters", f"{len(axis.filters)} beside {of_parts} of the parts", "2 in all", verb="has"
        )
    periods = {one.period for one in problem.references}
    if "repetitive" in parts and len(periods) > 1:
        listed = ", ".join(f"{one:g} s" if one else "none" for one in sorted(periods, key=str))
        raise ParameterError(
            "references", f"periods of {listed}", "one period for the repetitive part", verb="have"
        )
    period = next(iter(periods), None)
    base = Controller(
        dt=dt,
        limits=problem.limits,
        feedforward=axis.feedforward,
        filters=axis.filters,
        drive_unit=problem.drive_unit,
    )
    lag = problem.stage.lag if problem.stage is not None else 0.0
    box = box_of(parts, cores, dt, period, problem.limits, problem.law, lag)
    return AxisSearch(axis.name, box, base, plants)


def _usual_parts(
    problem: TuningProblem, plants: list[_core.LoopPlant], dt: float
) -> tuple[str, ...]:
    parts = ["pid", "low-pass"]
    if resonance(plants, dt) is not None:
        parts.append("notch")
    periods = {one.period for one in problem.references}
    rising = all(plant.static_gain > 0.0 for plant in plants)
    axes = (one.x if isinstance(one, XYReference) else one for one in problem.references)
    if len(periods) == 1 and rising and all(map(can_be_learnt, axes)):
        parts.append("repetitive")
    return tuple(parts)


def _with_reserve(margins: Margins, reserve: float) -> tuple[float, float, float, float]:
    """Return gain, phase, sensitivity and learning with a factor in reserve.

    That is for what the grid does not show.
    """
    gain = 1.0 + (margins.gain - 1.0) * reserve
    sensitivity = 1.0 + (margins.sensitivity - 1.0) / reserve
    learning = margins.learning * (1.0 + 1e-9)
    phase = min(margins.phase * reserve, 0.999 * math.pi)
    return gain, phase, sensitivity, learning


def _margin_reports(problem: TuningProblem, solution: Solution) -> list[MarginReport]:
    """Check the margins of a solution, exactly, over all plants."""
    margins = problem.margins
    bounds = {
        "gain margin": margins.gain,
        "phase margin": margins.phase,
        "learning": margins.learning,
        "sensitivity": margins.sensitivity,
    }
    worst: dict[str, MarginReport] = {}
    for axis, controller in zip(solution.axes, solution.controllers, strict=True):
        for name, plant in axis.plants:
            check = _core.check_loop(controller._core, plant)
            values = {
                "gain margin": check["gain_margin"] or math.inf,
                "phase margin": math.pi if check["phase_margin"] is None else check["phase_margin"],
                "learning": check["small_gain"] or 0.0,
                "sensitivity": check["sensitivity"] if check["stable"] else math.inf,
            }
            for key, value in values.items():
                report = MarginReport(key, value, bounds[key], name)
                if key not in worst or report.share > worst[key].share:
                    worst[key] = report
    if all(one.repetitive is None for one in solution.controllers):
        del worst["learning"]
    return list(worst.values())
