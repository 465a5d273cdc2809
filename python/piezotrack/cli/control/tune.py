"""``piezotrack tune``: the gains of a controller for an identified model."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, Literal

from ...errors import ParameterError
from ..command import Argument, Option, command, refuse_without_effect
from ..option_groups import Motion
from ..options import Sensitivity, Zero
from ..output import Output
from ..values import ANGLE, DECIBELS, LENGTH, LOOP_TIME, PERCENT
from .controller_files import response_in
from .loop_options import (
    PAPER,
    LoopOptions,
    Simulation,
    Stage,
    gains_as_options,
    known_model,
    zero_words,
)

__all__ = ["tune_command"]


@command()
def tune_command(
    model: Annotated[
        Path, Argument("Model file, or response file, as `response` writes it", "MODEL|RESPONSE")
    ],
    references: Annotated[
        list[str] | None,
        Argument(
            "Motions, as of `track`; without one the gains follow from the margins alone",
            "REFERENCE",
        ),
    ] = None,
    stage: Stage = None,
    parts: Annotated[
        str | None,
        Option(
            "Parts, of pid,low-pass,notch,repetitive; default those that stage and motions need",
            metavar="NAMES",
        ),
    ] = None,
    minimise: Annotated[
        Literal["rms", "largest", "effort"],
        Option("Error to minimise, or the effort within --largest-error"),
    ] = "rms",
    largest_error: Annotated[float | None, Option("Largest rms error, as 20nm", LENGTH)] = None,
    effort: Annotated[
        float,
        Option(
            "Error that a change of the command of 1 V rms from sample to sample is worth", LENGTH
        ),
    ] = 0.0,
    gain_margin: Annotated[
        float | None,
        Option("Least gain margin, as 6dB; default 6.02dB, a factor of 2", DECIBELS),
    ] = None,
    phase_margin: Annotated[
        float | None, Option("Least phase margin, as 30deg; default 0.5rad, 28.6deg", ANGLE)
    ] = None,
    sensitivity: Sensitivity = 2.0,
    gain_spread: Annotated[
        float, Option("Range of the stage's gain about the model's", PERCENT)
    ] = 0.0,
    mode_spread: Annotated[
        float, Option("Range of its dynamics, slower and faster", PERCENT)
    ] = 0.0,
    delay_spread: Annotated[float, Option("Largest delay in addition", LOOP_TIME)] = 0.0,
    feedforward: Annotated[
        bool, Option("Feedforward by the inverse of the model; default yes")
    ] = True,
    zero: Zero = False,
    *,
    motion: Motion,
    loop: LoopOptions,
    simulation: Simulation,
    output: Output,
) -> None:
    """Find the gains of a controller under stability margins.

    For the motions given, on the simulated stage; the controller file is what `track`, `contour`,
    `play` and `export` take.
    """
    from ..._support.files.writing import picture_files
    from ...control.tuning.goal import Goal, TuningSearch
    from ...control.tuning.margins import Margins, Spread
    from ...control.tuning.tune import tune
    from ...control.tuning.tuned import picture_name

    margins = {"sensitivity": sensitivity}
    if gain_margin is not None:
        _within("--gain-margin", gain_margin, 1e-6, 400.0, "dB, above 0 and below 400")
        margins["gain"] = 10.0 ** (gain_margin / 20.0)
    if phase_margin is not None:
        _within("--phase-margin", phase_margin, 0.0, 180.0, "degrees, 0 to below 180")
        margins["phase"] = math.radians(phase_margin)
    _within("--sensitivity", sensitivity, 1.0, math.inf, "a factor above 1")
    _within("--mode-spread", mode_spread, 0.0, 95.0, "per cent, 0 to below 95")
    _within("--gain-spread", gain_spread, 0.0, 95.0, "per cent, 0 to below 95")
    _within("--delay-spread", delay_spread, 0.0, math.inf, "a time of 0 or above")
    if minimise == "effort" and largest_error is None:
        raise ParameterError(
            "--minimise", "effort without --largest-error", "--largest-error, as 20nm"
        )
    if largest_error is not None and not largest_error > 0.0:
        raise ParameterError("--largest-error", f"{1e9 * largest_error:g} nm", "an error above 0")
    own = stage != PAPER
    simulation.check(own=own, searched=True)
    desired = [motion.of(text) for text in references or ()]
    pictures = [name for i in range(len(desired)) for name in picture_files(picture_name(i))]
    output.will_write(["controller.json", "tuning.json", *pictures])
    if (response := response_in(model)) is not None:
        refuse_without_effect(OF_A_MODEL, "with a response file")
        stages: Any = response
        dt, limits, inverse, zeroed = loop.dt, loop.limits, None, ""
    else:
        known = known_model(model, zero=zero, paper=not own)
        plant = simulation.stage(stage, known)
        stages = [plant] if stage in (None, PAPER) else [plant, known]
        dt = loop.interval(known, desired[0] if desired else None, own=own)
        limits = loop.volts(known, own=own)
        inverse, zeroed = known.inverse() if feedforward else None, zero_words(known)
    tuned = tune(
        stages,
        desired or None,
        dt=dt,
        limits=limits,
        feedforward=inverse,
        parts=None if parts is None else [one.strip() for one in parts.split(",")],
        margins=Margins(**margins),
        spread=Spread(delay=(0.0, delay_spread), mode=0.01 * mode_spread, gain=0.01 * gain_spread),
        goal=Goal(
            minimise=minimise,
            effort=effort,
            largest_error=math.inf if largest_error is None else largest_error,
        ),
        timing=simulation.timing,
        search=TuningSearch(seed=simulation.seed),
    )
    words = f"stage: {stage or model.name}{zeroed}\n{tuned}"
    if gains := gains_as_options(tuned.controller):
        made = tuned.controller
        others = ", without filters" if made.filters else ""
        others += ", without the repetitive part" if made.repetitive is not None else ""
        words += f"\nas options of `track`{others}: {gains}"
    output.show(words, tuned.document(), output.write(tuned.save, "controller.json"))


# Options of a model, which a response is not.
OF_A_MODEL = ("stage", "feedforward", "zero", "noise", "bandwidth", "rate", "dt")


def _within(option: str, value: float, low: float, high: float, expected: str) -> None:
    """Refuse a value by the name and in the unit of its option, which the library does not know.

    0 is in its range, 1 is not.
    """
    if not (low < value < high or value == low == 0.0):
        raise ParameterError(option, f"{value:g}", expected)
