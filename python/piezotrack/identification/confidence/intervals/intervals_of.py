"""Intervals of confidence of a fit, by the method that is wanted."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...._support.arguments import one_of
from ....errors import ParameterError
from ...fitted.certainty.covariance import normal_reach
from ...fitted.identification import Identification
from .bootstrap import bootstrap_confidence
from .profile import profile_confidence
from .searched_fit import SearchedFit

if TYPE_CHECKING:
    from ...fitted.certainty.confidence import Confidence
    from ...fitted.identified_model import IdentifiedModel

__all__ = ["intervals_of"]


def intervals_of(model: IdentifiedModel, level: float, method: str) -> Confidence:
    """Return the intervals of what was fitted.

    Parameters
    ----------
    model : IdentifiedModel
        The fit.
    level : float
        Between 0 and 1.
    method : {"profile", "bootstrap"}
        What they follow from.

    Returns
    -------
    Confidence
        The intervals.

    Raises
    ------
    ParameterError, DataError, NumericalError
        As for `IdentifiedModel.confidence`.
    """
    normal_reach(level)
    one_of("method", method, ("profile", "bootstrap"))
    if not isinstance(model, Identification):
        raise ParameterError("model", "no record", "what pt.identify returns", verb="has")
    searched = SearchedFit.of(model)
    if method == "profile":
        return profile_confidence(searched, float(level))
    return bootstrap_confidence(searched, float(level))
