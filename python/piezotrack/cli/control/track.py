"""``piezotrack track``: tracking with an identified model, on a simulated stage or a device."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from ...errors import DeviceError, Interrupted, ParameterError
from ..command import Argument, Option, command, refuse_without_effect
from ..connection import connected, with_what_is_kept
from ..option_groups import Motion
from ..options import OnDevice, Reference, Zero
from ..output import Output
from ..values import GAIN, LOOP_TIME
from .controller_files import controller_in, stage_of_controller
from .loop_options import (
    NO_FEEDBACK,
    PAPER,
    BeyondReach,
    FeedbackOptions,
    JitterySimulation,
    Online,
    Stage,
    Unstable,
    drive_notes,
    known_model,
    repetitive_part,
    small_margins,
    unit_of,
    zero_words,
)
from .several_axes import axes_in, refuse_several_references, track_several

if TYPE_CHECKING:
    from ...control.controller.controller import Controller
    from ...control.loop.tracking import Tracking
    from ...control.timing import Timing
    from ...identification.fitted.identified_model import IdentifiedModel
    from ...references.reference import Reference as Desired
    from ...stages.virtual import VirtualStage

__all__ = ["track_command"]


@command()
def track_command(
    model: Annotated[
        Path, Argument("Model file, or controller file, as `tune` writes it", "MODEL|CONTROLLER")
    ],
    reference: Reference,
    stage: Stage = None,
    device: OnDevice = None,
    *,
    motion: Motion,
    loop: FeedbackOptions,
    online: Online = False,
    repetitive: Annotated[bool, Option("Repetitive control")] = False,
    kq: Annotated[
        float | None,
        Option("Learning gain of the repetitive control; default 0.5 over the stage's gain", GAIN),
    ] = None,
    tq: Annotated[
        float | None,
        Option("Filter time of the repetitive control; default a 25th of the period", LOOP_TIME),
    ] = None,
    zero: Zero = False,
    beyond_reach: BeyondReach = False,
    unstable: Unstable = False,
    simulation: JitterySimulation,
    output: Output,
) -> None:
    """Track a reference in closed loop.

    On a simulated stage; with --device this computer closes the loop of a CONTROLLER on a device.
    A model of several axes takes --kp and --ti of each decoupled axis, and as REFERENCE a file with
    a column of each, a path, or a motion of each, divided by semicolons.
    """
    from ...control.controller.controller import Controller
    from ...control.running.zero import zero as read_zero

    if (axes := axes_in(model)) is not None:
        track_several(
            axes, model, reference, stage, motion, loop, simulation, output, unstable=unstable
        )
        return
    refuse_several_references(reference)
    free = {"beyond_reach": beyond_reach, "unstable": unstable}
    desired = motion.of(reference)
    if device is not None:
        refuse_without_effect(SIMULATED, "with --device")
        _on_device(model, device, desired, output, zero=zero, free=free)
        return
    own = stage != PAPER
    simulation.check(own=own)
    loop.check(own=own)
    if not loop.feedforward:
        refuse_without_effect(["online"], "with --no-feedforward")
    if not repetitive:
        refuse_without_effect(["kq", "tq"], "without --repetitive")
    timing = simulation.timing
    if (ready := controller_in(model)) is not None:
        refuse_without_effect(OF_A_CONTROLLER, "with a controller file, which has its own")
        if stage is None:
            refuse_without_effect(["zero"], "without --stage")
        plant, known = stage_of_controller(ready, stage, simulation)
        name = f"stage: {_stage_name(stage, 'the model of its feedforward')}, controller: {model}"
        begun = read_zero(plant) if zero else None
        _simulate(output, plant, ready, desired, timing, free, known, name, stage, begun)
        return
    if not (loop.feedforward or repetitive or loop.has_feedback(own=own)):
        raise ParameterError("--no-feedforward: expected --kp and --ti, or the drive is constant")
    known = known_model(model, zero=zero, paper=not own)
    playback: Literal["table", "online"] = "online" if online else "table"
    made = Controller(
        dt=loop.interval(known, desired, own=own),
        limits=loop.volts(known, own=own),
        feedforward=known.inverse(playback=playback) if loop.feedforward else None,
        feedback=loop.pid(known, own=own),
        repetitive=repetitive_part(loop, known, desired, kq, tq, own=own) if repetitive else None,
        drive_unit=unit_of(own, known),
    )
    name = f"stage: {_stage_name(stage, model.name)}"
    plant = simulation.stage(stage, known)
    _simulate(output, plant, made, desired, timing, free, known, name, stage)


def _stage_name(stage: str | None, default: str) -> str:
    return "the virtual stage of Xu and Li 2010" if stage == PAPER else stage or default


def _simulate(
    output: Output,
    plant: VirtualStage,
    loop: Controller,
    desired: Desired,
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

    output.will_write(["tracking.csv", "tracking.json", *picture_files("tracking")])
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
    written = output.write(partial(run.save, entries=entries))
    output.show("\n".join(lines), run.document() | entries, written)


# Options of a controller that a file has.
OF_A_CONTROLLER = (
    *("dt", "rate", "limits", "feedforward", "online", "feedback", "kp", "ti", "td", "tt"),
    *("repetitive", "kq", "tq"),
)
# Those, and options of a simulation.
SIMULATED = (
    *OF_A_CONTROLLER,
    *("stage", "delay", "jitter", "noise", "bandwidth", "seed"),
)


def _on_device(
    file: Path,
    address: str,
    desired: Desired,
    output: Output,
    *,
    zero: bool,
    free: dict[str, bool],
) -> None:
    """Close the loop of a controller file on a device; what was tracked before a fault is kept."""
    from ..._support.files.writing import picture_files
    from ...control.controller.load import load_controller
    from ...control.running.track import track
    from ...control.running.zero import zero as read_zero

    loop = load_controller(file)
    output.will_write(["tracking.csv", "tracking.json", *picture_files("tracking")])
    with connected(address) as used:
        try:
            begun = read_zero(used) if zero else None
            run = track(used, loop, desired, offset=begun, **free)  # type: ignore[arg-type]
        except (DeviceError, Interrupted) as error:
            ended = f"ended: {error}"

            def write(run: Tracking) -> str:
                table, *_ = run.save(output.folder, entries={"notes": [ended]})
                return f"the run up to then is in {table.parent}"

            raise with_what_is_kept(error, "tracked", write) from None
    output.show(run.summary(), run.document(), output.write(run.save))
