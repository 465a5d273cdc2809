"""``piezotrack reproduce``: the paper's figures and tables, published beside obtained."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .error_messages import in_words
from .options import Out, can_be_folder, list_files

__all__ = ["reproduce_command"]


@in_words
def reproduce_command(
    out: Out = Path("report"),
    seeds: Annotated[
        int, typer.Option(help="Seeds of the sensors' noise; the table has medians over them.")
    ] = 20,
    quick: Annotated[bool, typer.Option("--quick", help="Two seeds, for a first look.")] = False,
    dbo: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            help="With training.csv and tracking.csv of the measured DBO log: the same way on it.",
        ),
    ] = None,
) -> None:
    """Go the way of Xu and Li 2010 on the virtual stage: a report as HTML, PDF and JSON."""
    from ..xu_li_2010.reproduction import reproduce

    can_be_folder(out)
    found = reproduce(seeds=2 if quick else seeds, dbo=dbo)
    written = found.save(out)
    print(found.summary())
    list_files(written)
