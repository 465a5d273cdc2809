"""Problems with what fits by least squares have shown of slow parts and delays."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..variants.drift import with_drifts
from ..variants.slow_parts import MOST

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ...problem.problem import Problem
    from ..weights import Structure

__all__ = ["as_shown", "with_delays"]


def with_delays(problem: Problem, start: Structure) -> Problem:
    """Fit a delay where nothing is given and a fit has one, and none elsewhere.

    Parameters
    ----------
    problem : Problem
        The problem.
    start : Structure
        Structure of the fit.

    Returns
    -------
    Problem
        The problem with these delays.
    """
    records = tuple(
        replace(record, delay=delayed) if record.delay is None else record
        for record, delayed in zip(problem.records, start.delayed, strict=True)
    )
    return replace(problem, records=records)


def as_shown(problem: Problem, start: Structure) -> Problem:
    """Return a problem with the creep, drifts and delays of a fit where none are given.

    Parameters
    ----------
    problem : Problem
        The problem.
    start : Structure
        Structure of the fit.

    Returns
    -------
    Problem
        With three time constants of the creep at most.
    """
    if problem.creep is None and start.creep_times:
        problem = replace(problem, creep=_few(start.creep_times))
    drifting = with_drifts(problem, [time is not None for time in start.drifts])
    return with_delays(drifting, start)


def _few(times: Sequence[float]) -> tuple[float, ...]:
    """Return as many time constants as a search has, from the shortest to the longest."""
    places = np.linspace(0, len(times) - 1, min(len(times), MOST))
    return tuple(times[round(place)] for place in places)
