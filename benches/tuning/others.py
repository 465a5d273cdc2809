"""Differential evolution of scipy and CMA-ES on the cost that `pt.tune` minimises."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from piezotrack import _core
from piezotrack.control.tuning import search as tuning_search
from piezotrack.control.tuning.model_set.motions import tasks_of
from piezotrack.control.tuning.problem import TuningProblem

if TYPE_CHECKING:
    from collections.abc import Callable

    from cases import Case
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = ["METHODS", "Cost"]

DEFAULTS: dict[str, Any] = {
    "dt": None,
    "limits": None,
    "feedforward": "inverse",
    "law": "pid",
    "parts": None,
    "filters": (),
    "margins": None,
    "spread": None,
    "goal": None,
    "timing": None,
    "search": None,
    "threads": 1,
}


class Cost:
    """Cost over the unit box; beyond the margins a large number that falls towards them."""

    def __init__(self, case: Case) -> None:
        stage, reference, options = case.make()
        given = {**DEFAULTS, **options}
        self.problem = TuningProblem.checked(stage=stage, reference=reference, **given)
        (dt,) = self.problem.intervals
        axes = [tuning_search._axis_search(self.problem, one, dt) for one in self.problem.axes]
        learns = any(one.box.period is not None for one in axes)
        tasks = tasks_of(self.problem, [one.base for one in axes], learns)
        self.given: dict[str, Any] = {
            "margins": tuning_search._with_reserve(self.problem.margins, 1.0),
            "axes": [one.sought() for one in axes],
            "tasks": [one for stage in tasks for one in stage],
            "stages": len(tasks),
        }
        self.coordinates = sum(len(one.box.ranges) for one in axes)
        self.evaluated = 0
        self.best = np.inf

    def __call__(self, places: Array) -> Array:
        """Costs [m] of some places, shape (places, coordinates)."""
        both = _core.tuning_costs(self.problem, places=places.tolist(), **self.given)
        excess, costs = np.array(both).T
        self.evaluated += len(places)
        self.best = min(self.best, costs.min())
        return np.where(np.isfinite(costs), costs, 1e6 * np.minimum(excess, 1e300))


def evolution(cost: Cost, budget: int, seed: int) -> None:
    """`scipy.optimize.differential_evolution` of 15 members a coordinate."""
    from scipy.optimize import differential_evolution

    n = cost.coordinates
    differential_evolution(
        lambda columns: cost(columns.T.reshape(-1, n)),
        [(0.0, 1.0)] * n,
        rng=seed,
        popsize=15,
        maxiter=max(1, budget // (15 * n) - 1),
        tol=1e-10,
        polish=False,
        vectorized=True,
        updating="deferred",
    )


def adaptation(cost: Cost, budget: int, seed: int) -> None:
    """CMA-ES, begun again at the best of forty random places until the budget is used up."""
    import cma

    n = cost.coordinates
    rng = np.random.default_rng(seed)
    while cost.evaluated < budget:
        places = rng.random((40, n))
        start = places[np.argmin(cost(places))]
        options = {
            "bounds": [0.0, 1.0],
            "seed": int(rng.integers(1, 2**31)),
            "verbose": -9,
            "popsize": 4 + 2 * int(3.0 * np.log(n)),
            "tolfun": 1e-13,
            "tolx": 1e-5,
            "maxfevals": budget // 8,
        }
        strategy = cma.CMAEvolutionStrategy(start, 0.2, options)
        while not strategy.stop():
            asked = strategy.ask()
            strategy.tell(asked, list(cost(np.array(asked))))


METHODS: dict[str, Callable[[Cost, int, int], None]] = {
    "differential evolution": evolution,
    "CMA-ES": adaptation,
}
