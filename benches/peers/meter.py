"""What a peer's search calls: costs, counted, with the course of the best against time."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import numpy as np
from kernels import NONE, lane_costs

if TYPE_CHECKING:
    from collections.abc import Callable

    from problems import Problem

Array = np.ndarray[Any, np.dtype[np.float64]]
# What a candidate costs whose motion does not stay finite [um]: a metre.
DIVERGED = 1e6


class SpentError(Exception):
    """The budget of simulations, or of time, is used up."""


class Meter:
    """The cost function of a peer: counts, keeps the best and its course, guards against NaN."""

    def __init__(
        self,
        problem: Problem,
        kernel: Callable[..., Array] | None = lane_costs,
        budget: int = 10**9,
        patience: float = np.inf,
    ) -> None:
        self.problem, self.kernel = problem, kernel
        self.budget, self.patience = budget, patience
        self.simulations = self.diverged = 0
        self.best, self.where = np.inf, np.full(problem.size, 0.5)
        self.course: list[tuple[float, int, float]] = []
        self.began, self.ended = time.perf_counter(), np.nan

    @property
    def seconds(self) -> float:
        """Time since the search began."""
        return time.perf_counter() - self.began

    def costs(self, units: Array) -> Array:
        """Costs of points of the unit cube [um], shape (points, size)."""
        units = np.ascontiguousarray(np.atleast_2d(units), dtype=float)
        stages = self.problem.stages(units)
        if self.kernel is None:
            return np.concatenate([self.one(*pair) for pair in zip(units, stages, strict=True)])
        problem = self.problem
        costs = 1e6 * self.kernel(stages, *problem.record, problem.offset, NONE)
        return self.took(units, costs)

    def one(self, unit: Array, stage: Array) -> Array:
        """Cost of one point by `solve_ivp` [um], shape (1,)."""
        x = self.problem.displacement(stage, *self.problem.quick)
        return self.took(unit[np.newaxis], np.array([self.problem.cost(x)]))

    def residuals(self, units: Array) -> Array:
        """Residuals of points of the unit cube [um], shape (samples, points)."""
        away = 1e6 * self.problem.deviations(self.problem.stages(units), self.kernel or lane_costs)
        if self.problem.offset:
            away = away - away.mean(axis=0)
        costs = self.took(units, np.sqrt(np.mean(away**2, axis=0)))
        away[:, costs >= DIVERGED] = DIVERGED
        return away

    def took(self, units: Array, costs: Array) -> Array:
        """Count what was simulated; costs that are not finite become `DIVERGED`."""
        lost = ~(costs < DIVERGED)
        costs[lost] = DIVERGED
        self.diverged += int(lost.sum())
        self.simulations += len(costs)
        least = int(costs.argmin())
        if costs[least] < self.best:
            self.best, self.where = float(costs[least]), units[least].copy()
            self.course.append((self.seconds, self.simulations, self.best))
        if self.simulations >= self.budget or self.seconds > self.patience:
            raise SpentError
        return costs
