"""``piezotrack reproduce``: figures and tables of the paper, published and obtained."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from ..command import Option, command, refuse_without_effect
from ..output import Output

__all__ = ["reproduce_command"]


@command(out=Path("report"))
def reproduce_command(
    draws: Annotated[int, Option("Draws of the sensor noise; the tables show medians")] = 20,
    quick: Annotated[bool, Option("Two draws, for a first look")] = False,
    dbo: Annotated[
        Path | None,
        Option(
            "Folder of the measured DBO log, with training.csv and tracking.csv", metavar="FOLDER"
        ),
    ] = None,
    *,
    output: Output,
) -> None:
    """Repeat the experiments of Xu and Li 2010.

    On a simulated stage, with a report as Markdown, pictures and JSON.
    """
    from ...xu_li_2010.reproduction import REPORT, reproduce

    if quick:
        refuse_without_effect(("draws",), "with --quick")
    output.will_write(REPORT)
    found = reproduce(seeds=2 if quick else draws, dbo=dbo, progress=output.progress)
    output.show(found.summary(), found.document(), output.write(found.save))
