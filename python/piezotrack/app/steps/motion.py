"""Third step: the motion, and what the stage makes of it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..._support.files.writing import write_columns
from ..._support.units import best_length_unit, drive_text, length_text, shown_unit
from .. import parts
from ..code import call, command
from ..desk import Download, Same
from .closed_loop import (
    by_hand,
    controller_of,
    known_tuning,
    limits_of,
    model_of,
    noise_of,
    range_of,
    reach_of,
    reference_of,
    reference_text,
    run_of,
    straight_line,
)
from .model import chosen_trial

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

    from ...control.controller.controller import Controller
    from ...control.loop.tracking import Tracking
    from ..desk import Desk
    from ..parts import Light, Part

__all__ = [
    "MotionStep",
    "beyond_reach",
    "is_beyond",
    "motion_file",
    "motion_line",
    "motion_word",
]

KINDS = {
    "triangle": "triangle",
    "sine": "sine",
    "staircase": "staircase",
    "step": "step",
    "raster": "raster, fast axis",
    "spiral": "spiral, one axis",
    "file": "a file of your own",
}
OWN = "A CSV file with columns as time_s and desired_um: drop or choose it"
# Frequencies of a motion as shares of the sampling rate, and steps.
SLOWEST, FASTEST, MOST_STEPS = 2e-5, 0.05, 40
NAMES = {"without": "no compensation", "inverse": "inverse", "loop": "inverse and loop"}
ROLES = {"without": "first", "inverse": "second", "loop": "third"}


class MotionStep:
    """The motion."""

    title = "Motion"

    def light(self, desk: Desk) -> tuple[Light, str]:
        """Green where the motion is within the reach."""
        if not desk.state.log.source or chosen_trial(desk) is None:
            return "grey", "needs a model"
        motion = reference_of(desk)
        beyond = is_beyond(desk)
        words = f"{motion.name}, {length_text(motion.high - motion.low, 3)}"
        return ("amber" if beyond else "green"), words

    def page(self, desk: Desk) -> Iterator[Part]:
        """Return the controls of the motion, and what three controllers make of it."""
        if not desk.state.log.source or chosen_trial(desk) is None:
            yield parts.needs("model", "Fit a model first.")
            return
        yield _controls(desk)
        runs = {name: run_of(desk, one) for name, one in controllers(desk).items()}
        yield from _warnings(desk, runs["inverse"])
        yield _motion_chart(desk, runs)
        yield _error_chart(desk, runs)
        yield _voltage_chart(desk, runs["inverse"])
        yield _table(desk, runs)
        yield parts.code("code", "The same in Python", "\n".join(self.python(desk)))
        yield parts.code("command", "and as a command", "\n".join(self.commands(desk)))

    def python(self, desk: Desk) -> list[str]:
        """Make the motion and the inverse for it, and simulate both."""
        if not desk.state.log.source or chosen_trial(desk) is None:
            return []
        noise = call("stage = pt.VirtualStage.of", "fit", noise=noise_of(desk), seed=1)
        run = call(
            "run = pt.track",
            "stage",
            "pt.Controller.of(fit)",
            "reference",
            beyond_reach=is_beyond(desk) or None,
        )
        return [
            motion_line(desk),
            noise,
            run,
            "print(run.metrics)",
        ]

    def commands(self, desk: Desk) -> list[str]:
        """Compute the voltage of the inverse."""
        if not desk.state.log.source or chosen_trial(desk) is None:
            return []
        name = model_of(desk).model.info.name
        options = {"out": "voltage", "beyond_reach": is_beyond(desk)}
        return [command("feedforward", f"results/{name}.json", motion_word(desk), **options)]

    @property
    def actions(self) -> Mapping[str, Callable[[Desk, Mapping[str, Any]], Download | None]]:
        """The motion as CSV, and the whole reach."""
        return {"csv": _csv, "whole": _whole}


def controllers(desk: Desk) -> dict[str, Controller]:
    """Return the three ways to follow a motion."""
    loop = controller_of(desk)

    def compute() -> dict[str, Controller]:
        alone = replace(loop, feedback=None, repetitive=None, filters=())
        return {
            "without": replace(alone, feedforward=straight_line(desk)),
            "inverse": alone,
            "loop": loop,
        }

    found: dict[str, Controller] = desk.result("ways", [Same(loop), Same(model_of(desk))], compute)
    return found


def motion_line(desk: Desk) -> str:
    """Return the line of Python that makes the motion."""
    state = desk.state.motion
    if state.kind == "file":
        return call("reference = pt.references.read_reference", repr(state.file))
    if state.kind in ("raster", "spiral"):
        home = range_of(desk)[0]
        path = call(
            "reference = pt.references.parse_path", repr(reference_text(desk)), origin=(home, home)
        )
        return f"{path}.x"
    return call("reference = pt.parse_reference", repr(reference_text(desk)))


def motion_word(desk: Desk) -> str:
    """Return the motion as an argument of a command."""
    return motion_file(desk) or reference_text(desk)


def motion_file(desk: Desk) -> str:
    """Return the name of the file of the motion; empty for one that is a text."""
    state = desk.state.motion
    return {"file": state.file, "raster": "motion.csv", "spiral": "motion.csv"}.get(state.kind, "")


def is_beyond(desk: Desk) -> bool:
    """Whether commands and functions have to be told that the motion may be beyond the reach."""
    motion, reach = reference_of(desk), reach_of(desk)
    slack = 0.01 * (reach.high - reach.low)
    return motion.low < reach.low - slack or motion.high > reach.high + slack


def _controls(desk: Desk) -> Part:
    """Return the kind of the motion and its numbers, within the reach."""
    state, reach, rate = desk.state.motion, reach_of(desk), 1.0 / (model_of(desk).dt or 1.0)
    low, high = range_of(desk)
    items = [parts.select("kind", "Motion", state.kind, list(KINDS.items()))]
    if state.kind == "file":
        items.append(parts.file("motion", OWN))
    else:
        bounds = (reach.low, reach.high)
        spread = 0.1 * (reach.high - reach.low)
        wider = (bounds[0] - spread, bounds[1] + spread)
        items += [
            parts.slider(
                "frequency",
                "Steps a second" if state.kind in ("staircase", "step") else "Frequency",
                state.frequency,
                (SLOWEST * rate, FASTEST * rate),
                "Hz",
                scale="log",
            ),
            parts.slider("low", "Lowest", low, wider, "um", per=1e6),
            parts.slider("high", "Highest", high, wider, "um", per=1e6),
        ]
    if state.kind in ("staircase", "raster", "spiral"):
        words = {"staircase": "Steps", "raster": "Lines", "spiral": "Turns"}[state.kind]
        items.append(parts.slider("steps", words, state.steps, (1, MOST_STEPS), whole=True))
    span = f"{1e6 * reach.low:.4g} to {1e6 * reach.high:.4g} um"
    unit, scale = shown_unit(model_of(desk).drive_unit)
    bottom, top = limits_of(desk)
    title = f"The stage reaches {span} from {scale * bottom:g} to {scale * top:g} {unit}"
    return parts.controls("motion", title, *items, step="motion")


def beyond_reach(desk: Desk) -> list[Part]:
    """Say that the motion is beyond the reach, with what mends it; nothing where it is not."""
    if not is_beyond(desk):
        return []
    motion = reference_of(desk)
    words = (
        f"the motion goes from {1e6 * motion.low:.4g} to {1e6 * motion.high:.4g} um, beyond what "
        "the stage reaches: the voltage is held at its limit there"
    )
    fix = parts.action("keep within the reach", "motion.whole")
    return [parts.message("amber", words, *([fix] if not motion_file(desk) else []))]


def _warnings(desk: Desk, run: Tracking) -> list[Part]:
    """Say where the motion is beyond the reach, and the drive beyond what was fitted."""
    items = beyond_reach(desk)
    model = model_of(desk)
    notes = model.extrapolation_notes(run.voltage, run.controller.dt)
    items += [parts.message("amber", note) for note in notes]
    return [parts.messages("warnings", *items)] if items else []


def _motion_chart(desk: Desk, runs: Mapping[str, Tracking]) -> Part:
    """Draw the motion and what follows it, with what is beyond the reach shaded."""
    run, reach = runs["loop"], reach_of(desk)
    unit, scale = best_length_unit(float(np.ptp(run.desired)) or reach.high - reach.low)
    plot = desk.plotter
    lines = [
        plot.over_time("m-motion", one.t, scale * one.displacement, NAMES[name], ROLES[name])
        for name, one in runs.items()
    ]
    desired = plot.over_time(
        "m-motion", run.t, scale * run.desired, "desired", "desired", dash=True
    )
    far = reach.high - reach.low
    regions = [
        parts.region(a, b, "beyond the reach", "bad", axis="y", hatched=True)
        for a, b in (
            (scale * (reach.low - 9 * far), scale * reach.low),
            (scale * reach.high, scale * (reach.high + 9 * far)),
        )
    ]
    words = f"The motion {reference_of(desk).name} over {run.t[-1]:.4g} s and three ways to follow."
    return parts.chart(
        "m-motion",
        "Desired and simulated motion",
        words,
        ("time", "s"),
        ("displacement", unit),
        [*lines, desired],
        regions=regions,
        wide=True,
    )


def _error_chart(desk: Desk, runs: Mapping[str, Tracking]) -> Part:
    """Draw the true error of the three ways."""
    errors = {name: one.desired - one.displacement for name, one in runs.items()}
    unit, scale = best_length_unit(max(float(np.abs(one).max()) for one in errors.values()))
    lines = [
        desk.plotter.over_time("m-err", runs[name].t, scale * one, NAMES[name], ROLES[name])
        for name, one in errors.items()
    ]
    rms = {name: length_text(one.score(true=True).rms_error, 3) for name, one in runs.items()}
    each = ", ".join(f"{NAMES[name]} {one}" for name, one in rms.items())
    words = f"Error after the start, rms: {each}."
    view = settled_view(runs.values(), scale)
    return parts.chart("m-err", "Error", words, ("time", "s"), ("error", unit), lines, view=view)


def settled_view(runs: Iterable[Tracking], scale: float) -> list[float]:
    """Return the range of a chart of errors in which what follows the start is seen well."""
    most, last = 0.0, 0.0
    for run in runs:
        part = run.t >= run.settled
        most = max(most, float(np.abs(run.desired - run.displacement)[part].max()))
        last = float(run.t[-1])
    return [0.0, last, -1.3 * scale * most, 1.3 * scale * most]


def _voltage_chart(desk: Desk, run: Tracking) -> Part:
    """Draw the voltage of the inverse between its limits."""
    model, (low, high) = model_of(desk), limits_of(desk)
    unit, scale = shown_unit(model.drive_unit)
    wanted = run.feedforward
    slew = float(np.abs(np.diff(wanted)).max()) / run.controller.dt if run.t.size > 1 else 0.0
    line = desk.plotter.over_time("voltage", run.t, scale * wanted, "inverse", "second")
    far = high - low
    regions = [
        parts.region(
            scale * a, scale * b, "beyond what was fitted", "noise", axis="y", hatched=True
        )
        for a, b in ((low - 9 * far, low), (high, high + 9 * far))
    ]
    words = (
        f"The voltage of the inverse, {scale * wanted.min():.4g} to {scale * wanted.max():.4g} "
        f"{unit}; it changes by {scale * slew:.4g} {unit}/s at most."
    )
    levels = [
        {"at": scale * one, "label": f"limit {drive_text(one, model.drive_unit)}"}
        for one in (low, high)
    ]
    return parts.chart(
        "voltage",
        "Voltage",
        words,
        ("time", "s"),
        ("drive", unit),
        [line],
        regions=regions,
        levels=levels,
    )


def _table(desk: Desk, runs: Mapping[str, Tracking]) -> Part:
    """Return the errors after settling, and the settling times of steps."""
    rows = []
    for name, run in runs.items():
        figures = run.score(true=True)
        moves = run.settling(band=desk.state.motion.band)
        settled = [one.time for one in moves]
        words = ""
        if settled:
            slowest = max(settled)
            words = f"{1e3 * slowest:.3g} ms" if np.isfinite(slowest) else "not within its hold"
        errors = (length_text(figures.rms_error, 3), length_text(figures.max_error, 3))
        rows.append((NAMES[name], *errors, *([words] if settled else [])))
    band = f"settled to {100 * desk.state.motion.band:g} % of a step after"
    columns = ("", "rms error", "largest error", *([band] if len(rows[0]) > 3 else []))
    tuned = known_tuning(desk) is not None or by_hand(desk)
    title = "Errors after the start" + ("" if tuned else "; the loop has yet to be tuned")
    return parts.table("errors", title, columns, rows)


def _csv(desk: Desk, _: Mapping[str, Any]) -> Download:
    """Write the motion as CSV, at the samples of the controller."""
    sampled = reference_of(desk).sample(controller_of(desk).dt)
    path = desk.place("motion-file") / "motion.csv"
    write_columns(path, {"time_s": sampled.t, "desired_um": 1e6 * sampled.x})
    return Download("motion.csv", path.read_bytes())


def _whole(desk: Desk, _: Mapping[str, Any]) -> None:
    """Take the motion back into the reach."""
    desk.state = desk.state.changed("motion", {"low": None, "high": None})
