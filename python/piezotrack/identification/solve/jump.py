"""A record whose drive jumps to its first sample from rest, as loggers that start late show."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ... import _core
from ...errors import ParameterError
from ..fitted.model_entries import origin_of, provenance
from ..fitted.notes import carried_by_first_samples
from ..fitted.start import GAIN, Rest, least_voltage, start_at_jump
from ..methods.least_squares import LeastSquares
from .judging import NOISY
from .weights import Structure

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from ...data.dataset import Dataset
    from ..fitted.identification import Identification
    from ..problem.problem import Problem

    Identify = Callable[[Problem, Structure | None], Identification]

__all__ = ["preceded", "rest_of", "with_rest", "with_rest_tried"]

# Voltages of rest with a fit each, spread and about the best of these.
COARSE, ABOUT = 9, 6
# Samples of the beginning of a record on which they are compared: so many, or twice those up to
# where the drive has reversed by such a share of its range.
FIRST, REVERSED = 1500, 0.1
# Ratio of residuals of the beginning that are alike, how many of these are tried on the whole
# record, and ratio of its residual to that of the beginning, or of that and the noise, that ends
# this.
ALIKE, TRIED, APART = 1.1, 3, 1.5
# Fits with a voltage of rest that was found from the one before, at most.
ROUNDS = 3
# Share of the stroke below which a residual is no motion, but what a search leaves.
UNSEEN = 1e-5
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
    if record.history is not None or data.warmup or fit.cost < UNSEEN * fit.stroke:
        return fit
    if not _begins_apart(fit, data):
        return fit
    jumped = at_rest()
    later = float(np.sqrt(np.mean(_left(fit, jumped.data) ** 2)))
    # The first sample, where the jump lies, may be all that it explains.
    explains = jumped.cost < min(later, (1.0 - GAIN) * fit.cost)
    return jumped if explains else fit


def rest_of(fit: Identification) -> Rest | None:
    """Return the rest of a stage until the drive jumped, if it was at rest."""
    return None if fit.start is None else fit.start.rest


def with_rest(
    problem: Problem,
    identify: Identify,
    known: Rest | None = None,
    shown: Structure | None = None,
) -> Identification:
    """Identify a stage that was at rest until the drive jumped to the first sample.

    At rest at a voltage, or at another one where that lowers the residual by 2 %. The drive jumps
    at the first sample, or within the interval before, whichever explains more.

    Parameters
    ----------
    problem : Problem
        The problem, of one record.
    identify : callable
        What solves a problem, from a structure if one is given.
    known : Rest, optional
        Rest that another fit has shown, about whose voltage it is searched; 0 V, and a grid where
        that is far off, without.
    shown : Structure, optional
        Structure of a fit without a jump: the one with it where that leaves nothing but noise.

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
    kinds = (False,) if data.hold == "zoh" else (False, True)
    if known is not None:
        return _nearer(problem, identify, _at_rest(problem, identify, known))
    if shown is not None:
        fit = _at_rest(problem, identify, Rest(0.0), shown)
        if fit.cost < NOISY * min(fit.noises):
            return fit
    fit = _at_rest(problem, identify, Rest(0.0))
    for within in kinds[1:]:
        if _begins_apart(fit, fit.data):
            other = _at_rest(problem, identify, Rest(0.0, within))
            fit = min(fit, other, key=lambda one: one.cost)
    if _begins_apart(fit, fit.data):
        begun = _begun(problem)
        start = Structure.of(fit) if isinstance(fit.method, LeastSquares) else None
        costs: dict[Rest, float] = {}

        def cost(within: bool, volts: float) -> float:
            rest = Rest(volts, within)
            costs[rest] = _at_rest(begun, identify, rest, start).cost
            return costs[rest]

        for within in kinds:
            of_kind = partial(cost, within)
            least_voltage(of_kind, _voltages(data), (COARSE, ABOUT))
            least = min(costs.values())
            if least < APART * fit.noises[0]:
                break
        # The beginning may explain several alike, of which the whole record shows one.
        alike = [one for one in sorted(costs, key=costs.__getitem__) if costs[one] < ALIKE * least]
        best = fit
        for rest in alike[:TRIED]:
            best = min(best, _at_rest(problem, identify, rest), key=lambda one: one.cost)
            if best.cost < APART * least:
                break
        fit = best if best.cost < (1.0 - GAIN) * fit.cost else fit
    return _nearer(problem, identify, fit)


def _nearer(problem: Problem, identify: Identify, fit: Identification) -> Identification:
    """Move the voltage of rest to where a fit explains the record best."""
    for _ in range(ROUNDS):
        better = best_rest(fit, problem.records[0].data)
        if better is None:
            break
        other = _at_rest(problem, identify, better)
        if other.cost >= (1.0 - GAIN) * fit.cost:
            break
        fit = other
    return fit


def best_rest(fit: Identification, data: Dataset) -> Rest | None:
    """Return the rest, of any voltage, with which a model explains a record best.

    Parameters
    ----------
    fit : Identification
        The model, and the rest that it was fitted with.
    data : Dataset
        The record.

    Returns
    -------
    Rest or None
        The rest; None where none lowers the residual by 2 %.
    """
    known = rest_of(fit) or Rest(0.0)

    def cost(volts: float, data: Dataset = data) -> float:
        start = start_at_jump(fit.model, data, known._replace(voltage=volts))
        own = replace(fit.records[0], start=start)
        left = _left(replace(fit, start=start, records=(own,)), data)[1:]
        return float(np.std(left) if fit.offset_fitted else np.sqrt(np.mean(left**2)))

    first = _first(data)
    volts = least_voltage(lambda volts: cost(volts, first), _voltages(data))
    better = cost(volts) < (1.0 - GAIN) * cost(known.voltage)
    return known._replace(voltage=volts) if better else None


def preceded(problem: Problem, rest: Rest) -> Problem:
    """Put a stage at rest before the drive jumps to the first sample.

    Parameters
    ----------
    problem : Problem
        The problem, of one record.
    rest : Rest
        The rest.

    Returns
    -------
    Problem
        With a record that begins at rest, whose window begins after the jump.
    """
    (record,) = problem.records
    before = record.data._preceded(*rest)
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
    problem: Problem, identify: Identify, rest: Rest, start: Structure | None = None
) -> Identification:
    data = problem.records[0].data
    fit = identify(preceded(problem, rest), start)
    judged = data if data.warmup else data[float(data.t[1]) :]
    at_jump = start_at_jump(fit.model, data, rest)
    own = replace(fit.records[0], data=judged, start=at_jump, origin=origin_of(judged))
    known = {**fit.details, "provenance": {**fit.details["provenance"], **provenance(judged)}}
    return replace(fit, data=judged, records=(own,), start=at_jump, details=known)
