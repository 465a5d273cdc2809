"""Pictures of a fit: loop, displacement and error over time, convergence of the swarm.

Every function takes the axes to draw on and returns them, so that the pictures can be combined.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..._support.plot_style import (
    ERROR,
    GUIDE,
    MARKS,
    MEASURED,
    QUIET,
    SIMULATED,
    axes_or_new,
    heading,
    legend_inside,
    literal,
    panels,
    plain_log_ticks,
    thinned,
    whole,
)
from ..._support.units import best_length_unit, shown_unit

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure
    from numpy.typing import NDArray

    from ...data.dataset import Dataset
    from ...stages.base import Response
    from ..fitted.fitted_record import FittedRecord
    from ..fitted.identification import Identification

    Array = NDArray[np.float64]

__all__ = [
    "named",
    "plot_convergence",
    "plot_identification",
    "plot_loop",
    "plot_response",
    "plot_time",
    "what_was_fitted",
    "what_was_not_fitted",
]


def plot_loop(
    data: Dataset, run: Response, ax: Axes | None = None, *, title: str = "Hysteresis loop"
) -> Axes:
    """Draw the hysteresis loop: displacement over drive, measured and simulated.

    Parameters
    ----------
    data : Dataset
        The record.
    run : Response
        Response of the model on that record.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure where not given.
    title : str, optional
        What ran.

    Returns
    -------
    matplotlib.axes.Axes
        The axes drawn on.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> import piezotrack as pt
    >>> log = pt.datasets.dbo_training()[3.0:8.0]
    >>> fit = pt.identify(log, "prandtl-ishlinskii", progress=False)
    >>> run = fit.simulate(log, offset=fit.offset)
    >>> ax = pt.identification.plot_loop(log, run, ax=Figure().subplots())
    >>> ax.get_xlabel(), ax.get_ylabel()
    ('drive [V]', 'displacement [um]')
    """
    (ax,) = axes_or_new(ax, 1)
    unit, scale = best_length_unit(data.stroke)
    drive, times = shown_unit(data.drive_unit)
    for y, style in ((data.y, MEASURED), (run.x, SIMULATED)):
        kept = thinned(y)
        ax.plot(times * data.u[kept], scale * y[kept], **style)
    ax.set(xlabel=f"drive [{literal(drive)}]", ylabel=f"displacement [{unit}]")
    heading(ax, title)
    # Beside the loop, which fills the other diagonal.
    falls = float(np.dot(data.u - data.u.mean(), data.y - data.y.mean())) < 0.0
    ax.legend(loc="upper right" if falls else "upper left", frameon=False, fontsize="small")
    return ax


def plot_time(
    data: Dataset,
    run: Response,
    axes: Sequence[Axes] | None = None,
    *,
    stroke: float | None = None,
    fitted_until: float | None = None,
    title: str = "Displacement over time",
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
    title : str, optional
        What ran.

    Returns
    -------
    tuple of two matplotlib.axes.Axes
        Displacement, error.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> import piezotrack as pt
    >>> log = pt.datasets.dbo_training()[3.0:8.0]
    >>> fit = pt.identify(log, "prandtl-ishlinskii", progress=False)
    >>> run = fit.simulate(log, offset=fit.offset)
    >>> above, below = pt.identification.plot_time(log, run, axes=Figure().subplots(2, 1))
    >>> below.get_ylabel()
    'error [nm]'
    """
    above, below = axes_or_new(axes, 2)
    unit, scale = best_length_unit(data.stroke)
    error = data.y - run.x
    small, fine = best_length_unit(float(np.abs(error).max()))
    for y, style in ((data.y, MEASURED), (run.x, SIMULATED)):
        kept = thinned(y)
        above.plot(data.t[kept], scale * y[kept], **style)
    above.set(ylabel=f"displacement [{unit}]")
    heading(above, title, 84)
    if fitted_until is not None:
        mark = {**QUIET, "label": "fitted before, predicted after"}
        above.axvline(fitted_until, **mark)
        below.axvline(fitted_until, **QUIET)
    above.margins(x=0.0, y=0.05)
    legend_inside(above)
    kept = thinned(error)
    below.plot(data.t[kept], fine * error[kept], **{**ERROR, "linewidth": 0.8})
    below.axhline(0.0, **GUIDE)
    below.set(xlabel="time [s]", ylabel=f"error [{small}]")
    rms = float(np.sqrt(np.mean(error**2)))
    heading(
        below,
        f"error = measured - simulated: rms {fine * rms:.3g} {small} "
        f"({100 * rms / (stroke or data.stroke):.3g} % of stroke)",
        84,
    )
    below.margins(x=0.0)
    return above, below


def plot_convergence(
    fit: Identification, ax: Axes | None = None, *, title: str = "Convergence"
) -> Axes:
    """Draw the best cost of the swarm after each iteration, and where the other restarts ended.

    Parameters
    ----------
    fit : Identification
        Result of a search.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure where not given.
    title : str, optional
        What ran.

    Returns
    -------
    matplotlib.axes.Axes
        The axes drawn on.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> import piezotrack as pt
    >>> log = pt.datasets.dbo_training()[3.0:5.0]
    >>> few = pt.ParticleSwarm(iterations=3, seed=1, runs=1)
    >>> fit = pt.identify(log, "dahl", method=few, progress=False)
    >>> ax = pt.identification.plot_convergence(fit, ax=Figure().subplots())
    >>> ax.get_ylabel()
    'best cost, rms [um]'
    """
    (ax,) = axes_or_new(ax, 1)
    # A cost of 0 has no place on a logarithmic scale.
    finite = np.isfinite(fit.history) & (fit.history > 0.0)
    iterations = np.arange(fit.history.size)[finite]
    one = "swarm" if fit.swarm is not None else "descent"
    best = f"best of {len(fit.runs)} {one}s" if len(fit.runs) > 1 else one
    ax.plot(
        iterations,
        1e6 * fit.history[finite],
        color=SIMULATED["color"],
        linewidth=1.4,
        label=f"{best}: {1e6 * fit.history[-1]:.4g} um",
    )
    ends = [(run.nit, 1e6 * run.cost) for run in fit.runs if 0.0 < run.cost < np.inf]
    if len(ends) > 1:
        refined = fit.npolish and fit.swarm is not None
        label = f"each {one}, refined" if refined else f"end of each {one}"
        ax.plot(*zip(*ends, strict=True), **{**MARKS, "marker": "x", "label": label})
    if fit.npolish and fit.cost > 0.0:
        least = fit.cost_um if fit.cost_with_priors is None else 1e6 * fit.cost_with_priors
        ax.plot(fit.nit, least, **{**MARKS, "label": f"refined: {least:.4g} um"})
    if finite.any():
        ax.set_yscale("log")
    ax.set(xlabel="iteration", ylabel="best cost, rms [um]")
    ax.margins(x=0.02)
    heading(
        ax,
        f"{title}: {fit.nit} iterations, {fit.nfev} simulations",
    )
    legend_inside(ax, ncols=2)
    if finite.any():
        plain_log_ticks(ax)
    return ax


def plot_response(
    t: Array,
    u: Array,
    x: Array,
    fig: Figure | SubFigure | None = None,
    *,
    title: str = "Simulated response",
    drive_unit: str = "V",
) -> Figure:
    """Draw a simulated displacement over time and over the drive.

    Parameters
    ----------
    t, u, x : ndarray, shape (n,)
        Time [s], drive in `drive_unit`, displacement [m].
    fig : matplotlib.figure.Figure or SubFigure, optional
        Where to draw; a new figure where not given.
    title : str, optional
        What ran.
    drive_unit : str, optional
        Unit of the drive, SI.

    Returns
    -------
    matplotlib.figure.Figure
        The figure drawn in.
    """
    figure = panels(fig, (11.0, 4.2))
    left, right = figure.subplots(1, 2)
    unit, scale = best_length_unit(float(np.ptp(x)))
    kept = thinned(x)
    left.plot(t[kept], scale * x[kept], **SIMULATED)
    left.set(xlabel="time [s]", ylabel=f"displacement [{unit}]")
    heading(left, "Displacement over time")
    left.margins(x=0.0)
    drive, times = shown_unit(drive_unit)
    right.plot(times * u[kept], scale * x[kept], **SIMULATED)
    right.set(xlabel=f"drive [{literal(drive)}]", ylabel=f"displacement [{unit}]")
    heading(right, "Hysteresis loop")
    figure.suptitle(literal(title), fontsize="large")
    return whole(figure)


def plot_identification(
    fit: Identification, data: Dataset | None = None, fig: Figure | SubFigure | None = None
) -> Figure:
    """Draw loop, displacement, error and, after a search, convergence in one figure.

    Parameters
    ----------
    fit : Identification
        What a fit found.
    data : Dataset, optional
        Another record to show the model on.
    fig : matplotlib.figure.Figure or SubFigure, optional
        Where to draw; a new figure where not given.

    Returns
    -------
    matplotlib.figure.Figure
        The figure drawn in, with four panels or three.
    """
    if data is None and len(fit.records) > 1:
        return _of_records(fit, fig)
    own = data is None
    record = fit.data if data is None else data
    run = fit.simulate(record, offset=fit.offset if own else "own")
    searched = fit.model.info.searched
    figure = panels(fig, (11.0, 6.6 if searched else 5.6))
    grid = figure.add_gridspec(2, 2, width_ratios=[1.0, 1.35])
    plot_loop(record, run, figure.add_subplot(grid[0 if searched else slice(None), 0]))
    if searched:
        plot_convergence(fit, figure.add_subplot(grid[1, 0]))
    above = figure.add_subplot(grid[0, 1])
    below = figure.add_subplot(grid[1, 1], sharex=above)
    plot_time(record, run, (above, below), stroke=fit.stroke)
    title = what_was_fitted(fit) if own else what_was_not_fitted(fit, record, run)
    figure.suptitle(title, fontsize="large")
    return whole(figure)


def _of_records(fit: Identification, fig: Figure | SubFigure | None) -> Figure:
    """Draw loop, displacement and error of each record, and the convergence below."""
    count = len(fit.records)
    figure = panels(fig, (11.0, 4.6 * count + 3.0))
    parts = figure.subfigures(count + 1, 1, height_ratios=[4.6] * count + [3.0], squeeze=False)
    for one, part in zip(fit.records, parts[:count, 0], strict=True):
        if one.data is None:
            continue
        run = fit.simulate(one.data, offset=one.offset)
        grid = part.add_gridspec(2, 2, width_ratios=[1.0, 1.35])
        plot_loop(one.data, run, part.add_subplot(grid[:, 0]))
        above = part.add_subplot(grid[0, 1])
        below = part.add_subplot(grid[1, 1], sharex=above)
        plot_time(one.data, run, (above, below), stroke=one.stroke)
        part.suptitle(what_was_fitted(fit, one), fontsize="large")
    plot_convergence(fit, parts[count, 0].subplots())
    return whole(figure)


def what_was_fitted(fit: Identification, own: FittedRecord | None = None) -> str:
    """Write model, record, window and error of a fit, as the title of its pictures.

    Parameters
    ----------
    fit : Identification
        The fit.
    own : FittedRecord, optional
        Which of its records; the first where not given.

    Returns
    -------
    str
        One line.
    """
    own = fit.records[0] if own is None else own
    record = fit.data if own.data is None else own.data
    return f"{named(fit, record)}: {own.cost_percent:.3g} % of stroke rms"


def what_was_not_fitted(fit: Identification, record: Dataset, run: Response) -> str:
    """Write model, record, window and error on another record, as the title of its pictures."""
    rms = 100.0 * float(np.sqrt(np.mean((record.y - run.x) ** 2))) / fit.stroke
    return f"{named(fit, record)}, not fitted: {rms:.3g} % of stroke rms"


def named(fit: Identification, record: Dataset) -> str:
    """Write model, record and window."""
    first, last = float(record.t[0]), float(record.t[-1]) + record.dt
    source = literal(record.source) if record.source else "the record"
    title = fit.model.info.title
    model = f"{title}," if "," in title else title
    return f"{model} on {source}, {first:.6g} to {last:.6g} s"
