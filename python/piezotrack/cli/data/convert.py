"""``piezotrack convert``: a log in another format."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from ...errors import ParameterError
from ..command import Argument, command
from ..option_groups import LogOptions
from ..options import LogFile, Overwrite
from ..output import Printing

__all__ = ["convert_command"]


@command()
def convert_command(
    file: LogFile,
    to: Annotated[Path, Argument("File to write: .csv, .npz, .mat or .parquet", "OUT")],
    *,
    reading: LogOptions,
    overwrite: Overwrite = False,
    printing: Printing,
) -> None:
    """Write a log in another format: CSV, NPZ, MAT or Parquet.

    In s, V and m, with the units in the titles; every number is kept to the last bit.
    """
    from ...data.log_file import format_to_write

    format_to_write(to)
    # A log that is missing may be due to names the wrong way round.
    if file.exists() and to.exists() and not overwrite:
        raise ParameterError(f"{to} exists: expected --overwrite, or another name")
    log = reading.log(file)
    words = f"{len(log)} samples, {log.duration:.6g} s at {1.0 / log.dt:.6g} Hz"
    notes = [f"note  {note}" for note in log.notes]
    document = {"samples": len(log), "dt": {"value": log.dt, "unit": "s"}, "notes": log.notes}
    printing.show("\n".join([words, *notes]), document, [log.save(to)])
