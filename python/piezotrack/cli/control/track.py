"""``piezotrack track`` and ``piezotrack feedforward``: tracking with an identified model."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from ...errors import DeviceError, Interrupted, ParameterError
from ..connection import connected, with_what_is_kept
from ..error_messages import report_errors
from ..options import (
    Duration,
    Jitter,
    Json,
    ModelFile,
    Out,
    Overwrite,
    Period,
    Quiet,
    Zero,
    refuse_without_effect,
)
from ..output import Output
from .controller_files import controller_in, stage_of_controller
from .loop_options import (
    NO_FEEDBACK,
    PAPER,
    AmplifierBandwidth,
    Feedback,
    Feedforward,
    Interval,
    Kp,
    Limits,
    Loop,
    LoopDelay,
    Noise,
    StageFile,
    Td,
    Ti,
    drive_notes,
    known_model,
    noise_metres,
    refuse_of_other_stage,
    simulated,
    small_margins,
    unit_of,
    zero_words,
)

if TYPE_CHECKING:
    from ...control.controller.controller import Controller
    from ...control.loop.tracking import Tracking
    from ...control.timing import Timing
    from ...identification.fitted.identified_model import IdentifiedModel
    from ...references.reference import Reference
    from ...stages.virtual import VirtualStage

__all__ = [
    "BeyondReach",
    "feedforward_command",
    "track_command",
]

Online = Annotated[
    bool,
    typer.Option(
        "--online",
        help="Compute the feedforward at every sample; default a stored table of one period.",
    ),
]


BeyondReach = Annotated[
    bool,
    typer.Option("--beyond-reach", help="Allow a reference beyond the reach of the stage."),
]


@report_errors
def track_command(
    context: typer.Context,
    model: Annotated[
        Path,
        typer.Argument(
            metavar="MODEL|CONTROLLER",
            help="Model file in JSON, or a controller file, as `tune` writes it.",
        ),
    ],
    reference: Annotated[
        str,
        typer.Option(
            metavar="TEXT|FILE",
            help="Reference: sine:0.2Hz,0..110um, triangle:, staircase:, chirp:, multisine:, or a "
            "CSV file with time and displacement.",
        ),
    ],
    stage: StageFile = None,
    out: Out = Path("results"),
    overwrite: Overwrite = False,
    dt: Interval = None,
    limits: Limits = None,
    zero: Zero = False,
    feedforward: Feedforward = True,
    online: Online = False,
    feedback: Feedback = None,
    kp: Kp = None,
    ti: Ti = None,
    td: Td = None,
    tt: Annotated[
        float | None,
        typer.Option(
            help="Tracking time of the antiwindup in s, inf for none; default sqrt(ti td), or ti.",
            show_default=False,
        ),
    ] = None,
    repetitive: Annotated[bool, typer.Option(help="Repetitive control.")] = False,
    kq: Annotated[
        float | None,
        typer.Option(
            help="Learning gain of the repetitive control in V/um; default half of the inverse of "
            f"the stage's gain, of {PAPER} 1.",
            show_default=False,
        ),
    ] = None,
    tq: Annotated[
        float | None,
        typer.Option(
            help="Time constant of the repetitive control's filter in s; default a 25th of the "
            f"period, of {PAPER} 0.2.",
            show_default=False,
        ),
    ] = None,
    delay: LoopDelay = 0.0,
    jitter: Jitter = 0.0,
    noise_nm: Noise = 0.0,
    bandwidth: AmplifierBandwidth = math.inf,
    duration: Duration = None,
    period: Period = None,
    seed: Annotated[int, typer.Option(help="Random seed of the sensor noise.")] = 1,
    beyond_reach: BeyondReach = False,
    unstable: Annotated[
        bool,
        typer.Option(
            "--unstable", help="Simulate although the loop is unstable for small motions."
        ),
    ] = False,
    device: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="Device on which this computer closes the loop of a CONTROLLER, as of `measure`.",
            show_default=False,
        ),
    ] = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Track a reference in closed loop."""
    from ...control.controller.controller import Controller
    from ...control.running.zero import zero as read_zero
    from ...control.timing import Timing
    from ...references.parse import reference_of

    if device is not None:
        refuse_without_effect(context, SIMULATED, "with --device")
        desired = reference_of(reference, duration=duration, period=period)
        result = Output(out, overwrite=overwrite, json=json, quiet=quiet)
        free = {"zero": zero, "beyond_reach": beyond_reach, "unstable": unstable}
        _on_device(model, device, desired, result, **free)
        return
    desired = reference_of(reference, duration=duration, period=period)
    timing = Timing(delay=delay, jitter=jitter)
    free = {"beyond_reach": beyond_reach, "unstable": unstable}
    result = Output(out, overwrite=overwrite, json=json, quiet=quiet)
    of_model = stage != PAPER
    refuse_of_other_stage(context, of_model)
    if of_model and not (noise_nm or jitter):
        refuse_without_effect(context, ["seed"], "without --noise-nm or --jitter")
    settings = Loop(of_model, dt, limits, feedback, kp, ti, td, tt)
    settings.check(context)
    if not feedforward:
        refuse_without_effect(context, ["online"], "with --no-feedforward")
    if not repetitive:
        refuse_without_effect(context, ["kq", "tq"], "without --repetitive")
    sensor: dict[str, Any] = {
        "noise": noise_metres(noise_nm),
        "bandwidth": bandwidth,
        "seed": seed,
    }
    if (loop := controller_in(model)) is not None:
        refuse_without_effect(context, OF_A_CONTROLLER, "with a controller file, which has its own")
        if stage is None:
            refuse_without_effect(context, ["zero"], "without --stage")
        plant, known = stage_of_controller(loop, stage, **sensor)
        name = f"stage: {_stage_name(stage, 'the model of its feedforward')}, controller: {model}"
        begun = read_zero(plant) if zero else None
        _simulate(result, plant, loop, desired, timing, free, known, name, stage, begun)
        return
    if not (feedforward or repetitive or settings.has_feedback):
        raise ParameterError("--no-feedforward: expected --kp and --ti, or nothing moves the stage")
    known = known_model(model, zero=zero, paper=not of_model)
    playback: Literal["table", "online"] = "online" if online else "table"
    loop = Controller(
        dt=settings.dt(known, desired),
        limits=settings.volts(known),
        feedforward=known.inverse(playback=playback) if feedforward else None,
        feedback=settings.pid(known),
        repetitive=settings.repetitive(known, desired, kq, tq) if repetitive else None,
        drive_unit=unit_of(of_model, known),
    )
    plant = simulated(stage, known, *sensor.values())
    name = f"stage: {_stage_name(stage, model.name)}"
    _simulate(result, plant, loop, desired, timing, free, known, name, stage)


def _stage_name(stage: str | None, default: str) -> str:
    return "the virtual stage of Xu and Li 2010" if stage == PAPER else stage or default


def _simulate(
    result: Output,
    plant: VirtualStage,
    loop: Controller,
    desired: Reference,
    timing: Timing,
    free: dict[str, bool],
    known: IdentifiedModel | None,
    name: str,
    stage: str | None,
    offset: float | None = None,
) -> None:
    """Track a reference on a simulated stage; print and write the run."""
    from ..._support.files.writing import picture_files
    from ...control.loop.stability import check_loop
    from ...control.running.track import track

    result.will_write(["tracking.csv", "tracking.json", *picture_files("tracking")])
    run = track(plant, loop, desired, timing=timing, offset=offset, **free)
    zeroed = zero_words(known) if known is not None and stage != PAPER else ""
    lines = [f"{name}{zeroed}", run.summary()]
    notes = [] if known is None else drive_notes(known, run)
    lines += [f"note  {note}" for note in notes]
    if loop.feedback is not None or loop.repetitive is not None:
        margins = check_loop(plant, loop, delay=timing.delay).middle
        lines.append(f"loop at {margins}")
        lines += [f"note  {note}" for note in small_margins(margins)]
    elif stage != PAPER:
        lines.append(NO_FEEDBACK)
    entries = {
        "model_drive_range": None if known is None else known.drive_range,
        "notes": notes,
        "stage": stage or "model",
    }
    written = run.save(result.out, entries=entries)
    result.show("\n".join(lines), run.document() | entries, written)


# Options of a controller that a file has.
OF_A_CONTROLLER = (
    *("dt", "limits", "feedforward", "online", "feedback", "kp", "ti", "td", "tt"),
    *("repetitive", "kq", "tq"),
)
# Those, and options of a simulation.
SIMULATED = (
    *OF_A_CONTROLLER,
    *("stage", "delay", "jitter", "noise_nm", "bandwidth", "seed"),
)


def _on_device(
    file: Path,
    address: str,
    desired: Reference,
    result: Output,
    *,
    zero: bool,
    beyond_reach: bool,
    unstable: bool,
) -> None:
    """Close the loop of a controller file on a device; what was tracked before a fault is kept."""
    from ..._support.files.writing import picture_files
    from ...control.controller.load import load_controller
    from ...control.running.track import track
    from ...control.running.zero import zero as read_zero

    loop = load_controller(file)
    result.will_write(["tracking.csv", "tracking.json", *picture_files("tracking")])
    with connected(address) as used:
        try:
            begun = read_zero(used) if zero else None
            run = track(
                used,
                loop,
                desired,
                offset=begun,
                beyond_reach=beyond_reach,
                unstable=unstable,
            )
        except (DeviceError, Interrupted) as error:
            ended = f"ended: {error}"

            def write(run: Tracking) -> str:
                table, *_ = run.save(result.out, entries={"notes": [ended]})
                return f"what was tracked up to then is in {table.parent}"

            raise with_what_is_kept(error, "tracked", write) from None
    result.show(run.summary(), run.document(), run.save(result.out))


@report_errors
def feedforward_command(
    model: ModelFile,
    reference: Annotated[
        str,
        typer.Argument(
            metavar="REFERENCE",
            help="CSV file with time and displacement, or a text, as sine:0.2Hz,0..110um.",
        ),
    ],
    out: Out = Path("results"),
    overwrite: Overwrite = False,
    dt: Annotated[
        float | None,
        typer.Option(
            help="Sampling interval of the table in s; default that of the reference file, or of "
            "the record identified.",
            show_default=False,
        ),
    ] = None,
    limits: Limits = None,
    zero: Zero = False,
    online: Online = False,
    duration: Duration = None,
    period: Period = None,
    beyond_reach: BeyondReach = False,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Compute the feedforward voltage for a reference."""
    from ..._support.files.writing import (
        make_folder,
        picture_files,
        result_set,
        save_figures,
        write_columns,
    )
    from ..._support.units import drive_word, shown_unit
    from ...control.loop.preconditions import check_within_reach
    from ...control.plant import plant_of
    from ...control.views.tracking_plot import plot_feedforward
    from ...references.parse import reference_of

    known = known_model(model, zero=zero)
    desired = reference_of(reference, duration=duration, period=period)
    settings = Loop(True, dt, limits, None, None, None, None)
    interval = settings.dt(known, desired)
    # A file without a record has no range.
    volts = None if limits is None and known.drive_range is None else settings.volts(known)
    result = Output(out, overwrite=overwrite, json=json, quiet=quiet)
    result.will_write(["feedforward.csv", *picture_files("feedforward")])
    samples = desired.sample(interval)
    if volts is not None and not beyond_reach:
        check_within_reach(plant_of(known), volts, samples, known.drive_unit)
    voltage, how = known.inverse(playback="online" if online else "table").played(
        desired, interval, samples=samples, limits=volts
    )
    if volts is not None:
        voltage = voltage.clip(*volts)
    unit, scale = shown_unit(known.drive_unit)
    what = drive_word(known.drive_unit)
    shown = scale * voltage
    table = {"time_s": samples.t, f"{what}_{unit}": shown, "displacement_um": 1e6 * samples.x}
    with result_set(make_folder(out)) as folder:
        written = [write_columns(folder / "feedforward.csv", table)]
        title = f"feedforward ({known.model.info.title}) for {desired.name}"
        picture = plot_feedforward(
            samples.t, voltage, samples.x, title=title, drive_unit=known.drive_unit
        )
        written += save_figures({"feedforward": picture}, folder)
    notes = known.extrapolation_notes(voltage, interval)
    lines = [
        f"{desired!r} at {1.0 / interval:g} Hz; {how}{zero_words(known)}",
        f"{voltage.size} samples, {what} from {shown.min():.4g} to {shown.max():.4g} {unit}",
        *(f"note  {note}" for note in notes),
    ]
    document = {
        "reference": repr(desired),
        "samples": voltage.size,
        "dt": {"value": interval, "unit": "s"},
        f"{what}_range": {
            "value": [float(voltage.min()), float(voltage.max())],
            "unit": known.drive_unit,
        },
        "feedforward": how,
        "notes": notes,
    }
    result.show("\n".join(lines), document, written)
