"""Checked arguments of a record: factors, limits of time and further columns."""

from __future__ import annotations

import math
from collections.abc import Mapping
from numbers import Integral
from typing import TYPE_CHECKING

from .._support.arrays import real, signal_of
from .._support.messages import listed, quoted
from ..errors import ParameterError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]

__all__ = ["decimation_factor", "further_columns", "time_limit"]


def decimation_factor(value: object) -> int:
    """Check the factor of a decimation or an interpolation."""
    if isinstance(value, bool) or not isinstance(value, Integral) or value < 2:
        raise ParameterError(f"factor is {quoted(value)}: expected a whole number, 2 or more")
    return int(value)


def time_limit(name: str, value: object) -> float:
    """Check a limit of a window of time [s]."""
    number = real(value)
    if not math.isfinite(number):
        raise ParameterError(
            f"{name} is {quoted(value)}: expected a finite number of seconds or None"
        )
    return number


def further_columns(
    columns: Mapping[str, ArrayLike] | None, units: Mapping[str, str] | None, u: Array
) -> tuple[dict[str, Array], dict[str, str]]:
    """Check the further columns and their units; a missing unit becomes an empty text."""
    columns, units = columns or {}, units or {}
    for argument, mapping in (("columns", columns), ("column_units", units)):
        if not isinstance(mapping, Mapping):
            raise ParameterError(f"{argument} is {quoted(mapping)}: expected a mapping by name")
    for name in (*columns, *units):
        if name not in columns or not isinstance(name, str):
            known = listed(list(columns)) or "none"
            raise ParameterError(
                f"{quoted(name)} is not the name of a column: the names are {known}"
            )
    for name, unit in units.items():
        if not isinstance(unit, str):
            raise ParameterError(
                f"column_units has {quoted(unit)} for {quoted(name)}: expected text"
            )
    kept = {
        name: signal_of(f"column {quoted(name)}", values, like=u, finite=False)
        for name, values in columns.items()
    }
    return kept, {name: units.get(name, "") for name in kept}
