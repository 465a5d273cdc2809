"""``piezotrack contour``: contouring of a path with a simulated XY stage."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from ...errors import DataError, ParameterError
from ..command import Argument, Option, command, refuse_without_effect
from ..option_groups import Motion
from ..output import Output
from ..values import LOOP_TIME, PLAIN, Ranged
from .loop_options import (
    NO_FEEDBACK,
    PAPER,
    BeyondReach,
    FeedbackOptions,
    JitterySimulation,
    Unstable,
)
from .xy_stages import ControllerStage, OwnStage, PaperStage, controllers_in

if TYPE_CHECKING:
    from ...control.controller.controller import Controller
    from ...identification.experiments.cross_talk import CrossTalk
    from ...references.xy_reference import XYReference
    from ...stages.xy import XYStage

__all__ = ["contour_command"]

OF_CONTROLLERS = ("dt", "rate", "limits", "feedforward", "feedback", "kp", "ti", "td", "tt")


@command()
def contour_command(
    files: Annotated[
        list[str],
        Argument(
            "Model or controller files of x and y, one for both, or none for the stage of "
            "Xu and Li 2010; then the path: circle:0.1Hz,10um, lissajous:, raster:, spiral:, or a "
            "CSV file with x and y, centred in the workspace by default",
            "[MODEL_X|CONTROLLER_X [MODEL_Y|CONTROLLER_Y]] PATH",
        ),
    ],
    stage: Annotated[
        list[str] | None,
        Option(
            f"Stage to simulate: another model file, or {PAPER}; repeated: of x and of y; default "
            "the models themselves",
            metavar=f"FILE|{PAPER}",
        ),
    ] = None,
    lag: Annotated[
        float | None,
        Option(f"Time from sampling x to sampling y; default 0, of {PAPER} 10ms", LOOP_TIME),
    ] = None,
    cross_talk: Annotated[
        tuple[float, float] | None,
        Option(
            f"Share of y in x and of x in y; default none, of {PAPER} 0.015:0.01",
            Ranged(PLAIN, "XY:YX"),
        ),
    ] = None,
    decouple: Annotated[
        bool, Option("Identify the cross-talk and decouple the feedforward")
    ] = False,
    beyond_reach: BeyondReach = False,
    unstable: Unstable = False,
    *,
    motion: Motion,
    loop: FeedbackOptions,
    simulation: JitterySimulation,
    output: Output,
) -> None:
    """Simulate contouring of a path with an XY stage."""
    from ..._support.files.writing import picture_files
    from ...control.loop.contouring import contour

    *models, path = files
    if path.endswith(".json"):
        raise ParameterError("PATH", "missing", "a path, as circle:1Hz,10um, after the files")
    if len(models) > 2:
        raise ParameterError(f"{len(models)} files are given: expected two at most, of x and y")
    own = _is_own(stage, models)
    loop.check(own=own)
    simulation.check(own=own)
    if not loop.feedforward:
        refuse_without_effect(["decouple"], "with --no-feedforward")
        if models and not own:
            raise ParameterError("MODEL_X", models[0], "none with --no-feedforward")
    ready = controllers_in(models)
    xy: ControllerStage | OwnStage | PaperStage
    if ready is not None:
        refuse_without_effect(OF_CONTROLLERS, "with controller files, which have their own")
        xy = ControllerStage(ready, models, stage)
    elif own:
        xy = OwnStage(models, loop, stage)
    else:
        xy = PaperStage(models, loop, simulation.seed)
    plant = _changed(xy.stage(simulation), lag, cross_talk)
    desired = _path(path, motion, loop, xy.place(plant))
    output.will_write(["contour.csv", "contour.json", *picture_files("contour")])
    loops = xy.controllers(desired)
    how = xy.words if loops[0].feedforward is not None else "no feedforward"
    mixing: dict[str, Any] = {"timing": simulation.timing}
    if decouple:
        found = _cross_talk(plant, loops)
        mixing["decoupling"] = found.matrix
        how += f"\ncross-talk identified: {found}"
    run = contour(plant, loops, desired, **mixing, beyond_reach=beyond_reach, unstable=unstable)
    notes = xy.notes(run)
    entries = {"notes": [*run.notes, *notes]}
    shares = [f"{100 * share:g} %" for share in plant.cross_talk]
    between = f"y lags by {plant.lag:g} s, {shares[0]} of y in x, {shares[1]} of x in y"
    lines = [f"stage: {xy.name}: {between}; {how}", run.summary()]
    lines += [f"note  {note}" for note in notes]
    if loops[0].feedback is None and own:
        lines.append(NO_FEEDBACK)
    simulated = " and ".join(dict.fromkeys(stage)) if stage else "model" if own else PAPER
    document = run.document() | entries | {"stage": simulated}
    output.show("\n".join(lines), document, output.write(partial(run.save, entries=entries)))


def _is_own(stage: list[str] | None, models: list[str]) -> bool:
    """Whether stages of models are simulated."""
    if stage in (None, [PAPER]):
        return bool(models) and not stage
    words = " ".join(stage)
    if PAPER in stage or len(stage) > 2:
        raise ParameterError("--stage", words, f"one model file, or that of x and of y, or {PAPER}")
    if not models:
        raise ParameterError(
            "--stage", f"{words} without MODEL_X, whose inverse is to be played", f"{PAPER}"
        )
    return True


def _path(text: str, motion: Motion, loop: FeedbackOptions, place: dict[str, Any]) -> XYReference:
    """Read the path from a file if the text names one, else parse the text."""
    from ...references.parse import path_of
    from ..option_groups import interval

    options = {"duration": motion.duration, "period": motion.period, **place}
    # A file without times has those of the controller.
    dt = interval(loop.dt, loop.rate) if Path(text).is_file() else None
    try:
        return path_of(text, **options)
    except ParameterError as error:
        # Here --displacement does not belong to the path either.
        words = re.sub(
            r"displacement: '(.)' is not a column", r"there is no column \1_um", str(error)
        )
        raise error if words == str(error) else ParameterError(words) from None
    except DataError as error:
        if dt is not None and "dt=" in str(error):
            return path_of(text, dt=dt, **options)
        # Here --time does not belong to the path.
        words = str(error).replace("name it with time=, or give the", "expected time_s, or the")
        raise DataError(words.replace("interval with dt=", "interval with --dt")) from None


def _changed(stage: XYStage, lag: float | None, cross_talk: tuple[float, float] | None) -> XYStage:
    """Change the stage as the options say."""
    if lag is not None:
        stage = replace(stage, lag=lag)
    if cross_talk is not None:
        stage = replace(stage, cross_talk=cross_talk)
    return stage


def _cross_talk(stage: XYStage, loops: tuple[Controller, Controller]) -> CrossTalk:
    """Identify the cross-talk from records with one axis driven at a time between its limits."""
    import numpy as np

    from ...identification.experiments.cross_talk import identify_cross_talk

    t = np.arange(8000) / 1000.0
    lows, highs = zip(*(loop.limits for loop in loops), strict=True)
    slow = [
        low + 0.5 * (high - low) * (1.0 - np.cos(2.0 * np.pi * 0.25 * t))
        for low, high in zip(lows, highs, strict=True)
    ]
    held = [np.full(t.size, low) for low in lows]
    return identify_cross_talk(
        stage.record(slow[0], held[1], 1e-3), stage.record(held[0], slow[1], 1e-3)
    )
