"""The picture of a comparison of controllers."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ..._support.display.plot_style import (
    GREY,
    drawing,
    heading,
    is_narrow,
    legend_inside,
    names_beside,
    plain_log_ticks,
    share,
    sheet,
    whole,
)
from .comparison_table import short

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure
    from numpy.typing import NDArray

    from ..comparing.comparison import ControllerComparison

    Array = NDArray[np.float64]

__all__ = ["plot_controllers"]

MARKERS = "osv^Dx"


@drawing
def plot_controllers(
    comparison: ControllerComparison, fig: Figure | SubFigure | None = None
) -> Figure:
    """Draw errors along each reference, and over all of them on each stage.

    Those of all references are relative to the inverse alone; a line spans those of the searches.
    """
    rows = comparison.rows
    size = (12.0, 2.2 + 0.36 * len(rows))
    least = 1.5 + 0.25 * len(rows)
    drawn, axes = sheet(fig, size, (("references", "stages"),), least=least)
    left, right = axes.values()
    share(right, left, "y")
    places = np.arange(float(len(rows)))[::-1]
    for k, name in enumerate(comparison.references):
        cells = [row.cells[0][k] for row in rows]
        errors = [math.nan if one is None else 1e9 * one.rms for one in cells]
        _marks(left, errors, places, k, len(comparison.references), short(name))
    for k, name in enumerate(comparison.variants):
        errors = [100.0 * row.relative(k) for row in rows]
        _marks(right, errors, places, k, len(comparison.variants), name)
    ends = [[100.0 * row.searches[i] for row in rows] for i in (0, -1)]
    right.hlines(places, ends[0], ends[1], color=GREY, zorder=0)
    titles = ("each reference, as tuned for", "all references, each stage")
    units = ("true error [nm rms]", "true error [% of the inverse alone]")
    for axis, title, unit in zip((left, right), titles, units, strict=True):
        axis.set_xscale("log")
        plain_log_ticks(axis, "x")
        axis.set_ylim(-0.5, len(rows) - 0.5)
        axis.set_xlabel(unit)
        heading(axis, title)
        axis.grid(axis="y", alpha=0.3)
        names_beside(axis, places, [row.name for row in rows])
        if axis is right and not is_narrow(fig, size):
            axis.tick_params(labelleft=False)
        legend_inside(axis, ncols=3)
    return whole(drawn)


def _marks(ax: Axes, values: list[float], places: Array, k: int, count: int, label: str) -> None:
    """Draw the marks of one series, which are above those of the next in each row."""
    shift = 0.5 * ((count - 1) / 2.0 - k) / max(count, 1)
    ax.plot(values, places + shift, MARKERS[k % len(MARKERS)], label=label, alpha=0.8)
