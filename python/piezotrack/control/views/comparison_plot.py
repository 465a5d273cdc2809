"""The picture of a comparison of controllers."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ..._support.display.plot_style import GREY, panels, whole
from .comparison_table import short

if TYPE_CHECKING:
    from matplotlib.figure import Figure, SubFigure

    from ..comparing.comparison import ControllerComparison

__all__ = ["plot_controllers"]

MARKERS = "osv^Dx"


def plot_controllers(
    comparison: ControllerComparison, fig: Figure | SubFigure | None = None
) -> Figure:
    """Draw errors along each reference, and over all of them on each stage.

    Those of all references are relative to the inverse alone; a line spans those of the searches.
    """
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
    from matplotlib.transforms import ScaledTranslation

    rows = comparison.rows
    drawn = panels(fig, (12.0, 2.2 + 0.36 * len(rows)))
    left, right = drawn.subplots(1, 2)
    places = np.arange(len(rows))[::-1]
    for k, name in enumerate(comparison.references):
        cells = [row.cells[0][k] for row in rows]
        errors = [math.nan if one is None else 1e9 * one.rms for one in cells]
        left.plot(errors, places, MARKERS[k % len(MARKERS)], label=short(name), alpha=0.8)
    for k, name in enumerate(comparison.variants):
        errors = [100.0 * row.relative(k) for row in rows]
        right.plot(errors, places, MARKERS[k % len(MARKERS)], label=name, alpha=0.8)
    ends = [[100.0 * row.searches[i] for row in rows] for i in (0, -1)]
    right.hlines(places, *ends, color=GREY, zorder=0)
    # Below the labels, in inches: above any row there may be a mark.
    below = ScaledTranslation(0.0, -0.5, whole(drawn).dpi_scale_trans)
    titles = ("each reference, as tuned for", "all references, each stage")
    units = ("true error, nm rms", "true error, % of that of the inverse alone")
    for axis, title, unit in zip((left, right), titles, units, strict=True):
        axis.set_xscale("log")
        axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0), numticks=6))
        axis.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.xaxis.set_minor_formatter(NullFormatter())
        axis.set_ylim(-0.5, len(rows) - 0.5)
        axis.set_xlabel(unit)
        axis.set_title(title)
        axis.grid(axis="y", alpha=0.3)
        axis.set_yticks(places, [row.name for row in rows] if axis is left else [""] * len(rows))
        axis.legend(
            fontsize="small",
            ncol=3,
            loc="upper center",
            bbox_to_anchor=(0.5, 0.0),
            bbox_transform=axis.transAxes + below,
        )
    return whole(drawn)
