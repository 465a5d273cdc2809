"""Picture of Table 2: the circles at 0.1 Hz, and published and obtained values."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..._support.display.plot_style import (
    ACTUAL,
    ERROR,
    GUIDE,
    MEASURED,
    caption,
    drawing,
    heading,
    legend_inside,
    sheet,
    whole,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

    from ...control.loop.contouring import Contour
    from ..experiments.table_2 import Table2

__all__ = ["plot_table_2"]


@drawing
def plot_table_2(table: Table2, fig: Figure | SubFigure | None = None) -> Figure:
    """Plot the circles at 0.1 Hz, their errors over an angle, and published and obtained values."""
    rows = (3 * ("circles",) + 3 * ("angle",), [one for one in ("max", "mean", "SD") for _ in "12"])
    figure, axes = sheet(fig, (11.0, 8.4), rows, heights=(1.5, 1.0))
    circles = axes["circles"]
    slow = [run for case, run in table.cases if case.frequency == 0.1]
    for run in slow:
        run.plot_magnified(ax=circles, factor=5.0)
    heading(circles, "0.1 Hz, contour error \N{MULTIPLICATION SIGN} 5")
    # One name for the lines of all circles, and a square as without their legends.
    for line in circles.lines[2:]:
        line.set_label("_")
    circles.set_ylim(top=circles.get_ylim()[0] + float(np.ptp(circles.get_xlim())))
    legend_inside(circles, ncols=2)
    _over_angle(slow, axes["angle"])
    for name in ("max", "mean", "SD"):
        _bars(table, name, axes[name])
    caption(figure, "Circles of Table 2 of Xu and Li 2010")
    return whole(figure)


def _over_angle(runs: Sequence[Contour], ax: Axes) -> None:
    """Plot the error of the last turn of each circle, offset from each other."""
    apart = 1.15 * max(1e6 * run.metrics.peak_to_peak for run in runs)
    for row, run in enumerate(runs):
        part = run.last_turn
        angle = 360.0 * np.arange(part.sum()) / part.sum()
        ax.axhline(row * apart, **GUIDE)
        ax.plot(angle, row * apart + 1e6 * run.error[part], **{**ERROR, "linewidth": 0.8})
        label = f"{1e6 * (run.path.radius or 0.0):g} um"
        ax.annotate(label, (362.0, row * apart), va="center", annotation_clip=False)
    ax.set(xlabel="angle [deg]", ylabel="contour error [um], one radius above the other")
    ax.set(xticks=range(0, 361, 90), xlim=(0, 360))
    heading(ax, "0.1 Hz, last turn")


def _bars(table: Table2, name: str, ax: Axes) -> None:
    """Plot one statistic of the nine cases, published and obtained."""
    column, attribute = {
        "max": (2, "peak_to_peak"),
        "mean": (3, "mean_error"),
        "SD": (4, "sd_error"),
    }[name]
    cases = [case for case, _ in table.cases]
    places = np.arange(len(cases))
    published = [1e6 * case[column] for case in cases]
    obtained = [1e6 * getattr(run.metrics, attribute) for run in table.runs]
    ax.bar(
        places - 0.2, published, 0.4, color=MEASURED["color"], edgecolor="0.3", label="published"
    )
    ax.bar(places + 0.2, obtained, 0.4, color=ACTUAL["color"], edgecolor="0.1", label="obtained")
    what = "peak to peak" if name == "max" else name
    ax.set(ylabel=f"{what} [um]", xlabel="radius [um], and frequency [Hz]")
    labels = [f"{1e6 * case.radius:g}\n{case.frequency:g}" for case in cases]
    ax.set_xticks(places, labels, fontsize="small")
    ax.axhline(0.0, **{**GUIDE, "zorder": 2})
    legend_inside(ax)
