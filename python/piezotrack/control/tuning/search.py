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
from .box import box_of, resonance
from .goal import Goal
from .margins import NamedPlant, plants_of
from .model_set.searched import AxisSearch, SearchedSet
from .starts import cancelled, damped, simc
from .structures import SOUGHT, damps, gains_of
from .tuned import MarginReport

if TYPE_CHECKING:
    from .margins import Margins
    from .problem import Axis, TuningProblem

__all__ = ["Solution", "search_at"]

# The grid of the search is accurate to this; where the exact margins are beyond, it is searched
# again.
SLACK = 0.003
# Searches with more and more in reserve.
ROUNDS = 8
# What is in reserve grows by this at least: it acts on what a margin is above 1, and would come
# nearer and nearer to enough.
LEAST_RESERVE = 0.002
# By how much the cost may grow where an integral time below the interval is replaced.
SIMILAR = 1.02
# Budget of the search for gains from margins alone that a search along references begins with.
ALONE = {"particles": 24, "iterations": 12}


class Solution(NamedTuple):
    """Best settings at one sampling interval.

    Attributes
    ----------
    outcome : dict
        Settings, figures and counts of the core.
    axes : list of AxisSearch
        Controllers that were searched.
    searched : list of list of int
        The plants of each axis in the search, as `outcome` numbers them.
    stages : int
        Stages that it simulated.
    kept : list of MarginReport
        The margins of the settings over all plants, exact.
    """

    outcome: dict[str, Any]
    axes: list[AxisSearch]
    searched: list[list[int]]
    stages: int
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
        """The plants of the set."""
        return [one.name for axis in self.axes for one in axis.plants]

    @property
    def searched_names(self) -> list[str]:
        """The plants in the search, as the core numbers them."""
        pairs = zip(self.axes, self.searched, strict=True)
        return [axis.plants[i].name for axis, numbers in pairs for i in numbers]

    @property
    def rms_error(self) -> float:
        """Rms error over the motions [m], of the worst stage in the search."""
        squares = [one[0] ** 2 for one in self.outcome["figures"]]
        motions = len(squares) // self.stages
        if not motions:
            return 0.0
        parts = [squares[i : i + motions] for i in range(0, len(squares), motions)]
        return math.sqrt(max(sum(one) for one in parts) / motions)

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
    """Search at one sampling interval, and check the result exactly over the whole set.

    Where the search did not see what is beyond or follows worse, it is repeated with that; where
    it did see a plant whose exact margins are beyond, with some in reserve.
    """
    axes = [_axis_search(problem, axis, dt) for axis in problem.axes]
    models = SearchedSet(problem, axes, dt)
    rules = _rules(problem, models)
    starts = _starts(problem, models, rules) if models.follows else rules
    reserve, rounds = 1.0, 0
    solution: Solution | None = None
    while rounds < ROUNDS:
        outcome = models.search(problem, _with_reserve(problem.margins, reserve), starts)
        if outcome["excess"] > 1.0 and reserve > 1.0 and solution is not None:
            # Nothing keeps what is in reserve.
            return solution
        solution, beyond = _checked(problem, models, outcome)
        if outcome["excess"] > 1.0:
            return solution
        if solution.feasible:
            worst, grown = models.take_stage(outcome["settings"], outcome["cost"])
            outcome["cost"] = worst
            if not grown:
                return _entered(problem, models, solution)
        elif not models.take_plants(beyond):
            reserve *= 1.0 + max(1.2 * (solution.excess - 1.0), LEAST_RESERVE)
            rounds += 1
    assert solution is not None
    return solution


def _entered(problem: TuningProblem, models: SearchedSet, solution: Solution) -> Solution:
    """Take integral times from the sampling interval on, or proportional parts that vanish.

    Of a PID whose integral time is below the interval, that becomes the interval, or the
    proportional part becomes the least: what costs less, with the margins kept, and not more than
    `SIMILAR`.
    """
    for k, axis in enumerate(solution.axes):
        settings = dict(solution.outcome["settings"][k])
        pid = axis.box.parts(settings).feedback._pid
        if axis.box.law not in ("pid", "pi") or pid is None:
            continue
        gains = gains_of(pid, axis.box.dt)
        if gains.kp is None or gains.ti is not None or gains.ki is None:
            continue
        least = next(low for name, low, *_ in axis.box.ranges if name == "kp")
        before = models.cost(solution.outcome["settings"])[1]
        found = [(SIMILAR, solution)]
        for kp in (settings["ki"], least):
            outcome = dict(solution.outcome)
            outcome["settings"] = list(solution.outcome["settings"])
            outcome["settings"][k] = list({**settings, "kp": kp}.items())
            excess, cost = models.cost(outcome["settings"])
            changed, _ = _checked(problem, models, outcome)
            if excess <= 1.0 and changed.feasible:
                outcome["cost"] *= cost / before
                found.append((cost / before, changed))
        solution = min(found, key=lambda one: one[0])[1]
    return solution


def _rules(problem: TuningProblem, models: SearchedSet) -> list[list[float]]:
    """Gains of the tuning rule: along references, beside a notch, and with a filter that damps."""
    filtered = damps(problem.law)
    settings = [[name for name, *_ in axis.box.ranges] for axis in models.axes]
    notched = not models.follows and all("notch_depth" in names for names in settings)
    if "ki" not in SOUGHT[problem.law] or not (models.follows or filtered or notched):
        return []

    def of(axis: AxisSearch) -> list[dict[str, float]]:
        plants = [one.plant for one in axis.plants]
        modes, dt = resonance(plants, axis.base.dt), axis.base.dt
        found = damped(problem.law, plants, modes, dt) if filtered else simc(plants, dt)
        return found if modes is None or not notched else [*found, *cancelled(found, modes)]

    return [models.place(gains) for gains in zip(*map(of, models.axes), strict=True)]


def _starts(
    problem: TuningProblem, models: SearchedSet, starts: list[list[float]]
) -> list[list[float]]:
    """Gains of the tuning rule, and those from margins alone.

    The plants that these do not keep join the search.
    """
    if not starts:
        return []
    alone = replace(problem, goal=Goal(), search=replace(problem.search, **ALONE))
    margins = _with_reserve(problem.margins, 1.0)
    for _ in range(ROUNDS):
        outcome = models.search(alone, margins, starts, along=False)
        _, beyond = _checked(problem, models, outcome)
        if outcome["excess"] > 1.0 or not models.take_plants(beyond):
            break
    return [*starts, models.place(outcome["settings"])]


def _checked(
    problem: TuningProblem, models: SearchedSet, outcome: dict[str, Any]
) -> tuple[Solution, list[tuple[int, int]]]:
    """Check the margins of what was found exactly: with the plants beyond, by axis and number."""
    searched = [list(one) for one in models.plants]
    solution = Solution(outcome, models.axes, searched, max(len(models.stages), 1), [])
    if outcome["excess"] > 1.0:
        return solution, []
    worst = _worst(problem, solution)
    kept = [report for report, *_ in worst]
    beyond = [(axis, i) for report, axis, i in worst if report.share > 1.0 + SLACK]
    return solution._replace(kept=kept), beyond


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


def _worst(problem: TuningProblem, solution: Solution) -> list[tuple[MarginReport, int, int]]:
    """Check the margins of a solution, exactly, over all plants: the worst, by axis and number."""
    margins = problem.margins
    bounds = {
        "gain margin": margins.gain,
        "phase margin": margins.phase,
        "learning": margins.learning,
        "sensitivity": margins.sensitivity,
    }
    worst: dict[str, tuple[MarginReport, int, int]] = {}
    pairs = zip(solution.axes, solution.controllers, strict=True)
    for number, (axis, controller) in enumerate(pairs):
        for i, (name, plant) in enumerate(axis.plants):
            check = _core.check_loop(controller._core, plant)
            values = {
                "gain margin": check["gain_margin"] or math.inf,
                "phase margin": math.pi if check["phase_margin"] is None else check["phase_margin"],
                "learning": check["small_gain"] or 0.0,
                "sensitivity": check["sensitivity"] if check["stable"] else math.inf,
            }
            for key, value in values.items():
                report = MarginReport(key, value, bounds[key], name)
                if key not in worst or report.share > worst[key][0].share:
                    worst[key] = (report, number, i)
    if all(one.repetitive is None for one in solution.controllers):
        del worst["learning"]
    return list(worst.values())
