"""The part of a set of plants and stages that a search sees."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from .... import _core
from ..starts import place_of
from .followers import open_loop
from .motions import tasks_of
from .representatives import farthest, responses

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from ...controller.controller import Controller
    from ..box import Box
    from ..margins import NamedPlant
    from ..problem import TuningProblem

__all__ = ["AxisSearch", "SearchedSet"]

# Plants and stages that a search begins with.
PLANTS = 24
STAGES = 4
# A stage that follows worse than those simulated by more than this joins them.
WORSE = 1.02
# After so many plants were added one by one, all are.
PATIENCE = 8
# Margins that no loop of a search is without: the cost alone counts.
NO_MARGINS = (1.0 + 1e-9, 0.0, 1e9, 1.0)


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

    def sought(
        self, plants: Iterable[int] | None = None, cutoffs: tuple[float, float] | None = None
    ) -> _core.SoughtController:
        """Return what the core searches, under the margins of some plants or of all.

        `cutoffs` take the place of the range of the low-pass [Hz].
        """
        numbers = range(len(self.plants)) if plants is None else plants
        ranges = [
            one if cutoffs is None or one[0] != "cutoff" else (one[0], *cutoffs, one[3])
            for one in self.box.ranges
        ]
        return _core.SoughtController(
            controller=self.base._core,
            period=self.box.period,
            sign=self.box.sign,
            law=(self.box.law, *self.box.nominal),
            sought=ranges,
            plants=[self.plants[i].plant for i in numbers],
        )


class SearchedSet:
    """Plants and stages of the set that a search sees, and what they grow by.

    A search takes time for each of them. It begins with those that are farthest from each other;
    one on which its result is not as required, or which follows worse, joins them.

    Attributes
    ----------
    axes : list of AxisSearch
        Controllers that are searched.
    plants : list of list of int
        Numbers of the plants of each axis whose margins the search keeps.
    stages : list of int
        Numbers of the stages that it simulates.
    """

    def __init__(self, problem: TuningProblem, axes: list[AxisSearch], dt: float) -> None:
        self._problem, self.axes = problem, axes
        bases = [axis.base for axis in axes]
        repeats = any(axis.box.period is not None for axis in axes)
        self._tasks = tasks_of(problem, bases, repeats) if problem.references else []
        self.plants = [_spanning(axis.plants, dt) for axis in axes]
        self.stages = list(range(len(self._tasks)))
        if len(self._tasks) > STAGES:
            self.stages = farthest(open_loop(problem, bases[0]), STAGES)
        self._patience = PATIENCE
        self._sought = self._limited()

    @property
    def follows(self) -> bool:
        """Whether there are motions to follow."""
        return bool(self._tasks)

    def search(
        self,
        problem: TuningProblem,
        margins: tuple[float, float, float, float],
        starts: list[list[float]],
        *,
        along: bool = True,
    ) -> dict[str, Any]:
        """Search for the best settings, along the references or from margins alone.

        Where the best has a low-pass with a cutoff above half the sampling rate, the search is
        repeated with what is nearer: one below that, or none.
        """
        tasks = [one for i in self.stages for one in self._tasks[i]] if along else []

        def tuned(sought: list[_core.SoughtController]) -> dict[str, Any]:
            return _core.tune(
                problem,
                margins=margins,
                axes=sought,
                tasks=tasks,
                stages=len(self.stages) if tasks else 1,
                starts=starts,
            )

        outcome = tuned(self._sought)
        pairs = zip(self.axes, outcome["settings"], strict=True)
        cutoffs = [axis.box.cutoffs_beside(dict(settings)) for axis, settings in pairs]
        if all(one is None for one in cutoffs):
            return outcome
        axes = zip(self.axes, self.plants, cutoffs, strict=True)
        again = tuned([axis.sought(some, one) for axis, some, one in axes])
        for effort in ("candidates", "loops"):
            again[effort] += outcome[effort]
        return again

    def cost(self, settings: Sequence[Any]) -> tuple[float, float]:
        """Evaluate settings on the stages that are simulated: excess without margins, and cost."""
        return self._cost(settings, self.stages)

    def place(self, settings: Sequence[Any]) -> list[float]:
        """Place of the settings of all axes in the unit box."""
        pairs = zip(self.axes, settings, strict=True)
        return [at for axis, one in pairs for at in place_of(dict(one), axis.box.ranges)]

    def take_plants(self, beyond: Iterable[tuple[int, int]]) -> bool:
        """Add plants, by axis and number; whether one of them is new."""
        new = [(axis, i) for axis, i in beyond if i not in self.plants[axis]]
        if not new:
            return False
        self._patience -= 1
        for axis, i in new:
            self.plants[axis].append(i)
        if self._patience < 0:
            self.plants = [list(range(len(axis.plants))) for axis in self.axes]
        self._sought = self._limited()
        return True

    def take_stage(self, settings: Sequence[Any], cost: float) -> tuple[float, bool]:
        """Follow on all stages: the worst cost, and whether a stage was added for it."""
        if len(self.stages) == len(self._tasks):
            return cost, False
        excess, costs = np.array([self._cost(settings, [i]) for i in range(len(self._tasks))]).T
        worst = int(np.argmax(np.where(excess > 1.0, np.inf, costs)))
        if worst in self.stages or (excess[worst] <= 1.0 and costs[worst] <= WORSE * cost):
            return float(costs.max()), False
        self.stages.append(worst)
        return float(costs.max()), True

    def _cost(self, settings: Sequence[Any], stages: Sequence[int]) -> tuple[float, float]:
        """Evaluate settings on some stages."""
        tasks = [one for i in stages for one in self._tasks[i]]
        return _core.tuning_costs(
            self._problem,
            margins=NO_MARGINS,
            axes=self._sought,
            tasks=tasks,
            stages=len(stages) if tasks else 1,
            places=[self.place(settings)],
        )[0]

    def _limited(self) -> list[_core.SoughtController]:
        return [axis.sought(some) for axis, some in zip(self.axes, self.plants, strict=True)]


def _spanning(plants: Sequence[NamedPlant], dt: float) -> list[int]:
    """Choose all plants, or those farthest from each other where there are many."""
    if len(plants) <= PLANTS:
        return list(range(len(plants)))
    return farthest(responses([one.plant for one in plants], dt), PLANTS)
