"""Picture of a loop's stability: open loop, sensitivity, learning."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..._support.display.plot_style import (
    ACTUAL,
    COMMAND,
    ERROR,
    GUIDE,
    LEVEL,
    REPETITIVE,
    caption,
    drawing,
    legend_inside,
    sheet,
    stack,
    whole,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

    from ..loop.stability import LoopReport

__all__ = ["plot_loop_report"]

# Smallest magnitude that is shown.
LOWEST = 1e-4


@drawing
def plot_loop_report(report: LoopReport, fig: Figure | SubFigure | None = None) -> Figure:
    """Plot open loop, sensitivity and, with a repetitive part, the error left by a period."""
    curves = report.response()
    f = curves.frequency
    figure, axes = sheet(fig, (7.0, 7.4), (("size",), ("phase",), ("parts",)))
    size, phase, parts = axes.values()
    dark = {**COMMAND, "color": "0.2", "linewidth": 1.4}
    size.loglog(f, np.abs(curves.open_loop), **{**dark, "label": "open loop |L|"})
    size.axhline(1.0, **GUIDE)
    size.set(xlabel="frequency [Hz]", ylabel="magnitude")
    degrees = np.degrees(np.angle(curves.open_loop))
    # A line across the panel would be drawn where the phase goes through -180 degrees.
    degrees[1:][np.abs(np.diff(degrees)) > 180.0] = np.nan
    phase.semilogx(f, degrees, **{**dark, "label": "phase of L"})
    phase.set(xlabel="frequency [Hz]", ylabel="phase [deg]")
    phase.set(ylim=(-190, 190), yticks=(-180, -90, 0, 90, 180))
    parts.loglog(f, np.abs(curves.sensitivity), **{**ERROR, "label": "sensitivity |S|"})
    closed = {**ACTUAL, "linewidth": 1.2, "label": "complementary |T|"}
    parts.loglog(f, np.abs(curves.complementary), **closed)
    if np.any(curves.learning):
        left = {**REPETITIVE, "label": "error left after a period"}
        parts.loglog(f, curves.learning, **left)
    parts.axhline(1.0, **GUIDE)
    parts.set(xlabel="frequency [Hz]", ylabel="magnitude")
    _mark_crossover(report, size, phase)
    stack((size, phase, parts))
    for ax in (size, parts):
        ax.set_ylim(bottom=max(LOWEST, ax.get_ylim()[0]))
        ax.margins(x=0)
        legend_inside(ax)
    legend_inside(phase)
    gain, verdict = str(report.middle).split(": ", 1)
    words = f"{report.controller.title} on a stage of {gain}: {verdict}"
    caption(figure, words, "medium")
    return whole(figure)


def _mark_crossover(report: LoopReport, *axes: Axes) -> None:
    """Draw a line where the open loop crosses 1, at which the phase margin is read."""
    crossover = report.middle.crossover
    # With a repetitive part it is known of the feedback alone, which is not what is drawn.
    if crossover is None or report.controller.repetitive is not None:
        return
    for ax in axes:
        ax.axvline(crossover, **LEVEL, zorder=0, label=f"crossover {crossover:.3g} Hz")
