"""The picture of a comparison of controllers."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ..._support.display.plot_style import (
    GREY,
    drawing,
    heading,
    leftmost,
    legend_inside,
    names_beside,
    plain_log_ticks,
    share,
    sheet,
    whole,
)
from .comparison_table import short

if TYPE_CHECKING:
    from collections.abc import Mapping

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
    _references(comparison, axes["references"])
    _stages(comparison, axes["stages"])
    share(axes["stages"], axes["references"], "y")
    leftmost(axes.values())
    return whole(drawn)


def _references(comparison: ControllerComparison, ax: Axes) -> None:
    """Draw the error of each controller along each reference."""
    errors = {}
    for k, name in enumerate(comparison.references):
        cells = [row.cells[0][k] for row in comparison.rows]
        errors[short(name)] = [math.nan if one is None else 1e9 * one.rms for one in cells]
    _rows(comparison, ax, errors)
    ax.set_xlabel("true error [nm rms]")
    heading(ax, "each reference, as tuned for")


def _stages(comparison: ControllerComparison, ax: Axes) -> None:
    """Draw the error of each controller over all references on each stage."""
    rows = comparison.rows
    low, high = ([100.0 * row.searches[i] for row in rows] for i in (0, -1))
    ax.hlines(_places(comparison), low, high, color=GREY, zorder=0)
    stages = enumerate(comparison.variants)
    _rows(comparison, ax, {name: [100.0 * row.relative(k) for row in rows] for k, name in stages})
    ax.set_xlabel("true error [% of the inverse alone]")
    heading(ax, "all references, each stage")


def _places(comparison: ControllerComparison) -> Array:
    """Heights of the controllers, the first at the top."""
    return np.arange(float(len(comparison.rows)))[::-1]


def _rows(comparison: ControllerComparison, ax: Axes, errors: Mapping[str, list[float]]) -> None:
    """Draw the errors of all controllers, those of a series above those of the next in each row."""
    places = _places(comparison)
    for k, (name, values) in enumerate(errors.items()):
        shift = 0.5 * ((len(errors) - 1) / 2.0 - k) / len(errors)
        ax.plot(values, places + shift, MARKERS[k % len(MARKERS)], label=name, alpha=0.8)
    ax.set_xscale("log")
    plain_log_ticks(ax, "x")
    ax.set_ylim(-0.5, len(places) - 0.5)
    ax.grid(axis="y", alpha=0.3)
    names_beside(ax, places, [row.name for row in comparison.rows])
    legend_inside(ax, ncols=3)
