"""Identification of one model that is searched, from several records at once."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from ..fitted.start import GAIN
from .search import search_parameters

if TYPE_CHECKING:
    from ..fitted.identification import Identification
    from ..methods.choice import Search
    from ..problem.problem import Problem
    from ..problem.records import Record
    from .run import Run

__all__ = ["search_several_records"]

# A history that a record shows and that nobody gave.
SHOWN = (("settled", None), ("fit", None))


def search_several_records(problem: Problem, method: Search, run: Run) -> Identification:
    """Search the parameters of a model on several records, with the histories that they show.

    Parameters
    ----------
    problem : Problem
        The model and the records.
    method : Descents or ParticleSwarm
        What searches.
    run : Run
        How it is run.

    Returns
    -------
    Identification
        The result.

    Raises
    ------
    ParameterError, DataError, NumericalError, Interrupted
        As for `identify`.
    """
    records = problem.records
    fit = search_parameters(problem, method, run)
    shown = [one if one.history else _with_shown(fit, one) for one in records]
    moved = [i for i, one in enumerate(shown) if (one.history, records[i].history) in SHOWN]
    if not moved:
        return fit
    other = search_parameters(replace(problem, records=tuple(shown)), method, run)
    if not other.cost < (1.0 - GAIN) * fit.cost:
        return fit
    # A model that takes one record for virgin shows more of the others than there is.
    for i in moved if len(moved) > 1 else []:
        simpler = [records[k] if k == i else one for k, one in enumerate(shown)]
        less = search_parameters(replace(problem, records=tuple(simpler)), method, run)
        if not other.cost < (1.0 - GAIN) * less.cost:
            shown, other = simpler, less
    return other


def _with_shown(fit: Identification, record: Record) -> Record:
    """Give a record the history that it shows by the stage that never moved before any."""
    fitted = next(one for one in fit.records if one.data is record.data)
    # As of another record: the one that was fitted begins as it was assumed to.
    model = replace(
        fit,
        records=(),
        start=None,
        delay=fitted.delay,
        offset_fitted=fitted.offset_fitted,
        drift=fitted.drift,
    )
    return replace(record, history=model.start_on(record.data).history)
