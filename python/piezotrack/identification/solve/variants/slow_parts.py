"""Creep of a model that is searched, which its residual shows, and a drift beside it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ....errors import DataError, NumericalError
from ...fitted.start import start_after, start_at_jump
from ...linearised.sensitivity import LinearisedRecord
from ...linearised.values import fitted_values, without_search
from ..judging import NOISY
from .drift import with_drift_of_few_turns, with_drift_tried

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from ...fitted.identification import Identification
    from ...fitted.identified_model import IdentifiedModel
    from ...problem.problem import Problem

    Array = NDArray[np.float64]

__all__ = ["MOST", "with_slow_parts"]

# Up to so many times the noise, a drift beside less creep may explain the rest, by such a share
# better than more creep.
NEAR, LESS = 2.0, 0.02
# Residual beyond which creep does not explain it: such a share of the one before, and so many times
# the noise.
SHARE, FAR = 0.5, 5.0
# Share of the residual that each relaxation has to take away, and of the cost that a search has to:
# so much of all, or of what is above the noise.
GAIN, GAIN_ABOVE = 0.1, 0.3
# Relaxations of a search, at most, least ratio of their time constants, and that of those tried.
MOST, APART, STEP = 3, 3.0, 1.15
# Shortest time constant tried, in samples.
SHORTEST = 5.0
# Searches, each with the time constants that the residual of the one before shows, at most.
ROUNDS = 3
# Rows on which relaxations are compared, about.
ROWS = 5000


def with_slow_parts(
    problem: Problem,
    search: Callable[[Problem], Identification],
    begun: Sequence[float] = (),
) -> Identification:
    """Search with the creep that a residual shows, then with a drift where one is left.

    The record is linearised about a fit: of the relaxations of its motion, those are taken that
    lower the residual most beside changes of the values that were fitted: a search may have taken a
    part of the creep for them.

    Parameters
    ----------
    problem : Problem
        The problem, without creep. Of several records none is tried.
    search : callable
        What solves a problem.
    begun : sequence of float, optional
        Time constants of the creep to begin with [s].

    Returns
    -------
    Identification
        The result: with creep where that lowers the cost by 10 %, or by 30 % of what is above the
        noise; with a drift as `with_drift_tried`.

    Raises
    ------
    ParameterError, DataError, NumericalError, Interrupted
        As for `identify`.
    """
    records = tuple(
        replace(record, drift=False) if record.drift is None else record
        for record in problem.records
    )
    fits = _with_creep_tried(replace(problem, records=records), search, tuple(begun))
    best = fits[-1]
    # A further relaxation may have taken a part of a drift.
    for fit in [best, *(one for one in fits[-2::-1] if one.cost < NEAR * max(one.noises))]:
        if best.cost <= NOISY * max(best.noises):
            break
        creeping = replace(problem, creep=fit.model.creep_times or None)
        fit = with_drift_of_few_turns(creeping, with_drift_tried(creeping, fit, search), search)
        if fit.cost < (1.0 - LESS) * best.cost:
            best = fit
    return best


def _with_creep_tried(
    problem: Problem, search: Callable[[Problem], Identification], begun: tuple[float, ...]
) -> list[Identification]:
    """Search without creep or with some, then with what the residual of the search before shows."""
    fit = search(replace(problem, creep=begun or None))
    fits = [fit]
    if len(problem.records) > 1:
        return fits
    for _ in range(ROUNDS):
        if fit.cost <= NOISY * max(fit.noises):
            break
        try:
            times, left = _times_shown(fit)
            hopeless = left > max(SHARE * fit.cost, FAR * max(fit.noises))
            if not times or hopeless or _alike(times, fit.model.creep_times):
                break
            other = search(replace(problem, creep=times))
        except (DataError, NumericalError):
            break
        if not other.cost < _less(fit.cost, max(fit.noises)):
            break
        fit = other
        fits.append(fit)
    return fits


def _less(left: float, noise: float) -> float:
    """Return the residual below which something is better that leaves more than noise [m]."""
    return left - min(GAIN * left, GAIN_ABOVE * (left - noise))


def _alike(times: tuple[float, ...], others: tuple[float, ...]) -> bool:
    """Return whether time constants differ by less than those that are tried."""
    if len(times) != len(others):
        return False
    pairs = zip(times, others, strict=True)
    return all(abs(math.log(one / other)) < math.log(STEP) for one, other in pairs)


def _times_shown(fit: Identification) -> tuple[tuple[float, ...], float]:
    """Return the time constants of relaxations that lower a residual most [s], and it then [m]."""
    data = fit.data
    still = _with_creep(fit)
    record = LinearisedRecord(still, data)
    some = slice(None, None, -(-record.residual.size // ROWS))
    columns = [*record.columns(still, fitted_values(still)), *record.nuisance().values()]
    columns = [column[some] for column in columns]
    residual, motion = record.residual[some], record.begun(still)[some]
    window = float(data.t[-1] - data.t[0])
    count = math.ceil(math.log(window / (SHORTEST * data.dt)) / math.log(STEP))
    times = np.geomspace(SHORTEST * data.dt, window, max(count, 2)).tolist()
    relaxed = {time: record.begun(_with_creep(fit, time))[some] - motion for time in times}
    found: list[float] = []
    left = _left(residual, columns, [])
    while len(found) < MOST:
        others = [time for time in times if all(_apart(time, one) for one in found)]
        costs = {
            time: _left(residual, columns, [relaxed[one] for one in (*found, time)])
            for time in others
        }
        best = min(others, key=costs.__getitem__, default=None)
        if best is None or not costs[best] < _less(left, max(fit.noises)):
            break
        left = costs[best]
        found.append(best)
    return tuple(sorted(found)), left


def _apart(time: float, other: float) -> bool:
    return abs(math.log(time / other)) >= math.log(APART)


def _left(residual: Array, columns: list[Array], relaxed: list[Array]) -> float:
    """Return what least squares leave of a residual [m]; infinite where a weight is below 0."""
    matrix = np.column_stack([*columns, *relaxed])
    matrix = matrix / np.maximum(np.linalg.norm(matrix, axis=0), 1e-300)
    weights = np.linalg.lstsq(matrix, residual, rcond=1e-10)[0]
    if np.any(weights[len(columns) :] < 0.0):
        return math.inf
    return float(np.sqrt(np.mean((residual - matrix @ weights) ** 2)))


def _with_creep(fit: Identification, *times: float) -> IdentifiedModel:
    """Return the model of a fit with one relaxation of weight 1 for each time, beside no other."""
    creep: dict[str, Any] = {"creep_weights": (1.0,) * len(times), "creep_times": times}
    model: Any = replace(fit.model, **creep)
    data, start = fit.data, fit.start
    if start is None:
        return replace(without_search(fit), model=model)
    if start.rest is not None:
        begun = start_at_jump(model, data, start.rest)
    else:
        begun = start_after(model, data, start.history, start.voltage, creeps=False)
    records = tuple(replace(one, start=begun) for one in fit.records)
    return replace(without_search(fit), model=model, start=begun, records=records)
