"""Methods of search, each as a course of (simulations, best cost) on an objective.

All of them ask the same cost function, whose candidates are simulated side by side; what is
counted is simulations, so the language of a method does not matter.
"""

from __future__ import annotations

import contextlib
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import differential_evolution
from scipy.stats import qmc

import piezotrack as pt
from piezotrack import _core

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Course = list[tuple[int, float]]
    Method = Callable[[pt.identification.Objective, int, float, int], Course]

NEVER = 10**6


class Counted:
    """An objective with its simulations counted and the course of its best cost kept.

    Raises `Done` when the goal is reached or the simulations are used up.
    """

    def __init__(self, objective: pt.identification.Objective, goal: float, most: int) -> None:
        self.objective, self.goal, self.most = objective, goal, most
        self.size = len(objective.ranges)
        self.used, self.best = 0, np.inf
        self.course: Course = []

    def costs(self, places: Array) -> Array:
        """Costs at places in or out of the box; those outside are taken to its wall."""
        found = self.objective(np.clip(np.atleast_2d(places), 0.0, 1.0))
        self._take(len(found), float(found.min()))
        return found

    def descend(self, places: Array) -> tuple[Array, Array]:
        """Descend from places, one after the other in the count."""
        ends, costs, used = self.objective.descend(places)
        for cost, count in zip(costs, used, strict=True):
            self._take(int(count), float(cost))
        return ends, costs

    def _take(self, used: int, cost: float) -> None:
        self.used += used
        if cost < self.best:
            self.best = cost
            self.course.append((self.used, cost))
        if cost <= self.goal or self.used >= self.most:
            raise Done


class Done(Exception):  # noqa: N818 - an end, not an error
    """The goal is reached, or the simulations are used up."""


def course_of(run: Callable[[Counted, np.random.Generator], None]) -> Method:
    """Make a method of a function that goes on until `Done`."""

    def method(objective: pt.identification.Objective, seed: int, goal: float, most: int) -> Course:
        counted = Counted(objective, goal, most)
        with contextlib.suppress(Done):
            run(counted, np.random.default_rng(seed))
        return counted.course

    return method


def swarm(settings: pt.ParticleSwarm, *, descend: bool = False) -> Method:
    """One swarm after the other, each to its stall; with a descent from its best place."""

    def run(of: Counted, random: np.random.Generator) -> None:
        while True:
            one = _core.Swarm(settings._core, of.size, int(random.integers(2**31)))
            while not one.done:
                places = one.ask()
                inside = [place for place in places if place is not None]
                costs = iter(of.costs(np.array(inside)))
                one.tell([np.inf if place is None else float(next(costs)) for place in places])
            if descend:
                of.descend(np.atleast_2d(one.best[0]))

    return course_of(run)


def batches(points: Callable[[int, np.random.Generator, int], Iterator[Array]]) -> Method:
    """Descents from every point."""

    def run(of: Counted, random: np.random.Generator) -> None:
        for batch in points(of.size, random, 32):
            of.descend(batch)

    return course_of(run)


def random_points(size: int, random: np.random.Generator, count: int) -> Iterator[Array]:
    """Uniform points."""
    while True:
        yield random.random((count, size))


def sobol_points(size: int, random: np.random.Generator, count: int) -> Iterator[Array]:
    """Points of a scrambled Sobol sequence."""
    sequence = qmc.Sobol(size, seed=random)
    while True:
        yield sequence.random(count)


def distinct(places: Array, costs: Array, count: int) -> Array:
    """Return the best places that are not beside a better one."""
    chosen: list[Array] = []
    for i in np.argsort(costs):
        beside = any(np.abs(places[i] - one).max() < 0.05 for one in chosen)
        if np.isfinite(costs[i]) and not beside and len(chosen) < count:
            chosen.append(places[i])
    return np.array(chosen)


def sampled(samples: int, starts: int) -> Method:
    """Descents from the best distinct few of random points."""

    def run(of: Counted, random: np.random.Generator) -> None:
        while True:
            places = random.random((samples, of.size))
            of.descend(distinct(places, of.costs(places), starts))

    return course_of(run)


def short_swarm(settings: pt.ParticleSwarm, starts: int) -> Method:
    """A swarm that is cut short, then descents from its best distinct places."""

    def run(of: Counted, random: np.random.Generator) -> None:
        while True:
            one = _core.Swarm(settings._core, of.size, int(random.integers(2**31)))
            seen, seen_costs = [], []
            while not one.done:
                places = np.array([place for place in one.ask() if place is not None])
                costs = of.costs(places)
                seen.append(places)
                seen_costs.append(costs)
                one.tell([float(cost) for cost in costs])
            places, costs = np.concatenate(seen), np.concatenate(seen_costs)
            of.descend(distinct(places, costs, starts))

    return course_of(run)


def scatter(of: Counted, random: np.random.Generator) -> None:
    """Scatter search: a reference set of good and diverse places, combined and descended from.

    After Egea, Marti and Banga 2010, doi 10.1016/j.cor.2009.05.003, without its filters.
    """
    count = 10
    while True:
        places = random.random((10 * of.size, of.size))
        costs = of.costs(places)
        order = np.argsort(costs)
        keep = np.concatenate([order[: count // 2], random.choice(order[count // 2 :], count // 2)])
        places, costs = places[keep], costs[keep]
        idle = 0
        while idle < 3:
            pairs = [(i, j) for i in range(count) for j in range(count) if i != j]
            spread = np.array([0.5 * (places[j] - places[i]) for i, j in pairs])
            base = np.array([places[i] for i, _ in pairs])
            trial = np.clip(base + random.uniform(-1, 1, spread.shape) * spread, 0.0, 1.0)
            found = of.costs(trial)
            idle += 1
            for i in range(count):
                rows = [k for k, pair in enumerate(pairs) if pair[0] == i]
                best = min(rows, key=lambda k: found[k])
                if found[best] < costs[i]:
                    places[i], costs[i], idle = trial[best], found[best], 0
            ends, low = of.descend(places[[int(np.argmin(costs))]])
            if low[0] < costs.min() * (1 - 1e-6):
                k = int(np.argmax(costs))
                places[k], costs[k], idle = ends[0], low[0], 0


def cma_es(of: Counted, random: np.random.Generator) -> None:
    """CMA-ES of the package `cma`, restarted with twice the population."""
    import cma

    population = 4 + int(3 * np.log(of.size))
    while True:
        one = cma.CMAEvolutionStrategy(
            random.random(of.size),
            0.3,
            {
                "bounds": [0, 1],
                "popsize": population,
                "verbose": -9,
                "seed": int(random.integers(1, 2**31)),
            },
        )
        while not one.stop():
            places = one.ask()
            one.tell(places, _finite(of.costs(np.array(places))))
        population = min(2 * population, 512)


def fast_cma_es(of: Counted, random: np.random.Generator) -> None:
    """CMA-ES of the package `fcmaes`, restarted."""
    from fcmaes import cmaescpp

    while True:
        one = cmaescpp.ACMA_C(
            of.size,
            _box(of.size),
            popsize=32,
            input_sigma=0.3,
            rg=np.random.Generator(np.random.PCG64(int(random.integers(2**31)))),
        )
        stopped = 0
        while stopped == 0:
            places = one.ask()
            stopped = one.tell(_finite(of.costs(np.array(places))))


def _box(size: int) -> object:
    from scipy.optimize import Bounds

    return Bounds([0.0] * size, [1.0] * size)


def evolution(of: Counted, random: np.random.Generator) -> None:
    """Differential evolution of SciPy, without its polish."""
    while True:
        differential_evolution(
            lambda places: _finite(of.costs(places.T)),
            [(0.0, 1.0)] * of.size,
            vectorized=True,
            updating="deferred",
            polish=False,
            maxiter=NEVER,
            seed=int(random.integers(2**31)),
        )


def _finite(costs: Array) -> Array:
    """Put a large number for what diverged."""
    return np.where(np.isfinite(costs), costs, 1.0)


_RING = replace(pt.ParticleSwarm(), iterations=NEVER, polish=False)

METHODS: dict[str, Method] = {
    "descents, random points": batches(random_points),
    "descents, Sobol points": batches(sobol_points),
    "descents, best 8 of 64": sampled(64, 8),
    "descents, best 5 of 300": sampled(300, 5),
    "swarm cut short, 5 descents": short_swarm(replace(_RING, iterations=5), 5),
    "scatter search": course_of(scatter),
    "ring swarm, then descent": swarm(replace(_RING, iterations=200), descend=True),
    "ring swarm": swarm(_RING),
    "SPSO-2011": swarm(replace(pt.ParticleSwarm.spso_2011(), boundary="absorb")),
    "the paper's swarm": swarm(pt.ParticleSwarm.xu_li_2010()),
    "CMA-ES (cma)": course_of(cma_es),
    "CMA-ES (fcmaes)": course_of(fast_cma_es),
    "differential evolution (SciPy)": course_of(evolution),
}
