"""Intervals from profiles of the cost."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ...fitted.certainty.confidence import Confidence, ParameterInterval
from ...fitted.certainty.covariance import Interval, normal_reach
from .searched_fit import OF_SHORTEST_LAG

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...fitted.certainty.confidence import Shape
    from .searched_fit import SearchedFit

    Array = NDArray[np.float64]

__all__ = ["profile_confidence"]

# Share of the threshold by which the cost of the fit is above the least one where that is lower.
LOWER = 0.05
# Share of the threshold by which a profile rises between two minima.
BETWEEN = 0.05
# Rise over the threshold up to which a curve is kept.
KEPT = 1e3


def profile_confidence(searched: SearchedFit, level: float) -> Confidence:
    """Return intervals from profiles of its cost.

    Parameters
    ----------
    searched : SearchedFit
        The fit.
    level : float
        Between 0 and 1.

    Returns
    -------
    Confidence
        The intervals.

    Raises
    ------
    NumericalError
        The fit leaves no residual.
    """
    fit, freedom, notes = searched.fit, searched.freedom, []
    quantile = normal_reach(level) ** 2
    limited = {one.lower: one.text for one in fit.constraints}
    for name in sorted(set(limited) & set(searched.names.values())):
        notes.append(f"{name} has no profile, as the inequality {limited[name]} moves with it")
    wanted = [place for place, name in searched.names.items() if name not in limited]
    (least, cost), _ = searched.core.profiles(searched.values.tolist(), [])
    if searched.beside(least, cost, LOWER * quantile / freedom)[1] is not None:
        searched = searched.at(least)
    rises = {
        place: searched.factors[searched.names[place]] * quantile / freedom for place in wanted
    }
    (least, cost), curves = searched.core.profiles(least, list(rises.items()))
    least_rise = min(rises.values(), default=quantile / freedom)
    shortest, lower = searched.beside(least, cost, LOWER * least_rise)
    if shortest:
        notes.append(OF_SHORTEST_LAG)
    covered = set() if fit.covariance is None else set(fit.covariance.names)
    parameters = {}
    for place, (points, (below, upper)) in zip(wanted, curves, strict=True):
        name = searched.names[place]
        values, costs = np.array(points).T
        curve = ((costs / cost) ** 2 - 1.0) / rises[place]
        ends = [-math.inf if below is None else below, math.inf if upper is None else upper]
        if shortest:
            fitted = float(searched.values[place])
            ends = [min(ends[0], fitted), max(ends[1], fitted)]
        estimate, bounds = searched.estimate(name), searched.core.coordinates[place][2:]
        on_bound = least[place] in bounds or estimate.at_bound
        kept = curve <= KEPT
        parameters[name] = ParameterInterval(
            value=least[place],
            unit=estimate.unit,
            symbol=estimate.symbol,
            interval=Interval(*ends),
            bounds=bounds,
            on_bound=on_bound,
            shape=_shape(curve, below is None, upper is None),
            factor=searched.factors[name],
            values=values[kept],
            rises=np.maximum(curve[kept], 0.0),
        )
    bare = [name for name in parameters if name not in covered]
    for on_bound in (True, False):
        names = [name for name in bare if parameters[name].on_bound is on_bound]
        if names:
            reason = "on a bound and without covariance" if on_bound else "without covariance"
            notes.append(
                f"{', '.join(names)}: {reason}; the threshold has the largest factor of the others"
            )
    return Confidence(
        method="profile",
        level=level,
        parameters=parameters,
        cost=cost,
        lower=lower,
        samples=searched.samples,
        draws=0,
        notes=tuple(notes),
    )


def _shape(curve: Array, open_below: bool, open_above: bool) -> Shape:
    """Shape of a profile, its rise over the threshold from bound to bound."""
    if _minima(curve) > 1:
        return "several minima"
    if open_below and open_above:
        return "flat"
    if open_below or open_above:
        return "open below" if open_below else "open above"
    return "bounded"


def _minima(curve: Array) -> int:
    """Count the minima below the threshold with a rise between them."""
    count, falling, last = 0, True, math.inf
    # `last` is the lowest rise while the curve falls, and the highest while it rises.
    for rise in curve.tolist():
        if falling and rise > last + BETWEEN:
            count += last < 1.0
            falling, last = False, rise
        elif not falling and rise < last - BETWEEN:
            falling, last = True, rise
        else:
            last = min(last, rise) if falling else max(last, rise)
    return count + (falling and last < 1.0)
