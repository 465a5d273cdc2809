"""Whether a record shows that its stage had moved before: what a kind gains by other histories."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from .history import GAIN
from .objective import Objective

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from ..data.dataset import Dataset
    from ..stages.model_info import ModelInfo
    from .history import History
    from .result import Identification

    Array = NDArray[np.float64]

__all__ = ["Gaining", "other_histories"]

# Voltages tried before the record, from the best of which a descent starts.
GRID = 15
VOLTAGE = "voltage_before"


class Gaining(NamedTuple):
    """A history that suits a record better than that of a stage that never moved.

    Attributes
    ----------
    history : {"settled", "fit"}
        The history.
    cost : float
        Cost of the minimum with it that is next to the one without it [m].
    """

    history: History
    cost: float


def other_histories(
    data: Dataset,
    info: ModelInfo,
    fit: Identification,
    *,
    offset: bool,
    asked: Mapping[str, Any],
) -> list[Gaining]:
    """Find the histories that lower the cost next to a minimum without one.

    Parameters
    ----------
    data : Dataset
        The record.
    info : ModelInfo
        The kind.
    fit : Identification
        Its fit as of a stage that never moved before the record.
    offset : bool
        Whether an offset of the sensor is fitted.
    asked : mapping
        Further arguments of `Objective`.

    Returns
    -------
    list of Gaining
        Those by which the cost falls enough, the one with less freedom first.
    """
    found = []
    for history in ("settled", "fit"):
        objective = Objective(data, info.name, offset=offset, history=history, **asked)
        cost = float(objective.descend(_starts(objective, fit))[1].min())
        if cost < (1.0 - GAIN) * fit.cost:
            found.append(Gaining(history, cost))
    return found


def _starts(objective: Objective, fit: Identification) -> Array:
    """Where the descent starts: at the parameters of the fit, after the best voltage of a grid."""
    place = [_coordinate(fit, *one) for one in objective.coordinates if one[0] != VOLTAGE]
    if VOLTAGE not in objective.ranges:
        return np.array([place])
    volts = (np.arange(GRID) + 0.5) / GRID
    # After the parameters.
    places = np.column_stack([np.tile(place, (GRID, 1)), volts])
    return places[[int(np.argmin(objective(places)))]]


def _coordinate(fit: Identification, name: str, low: float, high: float, scale: str) -> float:
    """Coordinate of a parameter in the unit box."""
    value = fit.parameters[name].value
    if scale == "log" and value > 0.0:
        low, high, value = math.log(low), math.log(high), math.log(value)
    return min(max((value - low) / (high - low), 0.0), 1.0)
