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
    GUIDE,
    LEVEL,
    LIMITS,
    REPETITIVE,
    axes_or_new,
    few_ticks,
    heading,
    legend_inside,
    literal,
    panels,
    thinned,
    whole,
)
from ..._support.units import best_length_unit, drive_word, shown_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure
    from numpy.typing import NDArray

    from ..loop.tracking import Tracking

    Array = NDArray[np.float64]

__all__ = [
    "plot_effort",
    "plot_error",
    "plot_following",
    "plot_motion",
    "plot_tracking",
]

# Largest error of all, over that of the settled part, from which the picture is cropped.
CROPPED = 5.0


def plot_motion(run: Tracking, ax: Axes | None = None) -> Axes:
    """Plot desired and actual displacement over time."""
    (ax,) = axes_or_new(ax, 1)
    kept = thinned(run.fine_displacement)
    ax.plot(run.fine_t[kept], 1e6 * run.fine_displacement[kept], **ACTUAL)
    ax.plot(run.t, 1e6 * run.desired, **DESIRED)
    ax.set(xlabel="time [s]", ylabel="displacement [um]")
    _over_time(ax, run)
    return ax


def plot_error(run: Tracking, ax: Axes | None = None) -> Axes:
    """Plot the measured tracking error over time, and the largest of each period."""
    (ax,) = axes_or_new(ax, 1)
    ax.plot(run.t, 1e6 * run.error, **{**ERROR, "label": "desired - measured"})
    period = run.reference.period
    for i, figures in enumerate(run.periods):
        assert period is not None
        span = (i * period, min((i + 1) * period, _end(run)))
        label = None if i else "largest of each period"
        ax.plot(span, 2 * [1e6 * figures.max_error], **{**LEVEL, "label": label})
    ax.axhline(0.0, **GUIDE)
    ax.set(xlabel="time [s]", ylabel="tracking error [um]")
    _crop_start(ax, run)
    _shade_clipped(ax, run)
    _over_time(ax, run, ncols=2)
    return ax


def plot_following(run: Tracking, ax: Axes | None = None) -> Axes:
    """Plot actual against desired displacement, from the settled time on."""
    (ax,) = axes_or_new(ax, 1)
    part = run.t >= run.settled
    ax.plot(1e6 * run.desired[part], 1e6 * run.measured[part], **{**ACTUAL, "label": "measured"})
    ends = np.array([run.desired.min(), run.desired.max()]) * 1e6
    ax.plot(ends, ends, **{**DESIRED, "label": "measured = desired"})
    ax.set(xlabel="desired displacement [um]", ylabel="measured displacement [um]")
    few_ticks(ax)
    ax.legend(loc="upper left", frameon=False, fontsize="small")
    return ax


def plot_effort(run: Tracking, ax: Axes | None = None) -> Axes:
    """Plot the voltage and its parts over time."""
    (ax,) = axes_or_new(ax, 1)
    unit, scale = shown_unit(run.controller.drive_unit)
    ax.step(run.t, scale * run.voltage, where="post", **COMMAND)
    parts = (
        (run.feedforward, FEEDFORWARD),
        (run.feedback, FEEDBACK),
        (run.repetitive, REPETITIVE),
    )
    for voltage, style in parts:
        if np.any(voltage):
            ax.step(run.t, scale * voltage, where="post", **style)
    what = drive_word(run.controller.drive_unit)
    ax.set(xlabel="time [s]", ylabel=f"{what} [{unit}]")
    if run.saturated.any():
        for i, limit in enumerate(run.controller.limits):
            ax.axhline(scale * limit, **{**LIMITS, "label": None if i else "limits"})
    _over_time(ax, run)
    return ax


def _end(run: Tracking) -> float:
    """Time at which the last voltage ends [s]."""
    return float(run.t[-1]) + run.controller.dt


def _crop_start(ax: Axes, run: Tracking) -> None:
    """Scale the error to the settled one, where that of the way to the reference would hide it."""
    error = 1e6 * np.abs(run.error)
    largest, settled = float(error.max()), float(error[run.t >= run.settled].max())
    if largest > CROPPED * settled > 0.0:
        ax.set_ylim(-1.6 * settled, 1.6 * settled)
        heading(ax, f"before {run.settled:g} s up to {largest:.3g} um, cropped")


def _over_time(ax: Axes, run: Tracking, ncols: int = 3) -> None:
    """Let the time axis end where the run does, and put the legend into the axes."""
    ax.set_xlim(0.0, _end(run))
    few_ticks(ax)
    legend_inside(ax, ncols)


def _shade_clipped(ax: Axes, run: Tracking) -> None:
    """Shade the intervals in which the voltage was clipped, also one of a single sample."""
    changes = np.flatnonzero(np.diff(np.concatenate([[False], run.saturated, [False]])))
    times = np.append(run.t, _end(run))
    for i, (first, last) in enumerate(changes.reshape(-1, 2)):
        style = {**CLIPPED, "label": None if i else "command clipped"}
        ax.axvspan(times[first], times[last], **style)


def plot_feedforward(
    t: Array,
    voltage: Array,
    x: Array,
    fig: Figure | SubFigure | None = None,
    *,
    title: str = "Feedforward",
    drive_unit: str = "V",
) -> Figure:
    """Plot a feedforward over time and over the reference.

    Parameters
    ----------
    t, voltage, x : ndarray, shape (n,)
        Time [s], feedforward in `drive_unit`, reference [m].
    fig : matplotlib.figure.Figure or SubFigure, optional
        Figure to draw in; default a new one.
    title : str, optional
        Title of the picture.
    drive_unit : str, optional
        Unit of the drive, SI.

    Returns
    -------
    matplotlib.figure.Figure
        The figure drawn in.
    """
    figure = panels(fig, (11.0, 4.2))
    left, right = figure.subplots(1, 2)
    unit, scale = shown_unit(drive_unit)
    what = drive_word(drive_unit).capitalize()
    left.step(t, scale * voltage, where="post", **FEEDFORWARD)
    left.set(xlabel="time [s]", ylabel=f"feedforward [{literal(unit)}]")
    heading(left, f"{what} over time")
    left.margins(x=0)
    right.plot(1e6 * x, scale * voltage, **FEEDFORWARD)
    right.set(xlabel="reference [um]", ylabel=f"feedforward [{literal(unit)}]")
    heading(right, f"{what} over reference")
    few_ticks(right)
    figure.suptitle(literal(title), fontsize="large")
    return whole(figure)


def plot_tracking(run: Tracking, fig: Figure | SubFigure | None = None) -> Figure:
    """Plot all four: motion, error, actual against desired, voltage."""
    figure = panels(fig, (11.0, 7.0))
    axes = figure.subplots(2, 2)
    plot_motion(run, axes[0, 0])
    plot_following(run, axes[0, 1])
    plot_error(run, axes[1, 0])
    plot_effort(run, axes[1, 1])
    since = f"from {run.settled:g} s on: " if run.settled else ""
    figure.suptitle(f"{_title(run)}\n{since}{run.metrics}", fontsize="medium")
    return whole(figure)


def _title(run: Tracking) -> str:
    """Name the reference, its range and the parts of the controller."""
    reference, controller = run.reference, run.controller
    unit, scale = best_length_unit(max(abs(reference.low), abs(reference.high)))
    what = f"{literal(reference.name)}, {scale * reference.low:.4g} to {scale * reference.high:.4g}"
    return f"{what} {unit}: {controller.title} at {1.0 / controller.dt:.6g} Hz"
