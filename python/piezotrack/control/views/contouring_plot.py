"""Pictures of a contouring run."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..._support.arguments import positive
from ..._support.display.plot_style import (
    ACTUAL,
    DESIRED,
    ERROR,
    LEVEL,
    QUIET,
    axes_or_new,
    caption,
    drawing,
    legend_inside,
    literal,
    share,
    sheet,
    stack,
    trace,
    whole,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure
    from numpy.typing import NDArray

    from ..loop.contouring import Contour

    Array = NDArray[np.float64]

__all__ = [
    "plot_contour",
    "plot_contour_error",
    "plot_magnified",
    "plot_path",
]

# Size of the largest error in the picture, as a part of the path's smaller side.
SHOWN = 0.12


@drawing
def plot_path(run: Contour, ax: Axes | None = None) -> Axes:
    """Plot the path and the measured positions in the plane, with the smooth start."""
    (ax,) = axes_or_new(ax, 1)
    start, part = run.t < run.settled, run.last_turn
    if start.any():
        mark = {**QUIET, "label": "approach"}
        ax.plot(1e6 * run.x.measured[start], 1e6 * run.y.measured[start], **mark)
    ax.plot(
        1e6 * run.x.measured[part], 1e6 * run.y.measured[part], **{**ACTUAL, "label": "measured"}
    )
    x, y = run.path.outline
    ax.plot(1e6 * x, 1e6 * y, **DESIRED)
    _plane(ax, run)
    return ax


@drawing
def plot_magnified(run: Contour, ax: Axes | None = None, factor: float | None = None) -> Axes:
    """Plot the contour error, magnified, along the path."""
    (ax,) = axes_or_new(ax, 1)
    part = run.last_turn
    if factor is None:
        side = min(float(np.ptp(axis)) for axis in run.path.outline)
        factor = _round_down(SHOWN * side / run.metrics.max_error)
    factor = positive("factor", factor, "1")
    x, y = run.path.outline
    ax.plot(1e6 * x, 1e6 * y, **{**DESIRED, "label": "path"})
    # The point of the path where the motion should be, and the normal to the left.
    (px, vx, _), (py, vy, _) = (axis.at(run.t[part]) for axis in run.path.axes)
    speed = np.maximum(np.hypot(vx, vy), 1e-30)
    off = factor * run.error[part]
    ax.plot(
        1e6 * (px - off * vy / speed),
        1e6 * (py + off * vx / speed),
        **{**ERROR, "label": f"contour error \N{MULTIPLICATION SIGN} {factor:g}"},
    )
    _plane(ax, run)
    return ax


@drawing
def plot_contour_error(run: Contour, ax: Axes | None = None) -> Axes:
    """Plot the measured contour error over the last turn, with mean and standard deviation."""
    (ax,) = axes_or_new(ax, 1)
    part = run.last_turn
    found = run.metrics
    mean, sd = 1e6 * found.mean_error, 1e6 * found.sd_error
    error = {**ERROR, "label": "contour error"}
    trace(
        ax,
        run.t[part],
        1e6 * run.error[part],
        error,
        xlabel="time [s]",
        ylabel="contour error [um]",
    )
    ax.axhline(mean, **{**LEVEL, "label": "mean"})
    ax.axhspan(mean - sd, mean + sd, color="0.9", zorder=0, label="mean \N{PLUS-MINUS SIGN} SD")
    legend_inside(ax, ncols=3)
    return ax


@drawing
def plot_contour(run: Contour, fig: Figure | SubFigure | None = None) -> Figure:
    """Plot path, magnified error, errors of the axes and contour error, in the last turn."""
    rows = (("path", "magnified"), ("x", "error"), ("y", "error"))
    figure, axes = sheet(fig, (11.0, 8.6), rows, heights=(3.2, 1.0, 1.0), least=1.0, down=True)
    plot_path(run, axes["path"])
    plot_magnified(run, axes["magnified"])
    part = run.last_turn
    share(axes["y"], axes["x"], "y")
    for name, axis in (("x", run.x), ("y", run.y)):
        error = 1e6 * axis.error[part]
        trace(axes[name], run.t[part], error, ERROR, zero=True)
        axes[name].set(xlabel="time [s]", ylabel=f"error of {name} [um]")
    stack((axes["x"], axes["y"]), numbers=True)
    plot_contour_error(run, axes["error"])
    metrics = run.metrics
    caption(
        figure,
        f"{literal(run.path.name)}: {_parts(run)} at {1.0 / run.x.controller.dt:.6g} Hz\n"
        f"contour error {1e6 * metrics.peak_to_peak:.3f} um peak to peak, "
        f"mean {1e6 * metrics.mean_error:.3f} um, SD {1e6 * metrics.sd_error:.3f} um",
        "medium",
    )
    return whole(figure)


def _parts(run: Contour) -> str:
    """Name the parts of the controllers, once where those of both axes are the same."""
    x, y = run.x.controller.title, run.y.controller.title
    return x if x == y else f"x {x}, y {y}"


def _plane(ax: Axes, run: Contour) -> None:
    """Label a picture in the plane, and crop most of the smooth start."""
    ax.set(xlabel="x [um]", ylabel="y [um]", aspect="equal")
    edges = [(1e6 * float(axis.min()), 1e6 * float(axis.max())) for axis in run.path.outline]
    room = 0.2 * max(high - low for low, high in edges)
    ax.set(
        xlim=(edges[0][0] - room, edges[0][1] + room),
        ylim=(edges[1][0] - room, edges[1][1] + room),
    )
    legend_inside(ax, ncols=3)


def _round_down(value: float) -> float:
    """Return the largest of 1, 2, 5, 10, ... that is not above `value`, 1 at least."""
    if not value > 1.0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(step * power for step in (1.0, 2.0, 5.0) if step * power <= value))
