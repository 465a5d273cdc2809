"""The motion on the device that was named on the command line: played, and learnt."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..._support.units import best_length_unit, length_text
from ...control.controller.controller import Controller
from ...control.learning.learn import learn
from ...control.on_device.playing import play
from ...control.running.zero import zero as read_zero
from ...control.views.learning_text import outcome
from ...errors import DataError
from .. import parts
from ..code import Code, call, command, plain
from ..desk import Download, drawing
from .closed_loop import model_of, reference_of
from .device import (
    begin,
    facts_of,
    first,
    limits_fault,
    limits_of_device,
    need_stroke,
    ready,
    stroke,
)
from .motion import motion_line, motion_word

if TYPE_CHECKING:
    from collections.abc import Mapping

    from ...control.learning.iterative_learning import IterativeLearning
    from ...control.learning.learn import Learning
    from ...control.loop.tracking import Tracking
    from ...hardware.device import Device
    from ...identification.fitted.identified_model import IdentifiedModel
    from ...references.reference import Reference
    from ..desk import Desk
    from ..device import Tell
    from ..parts import Light, Part

__all__ = ["RUNNING", "running"]


def running(desk: Desk) -> list[Part]:
    """Return the part of the page that plays and learns the motion."""
    if desk.device is None:
        return []
    if limits_fault(desk):
        return first(desk, "use")
    state = desk.state.device
    settings = parts.controls(
        "run",
        "Follow the motion on the device",
        parts.check("zero", "Count from where it rests", state.zero),
        parts.number("trials", "Trials of learning, at most", state.trials, whole=True),
        parts.number("cutoff", "Learn up to", state.cutoff, "Hz", placeholder="automatic"),
        step="device",
    )
    still = not ready(desk)
    settings["buttons"] = [
        parts.action("Play the inverse", "use.play", disabled=still),
        parts.action("Learn", "use.learn", primary=True, disabled=still),
    ]
    page = [*first(desk, "use"), settings]
    run: Tracking | None = desk.on_device.get("run")
    errors = desk.on_device.get("errors", [])
    if errors:
        page.append(_trials_chart(errors))
    learnt: Learning | None = desk.on_device.get("learning")
    if learnt is not None:
        light: Light = "amber" if learnt.stopped in ("grows", "not settled") else "green"
        words = (
            f"{outcome(learnt)[-1]}; the table of trial {learnt.best} is kept, "
            f"{length_text(float(learnt.errors[learnt.best]), 3)} rms"
        )
        page.append(parts.messages("learnt", parts.message(light, words)))
    if run is not None:
        page += [_run_chart(desk, run), *_files(desk)]
    page.append(parts.code("run-code", "On the device in Python", "\n".join(_python(desk))))
    page.append(parts.code("run-command", "and as a command", _command(desk)))
    return page


def _controller(desk: Desk) -> Controller:
    """Return the controller of a table: the inverse alone, within the limits."""
    model = _model(desk)
    if model.dt is None:
        raise DataError("the model has no interval: fit one to a record")
    return Controller(dt=model.dt, limits=limits_of_device(desk), feedforward=model.inverse())


def _model(desk: Desk) -> IdentifiedModel:
    model = model_of(desk)
    return model.zeroed() if desk.state.device.zero else model


def _play(desk: Desk, _: Mapping[str, Any]) -> None:
    """Play the inverse along the motion."""
    need_stroke(desk)
    work = partial(
        _played,
        controller=_controller(desk),
        reference=reference_of(desk),
        zero=desk.state.device.zero,
    )

    def ended(run: Tracking) -> None:
        desk.on_device |= {"run": run, "errors": [], "learning": None}

    begin(desk, work, ended)


def _learn(desk: Desk, _: Mapping[str, Any]) -> None:
    """Learn the voltage of the motion, trial by trial."""
    need_stroke(desk)
    state = desk.state.device
    work = partial(
        _learnt,
        controller=_controller(desk),
        reference=reference_of(desk),
        model=_model(desk),
        trials=state.trials,
        cutoff=state.cutoff,
        zero=state.zero,
    )
    desk.on_device |= {"run": None, "errors": [], "learning": None}

    def tell(errors: object) -> None:
        desk.on_device["errors"] = errors

    def ended(found: Learning) -> None:
        desk.on_device |= {"run": found.final, "learning": found}

    begin(desk, work, ended, tell)


# In the process of the device, which is why they are functions of the module.


def _played(
    device: Device, _: Tell, *, controller: Controller, reference: Reference, zero: bool
) -> Tracking:
    return play(device, controller, reference, offset=read_zero(device) if zero else None)


def _learnt(
    device: Device,
    tell: Tell,
    *,
    controller: Controller,
    reference: Reference,
    model: IdentifiedModel,
    trials: int,
    cutoff: float | None,
    zero: bool,
) -> Learning:
    def progress(learner: IterativeLearning) -> None:
        tell([(one.rms_error, one.noise) for one in learner.trials])

    return learn(
        device,
        reference,
        controller,
        model=model,
        trials=trials,
        cutoff=cutoff,
        offset=read_zero(device) if zero else None,
        progress=progress,
    )


def _trials_chart(errors: list[tuple[float, float]]) -> Part:
    """Draw the error of each trial over the noise."""
    rms, noise = np.array(errors).T
    unit, scale = best_length_unit(float(rms.min()))
    at = np.arange(rms.size)
    words = (
        f"Trial {at[-1]}: {length_text(float(rms[-1]), 3)} rms, {length_text(float(rms[0]), 3)} "
    )
    lines = [parts.points(at, scale * rms, "error", "error", marks=True)]
    if np.isfinite(noise).all():
        lines.append(parts.points(at, scale * noise, "noise", "noise", dash=True))
    return parts.chart(
        "trials",
        "Error, trial by trial",
        f"{words}without learning.",
        ("trial", ""),
        ("rms error", unit),
        lines,
        log="y",
    )


def _run_chart(desk: Desk, run: Tracking) -> Part:
    """Draw the motion that was measured on the device."""
    unit, scale = best_length_unit(float(np.ptp(run.desired)))
    plot = desk.plotter
    lines = [
        plot.over_time("on-device", run.t, scale * run.measured, "measured", "measured"),
        plot.over_time("on-device", run.t, scale * run.desired, "desired", "desired", dash=True),
    ]
    rms = length_text(run.score().rms_error, 3)
    words = f"The motion measured on the device, {rms} rms from the desired one after the start."
    axes = ("time", "s"), ("displacement", unit)
    return parts.chart("on-device", "Measured on the device", words, *axes, lines)


def _files(desk: Desk) -> list[Part]:
    """Return buttons for the files of the last run."""
    items = [parts.action("Run as CSV", "use.run")]
    if desk.on_device.get("learning") is not None:
        items.append(parts.action("Learnt table", "use.learnt"))
    return [parts.buttons("device-files", *items)]


def _run_file(desk: Desk, _: Mapping[str, Any]) -> Download:
    """Write the run, as `piezotrack play` does."""
    run: Tracking | None = desk.on_device.get("run")
    if run is None:
        raise DataError("nothing has been played yet: expected a run on the device first")
    with drawing:
        written = run.save(desk.place("run") / "run")
    (path,) = (one for one in written if one.suffix == ".csv")
    return Download(path.name, path.read_bytes())


def _learnt_file(desk: Desk, _: Mapping[str, Any]) -> Download:
    """Write the learnt table, as `piezotrack learn` does."""
    learning: Learning | None = desk.on_device.get("learning")
    if learning is None:
        raise DataError("nothing has been learnt yet: expected trials on the device first")
    path = learning.save(desk.place("learnt") / "learnt.csv")
    return Download(path.name, path.read_bytes())


def _python(desk: Desk) -> list[str]:
    """Return the lines that play and learn."""
    state, (low, high) = desk.state.device, limits_of_device(desk)
    fit = "fit.zeroed()" if state.zero else "fit"
    offset = Code("pt.zero(device)") if state.zero else None
    inverse = Code(f"{fit}.inverse()")
    limits = Code(f"({plain(low)}, {plain(high)})")
    dt = Code(plain(model_of(desk).dt or 1.0))
    model = Code(fit)
    return [
        motion_line(desk),
        call("device = pt.hardware.connect", repr(facts_of(desk).address)),
        call("table = pt.Controller", dt=dt, limits=limits, feedforward=inverse),
        call("run = pt.play", "device", "table", "reference", offset=offset),
        call(
            "learnt = pt.learn",
            "device",
            "reference",
            "table",
            model=model,
            trials=state.trials,
            cutoff=state.cutoff,
            offset=offset,
        ),
        'learnt.save("learnt.csv")',
        "device.close()",
    ]


def _command(desk: Desk) -> str:
    """Return the command that learns."""
    state, (low, high) = desk.state.device, limits_of_device(desk)
    return command(
        "learn",
        f"results/{model_of(desk).model.info.name}.json",
        motion_word(desk),
        device=facts_of(desk).address,
        limits=f"{plain(low)}:{plain(high)}V",
        trials=state.trials,
        cutoff=None if state.cutoff is None else f"{plain(state.cutoff)}Hz",
        zero=state.zero,
    )


RUNNING = {
    "stroke": stroke,
    "play": _play,
    "learn": _learn,
    "run": _run_file,
    "learnt": _learnt_file,
}
