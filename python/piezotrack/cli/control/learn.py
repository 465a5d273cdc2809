"""``piezotrack learn``: a voltage table, learnt between trials on a simulated stage or a device."""

from __future__ import annotations

import math
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from ...errors import DataError, DeviceError, Interrupted, ParameterError
from ..connection import Rest, connected, with_what_is_kept
from ..error_messages import report_errors
from ..options import (
    Duration,
    Json,
    ModelFile,
    Overwrite,
    Period,
    Quiet,
    Zero,
    number,
    refuse_without_effect,
)
from ..output import Output
from .loop_options import (
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
    known_model,
    noise_metres,
    refuse_of_other_stage,
    simulated,
    unit_of,
)
from .track import BeyondReach

if TYPE_CHECKING:
    from contextlib import AbstractContextManager

    from ...control.learning.iterative_learning import IterativeLearning
    from ...control.learning.learn import Learning
    from ...hardware.device import Device
    from ...identification.fitted.identified_model import IdentifiedModel
    from ...stages.virtual import VirtualStage

__all__ = ["learn_command"]

# Options of a simulation, or of a feedback, which a table that a device plays cannot have.
SIMULATED = ("stage", "feedback", "kp", "ti", "td", "noise_nm", "bandwidth", "seed")


@report_errors
def learn_command(
    context: typer.Context,
    model: ModelFile,
    reference: Annotated[
        str,
        typer.Option(
            metavar="TEXT|FILE",
            help="Reference, as of `track`; one that repeats, or any with --method lifted.",
        ),
    ],
    stage: StageFile = None,
    device: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="Device that plays the trials, as of `measure`, in the place of a simulated "
            "stage.",
            show_default=False,
        ),
    ] = None,
    out: Annotated[
        Path, typer.Option("--out", "-o", metavar="TABLE.csv", help="File for the table.")
    ] = Path("learnt.csv"),
    picture: Annotated[
        bool, typer.Option("--picture", help="Write a picture beside the table, PNG and SVG.")
    ] = False,
    overwrite: Overwrite = False,
    dt: Interval = None,
    limits: Limits = None,
    zero: Zero = False,
    feedforward: Feedforward = True,
    feedback: Feedback = None,
    kp: Kp = None,
    ti: Ti = None,
    td: Td = None,
    trials: Annotated[int, typer.Option(help="Trials at most, the first included.")] = 30,
    method: Annotated[
        Literal["frequency", "lifted"],
        typer.Option(help="Learn a settled period, or the whole reference from rest."),
    ] = "frequency",
    gain: Annotated[float, typer.Option(help="Learning gain, above 0 and below 2.")] = 0.7,
    cutoff: Annotated[
        float | None,
        typer.Option(
            help="Frequency in Hz up to which is learnt; default the highest that converges.",
            show_default=False,
        ),
    ] = None,
    mode_scales: Annotated[
        str,
        typer.Option(
            metavar="A,B,...",
            help="Factors on the frequencies of the model's modes with which learning converges.",
        ),
    ] = "0.9,1,1.1",
    delay: LoopDelay = 0.0,
    noise_nm: Noise = 0.0,
    bandwidth: AmplifierBandwidth = math.inf,
    duration: Duration = None,
    period: Period = None,
    rest: Rest = None,
    seed: Annotated[int, typer.Option(help="Random seed of the sensor noise.")] = 1,
    beyond_reach: BeyondReach = False,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Learn the voltage of a repeated motion."""
    from ..._support.files.writing import picture_files
    from ...control.controller.controller import Controller
    from ...control.learning.learn import learn
    from ...control.running.zero import zero as read_zero
    from ...control.timing import Timing
    from ...references.parse import reference_of

    of_model = stage != PAPER
    settings = Loop(of_model, dt, limits, feedback, kp, ti, td)
    _check_options(context, settings, device, noise_nm)
    _check_file(out)
    known = known_model(model, zero=zero, paper=not of_model)
    desired = reference_of(reference, duration=duration, period=period)
    result = Output(out.parent, overwrite=overwrite, json=json, quiet=quiet)
    result.will_write([out.name, *(picture_files(out.stem) if picture else [])])
    plays: AbstractContextManager[VirtualStage | Device] = (
        nullcontext(simulated(stage, known, noise_metres(noise_nm), bandwidth, seed))
        if device is None
        else connected(device)
    )
    try:
        with plays as plant:
            loop = Controller(
                dt=settings.dt(known, desired),
                limits=_within(plant, settings, known),
                feedforward=known.inverse() if feedforward else None,
                feedback=settings.pid(known),
                drive_unit=unit_of(of_model, known),
            )
            learning = learn(
                plant,
                desired,
                loop,
                model=known,
                trials=trials,
                method=method,
                timing=Timing(delay=delay),
                gain=gain,
                cutoff=cutoff,
                mode_scales=[number("--mode-scales", one) for one in mode_scales.split(",")],
                rest=rest,
                offset=read_zero(plant, rest=rest) if zero and device is not None else None,
                beyond_reach=beyond_reach,
                progress=None if json or quiet else _show,
            )
    except (DeviceError, DataError, Interrupted) as error:
        raise with_what_is_kept(
            error, "learnt", lambda learnt: _kept(learnt, out, picture)
        ) from None
    words = _outcome(learning) if device is None else f"{_outcome(learning)}\n{learning.final.note}"
    result.show(words, learning.document(), _write(learning, out, picture))


def _check_options(
    context: typer.Context, settings: Loop, device: str | None, noise_nm: float
) -> None:
    """Refuse options without effect."""
    if device is None:
        refuse_without_effect(context, ["rest"], "without --device")
    else:
        refuse_without_effect(context, SIMULATED, "with --device")
    settings.check(context)
    refuse_of_other_stage(context, settings.own)
    if settings.own and not noise_nm:
        refuse_without_effect(context, ["seed"], "without --noise-nm")


def _check_file(out: Path) -> None:
    if out.suffix.lower() != ".csv":
        raise ParameterError("--out", out, "the name of a file, as table.csv")
    if out.is_dir():
        raise ParameterError("--out", f"{out}, a folder", "the name of a file in it")


def _within(
    plant: VirtualStage | Device, settings: Loop, known: IdentifiedModel
) -> tuple[float, float]:
    """Return the limits of the table [V]; by default no more than those of a device."""
    from ...hardware.device import Device

    low, high = settings.volts(known)
    if settings.limits is None and isinstance(plant, Device):
        # A recorder may have said a little more than what can be put out.
        least, most = max(low, plant.limits[0]), min(high, plant.limits[1])
        if least < most:
            return least, most
    return low, high


def _write(learning: Learning, out: Path, picture: bool) -> list[Path]:
    """Write the table and, where it is asked for, the picture."""
    from ..._support.files.writing import make_folder, result_set, save_figures

    with result_set(make_folder(out.parent)) as folder:
        written = [learning.save(folder / out.name)]
        if picture:
            written += save_figures({out.stem: learning.plot()}, folder)
    return written


def _kept(learnt: Learning, out: Path, picture: bool) -> str:
    """Write what was learnt before an error, and say where."""
    table, *_ = _write(learnt, out, picture)
    return f"the best table so far, of trial {learnt.best}, is in {table}"


def _show(learner: IterativeLearning) -> None:
    """Print the convergence before the first trial, and the errors of each."""
    from ...control.views.learning_text import heading, trial_line

    made = len(learner.trials)
    line = trial_line(made - 1, learner.trials[-1]) if made else heading(learner)
    print(line, flush=True)


def _outcome(learning: Learning) -> str:
    from ...control.views.learning_text import outcome

    before, after = learning.errors[0], learning.errors[learning.best]
    best = f"best: trial {learning.best}, {1e9 * after:.4g} nm rms after {1e9 * before:.4g} nm"
    return "\n".join([*outcome(learning), best])
