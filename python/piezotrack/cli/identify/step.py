"""``piezotrack step``: identification from a step response."""

from __future__ import annotations

from typing import Annotated

from ...errors import ParameterError
from ..command import Option, command
from ..option_groups import LogOptions
from ..options import LogFile, Window, cut, number, of_file, pairs
from ..output import Output
from ..values import LENGTH, VOLTAGE
from .fit_options import Fix

__all__ = ["step_command"]


@command(hold="zoh")
def step_command(
    file: LogFile,
    window: Window = None,
    fix: Fix = None,
    second_level: Annotated[
        str | None,
        Option("Voltage and displacement at the end of another step", metavar="VOLTAGE:LENGTH"),
    ] = None,
    *,
    reading: LogOptions,
    output: Output,
) -> None:
    """Identify frequency and damping from a step response.

    And the hysteresis parameters of the Dahl model, as in section 3.3 of Xu and Li 2010. With --fix
    the stiffness [N/m] and the moving mass [kg] can be given, one or both.
    """
    from ..._support.files.writing import picture_files
    from ...identification.experiments.step_response import identify_step

    known = {name: number("--fix", text) for name, text in pairs("--fix", fix)}
    if not known.keys() <= {"stiffness", "mass"}:
        raise ParameterError("--fix", f"'{next(iter(known))}'", "stiffness or mass", verb="names")
    log = cut(reading.log(file), file, window)
    output.will_write(["step.json", *picture_files("step")])
    level = None if second_level is None else _level(second_level)
    with of_file(file):
        step = identify_step(log, second_level=level, **known)
    options = " ".join(f"--fix {name}={value:.8g}" for name, value in step.hysteresis.items())
    hint = f"to hold these in a search: piezotrack identify LOG --model dahl {options}"
    output.show(f"{step.summary()}\n\n{hint}", step.document(), output.write(step.save))


def _level(text: str) -> tuple[float, float]:
    voltage, colon, length = text.partition(":")
    if not colon:
        raise ParameterError("--second-level", f"'{text}'", "VOLTAGE:LENGTH, as 37.5V:60.2um")
    return VOLTAGE.parse("--second-level", voltage), LENGTH.parse("--second-level", length)
