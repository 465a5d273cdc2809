"""MATLAB's files: MAT v5 and v7, and v7.3, which is HDF5."""

from __future__ import annotations

import re
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ...._support.units import split_unit
from ..table import Channel, ChannelTable, Format, split_matrix
from . import hdf5
from .mat_elements import Variable, read_variables

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

    from ..source import Source
    from ..table import WrittenColumn

__all__ = ["FORMAT"]

# Longest name of a variable in MATLAB.
LONGEST = 63
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
        variables = {one.name: one for one in read_variables(source)}
        channels = list(_channels(variables, "", {}))
    return ChannelTable(source, channels)


def _channels(
    variables: Mapping[str, Variable], group: str, inherited: Mapping[str, str]
) -> Iterator[Channel]:
    """Find the numbers in variables or fields, with the units in a structure beside them."""
    stated = {**inherited, **_units(variables)}
    for name, variable in variables.items():
        values = variable.values
        if isinstance(values, dict) and name not in UNITS:
            # Simulink's signals.values has the unit of signals.
            inner = {"values": stated[name]} if name in stated else {}
            yield from _channels(values, f"{group}/{name}" if group else name, inner)
        elif isinstance(values, np.ndarray):
            for column, place, count in split_matrix(name, variable.shape):
                unit = stated.get(column, stated.get(name))
                yield Channel(column, count, partial(_part, values, place), group, unit)


def _units(variables: Mapping[str, Variable]) -> dict[str, str]:
    """Read the texts of a structure ``units`` whose fields are named like the variables."""
    units: dict[str, str] = {}
    for name in UNITS:
        fields = variables[name].values if name in variables else None
        if isinstance(fields, dict):
            texts = ((field, one.values) for field, one in fields.items())
            units |= {field: text for field, text in texts if isinstance(text, str)}
            units |= {field: "" for field, one in fields.items() if 0 in one.shape}
    return units


def _part(values: np.ndarray, place: Any) -> Any:
    return values[place]


def _names(columns: Sequence[WrittenColumn]) -> list[str]:
    """Return names that MATLAB takes, each once."""
    names: list[str] = []
    for column in columns:
        plain = re.sub(r"[^A-Za-z0-9]+", "_", column.name).strip("_") or "column"
        plain = (plain if plain[0].isalpha() else f"x_{plain}")[: LONGEST - 4]
        # The unit is in the structure, and would be read twice.
        plain = f"{plain}_" if split_unit(plain)[1] else plain
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
