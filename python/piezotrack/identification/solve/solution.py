"""The solution of a problem, by the method that its model needs."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from ..problem.problem import AUTO
from .one_model import identify_model
from .selecting.selection import identify_best
from .variants.between_samples import with_interpolation_tried

if TYPE_CHECKING:
    from ..fitted.identification import Identification
    from ..methods.choice import MethodChoice
    from ..problem.problem import Problem
    from .run import Run

__all__ = ["solve"]


def solve(problem: Problem, methods: MethodChoice, run: Run) -> Identification:
    """Solve a problem.

    Parameters
    ----------
    problem : Problem
        The model, or ``"auto"``, and the records.
    methods : MethodChoice
        The methods, of which the one that the model needs is used.
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

    def identify(one: Problem) -> Identification:
        if one.model != AUTO:
            return identify_model(one, methods.method(one.info), run)
        return identify_best(one, methods, run)

    return _with_arguments(with_interpolation_tried(problem, identify), problem)


def _with_arguments(fit: Identification, problem: Problem) -> Identification:
    """Put the arguments that are not the defaults into the provenance of a fit."""
    given = {name: value for name, value in problem.settings().items() if name != "model"}
    records = problem.record_settings()
    if len(records) == 1:
        given |= records[0]
    elif any(records):
        given["records"] = records
    if not given:
        return fit
    if isinstance(known := given.get("parameters"), dict):
        # The order in which they were given changes nothing.
        given["parameters"] = dict(sorted(known.items()))
    origin = {**fit.details["provenance"], "arguments": given}
    return replace(fit, details={**fit.details, "provenance": origin})
