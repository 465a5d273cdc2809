"""``piezotrack reproduce``: figures and tables of the paper, published and obtained."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..error_messages import report_errors
from ..options import Json, Out, Overwrite, Quiet, refuse_without_effect
from ..output import Output

__all__ = ["reproduce_command"]


@report_errors
def reproduce_command(
    context: typer.Context,
    out: Out = Path("report"),
    overwrite: Overwrite = False,
    seeds: Annotated[
        int,
        typer.Option(
            help="Number of seeds of the sensor noise; the table shows medians over them."
        ),
    ] = 20,
    quick: Annotated[bool, typer.Option("--quick", help="Two seeds, for a first look.")] = False,
    dbo: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            help="Folder of the measured DBO log, with training.csv and tracking.csv; default "
            "none.",
        ),
    ] = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Repeat the experiments of Xu and Li 2010.

    On a simulated stage, with a report as Markdown, pictures and JSON.
    """
    from ...xu_li_2010.reproduction import REPORT, reproduce

    if quick:
        refuse_without_effect(context, ("seeds",), "with --quick")
    result = Output(out, overwrite=overwrite, json=json, quiet=quiet)
    result.will_write(REPORT)
    found = reproduce(seeds=2 if quick else seeds, dbo=dbo, progress=result.progress)
    result.show(found.summary(), found.document(), found.save(out))
