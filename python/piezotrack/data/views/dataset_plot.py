"""Picture of a record: drive, displacement, loop."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..._support.display.plot_style import (
    COMMAND,
    RECORDED,
    few_ticks,
    heading,
    literal,
    panels,
    thinned,
    whole,
)
from ..._support.units import best_length_unit, shown_unit

if TYPE_CHECKING:
    from matplotlib.figure import Figure, SubFigure

    from ..dataset import Dataset

__all__ = ["plot_dataset"]


def plot_dataset(data: Dataset, fig: Figure | SubFigure | None = None) -> Figure:
    """Draw drive and displacement over time, and displacement over drive.

    Parameters
    ----------
    data : Dataset
        The record.
    fig : matplotlib.figure.Figure or SubFigure, optional
        Where to draw; a new figure where not given.

    Returns
    -------
    matplotlib.figure.Figure
        The figure drawn in.
    """
    figure = panels(fig, (11.0, 4.8))
    grid = figure.add_gridspec(2, 2, width_ratios=[1.35, 1.0])
    drive = figure.add_subplot(grid[0, 0])
    displacement = figure.add_subplot(grid[1, 0], sharex=drive)
    loop = figure.add_subplot(grid[:, 1])
    unit, scale = best_length_unit(data.stroke)
    name, times = shown_unit(data.drive_unit)
    u = times * data.u
    kept = thinned(u)
    how = "steps-post" if data.hold == "zoh" else "default"
    dark = {**COMMAND, "color": "0.2", "linewidth": 1.1}
    drive.plot(data.t[kept], u[kept], drawstyle=how, **dark)
    kept = thinned(data.y)
    displacement.plot(data.t[kept], scale * data.y[kept], **RECORDED)
    loop.plot(u[kept], scale * data.y[kept], **RECORDED)
    of_drive, in_metres = f"drive [{literal(name)}]", f"displacement [{unit}]"
    drive.set(ylabel=of_drive)
    displacement.set(xlabel="time [s]", ylabel=in_metres)
    loop.set(xlabel=of_drive, ylabel=in_metres)
    for ax, words in ((drive, "Drive"), (displacement, "Displacement"), (loop, "Hysteresis loop")):
        heading(ax, words)
    for ax in (drive, displacement):
        ax.margins(x=0.0)
    few_ticks(loop)
    figure.suptitle(
        f"{literal(data.source or 'Record')}: {data.duration:.6g} s at {1.0 / data.dt:.6g} Hz, "
        f"stroke {scale * data.stroke:.3g} {unit}",
        fontsize="large",
    )
    return whole(figure)
