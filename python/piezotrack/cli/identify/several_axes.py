"""Several drives and displacements in ``piezotrack identify``: modes that they share."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from ...errors import ParameterError
from ..command import refuse_without_effect
from ..options import column

if TYPE_CHECKING:
    from pathlib import Path

    from ..option_groups import LogOptions
    from ..output import Output

__all__ = ["identify_several", "is_several"]

# Arrays of a record in a file of NumPy, where no others are named.
ARRAYS = {"drive": "u", "displacement": "y"}
# Options that act on several axes.
ACTING = {
    *("files", "drive", "displacement", "period", "time", "unit", "dt", "rate", "skip"),
    *("verbose", "json", "quiet", "out", "overwrite", "format", "width"),
}


def is_several(files: list[Path], reading: LogOptions) -> bool:
    """Whether the columns, or the arrays of a file of NumPy, are those of several axes."""
    from ...multiaxis.reading import are_axes

    if any("," in (one or "") for one in (reading.drive, reading.displacement)):
        return True
    drive, displacement = reading.drive or ARRAYS["drive"], reading.displacement
    return all(are_axes(file, drive, displacement or ARRAYS["displacement"]) for file in files)


def identify_several(
    files: list[Path], reading: LogOptions, period: float | None, output: Output
) -> None:
    """Identify the modes of several axes from logs, each a realisation, or from records."""
    from ..._support.files.writing import picture_files
    from ...multiaxis.identify import identify_axes
    from ...multiaxis.reading import read_axes

    others = [one.name for one in click.get_current_context().command.params if one.name]
    refuse_without_effect([name for name in others if name not in ACTING], "with several axes")
    names = {}
    arrays = all(file.suffix.lower() == ".npz" for file in files)
    for name, default in ARRAYS.items():
        if (text := getattr(reading, name) or (default if arrays else None)) is None:
            raise ParameterError(f"--{name}", "missing", "columns of all axes, divided by commas")
        names[name] = [column(one.strip()) or one for one in text.split(",")]
    output.will_write(["axes.csv", "axes.json", *picture_files("axes")])
    arguments = reading.arguments
    for name in names:
        arguments.pop(name, None)
    records = read_axes(
        files,
        drives=names["drive"],
        displacements=names["displacement"],
        period=period,
        **arguments,
    )
    model = identify_axes(records)
    output.show(model.summary(), model.document(), output.write(model.save))
