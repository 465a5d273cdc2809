"""MATLAB's files: MAT v5 to v7 through SciPy, v7.3 as HDF5."""

from __future__ import annotations

import re
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from . import hdf5
from .mat_elements import check_elements
from .table import Channel, ChannelTable, Format, split_matrix

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

    from .source import Source
    from .table import WrittenColumn

__all__ = ["FORMAT"]

# Longest name of a variable in MATLAB.
LONGEST = 63
# Structures within structures that are followed.
DEEPEST = 16
UNITS = ("units", "unit")


def _opens(source: Source) -> ChannelTable:
    if source.head.startswith(b"MATLAB 7.3"):
        return hdf5.open_matlab(source)
    if not source.head.startswith(b"MATLAB 5.0"):
        raise source.error(
            "is not a MAT file of version 5, 7 or 7.3: expected one as save('log.mat') or "
            "save('log.mat', '-v7.3') writes"
        )
    with source.decoding("MAT"):
        from scipy.io import loadmat

        check_elements(source)
        found = loadmat(source.path, struct_as_record=True, chars_as_strings=True)
        variables = {name: value for name, value in found.items() if not name.startswith("__")}
        channels = list(_channels(variables, "", {}, DEEPEST))
    return ChannelTable(source, channels)


def _channels(
    variables: Mapping[str, Any], group: str, stated: Mapping[str, str], depth: int
) -> Iterator[Channel]:
    """Find the numbers in variables or fields, with the units in a structure beside them."""
    stated = {**stated, **_units(variables)}
    for name, value in variables.items():
        if not isinstance(value, np.ndarray):
            continue
        if value.dtype.names is not None:
            if value.size == 1 and depth and name not in UNITS:
                record = value.reshape(-1)[0]
                fields = {part: record[part] for part in value.dtype.names}
                path = f"{group}/{name}" if group else name
                yield from _channels(fields, path, _of_field(stated, name), depth - 1)
        elif value.dtype.kind in "biuf":
            for column, place, count in split_matrix(name, value.shape):
                unit = stated.get(column, stated.get(name))
                yield Channel(column, count, partial(_part, value, place), group, unit)


def _units(variables: Mapping[str, Any]) -> dict[str, str]:
    """Read the texts of a structure ``units`` whose fields are named like the variables."""
    units: dict[str, str] = {}
    for name in UNITS:
        value = variables.get(name)
        if isinstance(value, np.ndarray) and value.dtype.names is not None and value.size == 1:
            record = value.reshape(-1)[0]
            for field in value.dtype.names:
                text = np.asarray(record[field])
                if text.dtype.kind == "U" and text.size <= 1:
                    units[field] = str(text.reshape(-1)[0]) if text.size else ""
    return units


def _of_field(stated: Mapping[str, str], name: str) -> dict[str, str]:
    """Return the units of what is in a field, as Simulink's signals.values have none."""
    return {"values": stated[name]} if name in stated else {}


def _part(values: np.ndarray, place: Any) -> Any:
    return values[place]


def _names(columns: Sequence[WrittenColumn]) -> list[str]:
    """Return names that MATLAB takes, each once."""
    names: list[str] = []
    for column in columns:
        plain = re.sub(r"[^A-Za-z0-9]+", "_", column.name).strip("_") or "column"
        plain = (plain if plain[0].isalpha() else f"x_{plain}")[: LONGEST - 4]
        name, number = plain, 2
        while name in (*names, *UNITS):
            name, number = f"{plain}_{number}", number + 1
        names.append(name)
    return names


def _writes(path: Path, columns: Sequence[WrittenColumn]) -> None:
    """Write one column vector for each column, and their units in the structure ``units``."""
    from scipy.io import savemat

    names = _names(columns)
    variables: dict[str, Any] = {
        name: column.values for name, column in zip(names, columns, strict=True)
    }
    variables["units"] = {name: column.unit for name, column in zip(names, columns, strict=True)}
    with path.open("wb") as file:
        savemat(file, variables, do_compression=True, oned_as="column", long_field_names=True)
        # The first 116 bytes are a text with the date; without it the same log is the same file.
        file.seek(0)
        file.write(b"MATLAB 5.0 MAT-file, written by piezotrack".ljust(116))


FORMAT = Format(
    name="MAT",
    endings=(".mat",),
    opens=_opens,
    begins=lambda head: head.startswith((b"MATLAB 5.0 MAT-file", b"MATLAB 7.3 MAT-file")),
    writes=_writes,
)
