"""``piezotrack simulate``: response of a model to a drive."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ...errors import ParameterError
from ..error_messages import report_errors
from ..option_groups import Columns
from ..options import (
    DriveColumn,
    HoldOption,
    Interval,
    Json,
    ModelFile,
    Out,
    Overwrite,
    Quiet,
    TimeColumn,
    Units,
    of_file,
)
from ..output import Output

__all__ = ["simulate_command"]


@report_errors
def simulate_command(
    model: ModelFile,
    drive_file: Annotated[Path, typer.Argument(metavar="DRIVE", help="Log with time and drive.")],
    out: Out = Path("results"),
    overwrite: Overwrite = False,
    time: TimeColumn = None,
    drive: DriveColumn = None,
    unit: Units = None,
    dt: Interval = None,
    hold: HoldOption = "foh",
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Simulate the response of a model to a drive."""
    from ..._support.files.writing import (
        make_folder,
        picture_files,
        result_set,
        save_figures,
        write_columns,
    )
    from ..._support.units import drive_word, shown_unit
    from ...data.reader import drive_dataset
    from ...identification.fitted.model_file import load
    from ...identification.views.plot import plot_response

    known = load(model)
    columns = Columns(time=time, drive=drive, unit=unit, dt=dt)
    log = drive_dataset(drive_file, **columns.arguments)
    name, scale = shown_unit(known.drive_unit)
    if log.drive_unit != known.drive_unit and "m" in (log.drive_unit, known.drive_unit):
        raise ParameterError(
            f"{drive_file.name}: the drive is in {shown_unit(log.drive_unit)[0]}: expected {name}, "
            f"as that of {model.name}"
        )
    result = Output(out, overwrite=overwrite, json=json, quiet=quiet)
    result.will_write(["simulated.csv", *picture_files("simulated")])
    t, u = log.t, log.u
    interval = float(t[-1] - t[0]) / (t.size - 1)
    with of_file(drive_file):
        at_first = known.model.equilibrium(float(u[0]))
        x = known.displacement(u, interval, hold=hold, initial=at_first)
    table = {
        "time_s": t,
        f"{drive_word(known.drive_unit)}_{name}": scale * u,
        "displacement_um": 1e6 * x,
    }
    with result_set(make_folder(out)) as folder:
        written = [write_columns(folder / "simulated.csv", table)]
        picture = plot_response(
            *(t, u, x),
            title=f"{known.model.info.title} driven by {drive_file.name}",
            drive_unit=known.drive_unit,
        )
        written += save_figures({"simulated": picture}, folder)
    remarks = known.extrapolation_notes(u, interval)
    words = (
        f"{t.size} samples from rest at {scale * u[0]:.4g} {name}, drive from "
        f"{scale * u.min():.4g} to {scale * u.max():.4g} {name}: displacement "
        f"from {1e6 * x.min():.4g} to {1e6 * x.max():.4g} um"
    )
    document = {
        "samples": t.size,
        "dt": {"value": interval, "unit": "s"},
        "drive_range": {"value": [float(u.min()), float(u.max())], "unit": known.drive_unit},
        "displacement_range": {"value": [float(x.min()), float(x.max())], "unit": "m"},
        "notes": remarks,
    }
    notes = [f"note  {remark}" for remark in remarks]
    result.show("\n".join([words, *notes]), document, written)
