"""``piezotrack step``: identification from a step response."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import ParameterError
from .error_messages import in_words
from .options import (
    Columns,
    DisplacementColumn,
    DriveColumn,
    HoldOption,
    Interval,
    Json,
    Out,
    Overwrite,
    Quiet,
    Resample,
    TimeColumn,
    Units,
    number,
    of_file,
    windowed,
)
from .output import Output

if TYPE_CHECKING:
    from ..identification.experiments.step_response import StepResult

__all__ = ["step_command"]


@in_words
def step_command(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Log of a step response.")],
    window: Annotated[
        str | None,
        typer.Option(metavar="A:B", help="Seconds with the step; default the whole log."),
    ] = None,
    out: Out = Path("results"),
    overwrite: Overwrite = False,
    time: TimeColumn = None,
    drive: DriveColumn = None,
    displacement: DisplacementColumn = None,
    unit: Units = None,
    dt: Interval = None,
    resample: Resample = None,
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
    from .._support.files import (
        make_folder,
        picture_files,
        save_figures,
        together,
        write_document,
    )
    from ..identification.experiments.step_response import identify_step

    log = Columns(time, drive, displacement, unit, dt).read(file, hold, resample)
    log = windowed(log, file, "--window", window)
    result = Output(out, overwrite=overwrite, json=json, quiet=quiet)
    result.will_write(["step.json", *picture_files("step")])
    level = None if second_level is None else _level(second_level)
    with of_file(file):
        step = identify_step(log, stiffness=stiffness, mass=mass, second_level=level)
    document = _document(step)
    with together(make_folder(out)) as folder:
        written = [write_document(folder / "step.json", document)]
        written += save_figures({"step": step.plot()}, folder)
    options = " ".join(f"--fix {name}={value:.8g}" for name, value in step.hysteresis.items())
    hint = f"to hold these in a search: piezotrack identify LOG --model dahl {options}"
    result.show(f"{step.summary()}\n\n{hint}", document, written)


def _document(step: StepResult) -> dict[str, Any]:
    """Content of the JSON file: readings and results, SI."""
    from .. import __version__

    return {
        "format": "piezotrack-step",
        "schema_version": 1,
        "unit": "V, m, s, Hz, rad/s; a1 1/m, a2 1/m^2, b1 N/m^2, b0 N/m",
        "readings": asdict(step.readings),
        "natural_angular_frequency": step.natural_angular_frequency,
        "damping_ratio": step.damping_ratio,
        "damping_by_decrement": step.damping_by_decrement,
        "time_constant": step.time_constant,
        "hysteresis": step.hysteresis,
        "ratios": step.ratios,
        "provenance": {"package": "piezotrack", "version": __version__},
    }


def _level(text: str) -> tuple[float, float]:
    voltage, colon, um = text.partition(":")
    if not colon:
        raise ParameterError(f"--second-level is '{text}': expected V:UM, as 37.5:60.2")
    return number("--second-level", voltage), number("--second-level", um) / 1e6
