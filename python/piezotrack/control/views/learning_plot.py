"""Picture of a learnt table: errors before and after, tables, and errors of all trials."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..._support.display.plot_style import (
    ACTUAL,
    ERROR,
    FEEDFORWARD,
    GUIDE,
    LEVEL,
    caption,
    drawing,
    legend_inside,
    literal,
    plain_log_ticks,
    sheet,
    trace,
    whole,
)
from ..._support.units import drive_word, shown_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

    from ..learning.learn import Learning

__all__ = ["plot_learning"]


@drawing
def plot_learning(learning: Learning, fig: Figure | SubFigure | None = None) -> Figure:
    """Plot errors of the first and the best trial, their tables, and the error of all trials."""
    figure, axes = sheet(fig, (7.2, 7.4), (("error",), ("table",), ("history",)))
    controller, t = learning.learner.controller, learning.learner.t
    for run, style, words in (
        (learning.first, ERROR, "first trial"),
        (learning.final, ACTUAL, f"trial {learning.best}"),
    ):
        line = {**style, "linewidth": 1.0, "label": words}
        trace(axes["error"], t, 1e9 * run.error[-t.size :], line)
    unit, scale = shown_unit(controller.drive_unit)
    learnt = scale * (learning.table - learning.learner.feedforward)
    trace(axes["table"], t, learnt, {**FEEDFORWARD, "label": "learnt"})
    words = f"{drive_word(controller.drive_unit)} [{unit}]"
    for name, label in (("error", "desired - measured [nm]"), ("table", words)):
        axes[name].axhline(0.0, **GUIDE)
        axes[name].set(xlabel="time in the trial [s]", ylabel=label)
        legend_inside(axes[name])
    _history(learning, axes["history"])
    name = learning.learner.reference.name
    caption(figure, literal(f"{name}: learnt in {len(learning.trials)} trials"), "medium")
    return whole(figure)


def _history(learning: Learning, ax: Axes) -> None:
    """Draw the rms error of each trial, and the noise in it."""
    trial = np.arange(len(learning.trials))
    ax.semilogy(trial, 1e9 * learning.errors, **{**ERROR, "marker": "o", "label": "rms error"})
    noise = [one.noise for one in learning.trials if one.noise is not None]
    if noise and max(noise) > 0.0:
        ax.axhline(1e9 * float(np.median(noise)), **{**LEVEL, "label": "noise (not repeatable)"})
    ax.set(xlabel="trial", ylabel="rms error [nm]")
    ax.locator_params(axis="x", integer=True)
    plain_log_ticks(ax)
    legend_inside(ax)
