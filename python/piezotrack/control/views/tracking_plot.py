"""Pictures of a tracked motion."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..._support.display.plot_style import (
    ACTUAL,
    CLIPPED,
    COMMAND,
    DESIRED,
    ERROR,
    FEEDBACK,
    FEEDFORWARD,
    LEVEL,
    LIMITS,
    REPETITIVE,
    axes_or_new,
    caption,
    drawing,
    legend_inside,
    literal,
    path,
    share,
    sheet,
    thinned,
    trace,
    whole,
)
from ..._support.units import best_length_unit, drive_word, shown_unit

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure
    from numpy.typing import NDArray

    from ..loop.tracking import Tracking

    Array = NDArray[np.float64]

__all__ = [
    "plot_effort",
    "plot_error",
    "plot_feedforward",
    "plot_following",
    "plot_motion",
    "plot_tracking",
]

# Largest error of all, over that of the settled part, from which the picture is cropped.
CROPPED = 5.0


@drawing
def plot_motion(run: Tracking, ax: Axes | None = None) -> Axes:
    """Plot desired and measured displacement over time."""
    (ax,) = axes_or_new(ax, 1)
    trace(ax, run.t, 1e6 * run.measured, {**ACTUAL, "label": "measured"})
    trace(ax, run.t, 1e6 * run.desired, DESIRED, ylabel="displacement [um]")
    _over_time(ax, run)
    return ax


@drawing
def plot_error(run: Tracking, ax: Axes | None = None) -> Axes:
    """Plot the measured tracking error over time, and the largest of each period.

    Where the first instants are beyond the rest, an inset shows them.
    """
    (ax,) = axes_or_new(ax, 1)
    error = {**ERROR, "label": "desired - measured"}
    trace(ax, run.t, 1e6 * run.error, error, zero=True, ylabel="tracking error [um]")
    period = run.reference.period
    for i, figures in enumerate(run.periods):
        assert period is not None
        span = (i * period, min((i + 1) * period, _end(run)))
        label = None if i else "largest of each period"
        ax.plot(span, 2 * [1e6 * figures.max_error], **{**LEVEL, "label": label})
    _show_start(ax, run)
    _shade_clipped(ax, run)
    _over_time(ax, run, ncols=2)
    return ax


@drawing
def plot_following(run: Tracking, ax: Axes | None = None) -> Axes:
    """Plot measured against desired displacement, from the settled time on."""
    (ax,) = axes_or_new(ax, 1)
    part = run.t >= run.settled
    measured = {**ACTUAL, "label": "measured"}
    path(ax, 1e6 * run.desired[part], 1e6 * run.measured[part], measured)
    ends = np.array([run.desired.min(), run.desired.max()]) * 1e6
    ax.plot(ends, ends, **{**DESIRED, "label": "measured = desired"})
    ax.set(xlabel="desired displacement [um]", ylabel="measured displacement [um]")
    ax.legend(loc="upper left", frameon=False, fontsize="small")
    return ax


@drawing
def plot_effort(run: Tracking, ax: Axes | None = None) -> Axes:
    """Plot the voltage and its parts over time."""
    (ax,) = axes_or_new(ax, 1)
    unit, scale = shown_unit(run.controller.drive_unit)
    parts = (
        (run.voltage, COMMAND),
        (run.feedforward, FEEDFORWARD),
        (run.feedback, FEEDBACK),
        (run.repetitive, REPETITIVE),
    )
    for voltage, style in parts:
        if voltage is run.voltage or np.any(voltage):
            trace(ax, run.t, scale * voltage, style, steps=True)
    ax.set_ylabel(f"{drive_word(run.controller.drive_unit)} [{unit}]")
    if run.saturated.any():
        _limits(ax, run.controller.limits, scale)
    _over_time(ax, run)
    return ax


def _limits(ax: Axes, limits: Sequence[float], scale: float) -> None:
    for i, limit in enumerate(limits):
        ax.axhline(scale * limit, **{**LIMITS, "label": None if i else "limits"})


def _end(run: Tracking) -> float:
    """Time at which the last voltage ends [s]."""
    return float(run.t[-1]) + run.controller.dt


def _show_start(ax: Axes, run: Tracking) -> None:
    """Scale the error to the settled one, with the first instants in an inset above it."""
    error = 1e6 * np.abs(run.error)
    largest, settled = float(error.max()), float(error[run.t >= run.settled].max())
    if not largest > CROPPED * settled > 0.0:
        return
    ax.set_ylim(-1.4 * settled, 4.9 * settled)
    end = _end(run)
    inset = ax.inset_axes(
        (0.42 * end, 2.5 * settled, 0.55 * end, 2.2 * settled), transform=ax.transData
    )
    # From the first sample until the error is that of the rest.
    last = min(int(np.flatnonzero(error > CROPPED * settled)[-1]) + 3, run.t.size - 1)
    first = run.t <= max(float(run.t[last]), 5.0 * run.controller.dt)
    trace(inset, 1e3 * run.t[first], 1e6 * run.error[first], ERROR, zero=True)
    inset.set_xlabel("first instants [ms]", fontsize="small", labelpad=1.0)
    inset.tick_params(labelsize="small", length=2.0, pad=1.5)
    inset.margins(y=0.12)


def _over_time(ax: Axes, run: Tracking, ncols: int = 3) -> None:
    """Let the time axis end where the run does, and put the legend into the axes."""
    ax.set(xlim=(0.0, _end(run)), xlabel="time [s]")
    legend_inside(ax, ncols)


def _shade_clipped(ax: Axes, run: Tracking) -> None:
    """Shade the intervals in which the voltage was clipped, also one of a single sample."""
    changes = np.flatnonzero(np.diff(np.concatenate([[False], run.saturated, [False]])))
    times = np.append(run.t, _end(run))
    for i, (first, last) in enumerate(changes.reshape(-1, 2)):
        style = {**CLIPPED, "label": None if i else "command clipped"}
        ax.axvspan(times[first], times[last], **style)


@drawing
def plot_feedforward(
    t: Array,
    voltage: Array,
    x: Array,
    fig: Figure | SubFigure | None = None,
    *,
    title: str = "Feedforward",
    drive_unit: str = "V",
    limits: Sequence[float] | None = None,
) -> Figure:
    """Plot a reference `x` [m] and its feedforward over time, and over each other, with limits."""
    rows = (("reference", "over"), ("drive", "over"))
    figure, axes = sheet(fig, (11.0, 4.8), rows, widths=(1.35, 1.0), down=True)
    unit, scale = shown_unit(drive_unit)
    label = f"{drive_word(drive_unit)} [{literal(unit)}]"
    reference = {**DESIRED, "linestyle": "-"}
    trace(axes["reference"], t, 1e6 * x, reference, ylabel="reference [um]")
    drive = axes["drive"]
    trace(drive, t, scale * voltage, FEEDFORWARD, steps=True, xlabel="time [s]", ylabel=label)
    share(drive, axes["reference"])
    kept = thinned(voltage, x)
    axes["over"].plot(1e6 * x[kept], scale * voltage[kept], **FEEDFORWARD)
    axes["over"].set(xlabel="reference [um]", ylabel=label)
    for ax in (drive, axes["over"]) if limits is not None else ():
        _limits(ax, limits or (), scale)
        legend_inside(ax, ncols=2)
    caption(figure, literal(title))
    return whole(figure)


@drawing
def plot_tracking(run: Tracking, fig: Figure | SubFigure | None = None) -> Figure:
    """Plot all four: motion, error, measured against desired, voltage."""
    rows = (("motion", "following"), ("error", "effort"))
    figure, axes = sheet(fig, (11.0, 7.0), rows, down=True)
    plot_motion(run, axes["motion"])
    plot_following(run, axes["following"])
    plot_error(run, axes["error"])
    plot_effort(run, axes["effort"])
    since = f"from {run.settled:g} s on: " if run.settled else ""
    caption(figure, f"{_title(run)}\n{since}{run.metrics}", "medium")
    return whole(figure)


def _title(run: Tracking) -> str:
    """Name the reference, its range and the parts of the controller."""
    reference, controller = run.reference, run.controller
    unit, scale = best_length_unit(max(abs(reference.low), abs(reference.high)))
    what = f"{literal(reference.name)}, {scale * reference.low:.4g} to {scale * reference.high:.4g}"
    return f"{what} {unit}: {controller.title} at {1.0 / controller.dt:.6g} Hz"
