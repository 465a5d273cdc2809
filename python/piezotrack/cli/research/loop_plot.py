"""Picture of the demonstration: the loop of actual over desired displacement, before and after."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..._support.display.plot_style import (
    ACTUAL,
    DESIRED,
    ERROR,
    FEEDFORWARD,
    GUIDE,
    RECORDED,
    heading,
    legend_inside,
    panels,
    whole,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure
    from numpy.typing import NDArray

    from ...control.loop.tracking import Tracking

__all__ = ["plot_before_and_after"]

# Errors without compensation, with feedforward alone, with all.
STYLES: tuple[dict[str, Any], ...] = (
    {"color": RECORDED["color"], "linewidth": 1.1},
    {"color": FEEDFORWARD["color"], "linewidth": 0.9},
    ERROR,
)


def plot_before_and_after(
    runs: Mapping[str, Tracking], fig: Figure | SubFigure | None = None
) -> Figure:
    """Draw actual over desired displacement of the first and the last run, and all errors.

    Parameters
    ----------
    runs : mapping of str to Tracking
        Three runs along the same reference, by what compensates the hysteresis.
    fig : matplotlib.figure.Figure or SubFigure, optional
        Figure to draw in; default a new one.

    Returns
    -------
    matplotlib.figure.Figure
        The figure drawn in.
    """
    figure = panels(fig, (10.0, 7.4))
    grid = figure.add_gridspec(2, 2, height_ratios=[1.7, 1.0])
    names = list(runs)
    left = figure.add_subplot(grid[0, 0])
    right = figure.add_subplot(grid[0, 1], sharex=left, sharey=left)
    for ax, when, name in ((left, "Before", names[0]), (right, "After", names[-1])):
        _plot_loop(ax, runs[name])
        rms = 1e6 * runs[name].metrics.rms_error
        heading(ax, f"{when}: {name}, error {rms:.2g} um rms")
    # Below the lines there is room.
    left.legend(loc="lower right", fontsize="small", edgecolor="none")
    below = figure.add_subplot(grid[1, :])
    for name, style in zip(names, STYLES, strict=True):
        part = _settled(runs[name])
        below.plot(runs[name].t[part], 1e6 * runs[name].error[part], **style, label=name)
    below.axhline(0.0, **GUIDE)
    below.set(xlabel="time [s]", ylabel="error = desired - actual [um]")
    below.margins(x=0.0)
    legend_inside(below)
    return whole(figure)


def _settled(run: Tracking) -> NDArray[np.bool_]:
    return run.part(run.t, None, None)


def _plot_loop(ax: Axes, run: Tracking) -> None:
    part = _settled(run)
    ax.plot(1e6 * run.desired[part], 1e6 * run.measured[part], **ACTUAL)
    ends = 1e6 * np.array([run.desired.min(), run.desired.max()])
    ax.plot(ends, ends, **DESIRED)
    ax.set(xlabel="desired displacement [um]", ylabel="actual displacement [um]")
