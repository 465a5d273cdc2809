"""A record whose drive jumps to its first sample from rest at 0 V, as loggers that start late."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...errors import ParameterError
from ..fitted.model_entries import origin_of, provenance
from ..fitted.notes import carried_by_first_samples
from ..fitted.start import GAIN, start_at_jump

if TYPE_CHECKING:
    from collections.abc import Callable

    from ...data.dataset import Dataset
    from ..fitted.identification import Identification
    from ..problem.problem import Problem
    from ..problem.records import Record

__all__ = ["with_rest", "with_rest_tried"]

# A drive that begins nearer to 0 than by this share of its range does not jump.
LEAST_JUMP = 0.02


def with_rest_tried(
    problem: Problem, fit: Identification, identify: Callable[[Problem], Identification]
) -> Identification:
    """Try that the stage was at rest at 0 V where the first samples carry the residual.

    Parameters
    ----------
    problem : Problem
        The problem, of one record.
    fit : Identification
        Its result without a jump.
    identify : callable
        What solves a problem.

    Returns
    -------
    Identification
        The one with the jump where it lowers the residual by 2 %: its window begins at the second
        sample, as the jump lies at the first.
    """
    (record,) = problem.records
    data = record.data
    if record.history is not None or data.warmup or not _may_jump(data):
        return fit
    run = fit.simulate(data, offset=fit.offset)
    if not carried_by_first_samples(data.counted(data.y - run.x)):
        return fit
    jumped = with_rest(problem, identify)
    left = jumped.data.counted(fit.simulate(jumped.data, offset=fit.offset).x - jumped.data.y)
    before = float(np.sqrt(np.mean(left**2)))
    return jumped if jumped.cost < (1.0 - GAIN) * before else fit


def with_rest(problem: Problem, identify: Callable[[Problem], Identification]) -> Identification:
    """Identify a stage that was at rest at 0 V until the drive jumped to the first sample.

    Parameters
    ----------
    problem : Problem
        The problem, of one record.
    identify : callable
        What solves a problem.

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
    (record,) = problem.records
    data = record.data
    fit = identify(replace(problem, records=(_at_rest_before(record),)))
    judged = data if data.warmup else data[float(data.t[1]) :]
    start = start_at_jump(fit.model, data)
    own = replace(fit.records[0], data=judged, start=start, origin=origin_of(judged))
    known = {**fit.details, "provenance": {**fit.details["provenance"], **provenance(judged)}}
    return replace(fit, data=judged, records=(own,), start=start, details=known)


def _may_jump(data: Dataset) -> bool:
    low, high = float(data.u.min()), float(data.u.max())
    return abs(float(data.u[0])) > LEAST_JUMP * (high - low)


def _at_rest_before(record: Record) -> Record:
    """Put a sample of 0 V before a record, which is warm-up as its first one is."""
    before = record.data._preceded(0.0)
    begin = before.t[0] if record.data.warmup else before.full.t[2]
    return replace(record, data=before[float(begin) :], history="virgin")
