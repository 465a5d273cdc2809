"""Identification of one kind of stage: by a search or by least squares."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from ... import _core
from ..._support.messages import quoted
from ..._support.progress_bar import ProgressBar
from ...errors import Interrupted, ParameterError
from ..fitted.start import GAIN
from ..methods.least_squares import LeastSquares
from .earlier_motion import other_histories
from .search import search_records
from .weights import solve_least_squares

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from ...stages.model_info import ModelInfo
    from ..fitted.identification import Identification
    from ..problem.records import Asked

__all__ = ["check_counts", "identify_kind", "identify_weights", "refuse_given"]

# How a search is run, not what it finds.
RUNNING = ("seed", "runs", "threads", "progress")
# Arguments of a search, not of what is searched.
OF_SEARCH = ("method", "swarm", "descents", "seed", "runs", "progress", "callback", "checkpoint")


def identify_kind(
    one: Asked, info: ModelInfo, *, of_swarm: Mapping[str, Any], least_squares: object
) -> Identification:
    """Identify a stage of one kind from one record.

    Parameters
    ----------
    one : Asked
        The record, and what is asked of it.
    info : ModelInfo
        The kind.
    of_swarm, least_squares : mapping, object
        Arguments for one of the two ways, not yet checked; those for the other are not used.

    Returns
    -------
    Identification
        The result.

    Raises
    ------
    ParameterError, DataError, NumericalError, Interrupted
        As for `identify`.
    """
    if not info.searched:
        return identify_weights((one,), info, of_swarm=of_swarm, least_squares=least_squares)
    if one.history is not None:
        return search_records((one,), info, **of_swarm)
    return _as_shown(one, info, of_swarm)


def identify_weights(
    records: Sequence[Asked],
    info: ModelInfo,
    *,
    of_swarm: Mapping[str, Any],
    least_squares: object,
) -> Identification:
    """Identify a stage whose weights least squares find, from one or several records.

    Parameters
    ----------
    records : sequence of Asked
        The records, each with what is asked of it alone.
    info : ModelInfo
        The kind.
    of_swarm, least_squares : mapping, object
        As for `identify_kind`.

    Returns
    -------
    Identification
        The result.

    Raises
    ------
    ParameterError, DataError, Interrupted
        As for `identify`.
    """
    settings = LeastSquares() if least_squares is None else least_squares
    if not isinstance(settings, LeastSquares):
        raise ParameterError(
            f"least_squares is {quoted(settings)}: expected a pt.identification.LeastSquares"
        )
    threads = of_swarm["threads"]
    count = 0 if threads is None else _core.as_count("threads", threads)
    try:
        with ProgressBar(of_swarm["progress"], f"identify: {info.name}, least squares"):
            return solve_least_squares(records, info, settings, count)
    except KeyboardInterrupt:
        raise Interrupted("interrupted before the weights were found") from None


def _as_shown(one: Asked, info: ModelInfo, of_swarm: Mapping[str, Any]) -> Identification:
    """Search with the history that the record shows: more freedom has to lower the cost."""
    fit = virgin = search_records((replace(one, history="virgin"),), info, **of_swarm)
    asked = {name: value for name, value in of_swarm.items() if name not in OF_SEARCH}
    # A part of the record may show a drift where the whole of it does not.
    asked |= {"delay": one.delay, "drift": one.drift if fit.drift else False}
    for other in other_histories(one.data, info, fit, offset=one.offset, asked=asked):
        if other.share * virgin.cost < (1.0 - GAIN) * fit.cost:
            found = search_records((replace(one, history=other.history),), info, **of_swarm)
            fit = found if found.cost < (1.0 - GAIN) * fit.cost else fit
    return fit


def refuse_given(info: ModelInfo, of_swarm: Mapping[str, object], least_squares: object) -> None:
    """Refuse arguments that do not apply to a kind.

    How a search is run may be said of every kind, for calls in a loop over kinds: least squares
    give the same answer from any seed.

    Parameters
    ----------
    info : ModelInfo
        The kind.
    of_swarm, least_squares : mapping, object
        Arguments for one of the two ways; None where not given.

    Raises
    ------
    ParameterError
        One is given for the other way.
    """
    how = "are searched" if info.searched else "follow by least squares"
    check_counts(of_swarm)
    given = {"least_squares": least_squares} if info.searched else of_swarm
    for name, value in given.items():
        if value is not None and name not in RUNNING:
            raise ParameterError(
                f"{name} is {quoted(value)}: expected none with the model {info.name!r}, whose "
                f"parameters {how}"
            )


def check_counts(of_swarm: Mapping[str, object]) -> None:
    """Refuse counts that are none, also where least squares alone are the answer.

    Parameters
    ----------
    of_swarm : mapping
        Arguments of a search; None where not given.

    Raises
    ------
    ParameterError
        ``seed``, ``runs`` or ``threads`` is no count.
    """
    for name in ("seed", "runs", "threads"):
        if of_swarm[name] is not None:
            _core.as_count(name, of_swarm[name])
