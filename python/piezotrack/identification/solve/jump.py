"""A record whose drive jumps to its first sample from rest, as loggers that start late show."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ... import _core
from ...errors import ParameterError
from ..fitted.model_entries import origin_of, provenance
from ..fitted.notes import carried_by_first_samples
from ..fitted.start import GAIN, least_voltage, start_at_jump
from ..methods.least_squares import LeastSquares
from .weights import Structure

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from ...data.dataset import Dataset
    from ..fitted.identification import Identification
    from ..problem.problem import Problem

    Identify = Callable[[Problem, Structure | None], Identification]

__all__ = ["preceded", "voltage_of_rest", "with_rest", "with_rest_tried"]

# Voltages of rest with a fit each, spread and about the best of these.
COARSE, ABOUT = 9, 6
# Samples of the beginning of a record on which they are compared: so many, or twice those up to
# where the drive has reversed by such a share of its range.
FIRST, REVERSED = 1500, 0.1
# Ratio of residuals of the beginning that are alike, how many of their voltages are tried on the
# whole record, and ratio of its residual to that of the beginning that ends this.
ALIKE, TRIED, APART = 1.1, 3, 1.5
# Fits with a voltage of rest that was found from the one before, at most.
ROUNDS = 3
# Share of the window in which a jump is over, and of the squares above the noise that are there.
VERY_FIRST, CARRIED = 0.01, 0.5


def with_rest_tried(
    problem: Problem, fit: Identification, at_rest: Callable[[], Identification]
) -> Identification:
    """Try that the stage was at rest before where the first samples carry the residual.

    Parameters
    ----------
    problem : Problem
        The problem, of one record.
    fit : Identification
        Its result without a jump.
    at_rest : callable
        What solves it with a jump, as `with_rest`.

    Returns
    -------
    Identification
        The one with the jump where it lowers the residual by 2 %, and that after the first sample
        too: its window begins at the second sample, as the jump lies at the first.
    """
    (record,) = problem.records
    data = record.data
    if record.history is not None or data.warmup:
        return fit
    if not _begins_apart(fit, data):
        return fit
    jumped = at_rest()
    later = float(np.sqrt(np.mean(_left(fit, jumped.data) ** 2)))
    # The first sample, where the jump lies, may be all that it explains.
    explains = jumped.cost < min(later, (1.0 - GAIN) * fit.cost)
    return jumped if explains else fit


def voltage_of_rest(fit: Identification) -> float | None:
    """Return the voltage [V] at which a stage was at rest until the drive jumped, if it was."""
    start = fit.start
    return start.voltage if start is not None and start.history == "rest" else None


def with_rest(problem: Problem, identify: Identify, known: float | None = None) -> Identification:
    """Identify a stage that was at rest until the drive jumped to the first sample.

    At rest at a voltage, or at another one where that lowers the residual by 2 %.

    Parameters
    ----------
    problem : Problem
        The problem, of one record.
    identify : callable
        What solves a problem, from a structure if one is given.
    known : float, optional
        Voltage of rest [V] that another fit has shown, about which it is searched; 0 V, and a
        grid where that is far off, without.

    Returns
    -------
    Identification
        The result; its window begins at the second sample at the earliest, as the jump lies at the
        first.

    Raises
    ------
    ParameterError
        There are several records.
    """
    if len(problem.records) > 1:
        raise ParameterError("history", "'rest'", "another one of several records")
    data = problem.records[0].data
    fit = _at_rest(problem, identify, 0.0 if known is None else known)
    if known is None and _begins_apart(fit, fit.data):
        begun = _begun(problem)
        start = Structure.of(fit) if isinstance(fit.method, LeastSquares) else None
        costs: dict[float, float] = {}

        def cost(volts: float) -> float:
            costs[volts] = _at_rest(begun, identify, volts, start).cost
            return costs[volts]

        least = costs[least_voltage(cost, _voltages(data), (COARSE, ABOUT))]
        # The beginning may explain several voltages alike, of which the whole record shows one.
        alike = [
            volts for volts in sorted(costs, key=costs.__getitem__) if costs[volts] < ALIKE * least
        ]
        best = fit
        for volts in alike[:TRIED]:
            best = min(best, _at_rest(problem, identify, volts), key=lambda one: one.cost)
            if best.cost < APART * least:
                break
        fit = best if best.cost < (1.0 - GAIN) * fit.cost else fit
    for _ in range(ROUNDS):
        better = best_voltage(fit, data)
        if better is None:
            break
        other = _at_rest(problem, identify, better)
        if other.cost >= (1.0 - GAIN) * fit.cost:
            break
        fit = other
    return fit


def best_voltage(fit: Identification, data: Dataset) -> float | None:
    """Return the voltage of rest with which a model explains a record best.

    Parameters
    ----------
    fit : Identification
        The model, and the voltage of rest that it was fitted with.
    data : Dataset
        The record.

    Returns
    -------
    float or None
        The voltage [V]; None where none lowers the residual by 2 %.
    """

    def cost(volts: float, data: Dataset = data) -> float:
        start = start_at_jump(fit.model, data, volts)
        own = replace(fit.records[0], start=start)
        left = _left(replace(fit, start=start, records=(own,)), data)[1:]
        return float(np.std(left) if fit.offset_fitted else np.sqrt(np.mean(left**2)))

    first = _first(data)
    volts = least_voltage(lambda volts: cost(volts, first), _voltages(data))
    return volts if cost(volts) < (1.0 - GAIN) * cost(voltage_of_rest(fit) or 0.0) else None


def preceded(problem: Problem, volts: float) -> Problem:
    """Put a stage at rest before the drive jumps to the first sample.

    Parameters
    ----------
    problem : Problem
        The problem, of one record.
    volts : float
        Voltage of rest [V].

    Returns
    -------
    Problem
        With a record that begins at rest, whose window begins after the jump.
    """
    (record,) = problem.records
    before = record.data._preceded(volts)
    begin = before.t[0] if record.data.warmup else before.full.t[2]
    at_rest = replace(record, data=before[float(begin) :], history="virgin")
    return replace(problem, records=(at_rest,))


def _begins_apart(fit: Identification, data: Dataset) -> bool:
    """Return whether the first samples carry the residual, or the very first what is not noise."""
    left = _left(fit, data)
    squares = (left - left.mean()) ** 2
    above = squares - fit.noises[0] ** 2
    count = math.ceil(VERY_FIRST * left.size)
    # Fewer do not lower the residual by the share that is required.
    least = max(CARRIED * above.sum(), 2.0 * GAIN * squares.sum())
    return carried_by_first_samples(left) or bool(above[:count].sum() >= least > 0.0)


def _left(fit: Identification, data: Dataset) -> NDArray[np.float64]:
    """Return the residual of a model on its record, or on a part of it [m]."""
    return data.counted(data.y - fit.simulate(data, offset=fit.offset).x)


def _voltages(data: Dataset) -> tuple[float, float]:
    """Return the range of the voltages that a stage may have been at [V]."""
    low, high = float(data.full.u.min()), float(data.full.u.max())
    reach = 0.5 * (high - low)
    return min(low - reach, 0.0), max(high + reach, 0.0)


def _begun(problem: Problem) -> Problem:
    """Return the problem of the first part of a long record."""
    (record,) = problem.records
    return replace(problem, records=(replace(record, data=_first(record.data)),))


def _first(data: Dataset) -> Dataset:
    """Return the first part of a long record."""
    turns = _core.turns(data.u, REVERSED * float(np.ptp(data.u)))
    last = max(FIRST, 2 * turns[0]) if turns else len(data)
    return data if len(data) <= last else data[: float(data.t[last])]


def _at_rest(
    problem: Problem, identify: Identify, volts: float, start: Structure | None = None
) -> Identification:
    data = problem.records[0].data
    fit = identify(preceded(problem, volts), start)
    judged = data if data.warmup else data[float(data.t[1]) :]
    at_jump = start_at_jump(fit.model, data, volts)
    own = replace(fit.records[0], data=judged, start=at_jump, origin=origin_of(judged))
    known = {**fit.details, "provenance": {**fit.details["provenance"], **provenance(judged)}}
    return replace(fit, data=judged, records=(own,), start=at_jump, details=known)
