"""Pictures of a fit: loop, displacement and error over time, convergence of the swarm.

Every function takes the axes to draw on and returns them, so that the pictures can be combined.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .._support.plot_style import MEASURED, axes_or_new, literal, plain_log_ticks, thinned
from .._support.units import best_length_unit, shown_unit

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from ..data.dataset import Dataset
    from ..stages.base import Response
    from .result import Identification

    Array = NDArray[np.float64]

__all__ = [
    "plot_convergence",
    "plot_identification",
    "plot_loop",
    "plot_response",
    "plot_time",
]

# Distinct in black and white too, also where many cycles overlap.
SIMULATED: dict[str, Any] = {"color": "#b3400a", "linewidth": 1.0, "label": "simulated"}
ERROR: dict[str, Any] = {"color": "#1b6ca8", "linewidth": 0.8}


def plot_loop(data: Dataset, run: Response, ax: Axes | None = None) -> Axes:
    """Draw the hysteresis loop: displacement over drive, measured and simulated.

    Parameters
    ----------
    data : Dataset
        The record.
    run : Response
        Response of the model on that record.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure where not given.

    Returns
    -------
    matplotlib.axes.Axes
        The axes drawn on.
    """
    (ax,) = axes_or_new(ax, 1)
    unit, scale = best_length_unit(data.stroke)
    drive, times = shown_unit(data.drive_unit)
    for y, style in ((data.y, MEASURED), (run.x, SIMULATED)):
        kept = thinned(y)
        ax.plot(times * data.u[kept], scale * y[kept], **style)
    ax.set(xlabel=f"drive [{literal(drive)}]", ylabel=f"displacement [{unit}]")
    ax.set_title("Hysteresis loop")
    ax.legend(loc="upper left", frameon=False)
    return ax


def plot_time(
    data: Dataset,
    run: Response,
    axes: Sequence[Axes] | None = None,
    *,
    stroke: float | None = None,
    fitted_until: float | None = None,
) -> tuple[Axes, Axes]:
    """Draw measured and simulated displacement over time, and the error below.

    Parameters
    ----------
    data : Dataset
        The record.
    run : Response
        Response of the model on that record.
    axes : two matplotlib.axes.Axes, optional
        Where to draw; a new figure where not given.
    stroke : float, optional
        Stroke that the percentage refers to [m]; the record's own where not given.
    fitted_until : float, optional
        Time [s] up to which the record was fitted; a line marks it.

    Returns
    -------
    tuple of two matplotlib.axes.Axes
        Displacement, error.
    """
    above, below = axes_or_new(axes, 2)
    unit, scale = best_length_unit(data.stroke)
    error = data.y - run.x
    small, fine = best_length_unit(float(np.abs(error).max()))
    for y, style in ((data.y, MEASURED), (run.x, SIMULATED)):
        kept = thinned(y)
        above.plot(data.t[kept], scale * y[kept], **style)
    above.set(ylabel=f"displacement [{unit}]", title="Displacement over time")
    above.margins(x=0.0, y=0.05)
    top = above.get_ylim()[1] - above.get_ylim()[0]
    above.set_ylim(top=above.get_ylim()[1] + 0.22 * top)
    above.legend(loc="upper right", ncols=2, frameon=False)
    kept = thinned(error)
    below.plot(data.t[kept], fine * error[kept], **ERROR)
    below.axhline(0.0, color="0.7", linewidth=0.8, zorder=0)
    below.set(xlabel="time [s]", ylabel=f"error [{small}]")
    rms = float(np.sqrt(np.mean(error**2)))
    below.set_title(
        f"Measured less simulated: rms {fine * rms:.3g} {small} "
        f"({100 * rms / (stroke or data.stroke):.3g} % of stroke)",
        fontsize="medium",
    )
    below.margins(x=0.0)
    if fitted_until is not None:
        for ax in (above, below):
            ax.axvline(fitted_until, color="0.4", linestyle=":", linewidth=1.2)
        above.annotate(
            " fitted before, predicted after",
            (fitted_until, 0.93),
            xycoords=("data", "axes fraction"),
            fontsize="small",
            va="center",
            color="0.3",
        )
    return above, below


def plot_convergence(fit: Identification, ax: Axes | None = None) -> Axes:
    """Draw the best cost of the swarm after each iteration.

    Parameters
    ----------
    fit : Identification
        Result of a search.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure where not given.

    Returns
    -------
    matplotlib.axes.Axes
        The axes drawn on.
    """
    (ax,) = axes_or_new(ax, 1)
    # A cost of 0 has no place on a logarithmic scale.
    finite = np.isfinite(fit.history) & (fit.history > 0.0)
    iterations = np.arange(fit.history.size)[finite]
    ax.plot(iterations, 1e6 * fit.history[finite], color="#1b6ca8", linewidth=1.4)
    if finite.any():
        ax.set_yscale("log")
    ax.set(xlabel="iteration", ylabel="best cost, rms [um]", title="Convergence of the swarm")
    ax.margins(x=0.02)
    if finite.any():
        plain_log_ticks(ax)
    caption = f"{1e6 * fit.history[-1]:.4g} um after {fit.nit} iterations,\n{fit.nfev} simulations"
    if fit.npolish and fit.cost > 0.0:
        ax.plot(fit.nit, fit.cost_um, "o", color="#b3400a", markersize=5)
        caption += f";\n{fit.cost_um:.4g} um after local refinement"
    ax.annotate(
        caption,
        (0.97, 0.93),
        xycoords="axes fraction",
        ha="right",
        va="top",
        fontsize="small",
    )
    return ax


def plot_response(t: Array, u: Array, x: Array, drive_unit: str = "V") -> Figure:
    """Draw a simulated displacement over time and over the drive.

    Parameters
    ----------
    t, u, x : ndarray, shape (n,)
        Time [s], drive [V], displacement [m].
    drive_unit : str, optional
        Unit of the drive, SI.

    Returns
    -------
    matplotlib.figure.Figure
        Two panels.
    """
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(11.0, 4.2), layout="constrained")
    unit, scale = best_length_unit(float(np.ptp(x)))
    kept = thinned(x)
    left.plot(t[kept], scale * x[kept], **SIMULATED)
    left.set(xlabel="time [s]", ylabel=f"displacement [{unit}]", title="Displacement over time")
    left.margins(x=0.0)
    drive, times = shown_unit(drive_unit)
    right.plot(times * u[kept], scale * x[kept], **SIMULATED)
    right.set(
        xlabel=f"drive [{literal(drive)}]", ylabel=f"displacement [{unit}]", title="Hysteresis loop"
    )
    return figure


def plot_identification(fit: Identification, data: Dataset | None = None) -> Figure:
    """Draw loop, displacement, error and, after a swarm search, convergence in one figure.

    Parameters
    ----------
    fit : Identification
        What a fit found.
    data : Dataset, optional
        Another record to show the model on.

    Returns
    -------
    matplotlib.figure.Figure
        Four panels, or three.
    """
    import matplotlib.pyplot as plt

    own = data is None
    record = fit.data if data is None else data
    run = fit.simulate(record, offset=fit.offset if own else "own")
    searched = fit.swarm is not None
    figure = plt.figure(figsize=(11.0, 6.4 if searched else 5.4), layout="constrained")
    grid = figure.add_gridspec(2, 2, width_ratios=[1.0, 1.35])
    plot_loop(record, run, figure.add_subplot(grid[0 if searched else slice(None), 0]))
    if searched:
        plot_convergence(fit, figure.add_subplot(grid[1, 0]))
    above = figure.add_subplot(grid[0, 1])
    below = figure.add_subplot(grid[1, 1], sharex=above)
    plot_time(record, run, (above, below), stroke=fit.stroke)
    return figure
