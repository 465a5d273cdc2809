"""Writing a record as a log."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from .._support.files.writing import replacing, write_columns
from .._support.messages import quoted
from .._support.units import drive_word, split_unit
from ..errors import ParameterError
from .columns import is_usual
from .formats import FORMATS
from .formats.table import WrittenColumn

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping

    import numpy as np
    from numpy.typing import NDArray

    from .formats.table import Format

    Array = NDArray[np.float64]

__all__ = ["format_to_write", "save_log", "write_log"]


class Signals(Protocol):
    """A record as it is written."""

    @property
    def t(self) -> Array: ...

    @property
    def u(self) -> Array: ...

    @property
    def y(self) -> Array: ...

    @property
    def recorded(self) -> Array: ...

    @property
    def drive_unit(self) -> str: ...

    @property
    def columns(self) -> Mapping[str, Array]: ...

    @property
    def column_units(self) -> Mapping[str, str]: ...


def write_log(log: Signals, path: Path) -> Path:
    """Write a log as a CSV file for `read`.

    Parameters
    ----------
    log : Dataset
        The record; its warm-up is left out.
    path : pathlib.Path
        The file.

    Returns
    -------
    pathlib.Path
        The file.
    """
    return write_columns(
        path, {"time_s": log.t, "voltage_V": log.u, "displacement_um": 1e6 * log.recorded}
    )


def save_log(log: Signals, path: str | os.PathLike[str]) -> Path:
    """Write a log in the format of the file's ending: see `Dataset.save`."""
    try:
        file = Path(path)
    except TypeError:
        raise ParameterError("path", quoted(path), "the name of a file") from None
    known = format_to_write(file)
    columns = [
        WrittenColumn("time", "s", log.t, "time_s"),
        _drive(log),
        WrittenColumn("displacement", "m", log.recorded, "displacement_m"),
    ]
    columns += [
        _further(name, log.column_units[name], values) for name, values in log.columns.items()
    ]
    with replacing(file) as temporary:
        known.write(temporary, columns)
    return file


def format_to_write(file: Path) -> Format:
    """Return the format that the ending of a file stands for, or refuse one that is not written."""
    ending = file.suffix.lower()
    written = [known for known in FORMATS if known.writes is not None]
    for known in written:
        if ending in known.endings:
            return known
    endings = ", ".join(known.endings[0] for known in written)
    words = f"{file.name}: expected an ending of a format that is written: {endings}"
    raise ParameterError(words, argument="path")


def _drive(log: Signals) -> WrittenColumn:
    name = drive_word(log.drive_unit)
    return WrittenColumn(name, log.drive_unit, log.u, f"{name}_{log.drive_unit}")


def _further(name: str, unit: str, values: Array) -> WrittenColumn:
    """Give a further column a title from which a reader gets its name and unit."""
    plain = re.sub(r"\s+", " ", name)
    bare = split_unit(plain)[0]
    if is_usual(plain) or is_usual(bare):
        # It would be taken for one of the three that are written before it.
        plain = f"column {plain}"
    is_plain = not unit and split_unit(plain) == (plain, "")
    return WrittenColumn(plain, unit, values, plain if is_plain else f"{plain} [{unit}]")
