"""Texts and pictures of tuned and of scheduled gains."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from ..._support.display.plot_style import (
    ACTUAL,
    COMMAND,
    ERROR,
    drawing,
    heading,
    legend_inside,
    plain_log_ticks,
    sheet,
    whole,
)
from ..._support.statistics import ErrorStatistics
from ..._support.units import shown_unit
from ..loop.tracking import Tracking
from ..tuning.structures import gains_of
from ..tuning.tuned import motion_of
from .tracking_text import clipped_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure, SubFigure

    from ..controller.controller import Controller
    from ..laws.pid import Pid
    from ..parts.filters import Filter
    from ..parts.repetitive import Repetitive
    from ..tuning.schedule import Schedule
    from ..tuning.tuned import Tuned

__all__ = ["plot_schedule", "plot_tuned", "schedule_text", "searches_text", "tuned_text"]


def tuned_text(tuned: Tuned) -> str:
    """Write the gains, the margins over the plants, and the active constraints."""
    gains = [_parts(one) for one in tuned.controllers]
    if len(gains) > 1:
        x, y = (one.replace("\n", "; ") for one in gains)
        gains = [f"x: {x}", f"y: {y}"]
    rate = 1.0 / tuned.controller.dt
    lines = [
        *gains,
        f"{tuned.minimised}, at {rate:.6g} Hz: {tuned.candidates} controllers evaluated, "
        f"{tuned.loops} loops simulated; {searches_text(tuned)}",
    ]
    if tuned.runs:
        scale, unit = _shown(tuned)
        learns = any(one.repetitive is not None for one in tuned.controllers)
        after = "learning" if learns else "settling"
        lines.append(
            f"{scale * tuned.value:.4g} {unit} after {after}, the largest over the stages tried, "
            "with the error assumed of the feedforward"
        )
    word = "contour error " if len(gains) > 1 else ""
    for run in tuned.runs:
        measured, true = (ErrorStatistics.__str__(run.score(true=one)) for one in (False, True))
        seen = "" if measured == true else "measured "
        lines.append(f"{motion_of(run)!r}: {seen}{word}{run.metrics}")
        lines += [f"  true {word}{true}"] if seen else []
        axes = {"": run} if isinstance(run, Tracking) else {"of x ": run.x, "of y ": run.y}
        clipped = {axis: one for axis, one in axes.items() if one.saturated.any()}
        lines += [f"  the drive {axis}is {clipped_text(one)}" for axis, one in clipped.items()]
    if tuned.other_kind is not None:
        model, error = tuned.other_kind
        lines.append(f"on a {model} stage fitted to the same record: {1e6 * error:.4g} um rms")
    lines += _bandwidths(tuned)
    lines.append(f"over {len(tuned.plants)} plants:")
    lines += [f"  {one}" for one in tuned.kept]
    active = "; ".join(tuned.active_constraints)
    active = active or "none: the minimum lies inside the bounds"
    lines.append(f"active constraints: {active}")
    return "\n".join(lines)


def searches_text(tuned: Tuned) -> str:
    """Write how near to the best the nearer half of the searches end."""
    half = sorted(tuned.spread)[(len(tuned.spread) - 1) // 2]
    if not math.isfinite(half):
        return f"fewer than half of {tuned.searches} searches keep what is required"
    nearer = max(100.0 * half, 0.1)
    return f"half of {tuned.searches} searches end within {nearer:.1f} % of the best"


@drawing
def plot_tuned(tuned: Tuned, fig: Figure | SubFigure | None = None) -> Figure:
    """Draw the figure that was made small, of the best controller after each iteration."""
    figure, axes = sheet(fig, (6.4, 4.2), (("all",),))
    ax = axes["all"]
    scale, unit = _shown(tuned) if tuned.runs else (tuned.controller.dt, "m s/V")
    values = scale * np.array(tuned.history)
    shown = np.isfinite(values)
    ax.semilogy(np.flatnonzero(shown), values[shown], **{**ERROR, "marker": "o"})
    ax.set(xlabel="iteration", ylabel=f"{tuned.minimised} [{unit}]")
    ax.locator_params(axis="x", integer=True)
    plain_log_ticks(ax)
    heading(ax, f"{tuned.candidates} controllers evaluated, {len(tuned.plants)} plants")
    return whole(figure)


def schedule_text(found: Schedule) -> str:
    """Write the gains at each place of the grid, and the errors beside those of the fixed ones."""
    tables = [_places(found, one) for one in found.controllers]
    if len(tables) == 1:
        return tables[0]
    return "\n".join(f"{axis}\n{one}" for axis, one in zip("xy", tables, strict=True))


@drawing
def plot_schedule(schedule: Schedule, fig: Figure | SubFigure | None = None) -> Figure:
    """Draw the errors with the fixed and with the scheduled gains over the rate."""
    figure, axes = sheet(fig, (6.4, 4.2), (("all",),))
    ax = axes["all"]
    for i, (amplitude, errors) in enumerate(zip(schedule.amplitudes, schedule.errors, strict=True)):
        for column, style, words in ((0, COMMAND, "fixed"), (1, ACTUAL, "scheduled")):
            label = f"{words}, {1e6 * amplitude:g} um"
            marks = {"marker": "os^D"[i], "linestyle": ("--", "-")[column], "label": label}
            ax.plot(schedule.rates, 1e6 * errors[:, column], **{**style, **marks})
    ax.set(xlabel="rate [Hz]", ylabel="rms error [um]", ylim=(0.0, None))
    legend_inside(ax, ncols=2)
    return whole(figure)


def _shown(tuned: Tuned) -> tuple[float, str]:
    """Return scale and unit of the figure along references."""
    return (1e6, "um") if tuned.unit == "m" else (1.0, tuned.unit)


def _bandwidths(tuned: Tuned) -> list[str]:
    """Write the bandwidth of the feedback, of each axis."""
    axes = "xy" if len(tuned.bandwidths) > 1 else [""]
    return [
        f"{axis}{': ' if axis else ''}bandwidth {value:.3g} Hz"
        for axis, value in zip(axes, tuned.bandwidths, strict=True)
        if value is not None
    ]


def _parts(controller: Controller) -> str:
    """Write the gains of a controller with their units."""
    unit, scale = shown_unit(controller.drive_unit)
    text = []
    law = controller.feedback
    if law is not None and law.info.name == "pid":
        text.append(_pid_text(law._pid, controller.dt, unit, 1e-6 * scale))
    elif law is not None:
        text.append(repr(law))
    text += [_filter_text(one) for one in controller.filters]
    if controller.repetitive is not None:
        text.append(_repetitive_text(controller.repetitive, unit, scale))
    return "\n".join(text) or "no feedback"


def _pid_text(pid: Pid, dt: float, unit: str, per_um: float) -> str:
    """Write the gains, without a part that vanishes; times only from a sampling interval on."""
    gains = gains_of(pid, dt)
    shown = {}
    if gains.kp is not None:
        shown["kp"] = f"{per_um * gains.kp:.4g} {unit}/um"
    if gains.ti is not None:
        shown["ti"] = f"{1e3 * gains.ti:.4g} ms"
    if gains.ki is not None:
        shown["ki"] = f"{per_um * gains.ki:.4g} {unit}/(um s)"
    if gains.ti is not None and gains.td is not None:
        shown["td"] = f"{1e3 * gains.td:.4g} ms"
    elif gains.kd is not None:
        shown["kd"] = f"{per_um * gains.kd:.4g} {unit} s/um"
    return f"{gains.name}: " + ", ".join(f"{name} {value}" for name, value in shown.items())


def _filter_text(part: Filter) -> str:
    values = part._values
    if part.info.name == "low-pass":
        return f"low-pass: {values['cutoff']:.4g} Hz"
    frequency, width, depth = (values[name] for name in ("frequency", "width", "depth"))
    return f"notch: {frequency:.4g} Hz, width {width:.3g}, depth {depth:.3g}"


def _repetitive_text(part: Repetitive, unit: str, scale: float) -> str:
    return (
        f"repetitive: kq {1e-6 * scale * part.kq:.3g} {unit}/um, {part.smoothing}, "
        f"lead {part.lead} samples, forgetting factor {part.forgetting_factor:.4g}"
    )


def _places(schedule: Schedule, controller: Controller) -> str:
    law: Any = controller.feedback
    unit, scale = shown_unit(controller.drive_unit)
    lines = [f"amplitude um  rate Hz  kp {unit}/um    ti ms    td ms   rms um: fixed, scheduled"]
    places = [(amplitude, rate) for amplitude in schedule.amplitudes for rate in schedule.rates]
    errors = schedule.errors.reshape(-1, 2)
    for (amplitude, rate), gains, (before, after) in zip(places, law.gains, errors, strict=True):
        lines.append(
            f"{1e6 * amplitude:>12g} {rate:>8g} {1e-6 * scale * gains.kp:>8.4g} "
            f"{1e3 * gains.ti:>8.3g} {1e3 * gains.td:>8.3g}   {1e6 * before:.4f}, {1e6 * after:.4f}"
        )
    return "\n".join(lines)
