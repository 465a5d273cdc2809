"""Identification of one model, from one record."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from ..._support.display.progress_bar import ProgressBar
from ..._support.display.progress_parts import Parts
from ...errors import Interrupted
from ..fitted.start import GAIN
from ..methods.descents import Descents
from ..methods.least_squares import LeastSquares
from ..methods.particle_swarm import ParticleSwarm
from .earlier_motion import earlier_motion, refined_cost
from .jump import rest_of, with_rest, with_rest_tried
from .search import search_parameters
from .several_records import search_several_records
from .variants.delay import with_delay_tried
from .variants.drift import (
    drifts_of,
    with_drift_of_few_turns,
    with_drift_tried,
    with_drifts,
)
from .variants.exponent import may_have_exponent, with_exponent_tried
from .weights import Structure, solve_least_squares

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from ..fitted.identification import Identification
    from ..fitted.start import History, Rest
    from ..methods.choice import Method, Search
    from ..problem.problem import Problem
    from .run import Run

    Solve = Callable[[Problem], Identification]

__all__ = ["identify_model", "weights_of"]

# Parts of the time of descents and of a swarm, for the progress: without an earlier motion, and
# with it.
HISTORIES, SWARM = (2.0, 1.0), (9.0, 1.0)


def identify_model(
    problem: Problem,
    method: Method,
    run: Run,
    start: Structure | None = None,
    rest: Rest | None = None,
) -> Identification:
    """Identify one model, by its method.

    Parameters
    ----------
    problem : Problem
        The model and the records.
    method : Descents, ParticleSwarm or LeastSquares
        The one that the model needs.
    run : Run
        How it is run.
    start : Structure, optional
        Structure that least squares begin with.
    rest : Rest, optional
        Rest of the stage, until the drive jumped to the first sample, that another model has shown.

    Returns
    -------
    Identification
        The result.

    Raises
    ------
    ParameterError, DataError, NumericalError, Interrupted
        As for `identify`.
    """

    def still(other: Problem, start: Structure | None, rest: Rest | None) -> Identification:
        def plain(one: Problem, begun: Structure | None = None) -> Identification:
            return _identify(one, method, run, begun or start)

        def with_exponent(one: Problem, begun: Structure | None = None) -> Identification:
            return _with_exponent(one, plain(one, begun), method, run)

        def with_drift(fit: Identification, search: Solve) -> Identification:
            return with_drift_tried(other, fit, search) if isinstance(method, Descents) else fit

        def at_rest(shown: Structure | None = None) -> Identification:
            fit = with_rest(other, plain, rest, shown)
            # From the voltage of rest that the exponent 1 shows: each fit takes longer.
            known = rest_of(fit)
            fit = with_drift(fit, lambda one: with_rest(one, plain, known))
            if not may_have_exponent(other, fit):
                return fit
            drifting = with_drifts(other, drifts_of(fit))
            better = with_rest(drifting, with_exponent, rest_of(fit))
            return better if better.cost < (1.0 - GAIN) * fit.cost else fit

        if rest is not None or any(record.history == "rest" for record in other.records):
            return at_rest()
        fit = with_drift(plain(other), plain)
        fit = _with_exponent(with_drifts(other, drifts_of(fit)), fit, method, run)
        # What is worse than another model without a jump lacks more than that.
        if len(other.records) > 1 or (start is not None and fit.cost > start.cost):
            return fit
        first = start is None and isinstance(method, LeastSquares)
        shown = Structure.of(fit, kept=True) if first else None
        return with_rest_tried(other, fit, partial(at_rest, shown))

    def identify(other: Problem, start: Structure | None, rest: Rest | None) -> Identification:
        fit = still(other, start, rest)
        if not isinstance(method, Descents):
            return fit
        return with_drift_of_few_turns(other, fit, lambda one: still(one, start, rest))

    return with_delay_tried(problem, method, start, rest, identify, run.threads)


def _identify(
    problem: Problem, method: Method, run: Run, start: Structure | None
) -> Identification:
    if isinstance(method, LeastSquares):
        return _weights(problem, method, run, start)
    if len(problem.records) > 1:
        return search_several_records(problem, method, run)

    if problem.records[0].history is not None:
        return search_parameters(problem, method, run)
    return _with_history_shown(problem, method, run)


def _with_exponent(
    problem: Problem, fit: Identification, method: Method, run: Run
) -> Identification:
    """Try exponents other than 1."""
    if isinstance(method, LeastSquares):
        return fit

    def search(other: Problem, by: Search | None) -> Identification:
        return search_parameters(other, by or method, run)

    return with_exponent_tried(problem, fit, search, run.threads)


def _weights(
    problem: Problem, method: LeastSquares, run: Run, start: Structure | None
) -> Identification:
    """Find the weights of a model by least squares."""
    with weights_of(problem.model, run):
        return solve_least_squares(problem, method, run, start)


@contextmanager
def weights_of(model: str, run: Run) -> Iterator[None]:
    """Show that weights of a model are being found, and say so where Ctrl-C comes.

    Parameters
    ----------
    model : str
        Name of the model.
    run : Run
        How it is run.

    Yields
    ------
    None

    Raises
    ------
    Interrupted
        Ctrl-C came.
    """
    try:
        with ProgressBar(run.progress, f"identify: {model}, least squares"):
            yield
    except KeyboardInterrupt:
        raise Interrupted("interrupted before the weights were found") from None


def _with_history_shown(problem: Problem, method: Search, run: Run) -> Identification:
    """Search with the history that a record shows: more freedom has to lower the cost.

    A swarm runs once, as of a stage that never moved before. From its best candidate and a few
    random places, descents search with another history; its cost is compared with that of the
    minimum next to the best candidate of the swarm.
    """
    (record,) = problem.records

    def with_history(history: History) -> Problem:
        return replace(problem, records=(replace(record, history=history),))

    swarms = isinstance(method, ParticleSwarm)
    parts = Parts(SWARM if swarms else HISTORIES)
    with parts.begin(0):
        fit = virgin = search_parameters(with_history("virgin"), method, run)
    alone = least = refined_cost(with_history("virgin"), virgin, run.threads)
    for other in earlier_motion(problem, virgin, alone, run.threads):
        if other.share * alone < (1.0 - GAIN) * least:
            with parts.begin(1):
                other_fit = search_parameters(
                    with_history(other.history), method, run, virgin if swarms else None
                )
            if other_fit.cost < (1.0 - GAIN) * least:
                fit, least = other_fit, other_fit.cost
    return fit
