"""``piezotrack contour``: contouring with an XY stage, or the nine circles of Table 2."""

from __future__ import annotations

import math
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ...errors import DataError, ParameterError
from ..error_messages import report_errors
from ..options import (
    Duration,
    Jitter,
    Json,
    Out,
    Overwrite,
    Period,
    Quiet,
    number,
    number_range,
    refuse_without_effect,
)
from ..output import Output
from .loop_options import (
    NO_FEEDBACK,
    PAPER,
    AmplifierBandwidth,
    Feedback,
    Feedforward,
    Interval,
    Limits,
    Loop,
    LoopDelay,
    Noise,
    Td,
    Ti,
    noise_metres,
    refuse_of_other_stage,
)
from .xy_stages import OwnStage, PaperStage

if TYPE_CHECKING:
    from ...control.controller.controller import Controller
    from ...identification.experiments.cross_talk import CrossTalk
    from ...references.xy_reference import XYReference
    from ...stages.xy import XYStage
    from ...xu_li_2010.experiments.table_2 import Published, Table2

__all__ = ["contour_command"]


@report_errors
def contour_command(
    context: typer.Context,
    models: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="[MODEL_X [MODEL_Y]]",
            help="Model files in JSON of x and y, or one for both. Without any, the virtual stage "
            "of the paper is simulated, with a model identified from a log of its x axis.",
        ),
    ] = None,
    path: Annotated[
        str | None,
        typer.Option(
            metavar="TEXT|FILE",
            help="Path: circle:0.1Hz,10um, lissajous:, raster:, spiral:, or a CSV file with x and "
            "y. Its centre is by default the middle of the workspace.",
        ),
    ] = None,
    table_2: Annotated[
        bool, typer.Option("--table-2", help="The nine circles of Table 2 of Xu and Li 2010.")
    ] = False,
    stage: Annotated[
        list[str] | None,
        typer.Option(
            metavar=f"FILE|{PAPER}",
            help=f"Stage to simulate: another model file, given twice for x and y, or {PAPER}. "
            "Default the models themselves.",
            show_default=False,
        ),
    ] = None,
    out: Out = Path("results"),
    overwrite: Overwrite = False,
    lag: Annotated[
        float | None,
        typer.Option(
            help=f"Time in s from sampling x to sampling y; default 0, of {PAPER} 0.01.",
            show_default=False,
        ),
    ] = None,
    cross_talk: Annotated[
        str | None,
        typer.Option(
            metavar="XY:YX",
            help=f"Cross-talk: share of y in x and of x in y; default none, of {PAPER} 0.015:0.01.",
            show_default=False,
        ),
    ] = None,
    decouple: Annotated[
        bool,
        typer.Option("--decouple", help="Identify the cross-talk and decouple the feedforward."),
    ] = False,
    dt: Interval = None,
    limits: Limits = None,
    feedforward: Feedforward = True,
    feedback: Feedback = None,
    kp: Annotated[
        str | None,
        typer.Option(
            metavar="KP|KX,KY",
            help=f"Proportional gain of the PID in V/um, or one for each axis; on {PAPER} 0.12.",
            show_default=False,
        ),
    ] = None,
    ti: Ti = None,
    td: Td = None,
    delay: LoopDelay = 0.0,
    jitter: Jitter = 0.0,
    noise_nm: Noise = 0.0,
    bandwidth: AmplifierBandwidth = math.inf,
    duration: Duration = None,
    period: Period = None,
    path_dt: Annotated[
        float | None, typer.Option(help="Sampling interval in s of a path file without times.")
    ] = None,
    seed: Annotated[int, typer.Option(help="Random seed of the noise of both sensors.")] = 1,
    beyond_reach: Annotated[
        bool, typer.Option("--beyond-reach", help="Allow a path beyond the reach of the stage.")
    ] = False,
    unstable: Annotated[
        bool,
        typer.Option("--unstable", help="Simulate although a loop is unstable for small motions."),
    ] = False,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Simulate contouring of a path with an XY stage."""
    from ...control.loop.contouring import contour
    from ...control.timing import Timing
    from ...xu_li_2010.experiments.table_2 import run_table_2

    of_model = _is_own(stage, models, table_2)
    gains = _gains(kp)
    loop = Loop(of_model, dt, limits, feedback, gains[0], ti, td)
    loop.check(context)
    refuse_of_other_stage(context, of_model)
    if of_model and not (noise_nm or jitter):
        refuse_without_effect(context, ["seed"], "without --noise-nm or --jitter")
    _check(context, models, path, table_2, feedforward, of_model)
    both = loop, replace(loop, kp=gains[1])
    xy = OwnStage(models, both, stage) if of_model else PaperStage(models, loop, seed)
    plant = _changed(xy.stage(noise_metres(noise_nm), bandwidth, seed), lag, cross_talk)
    desired = None if path is None else _path(path, duration, period, path_dt, xy.place(plant))
    result = Output(out, overwrite=overwrite, json=json, quiet=quiet)
    result.will_write(_names(table_2))
    loops = xy.controllers(desired, feedforward)
    how = xy.words if feedforward else "no feedforward"
    mixing: dict[str, Any] = {"timing": Timing(delay=delay, jitter=jitter)}
    if decouple:
        found = _cross_talk(plant, loops)
        mixing["decoupling"] = found.matrix
        how += f"\ncross-talk identified: {found}"
    if desired is None:
        table = run_table_2(plant, loops, **mixing)
        written, words, document = _write_table(table, out), str(table), _table_document(table)
    else:
        run = contour(plant, loops, desired, **mixing, beyond_reach=beyond_reach, unstable=unstable)
        notes = xy.notes(run)
        entries = {"notes": [*run.notes, *notes]}
        words = "\n".join([run.summary(), *(f"note  {note}" for note in notes)])
        written, document = run.save(out, entries=entries), run.document() | entries
    shares = [f"{100 * share:g} %" for share in plant.cross_talk]
    between = f"y lags by {plant.lag:g} s, {shares[0]} of y in x, {shares[1]} of x in y"
    lines = [f"stage: {xy.name}: {between}; {how}", words]
    if of_model and not loop.has_feedback:
        lines.append(NO_FEEDBACK)
    simulated = " and ".join(dict.fromkeys(stage)) if stage else "model" if of_model else PAPER
    result.show("\n".join(lines), document | {"stage": simulated}, written)


def _gains(kp: str | None) -> tuple[float | None, float | None]:
    """Parse one gain for both axes, or one for each."""
    if kp is None:
        return None, None
    parts = [number("--kp", part) for part in kp.split(",")]
    if len(parts) > 2:
        raise ParameterError("--kp", f"'{kp}'", "one gain, or KX,KY")
    return parts[0], parts[-1]


def _is_own(stage: list[str] | None, models: list[Path] | None, table_2: bool) -> bool:
    """Whether stages of models are simulated."""
    if stage in (None, [], [PAPER]):
        return bool(models) and not stage and not table_2
    words = " ".join(stage)
    if PAPER in stage or len(stage) > 2:
        raise ParameterError("--stage", words, f"one model file, or that of x and of y, or {PAPER}")
    if not models or table_2:
        reason = "with --table-2" if table_2 else "without MODEL_X, whose inverse is to be played"
        raise ParameterError("--stage", f"{words} {reason}", f"{PAPER}")
    return True


def _check(
    context: typer.Context,
    models: list[Path] | None,
    path: str | None,
    table_2: bool,
    feedforward: bool,
    of_model: bool,
) -> None:
    """Refuse options that exclude each other."""
    if table_2 == (path is not None):
        given = "both are" if table_2 else "neither is"
        raise ParameterError(f"--path and --table-2: expected one of them, {given} given")
    if table_2:
        of_a_path = ["duration", "period", "path_dt", "beyond_reach", "unstable"]
        refuse_without_effect(context, of_a_path, "with --table-2")
    if models and len(models) > 2:
        raise ParameterError(f"{len(models)} model files are given: expected two at most, x and y")
    if not feedforward:
        refuse_without_effect(context, ["decouple"], "with --no-feedforward")
        if models and not of_model:
            raise ParameterError(
                "MODEL_X", models[0], "none with --no-feedforward, where it has no effect"
            )


def _path(
    text: str,
    duration: float | None,
    period: float | None,
    dt: float | None,
    place: dict[str, Any],
) -> XYReference:
    """Read the path from a file if the text names one, else parse the text."""
    from ...references.parse import path_of

    if dt is not None and not Path(text).is_file():
        raise ParameterError("--path-dt", "for a path from a file", f"none with {text}")
    try:
        return path_of(text, duration=duration, period=period, dt=dt, **place)
    except DataError as error:
        # Here --time and --dt do not belong to the path.
        words = str(error).replace("name it with time=, or give the", "expected time_s, or the")
        raise DataError(words.replace("interval with dt=", "interval with --path-dt")) from None


def _changed(stage: XYStage, lag: float | None, cross_talk: str | None) -> XYStage:
    """Change the stage as the options say."""
    if lag is not None:
        stage = replace(stage, lag=lag)
    if cross_talk is not None:
        stage = replace(stage, cross_talk=number_range("--cross-talk", cross_talk))
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


def _names(table_2: bool) -> list[str]:
    """Files that the command writes."""
    from ..._support.files.writing import picture_files
    from ...xu_li_2010.experiments.table_2 import PUBLISHED

    if not table_2:
        return ["contour.csv", "contour.json", *picture_files("contour")]
    return ["table_2.csv", *picture_files("table_2", *map(_circle, PUBLISHED))]


def _circle(case: Published) -> str:
    return f"circle_{1e6 * case.radius:.0f}um_{case.frequency:g}Hz"


def _table_document(table: Table2) -> dict[str, Any]:
    """Return published and obtained contour errors, for a program."""
    from ...xu_li_2010.experiments.table_2 import PUBLISHED

    rows = [
        {
            "radius": {"value": case.radius, "unit": "m"},
            "frequency": {"value": case.frequency, "unit": "Hz"},
            "published": {
                "peak_to_peak": case.peak_to_peak,
                "mean_error": case.mean,
                "sd_error": case.sd,
            },
            "obtained": asdict(run.metrics),
        }
        for case, run in zip(PUBLISHED, table.runs, strict=True)
    ]
    return {"unit": "errors in m", "circles": rows}


def _write_table(table: Table2, out: Path) -> list[Path]:
    """Write the table with published and obtained values, and the pictures."""
    import numpy as np

    from ..._support.files.writing import make_folder, result_set, save_figures, write_columns
    from ...xu_li_2010.experiments.table_2 import PUBLISHED

    columns = {
        "radius_um": [1e6 * case.radius for case in PUBLISHED],
        "frequency_Hz": [case.frequency for case in PUBLISHED],
    }
    for name, ours in (
        ("peak_to_peak", "peak_to_peak"),
        ("mean", "mean_error"),
        ("sd", "sd_error"),
    ):
        columns[f"published_{name}_um"] = [1e6 * getattr(case, name) for case in PUBLISHED]
        columns[f"obtained_{name}_um"] = [1e6 * getattr(run.metrics, ours) for run in table.runs]
    arrays = {name: np.array(values) for name, values in columns.items()}
    figures = {"table_2": table.plot()}
    for case, run in zip(PUBLISHED, table.runs, strict=True):
        figures[_circle(case)] = run.plot()
    with result_set(make_folder(out)) as folder:
        written = write_columns(folder / "table_2.csv", arrays)
        return [written, *save_figures(figures, folder)]
