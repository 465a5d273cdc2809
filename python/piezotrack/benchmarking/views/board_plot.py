"""Picture of a benchmark: one panel a record, one line a model, on a logarithmic scale."""

from __future__ import annotations

import math
from itertools import cycle
from typing import TYPE_CHECKING, Any

from ..._support.display.look import look
from ..._support.display.plot_style import (
    LEVEL,
    drawing,
    in_rows,
    is_narrow,
    legend_inside,
    literal,
    names_beside,
    plain_log_ticks,
    sheet,
    whole,
)
from .board_table import title_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

    from ..board import Benchmark, BenchmarkResult

__all__ = ["plot_board"]

# Records side by side.
COLUMNS = 2
FITTED: dict[str, Any] = {"marker": "|", "color": "0.35", "markersize": 11, "markeredgewidth": 1.6}
CARRIED: dict[str, Any] = {"marker": "o", "color": "#d98200", "markersize": 6}
# Other records, in their order; from the fifth on again.
OTHERS: tuple[dict[str, Any], ...] = (
    {"marker": "D", "color": "#1b6ca8", "markersize": 6},
    {"marker": "s", "color": "#7a3b8f", "markersize": 6},
    {"marker": "^", "color": "#2e7d32", "markersize": 7},
    {"marker": "v", "color": "#a3333d", "markersize": 7},
)


@drawing
def plot_board(board: Benchmark, fig: Figure | SubFigure | None = None) -> Figure:
    """Draw the rms of each model on each part of each record."""
    tables = {name: [row for row in board.of(name) if row.parts] for name in board.records}
    tables = {name: rows for name, rows in tables.items() if rows}
    across = min(COLUMNS, max(1, len(tables)))
    if is_narrow(fig, (7.2 * across, 3.4)):
        across = 1
    lines = in_rows(tables or ["none"], across)
    heights = [max(len(tables.get(name, ())) for name in line) + 3.2 for line in lines]
    size = (7.2 * across, max(3.4, 0.27 * sum(heights)))
    # Letters do not shrink with the width: there is more height in its place.
    scale = size[0] / look().size(*size)[0]
    size = size[0], size[1] * max(1.0, 0.75 * scale)
    figure, axes = sheet(fig, size, lines, heights=heights)
    if not tables:
        axes["none"].text(0.5, 0.5, "no model was found", ha="center")
        axes["none"].set_axis_off()
    for name, rows in tables.items():
        _record(rows, axes[name])
    return whole(figure)


def _record(rows: list[BenchmarkResult], ax: Axes) -> None:
    """Draw the models of a record, the best at the top."""
    styles = {part.part: style for part, style in zip(rows[0].parts, _styles(rows), strict=True)}
    places = range(len(rows))
    for place, row in zip(places, rows, strict=True):
        shown = [max(part.rms_percent, 1e-6) for part in row.parts]
        ax.plot([min(shown), max(shown)], [place, place], color="0.8", linewidth=1.0, zorder=0)
    for i, (part, style) in enumerate(styles.items()):
        values = [max(row.parts[i].rms_percent, 1e-6) for row in rows]
        ax.plot(values, list(places), linestyle="none", label=literal(part), **style)
    noise = 100.0 * rows[0].noise / rows[0].stroke
    if math.isfinite(noise):
        ax.axvline(noise, **LEVEL, label="noise")
    ax.set_xscale("log")
    plain_log_ticks(ax, "x")
    names_beside(ax, places, [title_of(row) for row in rows])
    ax.tick_params(axis="y", labelsize="small")
    ax.set_ylim(len(rows) - 0.4, -0.6)
    ax.set_xlabel("rms error [% of stroke fitted]", fontsize="small")
    ax.grid(axis="x", color="0.92", linewidth=0.8)
    ax.set_axisbelow(True)
    ax.set_title(literal(rows[0].record_title), fontsize="medium", loc="left")
    legend_inside(ax, ncols=6)


def _styles(rows: list[BenchmarkResult]) -> list[dict[str, Any]]:
    """Give each part its mark: what was fitted, the rest of the record, and other records."""
    others, styles = cycle(OTHERS), []
    for part in rows[0].parts:
        if part.part == "fitted":
            styles.append(FITTED)
        elif part.part == "rest":
            styles.append(CARRIED)
        else:
            styles.append(next(others))
    return styles
