"""``piezotrack track`` and ``piezotrack feedforward``: tracking with an identified model."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from ..errors import ParameterError
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
    from ..control.controller import Controller
    from ..control.tracking import Tracking
    from ..identification.identified import IdentifiedModel
    from ..references.reference import Reference

__all__ = ["feedforward_command", "track_command"]

ModelFile = Annotated[Path, typer.Argument(metavar="MODEL", help="Model file in JSON.")]
Online = Annotated[
    bool,
    typer.Option(
        "--online",
        help="Compute the feedforward along the whole run; default a table of one period.",
    ),
]


@in_words
def track_command(
    context: typer.Context,
    model: ModelFile,
    reference: Annotated[
        str,
        typer.Option(
            metavar="TEXT", help="As sine:0.2Hz,0..110um, triangle:, chirp:, ..., or a CSV file."
        ),
    ],
    stage: Annotated[
        str, typer.Option(help="Plant: virtual, or model for the model itself.")
    ] = "virtual",
    out: Out = Path("results"),
    dt: ControlInterval = 0.02,
    limits: Annotated[
        str, typer.Option(metavar="LOW:HIGH", help="Voltage limits of the amplifier in V.")
    ] = "0:75",
    feedforward: Annotated[
        bool, typer.Option(help="Feedforward by the inverse of the model.")
    ] = True,
    online: Online = False,
    feedback: Annotated[bool, typer.Option(help="PID feedback.")] = True,
    kp: Annotated[float, typer.Option(help="Proportional gain in V/um.")] = 0.120,
    ti: Annotated[float, typer.Option(help="Integral time in s.")] = 0.009,
    td: Annotated[float, typer.Option(help="Derivative time in s.")] = 0.044,
    tt: Annotated[
        float | None, typer.Option(help="Tracking time of the antiwindup in s; inf for none.")
    ] = None,
    repetitive: Annotated[bool, typer.Option(help="Repetitive control.")] = False,
    kq: Annotated[
        float, typer.Option(help="Learning gain of the repetitive control in V/um.")
    ] = 1.0,
    tq: Annotated[
        float, typer.Option(help="Time constant of the repetitive control's filter in s.")
    ] = 0.2,
    delay: Annotated[
        float, typer.Option(help="Delay in the loop in s, in addition to the hold.")
    ] = 0.0,
    jitter: Jitter = 0.0,
    duration: Duration = None,
    period: Period = None,
    seed: Annotated[int, typer.Option(help="Seed of the virtual stage's sensor noise.")] = 1,
    beyond_reach: Annotated[
        bool,
        typer.Option("--beyond-reach", help="Allow a reference beyond the reach of the stage."),
    ] = False,
    unstable: Annotated[
        bool, typer.Option("--unstable", help="Allow a loop that is unstable for small motions.")
    ] = False,
) -> None:
    """Simulate closed-loop tracking of a reference: errors, samples as CSV, pictures."""
    from ..control.components import Pid, Repetitive
    from ..control.controller import Controller
    from ..control.stability import check_loop
    from ..control.tracking import track
    from ..identification.identified import load
    from ..stages.virtual import VirtualStage

    _refuse_without_effect(context, feedforward, feedback, repetitive, stage)
    known = load(model)
    desired = _reference(reference, duration, period)
    if repetitive and desired.period is None:
        raise ParameterError(f"--repetitive: the reference ({desired.name}) does not repeat")
    playback: Literal["table", "online"] = "online" if online else "table"
    loop = Controller(
        dt=dt,
        limits=number_range("--limits", limits),
        feedforward=known.inverse(playback=playback) if feedforward else None,
        feedback=Pid.from_um(kp=kp, ti=ti, td=td, tt=tt) if feedback else None,
        repetitive=Repetitive.from_um(period=desired.period or 0.0, tq=tq, kq=kq)
        if repetitive
        else None,
    )
    plant = VirtualStage.xu_li_2010(seed=seed) if stage == "virtual" else known
    can_be_folder(out)
    free = {"beyond_reach": beyond_reach, "unstable": unstable}
    run = track(plant, loop, desired, delay=delay, jitter=jitter, **free)
    written = _write(run, known, loop, out)
    print(f"the {stage} stage" if stage == "virtual" else "the model itself", end=", ")
    print(run.summary())
    if feedforward:
        # A loop's voltage has the noise of the sensor, whose rate says nothing.
        _list_remarks(known.beyond_fit(run.voltage))
    if loop.feedback is not None or loop.repetitive is not None:
        print(f"loop at {check_loop(plant, loop, delay=delay).middle}")
    list_files(written)


@in_words
def feedforward_command(
    model: ModelFile,
    reference: Annotated[
        str, typer.Argument(metavar="REFERENCE", help="CSV with time and displacement, or a text.")
    ],
    out: Out = Path("results"),
    dt: Annotated[float | None, typer.Option(help="Sampling interval of the table in s.")] = None,
    online: Online = False,
    duration: Duration = None,
    period: Period = None,
) -> None:
    """Compute the feedforward voltage for a reference: a CSV and a picture."""
    from .._support.files import make_folder, save_figures, together, write_columns
    from ..control.tracking_plot import plot_feedforward
    from ..identification.identified import load

    known = load(model)
    desired = _reference(reference, duration, period)
    interval = 0.02 if dt is None else dt
    can_be_folder(out)
    samples = desired.sample(interval)
    voltage, how = known.inverse(playback="online" if online else "table").played(
        desired, interval, samples=samples
    )
    table = {"time_s": samples.t, "voltage_V": voltage, "displacement_um": 1e6 * samples.x}
    with together(make_folder(out)) as folder:
        written = [write_columns(folder / "feedforward.csv", table)]
        picture = plot_feedforward(samples.t, voltage, samples.x)
        written += save_figures({"feedforward": picture}, folder)
    print(f"{desired!r} at {1.0 / interval:g} Hz; {how}")
    print(f"{voltage.size} samples, voltage from {voltage.min():.4g} to {voltage.max():.4g} V")
    _list_remarks(known.beyond_fit(voltage, interval))
    list_files(written)


def _refuse_without_effect(
    context: typer.Context, feedforward: bool, feedback: bool, repetitive: bool, stage: str
) -> None:
    """Refuse an unknown stage, and options of parts that are left out."""
    if stage not in ("virtual", "model"):
        raise ParameterError(f"--stage is '{stage}': expected virtual or model")
    if not feedforward:
        refuse_without_effect(context, ["online"], "with --no-feedforward")
    if not feedback:
        refuse_without_effect(context, ["kp", "ti", "td", "tt"], "with --no-feedback")
    if not repetitive:
        refuse_without_effect(context, ["kq", "tq"], "without --repetitive")
    if stage == "model":
        refuse_without_effect(context, ["seed"], "with --stage model, which has no sensor noise")


def _list_remarks(remarks: list[str]) -> None:
    for remark in remarks:
        print(f"note  {remark}")


def _reference(text: str, duration: float | None, period: float | None) -> Reference:
    """Read the reference from a file if the text names one, else parse the text."""
    from ..references.parse import parse_reference
    from ..references.reference import read_reference

    if Path(text).is_file():
        return read_reference(text, duration=duration, period=period)
    if period is not None:
        raise ParameterError(f"--period is for a reference from a file: expected none with {text}")
    return parse_reference(text, duration=duration)


def _write(run: Tracking, known: IdentifiedModel, loop: Controller, out: Path) -> list[Path]:
    """Write the samples as CSV, the metrics as JSON, and the pictures."""
    from .. import __version__
    from .._support.files import (
        make_folder,
        save_figures,
        together,
        write_columns,
        write_document,
    )

    table = {
        "time_s": run.t,
        "desired_um": 1e6 * run.desired,
        "measured_um": 1e6 * run.measured,
        "voltage_V": run.voltage,
        "feedforward_V": run.feedforward,
        "feedback_V": run.feedback,
        "repetitive_V": run.repetitive,
    }
    document: dict[str, Any] = {
        "format": "piezotrack-tracking",
        "schema_version": 1,
        "reference": repr(run.reference),
        "dt": {"value": loop.dt, "unit": "s"},
        "limits": {"value": list(loop.limits), "unit": "V"},
        "feedback": None if loop.feedback is None else repr(loop.feedback),
        "repetitive": None if loop.repetitive is None else repr(loop.repetitive),
        "feedforward": run.note,
        "unit": "errors in m, phase lag in rad, widest loop as a part of the travel",
        "from_s": run.settled,
        "metrics": asdict(run.metrics),
        "periods": [asdict(one) for one in run.periods],
        "model_drive_range": known.drive_range,
        "provenance": {"package": "piezotrack", "version": __version__},
    }
    with together(make_folder(out)) as folder:
        return [
            write_columns(folder / "tracking.csv", table),
            write_document(folder / "tracking.json", document),
            *save_figures({"tracking": run.plot()}, folder),
        ]
