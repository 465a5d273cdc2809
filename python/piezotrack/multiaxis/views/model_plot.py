"""Pictures of stages of several axes: responses over levels, residuals, closed loops."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..._support.display.plot_style import (
    DESIRED,
    MODELS,
    axes_or_new,
    caption,
    drawing,
    legend_inside,
    sheet,
    stack,
    trace,
    whole,
)
from ..._support.units import best_length_unit, drive_text, shown_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

    from ..loop.closed_loop import MultiAxisTracking
    from ..modal_model import MultiAxisModel

__all__ = ["plot_model", "plot_tracking"]

# Points of a modelled response where none was measured; lines averaged into one of a residual.
POINTS, AVERAGED = 2000, 9


@drawing
def plot_model(model: MultiAxisModel, fig: Figure | SubFigure | None = None) -> Figure:
    """Plot each response at each level, measured with its band of 95 % and modelled, and residuals.

    Dotted lines are what the modes leave, as a mean of neighbouring lines.
    """
    rows = [[f"{i}{j}" for j in range(model.drives)] for i in range(model.sensors)]
    figure, axes = sheet(fig, (4.2 * model.drives, 3.0 * model.sensors), rows)
    for i in range(model.sensors):
        for j in range(model.drives):
            _draw_entry(model, axes[f"{i}{j}"], i, j)
            axes[f"{i}{j}"].set_title(f"sensor {i}, drive {j}", fontsize="small")
    first = next(iter(axes.values()))
    legend_inside(first, ncols=2)
    caption(
        figure,
        "Measured responses with their bands, the modes (lines) and the residual (dotted)",
        "medium",
    )
    return whole(figure)


def _draw_entry(model: MultiAxisModel, ax: Axes, i: int, j: int) -> None:
    """Draw one response over the levels."""
    (ax,) = axes_or_new(ax, 1)
    (above, scale), (below, divisor) = shown_unit(model.output_unit), shown_unit(model.drive_unit)
    scale /= divisor
    for k, one in enumerate(model.levels):
        color = MODELS[k % len(MODELS)]["color"]
        label = f"{drive_text(float(f'{one.level:.3g}'), model.drive_unit)} rms"
        if model.responses:
            response = model.responses[k]
            f = response.frequency
            measured, band = np.abs(response.value[:, i, j]), response.band()[:, i, j]
            low = np.maximum(measured - band, 1e-2 * measured)
            ax.fill_between(
                f, scale * low, scale * (measured + band), color=color, alpha=0.25, lw=0
            )
            modelled = one.terms.response(response.z)[:, i, j]
            rest = np.square(np.abs(response.value[:, i, j] - modelled))
            window = np.ones(min(AVERAGED, rest.size)) / min(AVERAGED, rest.size)
            left = np.sqrt(np.convolve(rest, window, "same"))
            ax.semilogy(f, scale * left, color=color, linestyle=":", linewidth=0.8)
        else:
            f = np.linspace(0.0, 0.5 / model.dt, POINTS + 1)[1:]
            modelled = one.terms.response(np.exp(2j * np.pi * f * model.dt))[:, i, j]
        ax.semilogy(f, scale * np.abs(modelled), color=color, linewidth=1.1, label=label)
    ax.set(xlabel="frequency [Hz]", ylabel=f"[{above}/{below}]")
    ax.margins(x=0)


@drawing
def plot_tracking(run: MultiAxisTracking, fig: Figure | SubFigure | None = None) -> Figure:
    """Plot desired and actual displacement of each axis."""
    sensors = run.y.shape[1]
    figure, axes = sheet(fig, (8.0, 1.9 * sensors), [[f"axis {k}"] for k in range(sensors)])
    time = run.dt * np.arange(len(run.y), dtype=np.float64)
    for k, (name, ax) in enumerate(axes.items()):
        style = {**MODELS[k % len(MODELS)], "linestyle": "-", "linewidth": 1.3, "label": "actual"}
        signals = run.y[:, k], run.reference[:, k]
        unit, scale = best_length_unit(max(float(np.abs(one).max()) for one in signals))
        trace(ax, time, scale * signals[0], style)
        trace(ax, time, scale * signals[1], DESIRED)
        ax.set(xlabel="time [s]", ylabel=f"{name} [{unit}]")
    stack(list(axes.values()), numbers=True)
    legend_inside(next(iter(axes.values())), ncols=2)
    caption(figure, run.note, "medium")
    return whole(figure)
