"""``piezotrack noise``: noise of a sensor at rest."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..error_messages import report_errors
from ..option_groups import Columns
from ..options import (
    DisplacementColumn,
    Interval,
    Json,
    Out,
    Overwrite,
    Quiet,
    TimeColumn,
    Units,
    of_file,
    windowed,
)
from ..output import Output

__all__ = ["noise_command"]


@report_errors
def noise_command(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Log of a sensor at rest.")],
    window: Annotated[
        str | None,
        typer.Option(
            metavar="A:B", help="Seconds in which the stage is at rest; default the whole log."
        ),
    ] = None,
    out: Out = Path("results"),
    overwrite: Overwrite = False,
    time: TimeColumn = None,
    displacement: DisplacementColumn = None,
    unit: Units = None,
    dt: Interval = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Analyse the noise of a sensor at rest.

    Its rms, resolution and spectrum, and a model of it.
    """
    from ..._support.files.writing import picture_files
    from ...data.reader import read_displacement
    from ...identification.experiments.sensor_noise import identify_noise

    columns = Columns(time=time, displacement=displacement, unit=unit, dt=dt)
    log = read_displacement(file, **columns.arguments)
    result = Output(out, overwrite=overwrite, json=json, quiet=quiet)
    result.will_write(["noise.json", *picture_files("noise")])
    log = windowed(log, file, "--window", window)
    with of_file(file):
        found = identify_noise(log)
    written = found.save(out)
    result.show(found.summary(), found.document(), written)
