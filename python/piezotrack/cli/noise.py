"""``piezotrack noise``: noise of a sensor at rest."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .error_messages import in_words
from .options import (
    Columns,
    DisplacementColumn,
    Interval,
    Out,
    TimeColumn,
    Units,
    can_be_folder,
    list_files,
    of_file,
    windowed,
)

if TYPE_CHECKING:
    from ..identification.sensor_noise import Noise

__all__ = ["noise_command"]


@in_words
def noise_command(
    file: Annotated[Path, typer.Argument(help="Log in CSV, of a sensor at rest.")],
    window: Annotated[
        str | None, typer.Option(metavar="A:B", help="Seconds in which the stage is at rest.")
    ] = None,
    out: Out = Path("results"),
    time: TimeColumn = None,
    displacement: DisplacementColumn = None,
    unit: Units = None,
    dt: Interval = None,
) -> None:
    """Analyse a record at rest: rms, resolution, spectrum and a model of the noise."""
    from .._support.files import make_folder, save_figures, together
    from ..data.reader import read_displacement
    from ..identification.sensor_noise import identify_noise

    columns = Columns(time, None, displacement, unit, dt)
    log = read_displacement(
        file, time=columns.time, displacement=columns.displacement, units=columns.units, dt=dt
    )
    can_be_folder(out)
    log = windowed(log, file, "--window", window)
    with of_file(file):
        found = identify_noise(log)
    with together(make_folder(out)) as folder:
        written = [_write(found, folder), *save_figures({"noise": found.plot()}, folder)]
    print(found.summary())
    list_files(written)


def _write(found: Noise, folder: Path) -> Path:
    """Write the figures as JSON."""
    from .. import __version__
    from .._support.files import write_document

    document = {
        "format": "piezotrack-noise",
        "schema_version": 1,
        "unit": "m, Hz",
        "spread": asdict(found.spread),
        "drift": found.drift,
        "resolution": found.resolution,
        "levels": found.levels,
        "noise": found.noise,
        # JSON has no infinity.
        "bandwidth": None if found.bandwidth_sd is None else found.bandwidth,
        "bandwidth_sd": found.bandwidth_sd,
        "data": {"source": found.data.source, "sha256": found.data.sha256},
        "provenance": {"package": "piezotrack", "version": __version__},
    }
    return write_document(folder / "noise.json", document)
