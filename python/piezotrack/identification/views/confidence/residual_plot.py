"""Picture of the residual of a fit: against time, drive, rate and amplitude, and its spectrum."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...._support.display.plot_style import (
    ERROR,
    GREY,
    GUIDE,
    LEVEL,
    MARKS,
    RECORDED,
    caption,
    drawing,
    heading,
    legend_inside,
    literal,
    plain_log_ticks,
    sheet,
    trace,
    whole,
)
from ...._support.units import best_length_unit, drive_word, shown_unit
from ...confidence.residuals.residual import residual_of
from .residual_report import verdict

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure
    from numpy.typing import NDArray

    from ...confidence.residuals.residual import Residual, ResidualProfile
    from ...fitted.identification import Identification

    Array = NDArray[np.float64]

__all__ = ["plot_fit_residual", "plot_residual"]

# Points of a cloud, windows of the spectrum, and lags that are drawn.
MOST_POINTS, WINDOWS, LAGS = 4000, 8, 60


@drawing
def plot_fit_residual(
    fit: Identification, record: int = 0, fig: Figure | SubFigure | None = None
) -> Figure:
    """Draw the residual of a fit on one of its records, as `plot_residual`."""
    return plot_residual(residual_of(fit, record), fig)


@drawing
def plot_residual(residual: Residual, fig: Figure | SubFigure | None = None) -> Figure:
    """Draw a residual against time, drive, rate and amplitude, its spectrum and autocorrelation."""
    rows = (("time", "drive", "rate"), ("amplitude", "spectrum", "correlation"))
    figure, axes = sheet(fig, (12.0, 7.2), rows)
    data, kept = residual.data, residual.kept
    values = residual.values[kept]
    unit, scale = best_length_unit(float(np.abs(values).max()))
    _of_time(axes["time"], data.t[kept], values, unit, scale)
    drive, times = shown_unit(data.drive_unit)
    word = drive_word(data.drive_unit)
    _, *profiles = residual.profiles
    places = (axes["drive"], axes["rate"], axes["amplitude"])
    clouds = (data.u, residual.rate, residual.amplitude)
    labels = (
        f"{word} [{literal(drive)}]",
        f"rate of the {word} [{literal(drive)}/s]",
        f"amplitude of the half-cycle [{literal(drive)}]",
    )
    for ax, profile, cloud, label in zip(places, profiles, clouds, labels, strict=True):
        _cloud(ax, profile, times * cloud[kept], values, times, scale)
        ax.set(xlabel=label, ylabel=f"residual [{unit}]")
    _spectrum(axes["spectrum"], residual, unit, scale)
    _autocorrelation(axes["correlation"], residual)
    title = literal(f"Residual, {scale * residual.rms:.3g} {unit} rms: {verdict(residual)}")
    caption(figure, title)
    return whole(figure)


def _of_time(ax: Axes, t: Array, values: Array, unit: str, scale: float) -> None:
    trace(
        ax,
        t,
        scale * values,
        {**ERROR, "linewidth": 0.7},
        zero=True,
        xlabel="time [s]",
        ylabel=f"residual [{unit}]",
    )
    heading(ax, "Over time")


def _cloud(
    ax: Axes,
    profile: ResidualProfile,
    of: Array,
    values: Array,
    times: float,
    scale: float,
) -> None:
    """Draw the samples, and their mean and rms in bins."""
    step = max(1, values.size // MOST_POINTS)
    ax.plot(
        of[::step], scale * values[::step], ",", color=GREY, alpha=0.9, zorder=0, rasterized=True
    )
    centres = times * profile.centres
    ax.plot(centres, scale * profile.means, **{**MARKS, "markersize": 3.5}, label="mean")
    line = {**ERROR, "linewidth": 1.4}
    ax.plot(centres, scale * profile.rms, **line, label="rms")
    ax.plot(centres, -scale * profile.rms, **line)
    ax.axhline(0.0, **GUIDE)
    heading(ax, f"Against {profile.quantity}")
    legend_inside(ax)


def _spectrum(ax: Axes, residual: Residual, unit: str, scale: float) -> None:
    """Draw the amplitude spectral density by Welch's method, and that of white noise."""
    from scipy.signal import welch

    data = residual.data
    values = np.where(residual.kept, residual.values, residual.values[residual.kept].mean())
    values = data.at_readings(values)
    dt = data.measured.dt
    f, power = welch(
        values, 1.0 / dt, nperseg=min(values.size, max(64, values.size // WINDOWS * 2))
    )
    ax.loglog(
        f[1:], scale * np.sqrt(power[1:]), **{**RECORDED, "linewidth": 0.9, "label": "residual"}
    )
    level = scale * residual.noise * float(np.sqrt(2.0 * dt))
    ax.axhline(level, **LEVEL, label="white noise")
    ax.set(xlabel="frequency [Hz]", ylabel=f"density [{unit}/\N{SQUARE ROOT}Hz]")
    heading(ax, "Spectrum")
    legend_inside(ax, ncols=1)
    plain_log_ticks(ax)


def _autocorrelation(ax: Axes, residual: Residual) -> None:
    """Draw the autocorrelation, and the range of that of white noise."""
    r = residual.correlations[: LAGS + 1]
    lags = 1e3 * residual.data.measured.dt * np.arange(r.size)
    ax.vlines(lags[1:], 0.0, r[1:], color=RECORDED["color"], linewidth=1.4)
    within = 1.96 / float(np.sqrt(residual.kept.sum()))
    ax.axhline(0.0, **GUIDE)
    ax.axhline(within, **LEVEL, label="95 % of white noise")
    ax.axhline(-within, **LEVEL)
    ax.set(xlabel="lag [ms]", ylabel="autocorrelation")
    ax.set_ylim(min(-0.3, 1.1 * float(r.min())), 1.1)
    white = "white" if residual.is_white else "not white"
    heading(ax, f"Autocorrelation: Q = {residual.portmanteau:.3g}, {white}")
    legend_inside(ax)
