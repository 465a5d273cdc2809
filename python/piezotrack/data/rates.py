"""Signals at a lower and at a higher sampling rate, with their times."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .resampling import interpolated, low_passed

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = ["at_higher_rate", "at_lower_rate"]


def at_lower_rate(t: Array, factor: int, first: int) -> tuple[Array, Callable[[Array], Array]]:
    """Return every factor-th time from `first` on, and what filters and thins a signal."""
    return t[first::factor], lambda signal: low_passed(signal, factor)[first::factor]


def at_higher_rate(t: Array, dt: float, factor: int) -> tuple[Array, Callable[[Array], Array]]:
    """Return times with others inserted between them, and what interpolates a signal."""
    count = (t.size - 1) * factor + 1
    return t[0] + np.arange(count) * (dt / factor), lambda signal: interpolated(signal, factor)
