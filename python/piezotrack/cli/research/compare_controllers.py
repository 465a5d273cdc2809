"""``piezotrack compare-controllers``: controllers side by side on one stage."""

from __future__ import annotations

import math
from typing import Annotated

from ...errors import ParameterError
from ..command import Option, command
from ..control.loop_options import PAPER, LoopOptions, Simulation, Stage, known_model
from ..options import ModelFile, Sensitivity
from ..output import Output
from ..values import FREQUENCY, numbers

__all__ = ["compare_controllers_command"]

# Other spellings that the option takes.
SPELLINGS = {
    "inverse + sliding mode": "inverse + sliding-mode",
    "inverse + perturbation estimation": "inverse + perturbation-estimator",
    "inverse + disturbance observer": "inverse + disturbance-observer",
    "inverse + scheduled PID": "inverse + scheduled-pid",
    "PID + hysteresis observer": "PID + hysteresis-observer",
    "inverse + integral resonant control": "inverse + integral-resonant",
    "inverse + positive position feedback": "inverse + positive-position",
    "inverse + positive velocity and position feedback": "inverse + positive-velocity-position",
}


@command()
def compare_controllers_command(
    model: ModelFile,
    stage: Stage = None,
    frequencies: Annotated[
        str, Option("Frequencies of the references: slow, medium, fast", metavar="A,B,C")
    ] = "1,5,20",
    controllers: Annotated[
        str | None, Option("Controllers, separated by commas; default all", metavar="NAMES")
    ] = None,
    sensitivity: Sensitivity = 2.0,
    draws: Annotated[int, Option("Draws of the sensor noise by which each is judged")] = 3,
    runs: Annotated[int, Option("Independent searches, of which the median is taken")] = 3,
    *,
    loop: LoopOptions,
    simulation: Simulation,
    output: Output,
) -> None:
    """Compare controllers on one stage."""
    from ..._support.files.writing import picture_files
    from ...control.comparing.compare import compare_controllers
    from ...control.tuning.goal import TuningSearch
    from ...control.tuning.margins import Margins

    own = stage != PAPER
    simulation.check(own=own, searched=True)
    known = known_model(model, zero=False, paper=not own)
    output.will_write(["controllers.json", *picture_files("controllers")])
    plant = simulation.stage(stage, known)
    comparison = compare_controllers(
        plant,
        known,
        dt=loop.interval(known, None, own=own),
        limits=loop.volts(known, own=own),
        rates=_frequencies(frequencies),
        controllers=None
        if controllers is None
        else [SPELLINGS.get(one, one) for one in map(str.strip, controllers.split(","))],
        margins=Margins(sensitivity=sensitivity),
        timing=simulation.timing,
        seeds=draws,
        searches=runs,
        search=TuningSearch(seed=simulation.seed),
    )
    output.show(str(comparison), comparison.document(), output.write(comparison.save))


def _frequencies(text: str) -> tuple[float, float, float]:
    found = numbers("--frequencies", text, FREQUENCY)
    if len(found) != 3:
        raise ParameterError("--frequencies", f"'{text}'", "three, as 1,5,20Hz")
    slow, medium, fast = found
    if not 0.0 < slow < medium < fast < math.inf:
        raise ParameterError("--frequencies", f"'{text}'", "three in rising order")
    return slow, medium, fast
