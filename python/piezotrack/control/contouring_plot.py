"""Pictures of a path that was run, and of a sensor at rest."""

from __future__ import annotations

from typing import TYPE_CHECKING

import matplotlib.pyplot as plt
import numpy as np

from .._support.plot_style import axes_or_new, plain_log_ticks
from .._support.plot_style import ACTUAL, DESIRED, above
from .._support.units import best_length_unit

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from .contouring import Contour
    from ..identification.sensor_noise import Noise
    from ..xu_li_2010.table_2 import Table2

    Array = NDArray[np.float64]

__all__ = [
    "plot_contour",
    "plot_contour_error",
    "plot_magnified",
    "plot_noise",
    "plot_path",
    "plot_table_2",
]

# How large the largest error is drawn, as a part of the path's smaller side.
SHOWN = 0.12


def plot_path(run: Contour, ax: Axes | None = None) -> Axes:
    """Plot the path and the measured positions in the plane, with the way to the path.

    Parameters
    ----------
    run : Contour
        A path that was run.
    ax : matplotlib.axes.Axes, optional
        Where to.

    Returns
    -------
    matplotlib.axes.Axes
        With the picture.
    """
    (ax,) = axes_or_new(ax, 1)
    x, y = run.path.outline
    ax.plot(1e6 * x, 1e6 * y, **{**DESIRED, "linewidth": 2.6, "color": "0.72"})
    way, part = run.t < run.settled, _last(run)
    ax.plot(
        1e6 * run.x.measured[way], 1e6 * run.y.measured[way], color="0.5", linewidth=0.6, ls=":"
    )
    ax.plot(1e6 * run.x.measured[part], 1e6 * run.y.measured[part], **{**ACTUAL, "linewidth": 0.9})
    _plane(ax, run)
    above(ax)
    return ax


def plot_magnified(run: Contour, ax: Axes | None = None, factor: float | None = None) -> Axes:
    """Plot the contour error, magnified, along the path.

    Parameters
    ----------
    run : Contour
        A path that was run.
    ax : matplotlib.axes.Axes, optional
        Where to.
    factor : float, optional
        By how much; a round number that keeps the errors readable where it is not given.

    Returns
    -------
    matplotlib.axes.Axes
        With the picture.
    """
    (ax,) = axes_or_new(ax, 1)
    part = _last(run)
    if factor is None:
        side = min(float(np.ptp(axis)) for axis in run.path.outline)
        factor = _round_down(SHOWN * side / run.metrics.max_error)
    x, y = run.path.outline
    ax.plot(1e6 * x, 1e6 * y, color="0.72", linewidth=1.6, label="path")
    # The place on the path where the motion should be, and to the left of its direction.
    (px, vx, _), (py, vy, _) = (axis.at(run.t[part]) for axis in run.path.axes)
    speed = np.maximum(np.hypot(vx, vy), 1e-30)
    off = factor * run.error[part]
    ax.plot(
        1e6 * (px - off * vy / speed),
        1e6 * (py + off * vx / speed),
        color="C3",
        linewidth=0.8,
        label=f"contour error x {factor:g}",
    )
    _plane(ax, run)
    above(ax)
    return ax


def plot_contour_error(run: Contour, ax: Axes | None = None) -> Axes:
    """Plot the measured contour error over the last turn, with mean and standard deviation.

    Parameters
    ----------
    run : Contour
        A path that was run.
    ax : matplotlib.axes.Axes, optional
        Where to.

    Returns
    -------
    matplotlib.axes.Axes
        With the picture.
    """
    (ax,) = axes_or_new(ax, 1)
    part = _last(run)
    found = run.metrics
    mean, sd = 1e6 * found.mean_error, 1e6 * found.sd_error
    ax.axhspan(mean - sd, mean + sd, color="0.9", label="mean +- SD")
    ax.plot(run.t[part], 1e6 * run.error[part], color="C3", linewidth=0.8, label="contour error")
    ax.axhline(mean, color="0.4", linewidth=0.8, linestyle="--")
    ax.set(xlabel="time [s]", ylabel="contour error [um]")
    above(ax)
    ax.margins(x=0)
    return ax


def plot_contour(run: Contour) -> Figure:
    """Plot all four: path, magnified error, errors of the axes and contour error, in the last turn.

    Parameters
    ----------
    run : Contour
        A path that was run.

    Returns
    -------
    matplotlib.figure.Figure
        Not yet shown or saved.
    """
    figure = plt.figure(figsize=(11.0, 8.4), layout="constrained")
    grid = figure.add_gridspec(2, 2, height_ratios=[1.6, 1.0])
    plot_path(run, figure.add_subplot(grid[0, 0]))
    plot_magnified(run, figure.add_subplot(grid[0, 1]))
    part, shared = _last(run), None
    inner = grid[1, 0].subgridspec(2, 1, hspace=0.1)
    for row, (name, axis) in enumerate((("x", run.x), ("y", run.y))):
        ax = figure.add_subplot(inner[row], sharex=shared, sharey=shared)
        ax.plot(run.t[part], 1e6 * axis.error[part], color="C0", linewidth=0.8)
        ax.axhline(0.0, color="0.7", linewidth=0.6)
        ax.set(xlabel="time [s]" if row else "", ylabel=f"error of {name} [um]")
        ax.tick_params(labelbottom=bool(row))
        ax.locator_params(axis="y", nbins=4, prune="both")
        ax.margins(x=0)
        shared = shared or ax
    contour = figure.add_subplot(grid[1, 1])
    plot_contour_error(run, contour)
    found = run.metrics
    figure.suptitle(
        f"{run.path.name}: contour error {1e6 * found.peak_to_peak:.3f} um peak to peak, "
        f"mean {1e6 * found.mean_error:.3f} um, SD {1e6 * found.sd_error:.3f} um"
    )
    return figure


def plot_table_2(table: Table2) -> Figure:
    """Plot the circles at 0.1 Hz, their errors over an angle, and published beside obtained.

    Parameters
    ----------
    table : Table2
        The nine circles, run.

    Returns
    -------
    matplotlib.figure.Figure
        Not yet shown or saved.
    """
    from ..xu_li_2010.table_2 import PUBLISHED

    figure = plt.figure(figsize=(11.0, 8.4), layout="constrained")
    grid = figure.add_gridspec(2, 6, height_ratios=[1.5, 1.0])
    circles = figure.add_subplot(grid[0, :3])
    slow = [run for case, run in zip(PUBLISHED, table.runs, strict=True) if case.frequency == 0.1]
    for run in slow:
        plot_magnified(run, circles, factor=5.0)
    circles.set_title("0.1 Hz, contour error x 5")
    if legend := circles.get_legend():
        legend.remove()
    _over_angle(slow, figure.add_subplot(grid[0, 3:]))
    for column, name in enumerate(("max", "mean", "SD")):
        _bars(table, name, figure.add_subplot(grid[1, 2 * column : 2 * column + 2]))
    return figure


def _over_angle(runs: Sequence[Contour], ax: Axes) -> None:
    """Plot the last turn of circles, one above the other, each about a line of its own."""
    apart = 1.15 * max(1e6 * run.metrics.peak_to_peak for run in runs)
    for row, run in enumerate(runs):
        part = _last(run)
        angle = 360.0 * np.arange(part.sum()) / part.sum()
        ax.axhline(row * apart, color="0.75", linewidth=0.8)
        ax.plot(angle, row * apart + 1e6 * run.error[part], color="C3", linewidth=0.8)
        label = f"{1e6 * (run.path.radius or 0.0):g} um"
        ax.annotate(label, (362.0, row * apart), va="center", annotation_clip=False)
    ax.set(xlabel="angle [deg]", ylabel="contour error [um], one radius above the other")
    ax.set(xticks=range(0, 361, 90), xlim=(0, 360), title="0.1 Hz, last turn")


def _bars(table: Table2, name: str, ax: Axes) -> None:
    """Plot one figure of the nine cases, published beside obtained."""
    from ..xu_li_2010.table_2 import PUBLISHED

    column, attribute = {
        "max": (2, "peak_to_peak"),
        "mean": (3, "mean_error"),
        "SD": (4, "sd_error"),
    }[name]
    places = np.arange(len(PUBLISHED))
    published = [1e6 * case[column] for case in PUBLISHED]
    found = [1e6 * getattr(run.metrics, attribute) for run in table.runs]
    ax.bar(places - 0.2, published, 0.4, color="0.75", edgecolor="0.3", label="published")
    ax.bar(places + 0.2, found, 0.4, color="C0", edgecolor="0.1", label="obtained")
    what = "peak to peak" if name == "max" else name
    ax.set(ylabel=f"{what} [um]", xlabel="radius [um], and frequency [Hz]")
    labels = [f"{1e6 * case.radius:g}\n{case.frequency:g}" for case in PUBLISHED]
    ax.set_xticks(places, labels, fontsize="small")
    ax.axhline(0.0, color="0.4", linewidth=0.6)
    above(ax)


def plot_noise(noise: Noise) -> Figure:
    """Plot a record at rest: the beginning of it with its steps, and its spectrum.

    Parameters
    ----------
    noise : Noise
        What was found.

    Returns
    -------
    matplotlib.figure.Figure
        Not yet shown or saved.
    """
    figure, (left, right) = plt.subplots(1, 2, figsize=(11.0, 4.4), layout="constrained")
    data = noise.data
    unit, scale = best_length_unit(noise.spread.peak_to_peak)
    # Enough to see the course, few enough to tell the steps.
    shown = slice(0, min(len(data), 400))
    time = data.t[shown] - data.t[0]
    left.step(1e3 * time, scale * (data.y[shown] - data.y[shown].mean()), where="post", color="C0",
              linewidth=0.9)  # fmt: skip
    left.set(xlabel="time [ms]", ylabel=f"displacement from the mean [{unit}]")
    steps = f", steps of {1e6 * noise.resolution:.4g} um" if noise.resolution else ""
    left.set_title(f"At rest: {1e6 * noise.rms:.4g} um rms{steps}", fontsize="medium")
    left.margins(x=0)
    f, density = noise.spectrum()
    right.loglog(f, 1e9 * density, color="0.6", linewidth=0.9, label="record")
    colour = "white" if np.isinf(noise.bandwidth) else f"low-pass {noise.bandwidth:.4g} Hz"
    right.loglog(
        f, 1e9 * noise.density(f), color="C3", linewidth=1.6, linestyle="--",
        label=f"model: {1e6 * noise.noise:.4g} um rms, {colour}",
    )  # fmt: skip
    plain_log_ticks(right)
    right.set(xlabel="frequency [Hz]", ylabel="amplitude spectral density [nm/sqrt(Hz)]")
    above(right)
    return figure


def _last(run: Contour) -> NDArray[np.bool_]:
    """Tell the samples of the last turn; all that count where the path is run once."""
    turn = run.path.period
    start = run.settled
    if turn is not None:
        start = max(start, run.t[-1] + run.x.controller.dt - turn)
    last: NDArray[np.bool_] = run.t >= start - 1e-9
    return last


def _plane(ax: Axes, run: Contour) -> None:
    """Label a picture in the plane, and cut away most of the way from home."""
    ax.set(xlabel="x [um]", ylabel="y [um]", aspect="equal")
    edges = [(1e6 * float(axis.min()), 1e6 * float(axis.max())) for axis in run.path.outline]
    room = 0.2 * max(high - low for low, high in edges)
    ax.set(
        xlim=(edges[0][0] - room, edges[0][1] + room),
        ylim=(edges[1][0] - room, edges[1][1] + room),
    )


def _round_down(value: float) -> float:
    """Return the largest of 1, 2, 5, 10, ... that is not above `value`, 1 at least."""
    if not value > 1.0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(step * power for step in (1.0, 2.0, 5.0) if step * power <= value))
