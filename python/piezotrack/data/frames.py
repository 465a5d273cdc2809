"""Logs in data frames."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from .._support.messages import quoted
from .._support.units import require
from ..errors import DataError, ParameterError
from .columns import Columns
from .dataset import Dataset

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from .dataset import Hold

__all__ = ["Frame", "dataset_of_frame"]


class Frame(Protocol):
    """A table with named columns, as a pandas or polars data frame."""

    @property
    def columns(self) -> Iterable[Any]:
        """Titles of the columns."""

    def __getitem__(self, title: Any) -> Any:
        """One column."""


def dataset_of_frame(
    frame: Frame,
    *,
    time: str | int | None = None,
    drive: str | int | None = None,
    displacement: str | int | None = None,
    units: Mapping[str | int, str] | None = None,
    dt: float | None = None,
    hold: Hold = "foh",
) -> Dataset:
    """Make a record of a data frame: see `Dataset.from_frame`."""
    if not hasattr(frame, "columns") or isinstance(frame, Dataset):
        raise ParameterError(
            f"frame is {quoted(type(frame).__name__)}: expected a data frame with named columns"
        )
    titles = list(frame.columns)
    columns = Columns([str(title) for title in titles], has_titles=True)
    wanted = {"time": time, "drive": drive, "displacement": displacement}
    roles = columns.roles(wanted, units, needs_time=dt is None)
    signals, si = {}, {}
    for role, column in roles.items():
        if role == "time" and dt is not None:
            continue
        try:
            values = np.asarray(frame[titles[column.index]], dtype=np.float64)
        except (TypeError, ValueError):
            raise DataError(f"{column} has entries that are no numbers: expected numbers") from None
        unit = require(column.unit)
        signals[role], si[role] = unit.to_si(values), unit.si
    return Dataset(
        u=signals["drive"],
        y=signals["displacement"],
        t=signals.get("time"),
        dt=dt,
        hold=hold,
        drive_unit=si["drive"],
        source="data frame",
    )
