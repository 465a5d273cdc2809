"""Identification of one model, from one record."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from ..._support.display.progress_bar import ProgressBar
from ...errors import Interrupted
from ..fitted.start import GAIN
from ..methods.least_squares import LeastSquares
from .earlier_motion import earlier_motion
from .search import search_parameters
from .several_records import search_several_records
from .weights import solve_least_squares

if TYPE_CHECKING:
    from ..fitted.identification import Identification
    from ..fitted.start import History
    from ..methods.choice import Method, Search
    from ..problem.problem import Problem
    from .run import Run

__all__ = ["identify_model"]


def identify_model(problem: Problem, method: Method, run: Run) -> Identification:
    """Identify one model, by its method.

    Parameters
    ----------
    problem : Problem
        The model and the records.
    method : Descents, ParticleSwarm or LeastSquares
        The one that the model needs.
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
    if isinstance(method, LeastSquares):
        return _weights(problem, method, run)
    if len(problem.records) > 1:
        return search_several_records(problem, method, run)
    if problem.records[0].history is not None:
        return search_parameters(problem, method, run)
    return _with_history_shown(problem, method, run)


def _weights(problem: Problem, method: LeastSquares, run: Run) -> Identification:
    """Find the weights of a model by least squares."""
    try:
        with ProgressBar(run.progress, f"identify: {problem.model}, least squares"):
            return solve_least_squares(problem, method, run.threads)
    except KeyboardInterrupt:
        raise Interrupted("interrupted before the weights were found") from None


def _with_history_shown(problem: Problem, method: Search, run: Run) -> Identification:
    """Search with the history that a record shows: more freedom has to lower the cost."""
    (record,) = problem.records

    def search(history: History) -> Identification:
        with_history = replace(record, history=history)
        return search_parameters(replace(problem, records=(with_history,)), method, run)

    fit = virgin = search("virgin")
    # A part of the record may show a drift where the whole of it does not.
    shown = record if fit.drift else replace(record, drift=False)
    for other in earlier_motion(replace(problem, records=(shown,)), fit, run.threads):
        if other.share * virgin.cost < (1.0 - GAIN) * fit.cost:
            found = search(other.history)
            fit = found if found.cost < (1.0 - GAIN) * fit.cost else fit
    return fit
