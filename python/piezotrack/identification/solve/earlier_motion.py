"""Whether a record shows that its stage had moved before: what a model gains by other histories."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...errors import DataError
from ..fitted.start import GAIN
from ..methods.particle_swarm import ParticleSwarm
from ..problem.objective import Objective

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...data.dataset import Dataset
    from ..fitted.identification import Identification
    from ..fitted.start import History
    from ..problem.problem import Problem

    Array = NDArray[np.float64]

__all__ = ["EarlierMotion", "earlier_motion", "refined_cost", "starts"]

# Samples of a long record that are simulated: the history shows at its beginning.
BEGINNING = 200_000
# Share of the cost by which the voltages before a record change it where it shows its history.
UNSEEN = 1e-3
# Voltages tried before the record, from the best of which a descent starts.
GRID = 15
VOLTAGE = "voltage_before"


class EarlierMotion(NamedTuple):
    """A history that suits a record better than that of a stage that never moved.

    Attributes
    ----------
    history : {"settled", "fit"}
        The history.
    share : float
        Cost of the minimum with it that is next to the one without it, relative to that one.
    """

    history: History
    share: float


def refined_cost(problem: Problem, fit: Identification, threads: int) -> float:
    """Return the cost [m] of the minimum next to a fit: its own but of a swarm without refinement.

    Parameters
    ----------
    problem : Problem
        A model that is searched, and one record.
    fit : Identification
        Its fit.
    threads : int
        All cores where it is 0.

    Returns
    -------
    float
        The cost.
    """
    if not isinstance(fit.method, ParticleSwarm) or fit.method.polish:
        return fit.cost
    return min(fit.cost, _lowest(Objective._of(problem, threads), fit))


def earlier_motion(
    problem: Problem, fit: Identification, cost: float, threads: int
) -> list[EarlierMotion]:
    """Find the histories that lower the cost next to a minimum without one.

    Parameters
    ----------
    problem : Problem
        A model that is searched, and one record.
    fit : Identification
        Its fit as of a stage that never moved before the record.
    cost : float
        Cost of the minimum next to it [m].
    threads : int
        All cores where it is 0.

    Returns
    -------
    list of EarlierMotion
        Those by which the cost falls enough, the one with less freedom first; not that one where
        the cost falls as much again by the other.
    """
    (record,) = problem.records
    data = record.data

    def objective_of(part: Dataset, history: History) -> Objective:
        with_history = replace(record, data=part, history=history)
        return Objective._of(replace(problem, records=(with_history,)), threads)

    part = data
    if len(data) > BEGINNING:
        # Where that shows no reversal, the whole record has to be simulated.
        with suppress(DataError):
            beginning = data[float(data.t[0]) : float(data.t[BEGINNING])]
            part, cost = beginning, _lowest(objective_of(beginning, "virgin"), fit)
    fitted = objective_of(part, "fit")
    costs = fitted(_places(fitted, fit))
    # Where the window does not show the voltage before, it shows no history.
    if cost <= 0.0 or float(np.ptp(costs)) < UNSEEN * cost:
        return []
    objectives: dict[History, Objective] = {
        "settled": objective_of(part, "settled"),
        "fit": fitted,
    }
    settled, before = (
        EarlierMotion(name, _lowest(one, fit) / cost) for name, one in objectives.items()
    )
    gaining = [before] if before.share < (1.0 - GAIN) * settled.share else [settled, before]
    return [one for one in gaining if one.share < 1.0 - GAIN]


def _lowest(objective: Objective, fit: Identification) -> float:
    return float(objective.descend(starts(objective, fit))[1].min())


def starts(objective: Objective, fit: Identification) -> Array:
    """Place the start of a descent at the parameters of a fit, after the best voltage of a grid.

    Parameters
    ----------
    objective : Objective
        The cost with a history.
    fit : Identification
        A fit of the same model, as of a stage that never moved before the record.

    Returns
    -------
    ndarray, shape (1, d)
        The place in the unit box.
    """
    places = _places(objective, fit)
    return places[[int(np.argmin(objective(places)))]]


def _places(objective: Objective, fit: Identification) -> Array:
    """Places with the parameters of the fit: after each voltage of a grid where one is searched."""
    names = list(objective.ranges)
    values = {name: one.value for name, one in fit.parameters.items() if name != VOLTAGE}
    place = objective._place(values)
    if VOLTAGE not in names:
        return np.array([place])
    places = np.tile(place, (GRID, 1))
    places[:, names.index(VOLTAGE)] = (np.arange(GRID) + 0.5) / GRID
    return places
