"""``piezotrack export``: a controller for firmware or for another program."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from ...errors import ParameterError
from ..error_messages import report_errors
from ..options import (
    Duration,
    Json,
    Out,
    Overwrite,
    Period,
    Quiet,
    of_file,
    refuse_without_effect,
)
from ..output import Output

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ...export.write import Exported

__all__ = ["export_command"]


@report_errors
def export_command(
    context: typer.Context,
    controller: Annotated[
        Path, typer.Argument(metavar="CONTROLLER", help="Controller file in JSON.")
    ],
    to: Annotated[
        Literal["c99", "library", "json", "fmu"],
        typer.Option(
            help="C99 without a library, C that calls libpiezotrack, coefficients in JSON, or a "
            "co-simulation unit (FMI 2.0)."
        ),
    ] = "c99",
    out: Out = Path("results"),
    overwrite: Overwrite = False,
    name: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Name of files and functions; default that of CONTROLLER.",
            show_default=False,
        ),
    ] = None,
    single: Annotated[
        bool, typer.Option("--float", help="Numbers of 4 bytes in place of 8.")
    ] = False,
    reference: Annotated[
        str | None,
        typer.Option(
            metavar="TEXT|FILE",
            help="Motion that repeats, as of `track`: the feedforward is played from a table of "
            "one period.",
            show_default=False,
        ),
    ] = None,
    table: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="One period of a feedforward of your own to play, as `learn` writes it.",
            show_default=False,
        ),
    ] = None,
    duration: Duration = None,
    period: Period = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Write a controller as C, coefficients or FMU."""
    from ...control.controller.load import load_controller
    from ...export.write import export_controller, export_files
    from ...references.parse import reference_of

    result = Output(out, overwrite=overwrite, json=json, quiet=quiet)
    chosen = controller.stem.replace("-", "_") if name is None else name
    try:
        names = export_files(to, chosen)
    except ParameterError as error:
        if name is not None:
            raise
        raise ParameterError(f"{error}; --name gives one", argument="--name") from None
    if single and to in ("json", "library"):
        raise ParameterError("--float", f"no effect with --to {to}", "it left out", verb="has")
    if reference is None:
        refuse_without_effect(context, ("duration", "period"), "without --reference")
    known = load_controller(controller)
    volts = None if table is None else _table(table, known.dt, known.drive_unit)
    motion = None
    if reference is not None:
        motion = reference_of(reference, duration=duration, period=period)
    result.will_write(names)
    with of_file(controller):
        done = export_controller(
            known, out, to=to, name=chosen, single=single, reference=motion, table=volts
        )
    result.show(f"{known!r}\n{done}", _document(done), done.files)


def _table(file: Path, dt: float, unit: str) -> NDArray[np.float64]:
    """Read one period of a feedforward, with a sample for each interval."""
    from ...data.reader import drive_dataset

    record = drive_dataset(file)
    if abs(record.dt - dt) > 1e-6 * dt:
        raise ParameterError(
            f"--table {file} has samples every {1e3 * record.dt:g} ms: expected those of the "
            f"controller, every {1e3 * dt:g} ms"
        )
    if record.drive_unit != unit:
        raise ParameterError(
            f"--table {file} has a drive in {record.drive_unit}: expected {unit}, as the controller"
        )
    return record.u


def _document(done: Exported) -> dict[str, Any]:
    return {
        "state_bytes": done.state_bytes,
        "additions": done.additions,
        "multiplications": done.multiplications,
        "divisions": done.divisions,
        "bound": done.bound,
        "note": done.note,
    }
