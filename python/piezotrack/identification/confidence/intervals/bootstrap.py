"""Intervals from refits of resampled noise."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ....errors import DataError
from ...fitted.certainty.confidence import Confidence, ParameterInterval
from ...fitted.certainty.covariance import Interval
from ..estimate import without_repeated
from .searched_fit import OF_SHORTEST_LAG

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .searched_fit import SearchedFit

    Array = NDArray[np.float64]

__all__ = ["bootstrap_confidence"]

# Rise of the cost, in squares of its noise, from which a lower minimum matters.
LOWER = 0.2
# Refits and their seed; fewest samples of which a noise is resampled.
DRAWS, SEED, FEWEST = 200, 1, 80


def bootstrap_confidence(searched: SearchedFit, level: float) -> Confidence:
    """Return intervals from refits of resampled noise.

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
    DataError
        A record is too short to resample its noise.
    """
    fit, notes = searched.fit, []
    noises = []
    for record in fit.records:
        data = record.data
        assert data is not None
        residual = data.counted(data.y - fit.simulate(data, offset=record.offset).x)
        if residual.size < FEWEST:
            raise DataError(
                f"the record has {residual.size} samples: too short to resample its noise, "
                f"expected {FEWEST} or more"
            )
        noises.append(without_repeated(residual, data)[0])
    (least, cost), _ = searched.core.profiles(searched.values.tolist(), [])
    refits = searched.core.refits(least, noises, DRAWS, SEED)
    drawn = np.array([values for values, _ in refits])
    tied = {drawn.shape[1] - len(searched.core.tied) + i: name
            for i, name in enumerate(searched.core.tied)}  # fmt: skip
    shortest, lower = searched.beside(least, cost, LOWER / searched.freedom)
    if shortest:
        notes.append(OF_SHORTEST_LAG)
    parameters = {}
    for place, name in {**searched.names, **tied}.items():
        values = np.sort(drawn[:, place])
        ends = np.quantile(values, [0.5 - 0.5 * level, 0.5 + 0.5 * level])
        estimate = searched.estimate(name)
        searched_here = place < searched.values.size
        value = least[place] if searched_here else estimate.value
        if shortest:
            ends = np.array([min(ends[0], estimate.value), max(ends[1], estimate.value)])
        bounds = searched.core.coordinates[place][2:] if searched_here else None
        parameters[name] = ParameterInterval(
            value=value,
            unit=estimate.unit,
            symbol=estimate.symbol,
            interval=Interval(float(ends[0]), float(ends[1])),
            bounds=bounds,
            on_bound=bounds is not None and (value in bounds or estimate.at_bound),
            shape=None,
            factor=searched.factors.get(name, 1.0),
            values=values,
            rises=np.empty(0),
        )
    return Confidence(
        method="bootstrap",
        level=level,
        parameters=parameters,
        cost=cost,
        lower=lower,
        samples=searched.samples,
        draws=len(refits),
        notes=tuple(notes),
    )
