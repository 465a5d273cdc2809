"""Signals of logs in data frames."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from .._support.messages import quoted
from .._support.units import require
from ..errors import DataError, ParameterError
from .columns import Columns

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

__all__ = ["Frame", "signals_of_frame"]


class Frame(Protocol):
    """A table with named columns, as a pandas or polars data frame."""

    @property
    def columns(self) -> Iterable[Any]:
        """Titles of the columns."""

    def __getitem__(self, title: Any) -> Any:
        """One column."""


def signals_of_frame(
    frame: Frame,
    *,
    time: str | int | None = None,
    drive: str | int | None = None,
    displacement: str | int | None = None,
    units: Mapping[str | int, str] | None = None,
    needs_time: bool = True,
) -> tuple[dict[str, NDArray[np.float64]], str]:
    """Take time, drive and displacement from a data frame.

    Parameters
    ----------
    frame : DataFrame
        As of `Dataset.from_frame`.
    time, drive, displacement, units
        As of `Dataset.from_frame`.
    needs_time : bool, optional
        Whether there has to be a time; else it is not read.

    Returns
    -------
    signals : dict of str to ndarray, shape (n,)
        Time, drive and displacement by these names, SI; without time where it is not needed.
    drive_unit : str
        Unit of the drive.

    Raises
    ------
    DataError, ParameterError
        As of `Dataset.from_frame`.
    """
    # A record has further columns, which are a mapping.
    if isinstance(getattr(frame, "columns", {}), Mapping):
        raise ParameterError(
            "frame", quoted(type(frame).__name__), "a data frame with named columns"
        )
    titles = list(frame.columns)
    columns = Columns([str(title) for title in titles], has_titles=True)
    wanted = {"time": time, "drive": drive, "displacement": displacement}
    roles = columns.roles(wanted, units, needs_time=needs_time)
    signals, unit_of_drive = {}, "V"
    for role, column in roles.items():
        if role == "time" and not needs_time:
            continue
        try:
            values = np.asarray(frame[titles[column.index]], dtype=np.float64)
        except (TypeError, ValueError):
            raise DataError(f"{column} has entries that are no numbers: expected numbers") from None
        unit = require(column.unit)
        signals[role] = unit.to_si(values)
        if role == "drive":
            unit_of_drive = unit.si
    return signals, unit_of_drive
