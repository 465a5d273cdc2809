"""Drift of a sensor, fitted with a model that is searched where the residual shows one."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from .... import _core
from ....errors import DataError, NumericalError
from ...fitted.drift import Drift

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from ...fitted.identification import Identification
    from ...problem.problem import Problem
    from ...problem.records import Record

__all__ = [
    "GAIN",
    "drifts_of",
    "turns_often",
    "with_drift_of_few_turns",
    "with_drift_tried",
    "with_drifts",
]

# Share of the cost that drifts have to take away, as an error of the model may look like one, and
# share of the residual from which they are tried: the parameters have taken a part of them.
# A fit near the noise cannot lose as much: of it, half of what is above the noise.
GAIN, SIGN, GAIN_ABOVE = 0.2, 0.1, 0.5
# What a drift under a drive of few turns may leave, in multiples of the noise.
NOTHING_BUT_NOISE = 1.1
# Time constants of drifts that are taken off a residual, as shares of its window.
TIMES = (0.1, 0.3, 1.0, 10.0)


def with_drift_tried(
    problem: Problem, fit: Identification, search: Callable[[Problem], Identification]
) -> Identification:
    """Search with a drift of each record of many turns whose residual shows one.

    Parameters
    ----------
    problem : Problem
        The problem.
    fit : Identification
        Its result without a drift.
    search : callable
        What solves a problem.

    Returns
    -------
    Identification
        The one with drifts where these lower the cost by 20 %.
    """
    shown = [
        _may_drift(record) and turns_often(record) and _shows_drift(record, fit)
        for record in problem.records
    ]
    return _drifted(problem, fit, shown, search, GAIN * fit.cost)


def with_drift_of_few_turns(
    problem: Problem, fit: Identification, search: Callable[[Problem], Identification]
) -> Identification:
    """Search with a drift of each record of few turns, where a fit leaves more than noise.

    A loop that is not closed looks like a drift, and the parameters have taken most of one: the
    residual does not show it.

    Parameters
    ----------
    problem : Problem
        The problem.
    fit : Identification
        Its result without a drift.
    search : callable
        What solves a problem.

    Returns
    -------
    Identification
        The one with drifts where these lower the cost by 20 %, or by half of what is above the
        noise, and leave nothing but noise: an error of the model stays beside a drift.
    """
    if fit.cost <= NOTHING_BUT_NOISE * max(fit.noises):
        return fit
    few = [_may_drift(record) and not turns_often(record) for record in problem.records]
    above = fit.cost - max(fit.noises)
    drifted = _drifted(problem, fit, few, search, min(GAIN * fit.cost, GAIN_ABOVE * above))
    return drifted if drifted.cost <= NOTHING_BUT_NOISE * max(drifted.noises) else fit


def _drifted(
    problem: Problem,
    fit: Identification,
    drifting: list[bool],
    search: Callable[[Problem], Identification],
    gain: float,
) -> Identification:
    """Search with drifts of some records; the fit where they lower the cost by less than a gain."""
    if not any(drifting):
        return fit
    try:
        drifted = search(with_drifts(problem, drifting))
    except (DataError, NumericalError):
        return fit
    return drifted if drifted.cost < fit.cost - gain else fit


def with_drifts(problem: Problem, drifting: Iterable[bool]) -> Problem:
    """Fit a drift of records of which nothing is given.

    Parameters
    ----------
    problem : Problem
        The problem.
    drifting : iterable of bool
        Which of its records have a drift.

    Returns
    -------
    Problem
        The problem with these drifts.
    """
    records = tuple(
        replace(record, drift=True) if drifts and record.drift is None else record
        for record, drifts in zip(problem.records, drifting, strict=True)
    )
    return replace(problem, records=records)


def drifts_of(fit: Identification) -> list[bool]:
    """Return which records have a drift.

    Parameters
    ----------
    fit : Identification
        The result.

    Returns
    -------
    list of bool
        One for each record.
    """
    return [one.drift is not None for one in fit.records]


def _may_drift(record: Record) -> bool:
    """Return whether nothing is given of a drift."""
    return record.drift is None and record.offset


def turns_often(record: Record) -> bool:
    """Return whether the drive turns so often that an open loop does not look like a drift.

    Parameters
    ----------
    record : Record
        The record.

    Returns
    -------
    bool
        Six times or more, by a tenth of its range.
    """
    return _core.turns_often(record.data.counted(record.data.u))


def _shows_drift(record: Record, fit: Identification) -> bool:
    """Return whether a drift lowers the residual of a record."""
    data = record.data
    left = data.counted(data.y - fit.simulate(data).x)
    t = data.counted(data.t)
    begin, end = float(t[0]), float(t[-1])
    rms = float(np.std(left))
    drifts = (
        Drift(amplitude=1.0, time=share * (end - begin), begin=begin, end=end) for share in TIMES
    )
    return any(float(np.std(one.left_of(t, left))) < (1.0 - SIGN) * rms for one in drifts)
