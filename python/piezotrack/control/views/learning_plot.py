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
    legend_inside,
    literal,
    panels,
    plain_log_ticks,
    thinned,
    whole,
)
from ..._support.units import drive_word, shown_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

    from ..learning.learn import Learning

__all__ = ["plot_learning"]


def plot_learning(learning: Learning, fig: Figure | SubFigure | None = None) -> Figure:
    """Plot errors of the first and the best trial, their tables, and the error of all trials.

    Parameters
    ----------
    learning : Learning
        The learning.
    fig : matplotlib.figure.Figure or SubFigure, optional
        Where to draw; a new figure where not given.

    Returns
    -------
    matplotlib.figure.Figure
        The figure drawn in.
    """
    figure = panels(fig, (7.2, 7.4))
    error, table, history = figure.subplots(3, 1)
    count = learning.learner.t.size
    for run, style, words in (
        (learning.first, ERROR, "first trial"),
        (learning.final, ACTUAL, f"trial {learning.best}"),
    ):
        last = 1e9 * run.error[-count:]
        k = thinned(last)
        error.plot(learning.learner.t[k], last[k], **{**style, "linewidth": 1.0, "label": words})
    error.axhline(0.0, **GUIDE)
    error.set(ylabel="desired less\nmeasured [nm]", xlabel="time in the trial [s]")
    unit, scale = shown_unit(learning.learner.controller.drive_unit)
    k = thinned(learning.tables[0])
    learnt = scale * (learning.table - learning.learner.feedforward)
    table.plot(learning.learner.t[k], learnt[k], **{**FEEDFORWARD, "label": "learnt"})
    table.axhline(0.0, **GUIDE)
    word = drive_word(learning.learner.controller.drive_unit)
    table.set(ylabel=f"{word} [{unit}]", xlabel="time in the trial [s]")
    for ax in (error, table):
        ax.margins(x=0)
        legend_inside(ax)
    _history(learning, history)
    figure.suptitle(
        literal(f"{learning.learner.reference.name}: learnt in {len(learning.trials)} trials"),
        fontsize="medium",
    )
    return whole(figure)


def _history(learning: Learning, ax: Axes) -> None:
    """Draw the rms error of each trial, and the noise in it."""
    trial = np.arange(len(learning.trials))
    ax.semilogy(trial, 1e9 * learning.errors, **{**ERROR, "marker": "o", "label": "rms error"})
    noise = [one.noise for one in learning.trials if one.noise is not None]
    if noise and max(noise) > 0.0:
        ax.axhline(1e9 * float(np.median(noise)), **{**LEVEL, "label": "what does not repeat"})
    ax.set(xlabel="trial", ylabel="rms error [nm]")
    ax.locator_params(axis="x", integer=True)
    plain_log_ticks(ax)
    legend_inside(ax)
