"""Picture of a comparison: loops and errors in the worst cycle, RMS as bars, errors over time."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from ..._support.display.plot_style import (
    GUIDE,
    MEASURED,
    MODELS,
    QUIET,
    caption,
    drawing,
    heading,
    is_narrow,
    literal,
    names_beside,
    panels,
    share,
    trace,
    whole,
)
from ..._support.units import best_length_unit, shown_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure
    from numpy.typing import NDArray

    from ..comparison.compare import Comparison, ModelScore

    Array = NDArray[np.float64]

__all__ = ["plot_comparison"]

FITTED: dict[str, Any] = {"color": "0.8", "edgecolor": "0.3", "hatch": "///", "label": "fitted"}
JUDGED: dict[str, Any] = {"color": "0.35", "edgecolor": "0.2", "label": "not fitted"}


@drawing
def plot_comparison(comparison: Comparison, fig: Figure | SubFigure | None = None) -> Figure:
    """Put loops, errors and bars on one sheet."""
    rows = comparison.rows
    size = (11.0, max(8.2, 0.9 * len(rows) + 3.0))
    if is_narrow(fig, size):
        figure = panels(fig, (11.0, 18.0 + 2.2 * len(rows)))
        grid = figure.add_gridspec(2, 1, height_ratios=[18.0, 2.2 * len(rows)])
    else:
        figure = panels(fig, size)
        grid = figure.add_gridspec(1, 2, width_ratios=[1.0, 1.35])
    # The names have a place of their own below the loop.
    heights = [1.5, 0.3 + 0.045 * len(rows), 1.1, 0.7 + 0.24 * len(rows)]
    left = grid[0].subgridspec(len(heights), 1, height_ratios=heights)
    right = grid[1].subgridspec(len(rows), 1)
    loop = figure.add_subplot(left[0])
    _loops(comparison, loop, figure.add_subplot(left[-2], sharex=loop))
    below = figure.add_subplot(left[1])
    below.set_axis_off()
    named = loop.get_legend_handles_labels()
    below.legend(*named, loc="center", frameon=False, fontsize="small", handlelength=4.0)
    _bars(comparison, figure.add_subplot(left[-1]))
    _errors(comparison, [figure.add_subplot(right[i]) for i in range(len(rows))])
    caption(figure, _title(comparison))
    return whole(figure)


def _title(comparison: Comparison) -> str:
    """Write what was compared, and which model was best."""
    best, count = comparison.best, len(comparison.rows)
    where = "" if comparison.carried else f", {literal(comparison.test.source or 'other record')}"
    return (
        f"{count} {'model' if count == 1 else 'models'} fitted to "
        f"{literal(comparison.train.source or 'one record')}; best where not fitted{where}:\n"
        f"{literal(best.title)}, {best.test.rms_percent:.3g} % of stroke rms"
    )


def _loops(comparison: Comparison, loop: Axes, off: Axes) -> None:
    """Draw the cycle on which a model is furthest off: loops, and errors over the drive."""
    data = comparison.test
    followed = [comparison.followed(row, "test") for row in comparison.rows]
    part = _cycle(data.u, np.max([np.abs(data.y - x) for x in followed], axis=0))
    drive, times = shown_unit(data.drive_unit)
    u, y = times * data.u[part], data.y[part]
    unit, scale = best_length_unit(data.stroke)
    worst = max(float(np.abs(y - x[part]).max()) for x in followed)
    small, fine = best_length_unit(worst)
    loop.plot(u, scale * y, **MEASURED)
    for row, x, line in zip(comparison.rows, followed, _lines(comparison), strict=True):
        loop.plot(u, scale * x[part], label=literal(row.title), linewidth=1.1, **line)
        off.plot(u, fine * (y - x[part]), label=literal(row.title), linewidth=1.1, **line)
    off.axhline(0.0, **GUIDE)
    loop.set(ylabel=f"displacement [{unit}]")
    loop.tick_params(labelbottom=False)
    off.set(xlabel=f"drive [{literal(drive)}]", ylabel=f"error [{small}]")
    when = f"{data.t[part][0]:.4g} to {data.t[part][-1]:.4g} s"
    where = "" if comparison.carried else f" of {literal(data.source or 'the other record')}"
    heading(loop, f"Loop with the largest error\n({when}{where})")
    heading(off, "Its error = measured - simulated")


def _cycle(u: Array, off: Array) -> slice:
    """Find the cycle of a drive with the largest error, all of it where there is no cycle."""
    middle = 0.5 * (float(u.min()) + float(u.max()))
    up = np.flatnonzero((u[:-1] < middle) & (u[1:] >= middle)) + 1
    cycles = [slice(int(first), int(last) + 1) for first, last in pairwise(up)]
    return max(cycles, key=lambda one: float(off[one].max()), default=slice(None))


def _bars(comparison: Comparison, ax: Axes) -> None:
    """Draw the RMS of each model on both parts."""
    rows = comparison.rows
    places = np.arange(float(len(rows)))
    for shift, style, scores in (
        (-0.2, FITTED, [row.train for row in rows]),
        (0.2, JUDGED, [row.test for row in rows]),
    ):
        lengths = [score.rms_percent for score in scores]
        bars = ax.barh(places + shift, lengths, height=0.38, **style)
        ax.bar_label(bars, fmt=" %.3g", fontsize="small")
    names_beside(ax, places, [row.title for row in rows])
    ax.invert_yaxis()
    ax.margins(x=0.3)
    ax.set(xlabel="rms error [% of stroke]")
    ax.legend(fontsize="small", frameon=False, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2)


def _errors(comparison: Comparison, axes: list[Axes]) -> None:
    """Draw measured less simulated over time, one model below the other on one scale."""
    first, second = comparison.train, comparison.test
    # Another record is drawn after the end of the first.
    gap = 0.0 if comparison.carried else float(first.t[-1] - second.t[0]) + second.dt
    # The test may also come before what was fitted.
    split = max(float(first.t[0]), float(second.t[0]) + gap) - 0.5 * first.dt
    worst = max(max(row.train.max_error, row.test.max_error) for row in comparison.rows)
    unit, scale = best_length_unit(worst)
    reach = 1.1 * scale * worst or 1.0
    for ax, row, line in zip(axes, comparison.rows, _lines(comparison), strict=True):
        for t, error in (
            (first.t, first.y - comparison.followed(row, "train")),
            (second.t + gap, second.y - comparison.followed(row, "test")),
        ):
            trace(ax, t, scale * error, {"color": line["color"], "linewidth": 0.7})
        ax.axhline(0.0, **GUIDE)
        ax.axvline(split, **QUIET)
        ax.set_ylim(-reach, reach)
        if ax is axes[len(axes) // 2]:
            ax.set_ylabel(f"error [{unit}]")
        ax.set_title(_heading(row), fontsize="small", loc="left")
        share(ax, axes[0])
        ax.tick_params(labelbottom=ax is axes[-1])
    how = "" if comparison.carried else ", the other record after the first"
    axes[-1].set_xlabel(f"time [s]{how}")
    words = ("fitted ", " not fitted")
    if float(second.t[0]) + gap < first.t[0]:
        words = ("not fitted ", " fitted")
    for text, side in zip(words, ("right", "left"), strict=True):
        axes[0].annotate(
            text,
            (split, 0.96),
            xycoords=("data", "axes fraction"),
            fontsize="small",
            ha=side,
            va="top",
            color="0.2",
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.0},
        )


def _heading(row: ModelScore) -> str:
    best = f"{literal(row.title)}: rms {row.train.rms_percent:.3g} % fitted"
    return f"{best}, {row.test.rms_percent:.3g} % not fitted"


def _lines(comparison: Comparison) -> list[dict[str, Any]]:
    """Give each model its line."""
    return [MODELS[i % len(MODELS)] for i in range(len(comparison.rows))]
