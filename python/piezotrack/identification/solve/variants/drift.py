"""Drift of a sensor, fitted with a model that is searched where the residual shows one."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ....errors import DataError, NumericalError
from ...fitted.drift import Drift
from ...problem.objective import Objective

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from ...fitted.identification import Identification
    from ...problem.problem import Problem
    from ...problem.records import Record

__all__ = ["GAIN", "drifts_of", "with_drift_tried", "with_drifts"]

# Share of the cost that drifts have to take away, as an error of the model may look like one, and
# share of the residual from which they are tried: the parameters have taken a part of them.
GAIN, SIGN = 0.2, 0.1
# Time constants of drifts that are taken off a residual, as shares of its window.
TIMES = (0.1, 0.3, 1.0, 10.0)


def with_drift_tried(
    problem: Problem, fit: Identification, search: Callable[[Problem], Identification]
) -> Identification:
    """Search with a drift of each record of which nothing is given and whose residual shows one.

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
        record.drift is None and record.offset and _shows_drift(problem, record, fit)
        for record in problem.records
    ]
    if not any(shown):
        return fit
    try:
        drifted = search(with_drifts(problem, shown))
    except (DataError, NumericalError):
        return fit
    return drifted if drifted.cost < (1.0 - GAIN) * fit.cost else fit


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


def _shows_drift(problem: Problem, record: Record, fit: Identification) -> bool:
    """Return whether a drift lowers the residual of a record, and its drive repeats."""
    data = record.data
    left = data.counted(data.y - fit.simulate(data).x)
    t = data.counted(data.t)
    begin, end = float(t[0]), float(t[-1])
    rms = float(np.std(left))
    drifts = (
        Drift(amplitude=1.0, time=share * (end - begin), begin=begin, end=end) for share in TIMES
    )
    if not any(float(np.std(one.left_of(t, left))) < (1.0 - SIGN) * rms for one in drifts):
        return False
    alone = replace(record, drift=True, history="virgin")
    return "drift_time" in Objective._of(replace(problem, records=(alone,))).ranges
