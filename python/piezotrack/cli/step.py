"""``piezotrack step``: identification from a step response."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..errors import ParameterError
from .error_messages import in_words
from .options import (
    Columns,
    DisplacementColumn,
    DriveColumn,
    HoldOption,
    Interval,
    Out,
    TimeColumn,
    Units,
    can_be_folder,
    list_files,
    number,
    of_file,
    windowed,
)

if TYPE_CHECKING:
    from ..identification.step_response import StepResult

__all__ = ["step_command"]


@in_words
def step_command(
    file: Annotated[Path, typer.Argument(help="Log in CSV of a step response.")],
    window: Annotated[
        str | None, typer.Option(metavar="A:B", help="Seconds with the step.")
    ] = None,
    out: Out = Path("results"),
    time: TimeColumn = None,
    drive: DriveColumn = None,
    displacement: DisplacementColumn = None,
    unit: Units = None,
    dt: Interval = None,
    hold: HoldOption = "zoh",
    stiffness: Annotated[float | None, typer.Option(help="Stiffness in N/m, if known.")] = None,
    mass: Annotated[float | None, typer.Option(help="Moving mass in kg, if known.")] = None,
    second_level: Annotated[
        str | None,
        typer.Option(
            metavar="V:UM", help="Voltage in V and displacement in um at the end of another step."
        ),
    ] = None,
) -> None:
    """Identify frequency, damping and hysteresis parameters from a step response."""
    from .._support.files import make_folder, save_figures, together
    from ..identification.step_response import identify_step

    log = Columns(time, drive, displacement, unit, dt).read(file, hold)
    log = windowed(log, file, "--window", window)
    can_be_folder(out)
    level = None if second_level is None else _level(second_level)
    with of_file(file):
        step = identify_step(log, stiffness=stiffness, mass=mass, second_level=level)
    with together(make_folder(out)) as folder:
        written = [_write(step, folder), *save_figures({"step": step.plot()}, folder)]
    print(step.summary())
    options = " ".join(f"--fix {name}={value:.8g}" for name, value in step.hysteresis.items())
    print(f"\nto hold these in a search: piezotrack identify LOG --model dahl {options}")
    list_files(written)


def _write(step: StepResult, folder: Path) -> Path:
    """Write readings and results as JSON, SI."""
    from .. import __version__
    from .._support.files import write_document

    document = {
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
    return write_document(folder / "step.json", document)


def _level(text: str) -> tuple[float, float]:
    voltage, colon, um = text.partition(":")
    if not colon:
        raise ParameterError(f"--second-level is '{text}': expected V:UM, as 37.5:60.2")
    return number("--second-level", voltage), number("--second-level", um) / 1e6
