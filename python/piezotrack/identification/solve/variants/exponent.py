"""Exponent of a Bouc-Wen stage, fitted where the record shows that it is not 1."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ....data.dataset import Dataset
from ...fitted.start import GAIN
from ...methods.descents import Descents
from ...problem.objective import Objective
from ...problem.parameter import Parameter
from ..search import SENSOR, details_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from ...fitted.identification import Identification
    from ...problem.problem import Problem

    Array = NDArray[np.float64]

__all__ = ["may_have_exponent", "with_exponent_of", "with_exponent_tried"]

MODEL, NAME = "bouc-wen", "exponent"
# Largest exponent, and the factor from one to the next.
MOST, STEP = 4.5, 1.2
# Factor beside the best one of a thinned record with which it is found in the whole record, and how
# often it is applied at most.
BESIDE, MOST_BESIDE = 1.03, 8
# Parameters whose unit the exponent decides.
DECAYS = ("beta", "gamma")
# Most samples of a record, and of one that is thinned, and fewest; and the distance of the drive
# from straight lines between those that are kept, as a share of its range, and where they are too
# many.
MOST_SAMPLES, MOST_THINNED, FEWEST = 20_000, 2000, 500
OFF, MOST_OFF = 1e-4, 1e-2
# Change of the drive in the first interval that is a jump, in root mean squares of all changes.
JUMP = 4.0
# Share of a parameter within which the last search stays, and by how much its cost may be above
# that of the profile.
NEAR, WORSE = 0.5, 0.02


def with_exponent_tried(
    problem: Problem,
    fit: Identification,
    search: Callable[[Problem, Descents | None], Identification],
    threads: int,
) -> Identification:
    """Try exponents other than 1, from the fit with 1.

    Parameters
    ----------
    problem : Problem
        The problem.
    fit : Identification
        Its result with the exponent 1.
    search : callable
        What solves a problem by a search, by its own method or by another.
    threads : int
        All cores where it is 0.

    Returns
    -------
    Identification
        The one with the best exponent where that lowers the cost by 2 %.
    """
    if fit.start is None or not may_have_exponent(problem, fit):
        return fit
    (record,) = problem.records
    thin, history = _thinned(record.data), fit.start.history
    few = replace(problem, records=(replace(record, data=thin, history=history),))
    profile = _Profile(few, fit, threads)
    cost = profile.best()
    # The thinned record has costs of its own.
    if not cost < (1.0 - GAIN) * profile.costs[1.0]:
        return fit
    whole = replace(problem, records=(replace(record, history=history),))
    found = profile.finished(whole, search)
    if not found.cost < (1.0 - GAIN) * fit.cost:
        return fit
    origin = fit.details["provenance"]
    details = {**found.details, "provenance": origin}
    return replace(found, method=fit.method, nfev=fit.nfev + found.nfev, details=details)


def may_have_exponent(problem: Problem, fit: Identification) -> bool:
    """Return whether another exponent may lower the cost of a fit with 1.

    Parameters
    ----------
    problem : Problem
        The problem.
    fit : Identification
        Its result with the exponent 1.

    Returns
    -------
    bool
        False also of several records, and of long ones.
    """
    if not _is_free(problem) or len(problem.records) > 1:
        return False
    if len(problem.records[0].data.full) > MOST_SAMPLES:
        return False
    return (1.0 - GAIN) * fit.cost > max(fit.noises[0], 1e-9 * fit.stroke)


def _is_free(problem: Problem) -> bool:
    """Whether nothing is said that goes with an exponent of 1."""
    given = problem.parameters
    return (
        problem.model == MODEL
        and not problem.constraints
        and not any(name in given for name in (NAME, *DECAYS))
        and all(one.prior is None and one.tie is None for one in given.values())
    )


def _thinned(data: Dataset) -> Dataset:
    """Keep every so many of the samples, as straight lines between them allow."""
    u = data.full.u
    if data.hold != "foh" or _jumps_first(u):
        return data
    every = len(u) // FEWEST
    while every > 1 and _off(u, every) > OFF:
        every -= 1
    # A turn of the drive between samples that are kept costs little beside the time of more.
    fewer = -(-len(u) // MOST_THINNED)
    if fewer > every and _off(u, fewer) <= MOST_OFF:
        every = fewer
    if every <= 1:
        return data
    full, kept = data.full, slice(None, None, every)
    y = full.y if full.left_out is None else np.where(full.left_out, math.nan, full.y)
    thin = Dataset(u=u[kept], y=y[kept], t=full.t[kept], drive_unit=data.drive_unit, missing="drop")
    return thin[float(thin.t[-(-data.warmup // every)]) :]


def _jumps_first(u: Array) -> bool:
    """Return whether a drive jumps in the first interval, after which a mode may ring."""
    changes = np.diff(u)
    return bool(abs(changes[0]) > JUMP * np.sqrt(np.mean(changes**2)))


def _off(u: Array, every: int) -> float:
    """Return how far a drive is from straight lines between every so many of its samples."""
    places = np.arange(u.size - every)
    between = np.interp(places, np.arange(0, u.size, every), u[::every])
    return float(np.abs(between - u[places]).max()) / float(np.ptp(u))


class _Profile:
    """Least cost over the exponent, and where it lies."""

    def __init__(self, problem: Problem, fit: Identification, threads: int) -> None:
        self.problem, self.threads = problem, threads
        values = {name: one.value for name, one in fit.parameters.items()}
        run = fit.simulate(problem.records[0].data)
        # At this size [m] the branches of two exponents decay alike; what is simulated is a force.
        self.size = float(np.abs(run.hysteresis).max()) / values["stiffness"]
        self.values: dict[float, dict[str, float]] = {1.0: values}
        self.costs: dict[float, float] = {}
        self.n = 1.0
        self.descend(1.0, 1.0)

    def best(self) -> float:
        """Find the best exponent; return its cost."""
        n, before = 1.0, self.costs[1.0]
        while n * STEP <= MOST:
            cost = self.descend(n, n * STEP)
            if not cost < before:
                break
            n, before = n * STEP, cost
        self.n = self.vertex(n)
        return self.costs[self.n]

    def refined(self, problem: Problem) -> None:
        """Find the best exponent of the whole record beside that of the thinned one."""
        n, self.problem, self.costs = self.n, problem, {}
        for at in (n, n / BESIDE, n * BESIDE):
            self.descend(n, min(max(at, 1.0), MOST))
        for _ in range(MOST_BESIDE):
            n = min(self.costs, key=self.costs.__getitem__)
            beyond = n * BESIDE if n == max(self.costs) else n / BESIDE
            if min(self.costs) < n < max(self.costs) or not 1.0 < beyond < MOST:
                break
            self.descend(n, beyond)
        self.n = self.vertex(n)

    def vertex(self, n: float) -> float:
        """Return the exponent at the vertex of a parabola through the best one and those beside."""
        below = max((one for one in self.costs if one < n), default=None)
        above = min((one for one in self.costs if one > n), default=None)
        if below is None or above is None:
            return n
        squares = [self.costs[one] ** 2 for one in (below, n, above)]
        curve = np.polyfit(np.array([below, n, above]) - n, squares, 2)
        if not curve[0] > 0.0:
            return n
        at = n - float(curve[1]) / (2.0 * float(curve[0]))
        if not below < at < above or self.descend(n, at) > self.costs[n]:
            return n
        return at

    def alike(self, start: float, n: float) -> dict[str, float]:
        """Return the parameters found with one exponent, as they decay alike with another."""
        scale = self.size ** (start - n)
        values = {
            name: value * (scale if name in DECAYS else 1.0)
            for name, value in self.values[start].items()
        }
        return {**values, NAME: n}

    def descend(self, start: float, n: float) -> float:
        """Descend with the exponent `n` from where that with another one ended; return the cost."""
        objective = Objective._of(held(self.problem, n), self.threads)
        known = self.alike(start, n)
        places, costs, _ = objective.descend(objective._place(known))
        free = {
            name: value_at(part, low, high, kind)
            for part, (name, low, high, kind) in zip(places[0], objective.coordinates, strict=True)
        }
        self.values[n], self.costs[n] = {**known, **free}, float(costs[0])
        return self.costs[n]

    def finished(
        self, problem: Problem, search: Callable[[Problem, Descents | None], Identification]
    ) -> Identification:
        """Search the whole record with the best exponent, near the parameters of the profile."""
        self.refined(problem)
        problem = held(problem, self.n)
        objective = Objective._of(problem, self.threads)
        near = dict(problem.parameters)
        for name, low, high, _ in objective.coordinates:
            value = self.values[self.n][name]
            bounds = (max(low, value - NEAR * abs(value)), min(high, value + NEAR * abs(value)))
            if name not in SENSOR and name not in near and bounds[0] < bounds[1]:
                near[name] = Parameter(bounds=bounds)
        few = Descents(samples=2, starts=2, rounds=1)
        refined = search(replace(problem, parameters=near), few)
        start = {name: one.value for name, one in refined.parameters.items()}
        # What ends on a narrow bound, or beside the minimum, is searched as all others are.
        lowest = float(objective.descend(objective._place(start))[1][0])
        if refined.cost > (1.0 + WORSE) * lowest:
            refined = search(problem, None)
        return self.described(refined, objective)

    def described(self, fit: Identification, objective: Objective) -> Identification:
        """Describe the exponent as fitted, and the ranges of the others as those of a search."""
        parameters = dict(fit.parameters)
        for name, low, high, _ in objective.coordinates:
            one = parameters[name]
            at_bound = not low < one.value < high
            parameters[name] = one._replace(bounds=(low, high), at_bound=at_bound)
        parameters[NAME] = parameters[NAME]._replace(
            free=True,
            bounds=(1.0, MOST),
            at_bound=self.n >= MOST,
        )
        entries = dict(fit.details["parameters"])
        for name in set(entries) & set(parameters):
            entries[name] = details_of(parameters[name])
        return replace(fit, parameters=parameters, details={**fit.details, "parameters": entries})


def with_exponent_of(problem: Problem, fit: Identification) -> Problem:
    """Hold the exponent of a problem at that of a result, if it was tried.

    Parameters
    ----------
    problem : Problem
        The problem.
    fit : Identification
        Its result.

    Returns
    -------
    Problem
        The problem with the exponent held.
    """
    return held(problem, fit.parameters[NAME].value) if _is_free(problem) else problem


def held(problem: Problem, n: float) -> Problem:
    """Hold the exponent of a problem."""
    return replace(problem, parameters={**problem.parameters, NAME: Parameter(n)})


def value_at(part: float, low: float, high: float, scale: str) -> float:
    """Return the value at a coordinate of the unit box."""
    if scale == "log":
        return float(low * (high / low) ** part)
    return float(low + part * (high - low))
