"""Identification of one kind of stage: by a search or by least squares."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .. import _core
from .._support.messages import quoted
from .._support.progress_bar import ProgressBar
from ..errors import Interrupted, ParameterError
from .history import GAIN
from .least_squares import LeastSquares, solve_least_squares
from .other_histories import other_histories
from .search import search

if TYPE_CHECKING:
    from collections.abc import Mapping

    from ..data.dataset import Dataset
    from ..stages.model_info import ModelInfo
    from .history import History
    from .result import Identification

__all__ = ["check_counts", "identify_kind", "refuse_given"]

# How a search is run, not what it finds.
RUNNING = ("seed", "runs", "threads", "progress")
# Arguments of a search, not of what is searched.
OF_SEARCH = ("method", "swarm", "descents", "seed", "runs", "progress", "callback", "checkpoint")


def identify_kind(
    data: Dataset,
    info: ModelInfo,
    *,
    offset: bool,
    history: History | None,
    of_swarm: Mapping[str, Any],
    least_squares: object,
) -> Identification:
    """Identify a stage of one kind.

    Parameters
    ----------
    data : Dataset
        The record.
    info : ModelInfo
        The kind.
    offset : bool
        Whether an offset of the sensor is fitted.
    history : {"virgin", "settled", "fit"} or None
        What the stage went through before; None for what the record shows.
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
    if info.searched and history is not None:
        return search(data, info, offset=offset, history=history, **of_swarm)
    if info.searched:
        return _as_shown(data, info, offset, of_swarm)
    settings = LeastSquares() if least_squares is None else least_squares
    if not isinstance(settings, LeastSquares):
        raise ParameterError(
            f"least_squares is {quoted(settings)}: expected a pt.identification.LeastSquares"
        )
    try:
        with ProgressBar(of_swarm["progress"], f"identify: {info.name}, least squares"):
            return solve_least_squares(data, info, settings, offset, history)
    except KeyboardInterrupt:
        raise Interrupted("interrupted before the weights were found") from None


def _as_shown(
    data: Dataset, info: ModelInfo, offset: bool, of_swarm: Mapping[str, Any]
) -> Identification:
    """Search with the history that the record shows: more freedom has to lower the cost."""
    fit = virgin = search(data, info, offset=offset, **of_swarm)
    asked = {name: value for name, value in of_swarm.items() if name not in OF_SEARCH}
    for one in other_histories(data, info, fit, offset=offset, asked=asked):
        if one.share * virgin.cost < (1.0 - GAIN) * fit.cost:
            other = search(data, info, offset=offset, history=one.history, **of_swarm)
            fit = other if other.cost < (1.0 - GAIN) * fit.cost else fit
    return fit


def refuse_given(info: ModelInfo, of_swarm: Mapping[str, object], least_squares: object) -> None:
    """Refuse arguments that do not apply to a kind.

    How a search is run may be said of every kind, for calls in a loop over kinds: least squares
    give the same answer from any seed and on any number of threads.

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
