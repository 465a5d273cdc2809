"""Pictures of a tracked motion."""

from __future__ import annotations

from typing import TYPE_CHECKING

import matplotlib.pyplot as plt
import numpy as np

from .._support.plot_style import ACTUAL, DESIRED, above, axes_or_new

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from .tracking import Tracking

    Array = NDArray[np.float64]

__all__ = [
    "plot_effort",
    "plot_error",
    "plot_following",
    "plot_motion",
    "plot_tracking",
]


def plot_motion(run: Tracking, ax: Axes | None = None) -> Axes:
    """Plot desired and actual displacement over time.

    Parameters
    ----------
    run : Tracking
        A tracked motion.
    ax : matplotlib.axes.Axes, optional
        Axes to draw in; default a new figure.

    Returns
    -------
    matplotlib.axes.Axes
        With the picture.
    """
    (ax,) = axes_or_new(ax, 1)
    ax.plot(run.t, 1e6 * run.desired, **DESIRED)
    ax.plot(run.fine_t, 1e6 * run.fine_displacement, **ACTUAL)
    ax.set(xlabel="time [s]", ylabel="displacement [um]")
    above(ax)
    ax.margins(x=0)
    return ax


def plot_error(run: Tracking, ax: Axes | None = None) -> Axes:
    """Plot the measured tracking error over time, and the largest of each period.

    Parameters
    ----------
    run : Tracking
        A tracked motion.
    ax : matplotlib.axes.Axes, optional
        Axes to draw in; default a new figure.

    Returns
    -------
    matplotlib.axes.Axes
        With the picture.
    """
    (ax,) = axes_or_new(ax, 1)
    ax.plot(run.t, 1e6 * run.error, color="C3", linewidth=0.9)
    if run.saturated.any():
        low, high = ax.get_ylim()
        ax.fill_between(
            run.t, low, high, where=run.saturated, color="0.85", zorder=0, label="voltage clipped"
        )
        ax.set_ylim(low, high)
        above(ax)
    period = run.reference.period
    for i, one in enumerate(run.periods):
        assert period is not None
        span = (i * period, (i + 1) * period)
        ax.plot(span, 2 * [1e6 * one.max_error], color="0.5", linewidth=0.8, linestyle="--")
    ax.axhline(0.0, color="0.7", linewidth=0.6)
    ax.set(xlabel="time [s]", ylabel="tracking error [um]")
    ax.margins(x=0)
    return ax


def plot_following(run: Tracking, ax: Axes | None = None) -> Axes:
    """Plot actual against desired displacement, from the settled time on.

    Parameters
    ----------
    run : Tracking
        A tracked motion.
    ax : matplotlib.axes.Axes, optional
        Axes to draw in; default a new figure.

    Returns
    -------
    matplotlib.axes.Axes
        With the picture.
    """
    (ax,) = axes_or_new(ax, 1)
    part = run.t >= run.settled
    ax.plot(1e6 * run.desired[part], 1e6 * run.measured[part], color="C0", linewidth=0.9)
    ends = np.array([run.desired.min(), run.desired.max()]) * 1e6
    ax.plot(ends, ends, color="0.35", linewidth=0.8, linestyle="--")
    ax.set(xlabel="desired displacement [um]", ylabel="actual displacement [um]")
    # Fewer numbers than chosen by itself, which touch where they are long.
    ax.locator_params(axis="x", nbins=6)
    return ax


def plot_effort(run: Tracking, ax: Axes | None = None) -> Axes:
    """Plot the voltage and its parts over time.

    Parameters
    ----------
    run : Tracking
        A tracked motion.
    ax : matplotlib.axes.Axes, optional
        Axes to draw in; default a new figure.

    Returns
    -------
    matplotlib.axes.Axes
        With the picture.
    """
    (ax,) = axes_or_new(ax, 1)
    ax.step(run.t, run.voltage, where="post", color="0.55", linewidth=2.4, label="total")
    parts = {
        "feedforward": (run.feedforward, "C0"),
        "feedback": (run.feedback, "C1"),
        "repetitive": (run.repetitive, "C2"),
    }
    for name, (voltage, colour) in parts.items():
        if np.any(voltage):
            ax.step(run.t, voltage, where="post", color=colour, linewidth=1.0, label=name)
    ax.set(xlabel="time [s]", ylabel="voltage [V]")
    above(ax)
    ax.margins(x=0)
    return ax


def plot_feedforward(t: Array, voltage: Array, x: Array) -> Figure:
    """Plot a voltage table over time and over the reference.

    Parameters
    ----------
    t, voltage, x : ndarray, shape (n,)
        Time [s], voltage [V], reference [m].

    Returns
    -------
    matplotlib.figure.Figure
        Two panels.
    """
    figure, (left, right) = plt.subplots(1, 2, figsize=(11.0, 4.2), layout="constrained")
    left.step(t, voltage, where="post", color="C0", linewidth=1.1)
    left.set(xlabel="time [s]", ylabel="feedforward [V]", title="Voltage over time")
    left.margins(x=0)
    right.plot(1e6 * x, voltage, color="C0", linewidth=1.0)
    right.set(xlabel="reference [um]", ylabel="feedforward [V]", title="Voltage over reference")
    return figure


def plot_tracking(run: Tracking) -> Figure:
    """Plot all four: motion, error, actual against desired, voltage.

    Parameters
    ----------
    run : Tracking
        A tracked motion.

    Returns
    -------
    matplotlib.figure.Figure
        Not yet shown or saved.
    """
    figure = plt.figure(figsize=(11.0, 7.0), layout="constrained")
    axes = figure.subplots(2, 2)
    plot_motion(run, axes[0, 0])
    plot_following(run, axes[0, 1])
    plot_error(run, axes[1, 0])
    plot_effort(run, axes[1, 1])
    since = f"from {run.settled:g} s on: " if run.settled else ""
    figure.suptitle(f"{since}{run.metrics}")
    return figure
