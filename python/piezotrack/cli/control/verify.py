"""``piezotrack verify``: the sensitivity of a loop, measured on the stage."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from ...errors import ParameterError
from ..command import Argument, Option, command, refuse_without_effect
from ..connection import connected
from ..options import OnDevice, Rest, Sensitivity
from ..output import Output
from ..values import LENGTH
from .controller_files import only_controller, stage_of_controller
from .loop_options import PAPER, JitterySimulation, Stage

__all__ = ["verify_command"]


@command()
def verify_command(
    controller: Annotated[Path, Argument("Controller file, as `tune` writes it", "CONTROLLER")],
    excitation: Annotated[
        str,
        Argument("Voltage added to the command, random-phase:1..400Hz,-1..1V", "EXCITATION"),
    ],
    level: Annotated[float, Option("Displacement that the loop holds, as 30um", LENGTH)],
    response: Annotated[
        Path | None,
        Option("Response of which the sensitivity is predicted, as of `response`", metavar="FILE"),
    ] = None,
    stage: Stage = None,
    device: OnDevice = None,
    rest: Rest = None,
    sensitivity: Sensitivity = 2.0,
    *,
    simulation: JitterySimulation,
    output: Output,
) -> None:
    """Measure the sensitivity of a loop, and compare it with its bound and the prediction.

    On a simulated stage; with --device this computer closes the loop on a device.
    """
    from ..._support.files.writing import picture_files
    from ...control.tuning.margins import Margins
    from ...control.verifying.verify import verify
    from ...response.excitation import parse_excitation
    from ...response.response_file import load_response

    if not sensitivity > 1.0:
        raise ParameterError("--sensitivity", f"{sensitivity:g}", "a factor above 1")
    loop = only_controller(controller, "`piezotrack tune` makes one of it")
    lines = parse_excitation(excitation)
    known = None if response is None else load_response(response)
    output.will_write(["verification.csv", "verification.json", *picture_files("verification")])
    common = {"level": level, "model": known, "margins": Margins(sensitivity=sensitivity)}
    if device is not None:
        refuse_without_effect(
            ["stage", "delay", "jitter", "noise", "bandwidth", "seed"], "with --device"
        )
        with connected(device) as used:
            found = verify(used, loop, lines, safe=rest, **common)  # type: ignore[arg-type]
    else:
        refuse_without_effect(["rest"], "without --device")
        simulation.check(own=stage != PAPER)
        plant, _ = stage_of_controller(loop, stage, simulation)
        timing = simulation.timing
        found = verify(plant, loop, lines, timing=timing, **common)  # type: ignore[arg-type]
    output.show(found.summary(), found.document(), output.write(found.save))
