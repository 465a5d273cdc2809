"""``piezotrack simulate``: response of a model to a drive."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from ...errors import DataError, ParameterError
from ..command import Argument, Option, command
from ..option_groups import DriveColumns
from ..options import ModelFile, Zero, in_order, of_file
from ..output import Output
from .loop_options import known_model, zero_words

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = ["simulate_command"]


@command()
def simulate_command(
    model: ModelFile,
    log: Annotated[Path, Argument("Log with time and drive", "FILE")],
    *,
    columns: DriveColumns,
    hold: Annotated[
        Literal["foh", "zoh"], Option("Drive between samples: linear, constant")
    ] = "foh",
    zero: Zero = False,
    output: Output,
) -> None:
    """Simulate the response of a model to the drive of a log."""
    from ..._support.files.writing import (
        picture_files,
        result_set,
        save_figures,
        write_columns,
    )
    from ..._support.units import drive_word, shown_unit
    from ...data.reader import drive_dataset
    from ...identification.views.plot import plot_response

    in_order(model, log)
    known = known_model(model, zero=zero)
    record = drive_dataset(log, **columns.arguments)
    name, scale = shown_unit(known.drive_unit)
    if record.drive_unit != known.drive_unit and "m" in (record.drive_unit, known.drive_unit):
        raise ParameterError(
            f"{log.name}: the drive is in {shown_unit(record.drive_unit)[0]}: expected {name}, "
            f"as that of {model.name}"
        )
    output.will_write(["simulated.csv", *picture_files("simulated")])
    t, u = record.t, record.u
    interval = float(t[-1] - t[0]) / (t.size - 1)
    with of_file(log):
        at_first = known.model.equilibrium(float(u[0]))
        x = known.displacement(u, interval, hold=hold, initial=at_first)
    table = {
        "time_s": t,
        f"{drive_word(known.drive_unit)}_{name}": scale * u,
        "displacement_um": 1e6 * x,
    }

    def save(place: Path) -> list[Path]:
        with result_set(place) as folder:
            picture = plot_response(
                *(t, u, x),
                title=f"{known.model.info.title} driven by {log.name}",
                drive_unit=known.drive_unit,
                measured=_measured(log, columns, x),
            )
            written = [write_columns(folder / "simulated.csv", table)]
            return written + save_figures({"simulated": picture}, folder)

    remarks = known.extrapolation_notes(u, interval)
    words = (
        f"{t.size} samples from rest at {scale * u[0]:.4g} {name}, drive from "
        f"{scale * u.min():.4g} to {scale * u.max():.4g} {name}: displacement "
        f"from {1e6 * x.min():.4g} to {1e6 * x.max():.4g} um{zero_words(known)}"
    )
    document = {
        "samples": t.size,
        "dt": {"value": interval, "unit": "s"},
        "drive_range": {"value": [float(u.min()), float(u.max())], "unit": known.drive_unit},
        "displacement_range": {"value": [float(x.min()), float(x.max())], "unit": "m"},
        "notes": remarks,
    }
    notes = [f"note  {remark}" for remark in remarks]
    output.show("\n".join([words, *notes]), document, output.write(save))


def _measured(log: Path, columns: DriveColumns, x: Array) -> Array | None:
    """Return the displacement of a log that has one [m], its mean that of the simulated one."""
    from ...data.reader import read

    try:
        y = read(log, **columns.arguments).y
    except DataError:
        return None
    shifted: Array = y - y.mean() + x.mean()
    return shifted
