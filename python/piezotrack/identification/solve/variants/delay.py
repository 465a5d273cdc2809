"""Delay of the displacement, fitted where that lowers the residual."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from ....errors import DataError, NumericalError
from ...methods.least_squares import LeastSquares
from ..jump import voltage_of_rest
from ..weights import Structure

if TYPE_CHECKING:
    from collections.abc import Callable

    from ...fitted.identification import Identification
    from ...methods.choice import Method
    from ...problem.problem import Problem

__all__ = ["with_delay_tried"]

# Share of the cost that a delay has to take away: creep and a lag turn the phase as it does.
GAIN = 0.05
# A residual of so many times the noise has hardly anything but noise in it; up to so many times, a
# delay changes its structure little, and beyond, where it takes away such a share within it.
NOISY, NEAR, SIGN = 1.05, 1.5, 0.01


def with_delay_tried(
    problem: Problem,
    method: Method,
    start: Structure | None,
    rest: float | None,
    identify: Callable[[Problem, Structure | None, float | None], Identification],
) -> Identification:
    """Solve a problem, with a delay of each record where nothing is given and one is shown.

    Parameters
    ----------
    problem : Problem
        The problem.
    method : Descents, ParticleSwarm or LeastSquares
        Its method; delays are tried by least squares whose dynamics are chosen from the record.
    start : Structure, optional
        Structure that least squares begin with.
    rest : float or None
        Voltage of rest [V] that another model has shown.
    identify : callable
        What solves a problem from a structure, and from a voltage of rest.

    Returns
    -------
    Identification
        The one with delays where these lower the cost by 5 %.
    """
    fit = identify(problem, start, rest)
    given = any(record.delay is not None for record in problem.records)
    if given or not isinstance(method, LeastSquares) or method.dynamics != "auto":
        return fit
    noise = min(fit.noises)
    if fit.cost <= NOISY * noise:
        return fit
    records = tuple(replace(record, delay=True) for record in problem.records)
    delayed, rest = replace(problem, records=records), voltage_of_rest(fit)
    least = (1.0 - GAIN) * fit.cost
    try:
        kept = start is not None and start.kept
        late = identify(delayed, Structure.of(fit, kept=kept), rest)
        shown = least if fit.cost < NEAR * noise else (1.0 - SIGN) * fit.cost
        if start is None and late.cost < shown:
            late = min(late, identify(delayed, None, rest), key=lambda one: one.cost)
    except (DataError, NumericalError):
        return fit
    return late if late.cost < least else fit
