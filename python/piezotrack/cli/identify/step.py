"""``piezotrack step``: identification from a step response."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ...errors import ParameterError
from ..error_messages import report_errors
from ..option_groups import Columns, with_groups
from ..options import (
    HoldOption,
    Json,
    MissingOption,
    Out,
    Overwrite,
    Quiet,
    Resample,
    number,
    of_file,
    windowed,
)
from ..output import Output

__all__ = ["step_command"]


@report_errors
@with_groups
def step_command(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Log of a step response.")],
    window: Annotated[
        str | None,
        typer.Option(metavar="A:B", help="Seconds with the step; default the whole log."),
    ] = None,
    out: Out = Path("results"),
    overwrite: Overwrite = False,
    *,
    columns: Columns,
    resample: Resample = None,
    missing: MissingOption = None,
    hold: HoldOption = "zoh",
    stiffness: Annotated[
        float | None, typer.Option(help="Stiffness in N/m; default unknown.")
    ] = None,
    mass: Annotated[float | None, typer.Option(help="Moving mass in kg; default unknown.")] = None,
    second_level: Annotated[
        str | None,
        typer.Option(
            metavar="V:UM",
            help="Voltage in V and displacement in um at the end of another step; default none.",
        ),
    ] = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Identify frequency and damping from a step response.

    And the hysteresis parameters of the Dahl model, as in section 3.3 of Xu and Li 2010.
    """
    from ..._support.files.writing import picture_files
    from ...identification.experiments.step_response import identify_step

    log = columns.read(file, hold, resample, missing)
    log = windowed(log, file, "--window", window)
    result = Output(out, overwrite=overwrite, json=json, quiet=quiet)
    result.will_write(["step.json", *picture_files("step")])
    level = None if second_level is None else _level(second_level)
    with of_file(file):
        step = identify_step(log, stiffness=stiffness, mass=mass, second_level=level)
    written = step.save(out)
    options = " ".join(f"--fix {name}={value:.8g}" for name, value in step.hysteresis.items())
    hint = f"to hold these in a search: piezotrack identify LOG --model dahl {options}"
    result.show(f"{step.summary()}\n\n{hint}", step.document(), written)


def _level(text: str) -> tuple[float, float]:
    voltage, colon, um = text.partition(":")
    if not colon:
        raise ParameterError("--second-level", f"'{text}'", "V:UM, as 37.5:60.2")
    return number("--second-level", voltage), number("--second-level", um) / 1e6
