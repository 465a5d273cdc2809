"""``piezotrack learn``: a voltage table, learnt between trials on a simulated stage or a device."""

from __future__ import annotations

from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from ...errors import DataError, DeviceError, Interrupted
from ..command import Option, command, refuse_without_effect
from ..connection import connected, with_what_is_kept
from ..option_groups import Motion
from ..options import ModelFile, OnDevice, Reference, Rest, Zero, number
from ..output import Output, print_words
from ..values import FREQUENCY
from .loop_options import (
    PAPER,
    BeyondReach,
    FeedbackOptions,
    LoopOptions,
    Simulation,
    Stage,
    known_model,
    unit_of,
)

if TYPE_CHECKING:
    from contextlib import AbstractContextManager

    from ...control.learning.iterative_learning import IterativeLearning
    from ...control.learning.learn import Learning
    from ...hardware.device import Device
    from ...identification.fitted.identified_model import IdentifiedModel
    from ...stages.virtual import VirtualStage

__all__ = ["learn_command"]

# Options of a simulation, or of a feedback, which a table that a device plays cannot have.
SIMULATED = ("stage", "feedback", "kp", "ti", "td", "tt", "noise", "bandwidth", "seed")


@command(out=Path("learnt.csv"))
def learn_command(
    model: ModelFile,
    reference: Reference,
    stage: Stage = None,
    device: OnDevice = None,
    rest: Rest = None,
    trials: Annotated[int, Option("Trials at most, with the first")] = 30,
    from_rest: Annotated[
        bool, Option("Learn the whole motion from rest; default a settled period")
    ] = False,
    gain: Annotated[float, Option("Learning gain, above 0 and below 2", metavar="NUMBER")] = 0.7,
    cutoff: Annotated[
        float | None,
        Option("Highest frequency learnt; default the highest that converges", FREQUENCY),
    ] = None,
    mode_scales: Annotated[
        str,
        Option(
            "Factors on the model's resonances for which learning has to converge",
            metavar="A,B,...",
        ),
    ] = "0.9,1,1.1",
    zero: Zero = False,
    beyond_reach: BeyondReach = False,
    *,
    motion: Motion,
    loop: FeedbackOptions,
    simulation: Simulation,
    output: Output,
) -> None:
    """Learn the voltage of a repeated motion, trial by trial.

    On a simulated stage or a device. A folder as --out gets a picture as well.
    """
    from ..._support.files.writing import picture_files
    from ...control.controller.controller import Controller
    from ...control.learning.learn import learn
    from ...control.running.zero import zero as read_zero

    own = stage != PAPER
    if device is None:
        refuse_without_effect(["rest"], "without --device")
    else:
        refuse_without_effect(SIMULATED, "with --device")
    loop.check(own=own)
    simulation.check(own=own)
    known = known_model(model, zero=zero, paper=not own)
    desired = motion.of(reference)
    output.will_write(["learnt.csv", *picture_files("learnt")])
    plays: AbstractContextManager[VirtualStage | Device] = (
        nullcontext(simulation.stage(stage, known)) if device is None else connected(device)
    )
    try:
        with plays as plant:
            controller = Controller(
                dt=loop.interval(known, desired, own=own),
                limits=_within(plant, loop, known, own=own),
                feedforward=known.inverse() if loop.feedforward else None,
                feedback=loop.pid(known, own=own),
                drive_unit=unit_of(own, known),
            )
            learning = learn(
                plant,
                desired,
                controller,
                model=known,
                trials=trials,
                method="lifted" if from_rest else "frequency",
                timing=simulation.timing,
                gain=gain,
                cutoff=cutoff,
                mode_scales=[number("--mode-scales", one) for one in mode_scales.split(",")],
                rest=rest,
                offset=read_zero(plant, rest=rest) if zero and device is not None else None,
                beyond_reach=beyond_reach,
                progress=None if output.json or output.quiet else _show,
            )
    except (DeviceError, DataError, Interrupted) as error:
        raise with_what_is_kept(error, "learnt", partial(_kept, output)) from None
    words = _outcome(learning) if device is None else f"{_outcome(learning)}\n{learning.final.note}"
    output.show(words, learning.document(), output.write(partial(_save, learning)))


def _within(
    plant: VirtualStage | Device, loop: LoopOptions, known: IdentifiedModel, *, own: bool
) -> tuple[float, float]:
    """Return the limits of the table [V]; by default no more than those of a device."""
    from ...hardware.device import Device

    low, high = loop.volts(known, own=own)
    if loop.limits is None and isinstance(plant, Device):
        # A recorder may have said a little more than what can be put out.
        least, most = max(low, plant.limits[0]), min(high, plant.limits[1])
        if least < most:
            return least, most
    return low, high


def _save(learning: Learning, place: Path) -> list[Path]:
    """Write the table and a picture."""
    from ..._support.files.writing import result_set, save_figures

    with result_set(place) as folder:
        table = learning.save(folder / "learnt.csv")
        return [table, *save_figures({"learnt": learning.plot()}, folder)]


def _kept(output: Output, learnt: Learning) -> str:
    """Write what was learnt before an error, and say where."""
    table, *_ = output.write(partial(_save, learnt))
    return f"the best table so far, of trial {learnt.best}, is in {table}"


def _show(learner: IterativeLearning) -> None:
    """Print the convergence before the first trial, and the errors of each."""
    from ...control.views.learning_text import heading, trial_line

    made = len(learner.trials)
    print_words(trial_line(made - 1, learner.trials[-1]) if made else heading(learner))


def _outcome(learning: Learning) -> str:
    from ...control.views.learning_text import outcome

    before, after = learning.errors[0], learning.errors[learning.best]
    best = f"best: trial {learning.best}, {1e9 * after:.4g} nm rms after {1e9 * before:.4g} nm"
    return "\n".join([*outcome(learning), best])
