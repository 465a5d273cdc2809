"""One function for each peer: it searches through a `Meter`, and returns when it stops by itself.

The settings were chosen by short trials on both problems: for each library the method and the
size of the swarm with which it came soonest, or most often, to the lowest cost. All work in the
unit cube, with logarithms where piezotrack takes them, and all but `solve_ivp` evaluate whole
populations by one call of a numba kernel on all threads.
"""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import Bounds, differential_evolution, least_squares
from scipy.stats import qmc

if TYPE_CHECKING:
    from collections.abc import Callable

    from problems import Meter

ITERATIONS, PARTICLES = 2000, 10


class Inertia:
    """pyswarms asks it for the options of each iteration: w as in the paper."""

    def __init__(self) -> None:
        self.done = 0

    def __call__(self, options: dict[str, float], **_: object) -> dict[str, float]:
        self.done += 1
        return {**options, "w": 0.9 - 0.5 * min(self.done / 500.0, 1.0)}


def paper_swarm(meter: Meter, seed: int) -> None:
    """pyswarms with the paper's settings, all 2000 iterations."""
    from pyswarms.single import GlobalBestPSO

    swarm = _pyswarm(GlobalBestPSO, meter, seed, PARTICLES, {"c1": 2.0, "c2": 2.0, "w": 0.9}, 0.1)
    swarm.oh = Inertia()
    swarm.optimize(meter.costs, ITERATIONS + 1, verbose=False)


def pyswarms(meter: Meter, seed: int, particles: int = 16) -> None:
    """A swarm with the constriction of Clerc and Kennedy, again and again."""
    from pyswarms.single import GlobalBestPSO

    options = {"c1": 1.49618, "c2": 1.49618, "w": 0.7298}
    for again in range(10**6):
        swarm = _pyswarm(GlobalBestPSO, meter, 1000 * again + seed, particles, options, 0.5)
        swarm.ftol, swarm.ftol_iter = 1e-6, 30
        swarm.optimize(meter.costs, 10**6, verbose=False)


def _pyswarm(kind: Any, meter: Meter, seed: int, size: int, options: Any, clamp: float) -> Any:
    logging.disable(logging.INFO)  # each swarm opens a file for its log
    np.random.seed(seed)  # noqa: NPY002  pyswarms draws from it
    dimensions = meter.problem.size
    return kind(
        size,
        dimensions,
        options,
        bounds=(np.zeros(dimensions), np.ones(dimensions)),
        velocity_clamp=(-clamp, clamp),
        bh_strategy="nearest",
    )


def pymoo(meter: Meter, seed: int) -> None:
    """pymoo's CMA-ES with restarts in growing populations."""
    from pymoo.algorithms.soo.nonconvex.cmaes import CMAES
    from pymoo.core.problem import Problem
    from pymoo.optimize import minimize

    class Task(Problem):
        def __init__(self) -> None:
            super().__init__(n_var=meter.problem.size, n_obj=1, xl=0.0, xu=1.0)

        def _evaluate(self, x: Any, out: Any, *_: Any, **__: Any) -> None:
            out["F"] = meter.costs(x)[:, np.newaxis]

    algorithm = CMAES(sigma=0.3, restarts=9, popsize=16, parallelize=True)
    minimize(Task(), algorithm, ("n_evals", meter.budget), seed=seed, verbose=False)


def fcmaes(meter: Meter, seed: int) -> None:
    """BiteOpt of fcmaes with restarts, through ask and tell."""
    from fcmaes.bitecpp import Bite_C

    size = meter.problem.size
    rg = np.random.Generator(np.random.PCG64DXSM(seed))
    box = Bounds(np.zeros(size), np.ones(size))

    _restarts(meter, lambda: Bite_C(size, box, popsize=16, rg=rg))


def _restarts(meter: Meter, start: Callable[[], Any], idle: int = 40) -> None:
    """Ask and tell, and begin again where `idle` rounds have not improved, until all is spent."""
    while True:
        method, best, stalled = start(), np.inf, 0
        while stalled < idle:
            points = np.array(method.ask())
            costs = meter.costs(points)
            stop = method.tell(costs)
            stalled = 0 if costs.min() < best * (1.0 - 1e-6) else stalled + 1
            best = min(best, float(costs.min()))
            if stop:
                break


def scipy_de(meter: Meter, seed: int, **changes: Any) -> None:
    # Populations of 32 and 75.
    settings = {
        "popsize": 8 if meter.problem.size < 5 else 15,
        "strategy": "best1bin",
        "tol": 1e-8,
        "maxiter": 10**6,
        **changes,
    }
    differential_evolution(
        lambda x: meter.costs(x.T),
        [(0.0, 1.0)] * meter.problem.size,
        vectorized=True,
        updating="deferred",
        polish=True,
        rng=seed,
        **settings,
    )


def pints(meter: Meter, seed: int) -> None:
    """PINTS' CMA-ES with restarts from random points."""
    import pints

    np.random.seed(seed)  # noqa: NPY002  PINTS draws from it
    size = meter.problem.size
    box = pints.RectangularBoundaries(np.zeros(size), np.ones(size))

    def start() -> Any:
        method = pints.CMAES(np.random.random(size), 0.3, box)  # noqa: NPY002
        method.set_population_size(16)
        return method

    _restarts(meter, start)


def many_starts(meter: Meter, seed: int, starts: int = 16) -> None:
    """SciPy's `least_squares` from points of a Latin hypercube, derivatives by one batch."""
    size = meter.problem.size
    kept: dict[bytes, Any] = {}

    def both(x: Any) -> Any:
        if x.tobytes() not in kept:
            step = np.where(x < 0.5, 1e-6, -1e-6)
            away = meter.residuals(np.vstack([x, x + np.diag(step)]))
            kept.clear()
            kept[x.tobytes()] = away[:, 0], (away[:, 1:] - away[:, :1]) / step
        return kept[x.tobytes()]

    for start in qmc.LatinHypercube(size, rng=seed).random(starts):
        least_squares(
            lambda x: both(x)[0],
            start,
            lambda x: both(x)[1],
            bounds=(np.zeros(size), np.ones(size)),
            x_scale="jac",
            max_nfev=100,
        )
