"""Picture of a comparison: loops and errors in the worst cycle, RMS as bars, errors over time."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from ..._support.display.look import CHOSEN
from ..._support.display.plot_style import (
    GUIDE,
    MEASURED,
    MODELS,
    QUIET,
    caption,
    columns,
    drawing,
    heading,
    legend_below,
    literal,
    names_beside,
    stack,
    trace,
    whole,
)
from ..._support.units import best_length_unit, shown_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure
    from numpy.typing import NDArray

    from ...data.dataset import Dataset
    from ..comparison.compare import Comparison, ModelScore

    Array = NDArray[np.float64]

__all__ = ["plot_comparison"]

FITTED: dict[str, Any] = {"color": "0.8", "edgecolor": "0.3", "hatch": "///", "label": "fitted"}
JUDGED: dict[str, Any] = {"color": "0.35", "edgecolor": "0.2", "label": "not fitted"}


@drawing
def plot_comparison(comparison: Comparison, fig: Figure | SubFigure | None = None) -> Figure:
    """Put loops, errors and bars on one sheet."""
    rows = comparison.rows
    # The names have a place of their own below the loop.
    left = {"loop": 2.6, "loop error": 1.9, "rms": 1.2 + 0.4 * len(rows)}
    right = {f"error of {row.name}": 1.1 for row in rows}
    figure, axes = columns(fig, 11.0, (left, right), (1.0, 1.35))
    followed = [comparison.followed(row, "test") for row in rows]
    cycle = _cycle(comparison.test, followed)
    _loop(comparison, followed, cycle, axes["loop"])
    _loop_error(comparison, followed, cycle, axes["loop error"])
    stack([axes["loop"], axes["loop error"]])
    _bars(comparison, axes["rms"])
    below = [axes[name] for name in right]
    for row, line, ax in zip(rows, _lines(comparison), below, strict=True):
        _error(comparison, row, line["color"], ax)
    stack(below)
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


def _cycle(data: Dataset, followed: list[Array]) -> slice:
    """Find the cycle with the largest error of a model, all of it where there is no cycle."""
    u, off = data.u, np.max([np.abs(data.y - x) for x in followed], axis=0)
    middle = 0.5 * (float(u.min()) + float(u.max()))
    up = np.flatnonzero((u[:-1] < middle) & (u[1:] >= middle)) + 1
    cycles = [slice(int(first), int(last) + 1) for first, last in pairwise(up)]
    return max(cycles, key=lambda one: float(off[one].max()), default=slice(None))


def _loop(comparison: Comparison, followed: list[Array], cycle: slice, ax: Axes) -> None:
    """Draw the loops of a cycle."""
    data = comparison.test
    unit, scale = best_length_unit(data.stroke)
    _, times = shown_unit(data.drive_unit)
    ax.plot(times * data.u[cycle], scale * data.y[cycle], **MEASURED)
    _over_drive(comparison, [scale * x for x in followed], cycle, ax)
    ax.set_ylabel(f"displacement [{unit}]")
    when = f"{data.t[cycle][0]:.4g} to {data.t[cycle][-1]:.4g} s"
    where = "" if comparison.carried else f" of {literal(data.source or 'the other record')}"
    heading(ax, f"Loop with the largest error\n({when}{where})")
    legend_below(ax)


def _loop_error(comparison: Comparison, followed: list[Array], cycle: slice, ax: Axes) -> None:
    """Draw the errors of a cycle over the drive."""
    errors = [comparison.test.y - x for x in followed]
    unit, scale = best_length_unit(max(float(np.abs(one[cycle]).max()) for one in errors))
    _over_drive(comparison, [scale * one for one in errors], cycle, ax)
    ax.axhline(0.0, **GUIDE)
    ax.set_ylabel(f"error [{unit}]")
    heading(ax, "Its error = measured - simulated")


def _over_drive(comparison: Comparison, signals: list[Array], cycle: slice, ax: Axes) -> None:
    """Draw a signal of each model in a cycle over the drive."""
    drive, times = shown_unit(comparison.test.drive_unit)
    u = times * comparison.test.u[cycle]
    for row, one, line in zip(comparison.rows, signals, _lines(comparison), strict=True):
        ax.plot(u, one[cycle], label=literal(row.title), linewidth=1.1, **line)
    ax.set_xlabel(f"drive [{literal(drive)}]")


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


def _error(comparison: Comparison, row: ModelScore, color: str, ax: Axes) -> None:
    """Draw measured less simulated of a model over time, on one scale for all models."""
    first, second = comparison.train, comparison.test
    # Another record is drawn after the end of the first.
    gap = 0.0 if comparison.carried else float(first.t[-1] - second.t[0]) + second.dt
    # The test may also come before what was fitted.
    split = max(float(first.t[0]), float(second.t[0]) + gap) - 0.5 * first.dt
    worst = max(max(one.train.max_error, one.test.max_error) for one in comparison.rows)
    unit, scale = best_length_unit(worst)
    reach = 1.1 * scale * worst or 1.0
    for t, error in (
        (first.t, first.y - comparison.followed(row, "train")),
        (second.t + gap, second.y - comparison.followed(row, "test")),
    ):
        trace(ax, t, scale * error, {"color": color, "linewidth": 0.7})
    ax.axhline(0.0, **GUIDE)
    ax.axvline(split, **QUIET)
    ax.set_title(_heading(row), fontsize="small", loc="left")
    how = "" if comparison.carried else ", the other record after the first"
    ax.set(xlabel=f"time [s]{how}", ylabel=f"error [{unit}]", ylim=(-reach, reach))
    # In one picture they are named at the top.
    words = ("fitted ", " not fitted") if CHOSEN.get() or row is comparison.rows[0] else ()
    if words and float(second.t[0]) + gap < first.t[0]:
        words = ("not fitted ", " fitted")
    for text, side in zip(words, ("right", "left"), strict=False):
        ax.annotate(
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
