"""Pictures of a fit: loop, displacement and error over time, convergence of the swarm.

Every function takes the axes to draw on and returns them, so that the pictures can be combined.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..._support.arguments import expect, finite, positive
from ..._support.display.look import CHOSEN
from ..._support.display.plot_style import (
    BAND,
    ERROR,
    MARKS,
    MEASURED,
    QUIET,
    SIMULATED,
    axes_or_new,
    caption,
    drawing,
    heading,
    legend_inside,
    literal,
    plain_log_ticks,
    share,
    sheet,
    thinned,
    trace,
    whole,
)
from ..._support.units import best_length_unit, shown_unit
from ...data.dataset import Dataset
from ...errors import ParameterError, ShapeError
from ...stages.motion import Response
from ..fitted.identification import Identification
from ..fitted.score import share_fitted
from ..methods.particle_swarm import ParticleSwarm

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure
    from numpy.typing import NDArray

    from ..fitted.fitted_record import FittedRecord
    from ..fitted.identified_model import IdentifiedModel

    Array = NDArray[np.float64]

__all__ = [
    "band_of",
    "named",
    "plot_convergence",
    "plot_loop",
    "plot_model",
    "plot_model_loop",
    "plot_model_time",
    "plot_record",
    "plot_response",
    "plot_time",
    "what_was_fitted",
    "what_was_shown",
]


# Samples of a cycle of a model that is shown without a record.
SAMPLES = 500
STYLES = {"measured": MEASURED, "simulated": SIMULATED}


def _check(data: Dataset, run: Response) -> None:
    """Check a record and a response, which belong together."""
    expect("data", data, Dataset, "a Dataset")
    expect("run", run, Response, "what simulate returns")
    if run.x.size != data.y.size:
        raise ShapeError("run", f"{run.x.size} samples", f"{data.y.size}, as the record")


@drawing
def plot_loop(
    data: Dataset, run: Response, ax: Axes | None = None, *, title: str = "Hysteresis loop"
) -> Axes:
    """Draw the hysteresis loop: displacement over drive, measured and simulated."""
    _check(data, run)
    (ax,) = axes_or_new(ax, 1)
    _loop(ax, data.u, {"measured": data.y, "simulated": run.x}, data.drive_unit)
    heading(ax, title)
    return ax


def _loop(ax: Axes, u: Array, signals: Mapping[str, Array], drive_unit: str) -> None:
    """Draw signals, by their names, over the drive."""
    unit, scale = best_length_unit(max(float(np.ptp(x)) for x in signals.values()))
    drive, times = shown_unit(drive_unit)
    for name, x in signals.items():
        kept = thinned(x, u)
        ax.plot(times * u[kept], scale * x[kept], **STYLES[name])
    ax.set(xlabel=f"drive [{literal(drive)}]", ylabel=f"displacement [{unit}]")
    # Beside the loop, which fills the other diagonal.
    x = next(iter(signals.values()))
    falls = float(np.dot(u - u.mean(), x - x.mean())) < 0.0
    ax.legend(loc="upper right" if falls else "upper left", frameon=False, fontsize="small")


@drawing
def plot_time(
    data: Dataset,
    run: Response,
    axes: Sequence[Axes] | None = None,
    *,
    stroke: float | None = None,
    fitted_until: float | None = None,
    half: Array | None = None,
    title: str = "Displacement over time",
) -> tuple[Axes, Axes]:
    """Draw measured and simulated displacement over time, and the error below.

    The error is in per cent of `stroke` [m], that of the record where not given; a line marks the
    time `fitted_until` [s], and `half` is the half width of the band of 95 % of the errors [m].
    """
    _check(data, run)
    stroke = data.stroke if stroke is None else positive("stroke", stroke, "m")
    above, below = axes_or_new(axes, 2)
    unit, scale = best_length_unit(data.stroke)
    error = data.y - run.x
    if data.left_out is not None:
        error[data.left_out] = np.nan
    small, fine = best_length_unit(float(np.abs(data.counted(error)).max()))
    words = "time [s]" if CHOSEN.get() else ""
    for y, style in ((data.y, MEASURED), (run.x, SIMULATED)):
        trace(above, data.t, scale * y, style, xlabel=words, ylabel=f"displacement [{unit}]")
    heading(above, title)
    if fitted_until is not None:
        mark = {**QUIET, "label": "fitted before, predicted after"}
        fitted_until = finite("fitted_until", fitted_until, "s")
        above.axvline(fitted_until, **mark)
        below.axvline(fitted_until, **QUIET)
    above.margins(x=0.0, y=0.05)
    legend_inside(above)
    t, error = data.at_readings(data.t), data.at_readings(error)
    trace(
        below,
        t,
        fine * error,
        {**ERROR, "linewidth": 0.8},
        zero=True,
        xlabel="time [s]",
        ylabel=f"error [{small}]",
    )
    if half is not None:
        kept = thinned(half)
        width = fine * half[kept]
        below.fill_between(data.t[kept], -width, width, **BAND)
        legend_inside(below)
    rms = float(np.sqrt(np.mean(error**2)))
    heading(
        below,
        f"error = measured - simulated: rms {fine * rms:.3g} {small} "
        f"({100 * rms / stroke:.3g} % of stroke)",
    )
    return above, below


@drawing
def plot_convergence(
    fit: Identification, ax: Axes | None = None, *, title: str = "Convergence"
) -> Axes:
    """Draw the best cost of the swarm after each iteration, and where the other restarts ended."""
    search = fit.search
    if search is None:
        raise ParameterError("fit", "a model fitted by least squares", "one of a search")
    (ax,) = axes_or_new(ax, 1)
    # A cost of 0 has no place on a logarithmic scale.
    shown = np.isfinite(search.history) & (search.history > 0.0)
    iterations = np.arange(search.history.size)[shown]
    search_name = "swarm" if isinstance(fit.method, ParticleSwarm) else "descent"
    best = f"best of {len(search.runs)} {search_name}s" if len(search.runs) > 1 else search_name
    ax.plot(
        iterations,
        1e6 * search.history[shown],
        color=SIMULATED["color"],
        linewidth=1.4,
        label=f"{best}: {1e6 * search.history[-1]:.4g} um",
    )
    ends = [(run.nit, 1e6 * run.cost) for run in search.runs if 0.0 < run.cost < np.inf]
    if len(ends) > 1:
        refined = isinstance(fit.method, ParticleSwarm) and fit.method.polish
        label = f"each {search_name}, refined" if refined else f"end of each {search_name}"
        ax.plot(*zip(*ends, strict=True), **{**MARKS, "marker": "x", "label": label})
    if search.npolish and fit.cost > 0.0:
        least = fit.cost_um if search.cost_with_priors is None else 1e6 * search.cost_with_priors
        ax.plot(search.nit, least, **{**MARKS, "label": f"refined: {least:.4g} um"})
    if shown.any():
        ax.set_yscale("log")
    ax.set(xlabel="iteration", ylabel="best cost, rms [um]")
    ax.margins(x=0.02)
    heading(ax, f"{title}: {search.nit} iterations, {fit.nfev} simulations")
    legend_inside(ax, ncols=2)
    if shown.any():
        plain_log_ticks(ax)
    return ax


@drawing
def plot_response(
    t: Array,
    u: Array,
    x: Array,
    fig: Figure | SubFigure | None = None,
    *,
    title: str = "Simulated response",
    drive_unit: str = "V",
    measured: Array | None = None,
) -> Figure:
    """Draw a simulated displacement `x` [m] over time and over the drive, and the measured one."""
    figure, axes = sheet(fig, (11.0, 4.2), (("time", "loop"),))
    signals = {"simulated": x} if measured is None else {"measured": measured, "simulated": x}
    unit, scale = best_length_unit(max(float(np.ptp(one)) for one in signals.values()))
    for name, signal in signals.items():
        trace(
            axes["time"],
            t,
            scale * signal,
            STYLES[name],
            xlabel="time [s]",
            ylabel=f"displacement [{unit}]",
        )
    legend_inside(axes["time"])
    _loop(axes["loop"], u, signals, drive_unit)
    caption(figure, literal(title))
    return whole(figure)


@drawing
def plot_model(
    model: IdentifiedModel, data: Dataset | None = None, fig: Figure | SubFigure | None = None
) -> Figure:
    """Draw loop, displacement, error and, after a search, convergence in one figure.

    On `data`, or on the record of the fit; of a model without a record the loops in its range.
    """
    fit = model if isinstance(model, Identification) else None
    if fit is not None and data is None and len(fit.records) > 1:
        return _of_records(fit, fig)
    if fit is None and data is None:
        return _without_record(model, fig)
    record, run = _shown(model, data)
    searched = fit is not None and fit.model.info.searched
    rows = (("loop", "time"), ("convergence" if searched else "loop", "error"))
    figure, axes = sheet(fig, (11.0, 6.6 if searched else 5.6), rows, widths=(1.0, 1.35), down=True)
    plot_record(record, run, axes, stroke=model.stroke, half=band_of(model, record))
    if fit is not None and searched:
        plot_convergence(fit, axes["convergence"])
    title = what_was_shown(model, record, run)
    caption(figure, what_was_fitted(fit) if fit and data is None else title)
    return whole(figure)


def plot_record(
    record: Dataset, run: Response, axes: Mapping[str, Axes], which: str = "", **options: Any
) -> None:
    """Draw loop, displacement and error of a record in the panels of these names, and an end."""
    both = axes[f"time{which}"], axes[f"error{which}"]
    plot_loop(record, run, axes[f"loop{which}"])
    share(both[1], both[0])
    plot_time(record, run, both, **options)


@drawing
def plot_model_loop(
    model: IdentifiedModel, data: Dataset | None = None, ax: Axes | None = None
) -> Axes:
    """Draw the loop of a model on a record, as `plot_loop`."""
    return plot_loop(*_shown(model, data), ax)


@drawing
def plot_model_time(
    model: IdentifiedModel, data: Dataset | None = None, axes: Sequence[Axes] | None = None
) -> tuple[Axes, Axes]:
    """Draw displacement and error of a model on a record, as `plot_time`."""
    record, run = _shown(model, data)
    return plot_time(record, run, axes, stroke=model.stroke, half=band_of(model, record))


def _without_record(model: IdentifiedModel, fig: Figure | SubFigure | None) -> Figure:
    """Draw the loops of a model over the range of the drive that was fitted, and inner ones."""
    if model.drive_range is None:
        raise ParameterError("data", "None", "a record, as the file of the model has no range")
    low, high = model.drive_range
    t = np.arange(4.0 * SAMPLES + 1.0) / SAMPLES
    # A cycle of the whole range and then half of it, about its middle.
    size = np.where(t < 2.0, 1.0, 0.5)
    u = 0.5 * (low + high) + 0.5 * (high - low) * size * np.sin(2.0 * np.pi * t)
    x = model.displacement(u, 1.0 / SAMPLES, initial=model.model.equilibrium(float(u[0])))
    first = SAMPLES
    title = f"{model.model.info.title}: loops at 1 Hz over the range fitted, and half of it"
    return plot_response(
        *(t[first:], u[first:], x[first:]), fig, title=title, drive_unit=model.drive_unit
    )


def band_of(model: IdentifiedModel, data: Dataset) -> Array | None:
    """Return the half width of the band of a prediction; None of a model without its records.

    Parameters
    ----------
    model : IdentifiedModel
        The model.
    data : Dataset
        The record that is predicted.

    Returns
    -------
    ndarray, shape (n,), or None
        The half width [m].
    """
    if not isinstance(model, Identification) or model.covariance is None:
        return None
    half: Array = model.prediction_band(data).half
    return half


def _shown(model: IdentifiedModel, data: Dataset | None) -> tuple[Dataset, Response]:
    """Return the record on which a model is shown, and its response there."""
    if data is not None:
        return data, model.simulate(data)
    if not isinstance(model, Identification):
        raise ParameterError("data", "None", "a record, as a model from a file has none")
    return model.data, model.simulate(model.data, offset=model.offset)


def _of_records(fit: Identification, fig: Figure | SubFigure | None) -> Figure:
    """Draw loop, displacement and error of each record, and the convergence below."""
    shown = {f" {i}": one for i, one in enumerate(fit.records, 1) if one.data is not None}
    rows = []
    for which in shown:
        rows += [(f"loop{which}", f"time{which}"), (f"loop{which}", f"error{which}")]
    heights = [2.3] * len(rows)
    if fit.model.info.searched:
        rows.append(("convergence", "convergence"))
        heights.append(1.6)
    figure, axes = sheet(fig, (11.0, sum(heights)), rows, heights=heights, widths=(1.0, 1.35))
    for which, record in shown.items():
        assert record.data is not None
        run = fit.simulate(record.data, offset=record.offset)
        half = band_of(fit, record.data)
        title = what_was_fitted(fit, record)
        plot_record(record.data, run, axes, which, stroke=record.stroke, half=half, title=title)
    if fit.model.info.searched:
        plot_convergence(fit, axes["convergence"])
    return whole(figure)


def what_was_fitted(fit: Identification, fitted: FittedRecord | None = None) -> str:
    """Write model, record, window and error of a fit, as the title of its pictures.

    Parameters
    ----------
    fit : Identification
        The fit.
    fitted : FittedRecord, optional
        Which of its records; the first where not given.

    Returns
    -------
    str
        One line.
    """
    fitted = fit.records[0] if fitted is None else fitted
    record = fit.data if fitted.data is None else fitted.data
    return f"{named(fit, record)}: {fitted.cost_percent:.3g} % of stroke rms"


def what_was_shown(model: IdentifiedModel, record: Dataset, run: Response) -> str:
    """Write model, record, window and error on any record, as the title of its pictures."""
    data = record.without_faulty_readings()
    rms = 100.0 * float(np.sqrt(np.mean(data.counted(data.y - run.x) ** 2))) / model.stroke
    share = model._fitted_share(data)
    fitted = "" if share == 1.0 else f", {share_fitted(share)}"
    return f"{named(model, record)}{fitted}: {rms:.3g} % of stroke rms"


def named(fit: IdentifiedModel, record: Dataset) -> str:
    """Write model, record and window."""
    first, last = float(record.t[0]), float(record.t[-1]) + record.dt
    source = literal(record.source) if record.source else "the record"
    title = fit.model.info.title
    model = f"{title}," if "," in title else title
    return f"{model} on {source}, {first:.6g} to {last:.6g} s"
