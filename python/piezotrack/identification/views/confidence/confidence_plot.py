"""Picture of intervals of confidence: profiles of the cost, or distributions of refits."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ...._support.display.plot_style import (
    GREY,
    GUIDE,
    LEVEL,
    MARKS,
    SIMULATED,
    caption,
    drawing,
    heading,
    in_rows,
    leftmost,
    literal,
    sheet,
    whole,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

    from ...fitted.certainty.confidence import Confidence, ParameterInterval

__all__ = ["plot_confidence"]

# Panels in a row, and rise over the threshold up to which a profile is drawn.
ACROSS, HIGHEST = 4, 3.0
BINS, POINTS = 24, 400


@drawing
def plot_confidence(confidence: Confidence, fig: Figure | SubFigure | None = None) -> Figure:
    """Draw the rise of the cost along each parameter, or the distribution of its refits."""
    each = confidence.parameters
    across = min(ACROSS, max(len(each), 1))
    rows = in_rows(each, across)
    figure, axes = sheet(fig, (3.1 * across, 0.6 + 2.6 * len(rows)), rows)
    for name, one in each.items():
        ax = axes[name]
        _interval(ax, one)
        if confidence.draws:
            ax.hist(one.values, BINS, color=GREY)
            ax.set_ylabel("refits")
        else:
            _profile(ax, one)
            ax.set_ylabel("rise of the cost / threshold")
        unit = f" [{literal(one.unit)}]" if one.unit else ""
        ax.set_xlabel(f"{name}{unit}")
        heading(ax, one.shape or "")
    leftmost(axes.values(), numbers=True)
    caption(figure, f"Intervals of {100.0 * confidence.level:g} %")
    return whole(figure)


def _interval(ax: Axes, one: ParameterInterval) -> None:
    """Draw the interval as a band, up to the bounds where it is open."""
    low, high = one.bounds or one.interval
    lower, upper = one.interval
    ends = lower if math.isfinite(lower) else low, upper if math.isfinite(upper) else high
    ax.axvspan(*ends, color="#d8e6f1", zorder=0)
    ax.axvline(one.value, **GUIDE)


def _profile(ax: Axes, one: ParameterInterval) -> None:
    """Draw a profile as far as it is near the threshold.

    Its root goes straight between points; at a bound the profile itself.
    """
    near = np.flatnonzero(one.rises <= HIGHEST)
    inside = one.values[near]
    width = float(np.ptp(inside)) or abs(one.value)
    low, high = float(inside[0]) - 0.15 * width, float(inside[-1]) + 0.15 * width
    drawn = np.linspace(max(low, one.values[0]), min(high, one.values[-1]), POINTS)
    power = 1.0 if one.on_bound else 2.0
    straight = np.interp(drawn, one.values, one.rises ** (1.0 / power))
    ax.plot(drawn, straight**power, **SIMULATED)
    ax.plot(one.values, one.rises, **{**MARKS, "markersize": 3.5})
    ax.axhline(1.0, **LEVEL)
    ax.set(xlim=(low, high), ylim=(-0.05 * HIGHEST, HIGHEST))
