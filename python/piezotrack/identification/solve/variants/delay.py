"""Delay of the displacement, fitted where that lowers the residual."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from ....errors import DataError, NumericalError
from ...fitted.start import Rest
from ...methods.descents import Descents
from ...methods.least_squares import LeastSquares
from ...problem.objective import Objective
from ..judging import NOISY
from ..jump import preceded, rest_of
from ..weights import Structure
from .drift import GAIN as GAIN_OF_SEARCH
from .drift import drifts_of, with_drifts
from .exponent import with_exponent_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from ...fitted.identification import Identification
    from ...methods.choice import Method
    from ...problem.problem import Problem

    Identify = Callable[[Problem, Structure | None, Rest | None], Identification]

__all__ = ["with_delay_tried"]

# Share of the cost that a delay has to take away from a fit by least squares: creep and a lag turn
# the phase as it does. From a search as much as a drift.
GAIN = 0.05
# Up to so many times the noise, a delay changes the structure of a fit little, and beyond, where it
# takes away such a share within it.
NEAR, SIGN = 1.5, 0.01
# Delays from which descents beside a search begin, in samples.
BEGUN = (1.0, 5.0)


def with_delay_tried(
    problem: Problem,
    method: Method,
    start: Structure | None,
    rest: Rest | None,
    identify: Identify,
    threads: int,
) -> Identification:
    """Solve a problem, with a delay of each record where nothing is given and one is shown.

    Parameters
    ----------
    problem : Problem
        The problem.
    method : Descents, ParticleSwarm or LeastSquares
        Its method. Delays are tried by least squares whose dynamics are chosen from the record,
        and by descents for one record where those beside the result show one.
    start : Structure, optional
        Structure that least squares begin with.
    rest : Rest or None
        Rest that another model has shown.
    identify : callable
        What solves a problem from a structure, and from a voltage of rest.
    threads : int
        All cores where it is 0.

    Returns
    -------
    Identification
        The one with delays where these lower the cost by 5 %, of a search by 20 %.
    """
    fit = identify(problem, start, rest)
    given = any(record.delay is not None for record in problem.records)
    if given or fit.cost <= NOISY * min(fit.noises):
        return fit
    records = tuple(replace(record, delay=True) for record in problem.records)
    delayed = replace(problem, records=records)
    gain = GAIN
    try:
        if isinstance(method, LeastSquares) and method.dynamics == "auto":
            late = _by_weights(delayed, fit, start, identify)
        elif isinstance(method, Descents) and _shows_delay(delayed, fit, threads):
            gain, late = GAIN_OF_SEARCH, identify(delayed, None, rest_of(fit))
        else:
            return fit
    except (DataError, NumericalError):
        return fit
    return late if late.cost < (1.0 - gain) * fit.cost else fit


def _by_weights(
    delayed: Problem, fit: Identification, start: Structure | None, identify: Identify
) -> Identification:
    """Fit delays from the structure of a fit, and anew where they change it."""
    rest, near = rest_of(fit), NEAR * min(fit.noises)
    late = identify(delayed, Structure.of(fit, kept=start is not None and start.kept), rest)
    share = GAIN if fit.cost < near else SIGN
    if start is None and late.cost < (1.0 - share) * fit.cost:
        late = min(late, identify(delayed, None, rest), key=lambda one: one.cost)
    if start is None and rest is not None and late.cost > near:
        # Another voltage of rest may stand for the delay.
        late = min(late, identify(delayed, None, Rest(0.0)), key=lambda one: one.cost)
    return late


def _shows_delay(delayed: Problem, fit: Identification, threads: int) -> bool:
    """Return whether a delay lowers the cost of one record beside the result of a search."""
    if len(delayed.records) > 1:
        return False
    near = with_exponent_of(with_drifts(delayed, drifts_of(fit)), fit)
    (record,) = near.records
    rest, start = rest_of(fit), fit.start
    if rest is not None:
        near = preceded(near, rest)
    elif start is not None:
        near = replace(near, records=(replace(record, history=start.history),))
    objective = Objective._of(near, threads)
    values = {name: one.value for name, one in fit.parameters.items()}
    begun = [{**values, "delay": samples * record.data.dt} for samples in BEGUN]
    costs = objective.descend([objective._place(one) for one in begun])[1]
    return float(costs.min()) < (1.0 - GAIN_OF_SEARCH) * fit.cost
