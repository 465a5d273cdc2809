"""Picture of the demonstration: the loop of actual over desired displacement, before and after."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..._support.display.plot_style import (
    ERROR,
    FEEDFORWARD,
    GUIDE,
    RECORDED,
    drawing,
    heading,
    legend_inside,
    share,
    sheet,
    trace,
    whole,
)
from ...control.views.tracking_plot import plot_following

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy as np
    from matplotlib.figure import Figure, SubFigure
    from numpy.typing import NDArray

    from ...control.loop.tracking import Tracking

__all__ = ["plot_before_and_after"]

# Errors without compensation, with feedforward alone, with all.
STYLES: tuple[dict[str, Any], ...] = (
    {"color": RECORDED["color"], "linewidth": 1.1},
    {"color": FEEDFORWARD["color"], "linewidth": 0.9},
    ERROR,
)


@drawing
def plot_before_and_after(
    runs: Mapping[str, Tracking], fig: Figure | SubFigure | None = None
) -> Figure:
    """Draw actual over desired displacement of the first and the last run, and all errors."""
    rows = (("before", "after"), ("error", "error"))
    figure, axes = sheet(fig, (10.0, 7.4), rows, heights=(1.7, 1.0))
    names = list(runs)
    left, right, below = (axes[name] for name in ("before", "after", "error"))
    share(right, left)
    share(right, left, "y")
    for ax, when, name in ((left, "Before", names[0]), (right, "After", names[-1])):
        plot_following(runs[name], ax)
        rms = 1e6 * runs[name].metrics.rms_error
        heading(ax, f"{when}: {name}, error {rms:.2g} um rms")
    for name, style in zip(names, STYLES, strict=True):
        part = _settled(runs[name])
        error = 1e6 * runs[name].error[part]
        trace(below, runs[name].t[part], error, {**style, "label": name})
    below.axhline(0.0, **GUIDE)
    below.set(xlabel="time [s], after the smooth start", ylabel="desired - measured [um]")
    legend_inside(below)
    return whole(figure)


def _settled(run: Tracking) -> NDArray[np.bool_]:
    return run.part(run.t, None, None)
