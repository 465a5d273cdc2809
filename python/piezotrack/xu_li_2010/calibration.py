"""Calibration: a particle swarm fits the virtual stage to the published numbers."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import _core
from .._support.two_threads import one_by_one, two_threads
from ..control.loop.preconditions import check_stable
from ..errors import PiezotrackError
from ..identification.fit import identify
from ..identification.methods.descents import Descents
from ..identification.methods.particle_swarm import ParticleSwarm
from ..stages.feedback.dahl import DahlStage
from .apparatus import loop
from .experiments import fig_04_step_test, fig_06_identification, fig_12_14_tracking, fig_15_circles
from .experiments.procedure import FITTED_SECONDS, SEARCH_BOX
from .free_parameters import FREE, SEED, Free, apparatus_at, theta_at
from .published import observables

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from .apparatus import Apparatus

__all__ = ["calibrate", "cost", "medians", "values_of"]

# The model is fitted to every tenth sample: 500 Hz is plenty for 0.25 Hz.
THINNED = 10
# Larger circles are left out [m].
RADIUS = 20e-6


def values_of(apparatus: Apparatus) -> dict[str, float]:
    """Compute the calibrated observables of an apparatus, SI.

    Raises
    ------
    PiezotrackError
        A loop is unstable or diverges, or the step has no overshoot.
    """
    log = fig_06_identification.record(apparatus)
    thin = fig_06_identification.thinned(log, THINNED)
    published = DahlStage.xu_li_2010()
    fit = identify(
        thin[:FITTED_SECONDS],
        "dahl",
        parameters={
            **SEARCH_BOX,
            "a1": published.a1,
            "a2": published.a2,
            "b1": published.b1,
        },
        history="virgin",
        method=Descents(seed=SEED),
        threads=1,
        progress=False,
    )
    inverse = fit.inverse()
    one = loop(inverse, feedback=fig_12_14_tracking.PID)
    for stage in (apparatus.x, apparatus.y):
        check_stable(stage, one, apparatus.delay)
    table = fig_15_circles.circles(apparatus, inverse, largest=RADIUS, checked=False)
    error = log.y - fit.simulate(log, offset=fit.offset).x
    return {
        **fig_04_step_test.observe(fig_04_step_test.step_test(apparatus)),
        **fig_06_identification.observe(fit),
        "models.dahl": float(np.abs(error).max()),
        **fig_12_14_tracking.observe_compensation(
            fig_12_14_tracking.compensation(apparatus, inverse)
        ),
        **fig_15_circles.observe(table, apparatus.stage),
    }


def cost(values: Mapping[str, float]) -> float:
    """Mean over the observables of r^4 / (1 + r^4), with r the error in units of the tolerance.

    This is nearly the share of the numbers outside their tolerance, so that a single one that
    cannot be reached does not dominate. A number within a bound costs nothing.
    """
    terms = []
    for target in observables():
        if target.calibrated and target.key in values:
            off = values[target.key] - target.published
            off = max(off, 0.0) if target.kind == "bound" else off
            power = (off / target.slack) ** 4
            terms.append(power / (1.0 + power))
    return math.fsum(terms) / len(terms)


def medians(theta: Mapping[str, float], seeds: Sequence[int]) -> dict[str, float]:
    """Return the medians of `values_of` over seeds of the sensors, SI.

    Raises
    ------
    PiezotrackError
        As for `values_of`.
    """
    apparatus = apparatus_at(theta)
    runs = [values_of(apparatus.seeded(seed)) for seed in seeds]
    return {key: float(np.median([run[key] for run in runs])) for key in runs[0]}


def _cost_at(theta: Mapping[str, float] | None, seeds: Sequence[int]) -> float:
    """Cost of a candidate; infinite where a loop is unstable, or outside the box."""
    if theta is None:
        return math.inf
    try:
        return cost(medians(theta, seeds))
    except PiezotrackError:
        return math.inf


Progress = Callable[[int, float, dict[str, float]], object]


def _round(
    box: Sequence[Free],
    seeds: Sequence[int],
    settings: ParticleSwarm,
    seed: int,
    progress: Progress | None,
) -> tuple[float, dict[str, float]]:
    """Search a box with the swarm of the core: best cost and candidate."""
    swarm = _core.Swarm(settings._core, len(box), seed)
    with two_threads() as pool:
        for iteration in range(settings.iterations + 1):
            places = [None if one is None else theta_at(one, box) for one in swarm.ask()]
            swarm.tell(list(one_by_one(pool, lambda theta: _cost_at(theta, seeds), places)))
            if progress is not None:
                place, least = swarm.best
                progress(iteration, least, theta_at(place, box))
    place, least = swarm.best
    return least, theta_at(place, box)


# The later rounds: share of the first box, centred on the best candidate so far, and seeds of the
# sensors. The last one takes medians, so that the result is not fitted to the noise of one seed,
# with half as many iterations.
LATER = ((0.4, (SEED,)), (0.15, (SEED, SEED + 1, SEED + 2)))


def calibrate(
    *,
    particles: int = 40,
    iterations: int = 40,
    runs: int = 2,
    seed: int = SEED,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Search the free parameters, and document the result.

    Several independent swarms search the whole box; another searches a smaller box about the best
    candidate of them, and one more a still smaller box, with medians over three seeds of the
    sensors.

    Parameters
    ----------
    particles, iterations, seed : int, optional
        Of each swarm.
    runs : int, optional
        Swarms in the whole box.
    progress : callable, optional
        Called with iteration, best cost of its swarm and the candidate.

    Returns
    -------
    dict
        Content of ``calibrated.json``.
    """
    settings = ParticleSwarm(
        particles=particles, iterations=iterations, stall_iterations=iterations, topology="random"
    )
    found = [_round(FREE, (SEED,), settings, seed + run, progress) for run in range(runs)]
    costs = [least for least, _ in found]
    least, theta = min(found, key=lambda one: one[0])
    for share, seeds in LATER:
        box = [free.about(theta[free.name], share) for free in FREE]
        before = _cost_at(theta, seeds), theta
        length = iterations if len(seeds) == 1 else max(1, iterations // 2)
        after = _round(box, seeds, replace(settings, iterations=length), seed, progress)
        least, theta = min(before, after, key=lambda one: one[0])
        costs.append(least)
    shares = " and ".join(f"{share:g}" for share, _ in LATER)
    how = (
        f"{len(FREE)} free parameters of the virtual stage were found by {runs} swarms of "
        f"{particles} particles in {iterations} iterations each, and by two more in boxes of "
        f"{shares} of the ranges about the best, so that it agrees with {{}} published numbers; "
        "the mass of Table 1, the 40 um row of Table 2 and Figs. 13 and 14 were left out."
    )
    provenance = {"costs": costs, "cost": least, "seed": seed, "sensor_seeds": list(seeds)}
    return _document(theta, how, provenance)


# Change of a parameter for its sensitivities, as a part of its range.
NUDGE = 0.05


def _moved(
    theta: dict[str, float], free: Free, values: Mapping[str, float], seeds: Sequence[int]
) -> dict[str, float]:
    """Return the three observables most sensitive to a parameter, with their changes.

    In units of the tolerance for 5 % of the range; empty where a loop is unstable there.
    """
    part = free.part(theta[free.name])
    step = NUDGE if part + NUDGE <= 1.0 else -NUDGE
    try:
        moved = medians({**theta, free.name: free.at(part + step)}, seeds)
    except PiezotrackError:
        return {}
    changes = {
        one.key: (moved[one.key] - values[one.key]) / one.slack * math.copysign(1.0, step)
        for one in observables()
        if one.calibrated and one.key in values
    }
    largest = sorted(changes, key=lambda key: -abs(changes[key]))[:3]
    return {key: changes[key] for key in largest}


def _document(theta: dict[str, float], how: str, provenance: dict[str, Any]) -> dict[str, Any]:
    """Content of the file: the apparatus and its provenance."""
    seeds = provenance["sensor_seeds"]
    values = medians(theta, seeds)
    used = [one for one in observables() if one.calibrated and one.key in values]
    free = [
        {
            "name": parameter.name,
            "meaning": parameter.meaning,
            "bounds": [parameter.low, parameter.high],
            "value": theta[parameter.name],
            "moves": _moved(theta, parameter, values, seeds),
        }
        for parameter in FREE
    ]
    return {
        "format": "piezotrack-calibration",
        "schema_version": 1,
        "apparatus": apparatus_at(theta).document(),
        "free": free,
        "observables": [
            {"key": one.key, "published": one.published, "obtained": values[one.key]}
            for one in used
        ],
        "provenance": {
            "package": "piezotrack",
            "version": _core.__version__,
            "script": "python/examples/calibrate_virtual_stage.py",
            "how": how.format(len(used)),
            **provenance,
        },
    }
