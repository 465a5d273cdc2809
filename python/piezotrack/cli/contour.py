"""``piezotrack contour``: contouring with an XY stage, or the nine circles of Table 2."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import DataError, ParameterError
from .error_messages import in_words
from .options import (
    ControlInterval,
    Duration,
    Jitter,
    Out,
    Period,
    can_be_folder,
    list_files,
    number_range,
    refuse_without_effect,
)

if TYPE_CHECKING:
    from ..control.contouring import Contour
    from ..identification.cross_talk import CrossTalk
    from ..references.xy_reference import XYReference
    from ..stages.inverse import Inverse
    from ..stages.xy import XYStage
    from ..xu_li_2010.table_2 import Table2

__all__ = ["contour_command"]


@in_words
def contour_command(
    context: typer.Context,
    model: Annotated[
        Path | None,
        typer.Argument(
            metavar="[MODEL]",
            help="Model file in JSON for the feedforward of both axes; default a model identified "
            "from a simulated log of x.",
        ),
    ] = None,
    path: Annotated[
        str | None,
        typer.Option(
            metavar="TEXT",
            help="As circle:0.1Hz,10um, lissajous:, raster:, spiral:, or a CSV file with x and y.",
        ),
    ] = None,
    table_2: Annotated[
        bool, typer.Option("--table-2", help="The nine circles of Table 2 of Xu and Li 2010.")
    ] = False,
    out: Out = Path("results"),
    lag: Annotated[
        float | None, typer.Option(help="Time in s between the samples of x and y.")
    ] = None,
    cross_talk: Annotated[
        str | None, typer.Option(metavar="XY:YX", help="Cross-talk: share of y in x and of x in y.")
    ] = None,
    decouple: Annotated[
        bool,
        typer.Option("--decouple", help="Identify the cross-talk and decouple the feedforward."),
    ] = False,
    dt: ControlInterval = 0.02,
    limits: Annotated[
        str, typer.Option(metavar="LOW:HIGH", help="Voltage limits of the amplifiers in V.")
    ] = "0:75",
    feedforward: Annotated[
        bool, typer.Option(help="Feedforward by the inverse of the model.")
    ] = True,
    feedback: Annotated[bool, typer.Option(help="PID feedback.")] = True,
    kp: Annotated[float, typer.Option(help="Proportional gain in V/um.")] = 0.120,
    ti: Annotated[float, typer.Option(help="Integral time in s.")] = 0.009,
    td: Annotated[float, typer.Option(help="Derivative time in s.")] = 0.044,
    delay: Annotated[
        float, typer.Option(help="Delay in the loops in s, in addition to the hold.")
    ] = 0.0,
    jitter: Jitter = 0.0,
    duration: Duration = None,
    period: Period = None,
    path_dt: Annotated[
        float | None, typer.Option(help="Sampling interval in s of a path file without times.")
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of the sensors' noise.")] = 1,
    beyond_reach: Annotated[
        bool, typer.Option("--beyond-reach", help="Allow a path beyond the reach of the stage.")
    ] = False,
    unstable: Annotated[
        bool, typer.Option("--unstable", help="Allow loops that are unstable for small motions.")
    ] = False,
) -> None:
    """Simulate contouring of a path with the virtual XY stage: errors, CSV, pictures."""
    from ..control.components import Pid
    from ..control.contouring import contour
    from ..control.controller import Controller
    from ..xu_li_2010.table_2 import run_table_2

    if table_2 == (path is not None):
        given = "both are" if table_2 else "neither is"
        raise ParameterError(f"--path and --table-2: expected one of them, {given} given")
    if table_2:
        of_a_path = ["duration", "period", "path_dt", "beyond_reach", "unstable"]
        refuse_without_effect(context, of_a_path, "with --table-2")
    if not feedforward:
        refuse_without_effect(context, ["decouple"], "with --no-feedforward")
        if model is not None:
            raise ParameterError(
                f"MODEL is {model}: expected none with --no-feedforward, where it has no effect"
            )
    if not feedback:
        refuse_without_effect(context, ["kp", "ti", "td"], "with --no-feedback")
    desired = None if path is None else _path(path, duration, period, path_dt)
    stage = _stage(seed, lag, cross_talk)
    can_be_folder(out)
    inverse, how = _inverse(model, seed) if feedforward else (None, "no feedforward")
    loop = Controller(
        dt=dt,
        limits=number_range("--limits", limits),
        feedforward=inverse,
        feedback=Pid.from_um(kp=kp, ti=ti, td=td) if feedback else None,
    )
    mixing: dict[str, Any] = {"delay": delay, "jitter": jitter}
    if decouple:
        found = _cross_talk(stage)
        mixing["decoupling"] = found.matrix
        how += f"\ncross-talk identified: {found}"
    loops = (loop, loop)
    free = {"beyond_reach": beyond_reach, "unstable": unstable}
    if desired is None:
        table = run_table_2(stage, loops, **mixing)
        written, words = _write_table(table, out), str(table)
    else:
        run = contour(stage, loops, desired, **mixing, **free)
        written, words = _write(run, out), run.summary()
    xy, yx = (f"{100 * share:g} %" for share in stage.cross_talk)
    print(f"the virtual XY stage: y lags by {stage.lag:g} s, {xy} of y in x, {yx} of x in y; {how}")
    print(words)
    list_files(written)


def _path(text: str, duration: float | None, period: float | None, dt: float | None) -> XYReference:
    """Read the path from a file if the text names one, else parse the text."""
    from ..references.parse import parse_path
    from ..references.xy_reference import read_path

    if Path(text).is_file():
        try:
            return read_path(text, duration=duration, period=period, dt=dt)
        except DataError as error:
            # Here --time and --dt do not belong to the path.
            words = str(error).replace("name it with time=, or give the", "expected time_s, or the")
            raise DataError(words.replace("interval with dt=", "interval with --path-dt")) from None
    for option, value in (("--period", period), ("--path-dt", dt)):
        if value is not None:
            raise ParameterError(f"{option} is for a path from a file: expected none with {text}")
    return parse_path(text, duration=duration)


def _stage(seed: int, lag: float | None, cross_talk: str | None) -> XYStage:
    """Make the virtual stage with the changes of the options."""
    from ..stages.xy import XYStage

    stage = XYStage.xu_li_2010(seed=seed)
    if lag is not None:
        stage = replace(stage, lag=lag)
    if cross_talk is not None:
        stage = replace(stage, cross_talk=number_range("--cross-talk", cross_talk))
    return stage


def _inverse(model: Path | None, seed: int) -> tuple[Inverse, str]:
    """Invert the model, or one identified as in the paper."""
    from ..identification.identified import load
    from ..xu_li_2010.demo import demo_log, identify_demo

    if model is not None:
        return load(model).inverse(), f"feedforward by {model.name} on both axes"
    fit = identify_demo(demo_log(seed), seed=seed, progress=False)
    words = f"feedforward on both axes by a model of x, fitted to {fit.cost_um:.3g} um rms"
    return fit.inverse(), words


def _cross_talk(stage: XYStage) -> CrossTalk:
    """Identify the cross-talk from records with one axis driven at a time."""
    import numpy as np

    from ..identification.cross_talk import identify_cross_talk

    t = np.arange(8000) / 1000.0
    slow, held = 37.5 * (1.0 - np.cos(2.0 * np.pi * 0.25 * t)), np.zeros(t.size)
    return identify_cross_talk(stage.record(slow, held, 1e-3), stage.record(held, slow, 1e-3))


def _write(run: Contour, out: Path) -> list[Path]:
    """Write the samples as CSV, the metrics as JSON, and the picture."""
    from .. import __version__
    from .._support.files import (
        make_folder,
        save_figures,
        together,
        write_columns,
        write_document,
    )

    table = {"time_s": run.t}
    for name, axis in (("x", run.x), ("y", run.y)):
        table |= {
            f"desired_{name}_um": 1e6 * axis.desired,
            f"measured_{name}_um": 1e6 * axis.measured,
            f"voltage_{name}_V": axis.voltage,
        }
    table["contour_error_um"] = 1e6 * run.error
    document = {
        "format": "piezotrack-contour",
        "schema_version": 1,
        "path": repr(run.path),
        "unit": "errors in m, phase lag in rad, widest loop as a part of the travel",
        "from_s": run.settled,
        "contour": asdict(run.metrics),
        "contour_true": asdict(run.score(true=True)),
        "x": asdict(run.x.metrics),
        "y": asdict(run.y.metrics),
        "feedforward": run.x.note,
        "provenance": {"package": "piezotrack", "version": __version__},
    }
    with together(make_folder(out)) as folder:
        return [
            write_columns(folder / "contour.csv", table),
            write_document(folder / "contour.json", document),
            *save_figures({"contour": run.plot()}, folder),
        ]


def _write_table(table: Table2, out: Path) -> list[Path]:
    """Write the table with published and obtained values, and the pictures."""
    import numpy as np

    from .._support.files import make_folder, save_figures, together, write_columns
    from ..xu_li_2010.table_2 import PUBLISHED

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
        figures[f"circle_{1e6 * case.radius:.0f}um_{case.frequency:g}Hz"] = run.plot()
    with together(make_folder(out)) as folder:
        written = write_columns(folder / "table_2.csv", arrays)
        return [written, *save_figures(figures, folder)]
