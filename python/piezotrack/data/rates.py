"""Records at a lower and at a higher sampling rate."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .dataset import Dataset
from .resampling import interpolated, low_passed

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = ["at_higher_rate", "at_lower_rate"]


def at_lower_rate(whole: Dataset, factor: int, first: int) -> Dataset:
    """Return every factor-th sample from `first` on, low-pass filtered before."""
    return _changed(
        whole, whole.t[first::factor], lambda signal: low_passed(signal, factor)[first::factor]
    )


def at_higher_rate(whole: Dataset, factor: int) -> Dataset:
    """Return a record with samples inserted between the given ones."""
    count = (len(whole) - 1) * factor + 1
    times = whole.t[0] + np.arange(count) * (whole.dt / factor)
    return _changed(whole, times, lambda signal: interpolated(signal, factor))


def _changed(whole: Dataset, times: Array, change: Callable[[Array], Array]) -> Dataset:
    """Change all signals of a record, whose drive then goes straight from sample to sample."""
    return Dataset(
        u=change(whole.u),
        y=change(whole.y),
        t=times,
        hold="foh",
        drive_unit=whole.drive_unit,
        columns={name: change(values) for name, values in whole.columns.items()},
        column_units=whole.column_units,
        source=whole.source,
        notes=whole.notes,
    )
