"""``piezotrack reproduce``: figures and tables of the paper, published and obtained."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .error_messages import in_words
from .options import Out, can_be_folder, list_files, refuse_without_effect

__all__ = ["reproduce_command"]


@in_words
def reproduce_command(
    context: typer.Context,
    out: Out = Path("report"),
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
            help="Folder of the measured DBO log, with training.csv and tracking.csv.",
        ),
    ] = None,
) -> None:
    """Repeat the experiments of Xu and Li 2010 on a simulated stage: HTML, PDF and JSON."""
    from ..xu_li_2010.reproduction import reproduce

    if quick:
        refuse_without_effect(context, ("seeds",), "with --quick")
    can_be_folder(out)
    found = reproduce(seeds=2 if quick else seeds, dbo=dbo)
    written = found.save(out)
    print(found.summary())
    list_files(written)
