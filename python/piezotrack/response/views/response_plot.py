"""Pictures of a frequency response: Bode and Nyquist, with the band of 95 %."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..._support.display.plot_style import (
    ACTUAL,
    BAND,
    DESIRED,
    ERROR,
    GUIDE,
    MARKS,
    REPETITIVE,
    SIMULATED,
    axes_or_new,
    caption,
    drawing,
    heading,
    legend_inside,
    literal,
    share,
    sheet,
    whole,
)
from ...errors import ParameterError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, FigureBase, SubFigure
    from numpy.typing import NDArray

    from ...stages.base import Stage
    from ..modal_fit import ModalFit
    from ..response_data import FrequencyResponse

    Array = NDArray[np.float64]

__all__ = [
    "plot_amplitudes",
    "plot_frequency_response",
    "plot_magnitude",
    "plot_modal_fit",
    "plot_nyquist",
    "plot_phase",
]

RESPONSE: dict[str, Any] = {**ACTUAL, "label": "response", "linewidth": 1.2}
REGION: dict[str, Any] = {**BAND, "label": "band of 95 %"}
# Points of the outline of a region, and most regions drawn.
OUTLINE, MOST_REGIONS = 24, 400


@drawing
def plot_magnitude(response: FrequencyResponse, ax: Axes | None = None) -> Axes:
    """Draw the magnitude with its band, and the standard deviations of noise and distortion."""
    (ax,) = axes_or_new(ax, 1)
    unit, scale = response.shown_unit
    f, size, band = response.frequency, response.magnitude, response.band()
    # Where the band reaches 0 a logarithmic axis has no end for it.
    low = np.maximum(size - band, 1e-3 * size)
    ax.fill_between(f, scale * low, scale * (size + band), **REGION)
    ax.loglog(f, scale * size, **RESPONSE)
    if response.noise is not None:
        noise = {**ERROR, "label": "noise", "linestyle": ":"}
        ax.loglog(f, scale * np.sqrt(response.noise), **noise)
    if response.distortion is not None:
        # Lines at which noise alone explains the variance have none.
        distortion = np.sqrt(np.where(response.distortion > 0.0, response.distortion, np.nan))
        dots = {**REPETITIVE, "linestyle": "none", "marker": ".", "markersize": 3.0}
        ax.loglog(f, scale * distortion, **{**dots, "label": "nonlinear distortion"})
    lowest = size if response.noise is None else np.minimum(size, np.sqrt(response.noise))
    ax.set(xlabel="frequency [Hz]", ylabel=f"magnitude [{unit}]")
    if (lowest := lowest[lowest > 0.0]).size:
        ax.set_ylim(bottom=0.3 * scale * lowest.min())
    ax.margins(x=0)
    legend_inside(ax, ncols=2)
    heading(ax, literal(response.source) if response.source else "Frequency response")
    return ax


@drawing
def plot_phase(response: FrequencyResponse, ax: Axes | None = None) -> Axes:
    """Draw the phase with its band."""
    (ax,) = axes_or_new(ax, 1)
    f, phase = response.frequency, response.phase
    turn = np.arcsin(np.minimum(1.0, response.band() / response.magnitude))
    low, high = (np.degrees(phase + sign * turn) for sign in (-1.0, 1.0))
    ax.fill_between(f, low, high, **REGION)
    ax.semilogx(f, np.degrees(phase), **RESPONSE)
    ax.set(xlabel="frequency [Hz]", ylabel="phase [deg]")
    ax.margins(x=0)
    return ax


@drawing
def plot_nyquist(response: FrequencyResponse, ax: Axes | None = None) -> Axes:
    """Draw the response in the complex plane, with the region of 95 % about each line."""
    from matplotlib.collections import PolyCollection

    (ax,) = axes_or_new(ax, 1)
    unit, scale = response.shown_unit
    value, band = scale * response.value, scale * response.band()
    kept = np.arange(0, value.size, max(1, value.size // MOST_REGIONS))
    outline = np.exp(2j * np.pi * np.arange(OUTLINE) / OUTLINE)
    regions = value[kept, np.newaxis] + band[kept, np.newaxis] * outline
    corners = np.stack([regions.real, regions.imag], axis=-1)
    ax.add_collection(PolyCollection(list(corners), **{**REGION, "label": None}))
    ax.plot(value.real, value.imag, **RESPONSE)
    ax.axhline(0.0, **GUIDE)
    ax.axvline(0.0, **GUIDE)
    ax.set(xlabel=f"real part [{unit}]", ylabel=f"imaginary part [{unit}]", aspect="equal")
    ax.set_adjustable("datalim")
    return ax


@drawing
def plot_frequency_response(
    response: FrequencyResponse, fig: Figure | SubFigure | None = None
) -> Figure:
    """Plot magnitude and phase over frequency, and the response in the complex plane."""
    return whole(_panels(response, fig)[0])


@drawing
def plot_modal_fit(fit: ModalFit, fig: Figure | SubFigure | None = None) -> Figure:
    """Plot a response with the fitted modes over it."""
    figure, axes = _panels(fit.response, fig)
    _, scale = fit.response.shown_unit
    f, fitted = fit.response.frequency, fit.fitted
    modes = {**DESIRED, "label": "modes and delay"}
    axes["magnitude"].plot(f, scale * np.abs(fitted), **modes)
    legend_inside(axes["magnitude"], ncols=2)
    turn = np.unwrap(np.angle(fitted))
    turn += 2.0 * np.pi * np.round((fit.response.phase[0] - turn[0]) / (2.0 * np.pi))
    axes["phase"].plot(f, np.degrees(turn), **modes)
    axes["nyquist"].plot(scale * fitted.real, scale * fitted.imag, **modes)
    return whole(figure)


def _panels(
    response: FrequencyResponse, fig: Figure | SubFigure | None
) -> tuple[FigureBase, dict[str, Axes]]:
    """Draw a response in its three panels."""
    rows = (("magnitude", "nyquist"), ("phase", "nyquist"))
    figure, axes = sheet(fig, (11.0, 5.6), rows, heights=(3.0, 2.0), widths=(3.0, 2.0))
    plot_magnitude(response, axes["magnitude"])
    plot_phase(response, axes["phase"])
    plot_nyquist(response, axes["nyquist"])
    share(axes["phase"], axes["magnitude"])
    caption(figure, f"{response.excitation}", "medium")
    return figure, axes


@drawing
def plot_amplitudes(
    responses: Sequence[FrequencyResponse],
    frequency: float,
    *,
    model: Stage | None = None,
    fig: Figure | SubFigure | None = None,
) -> Figure:
    """Plot gain and phase at a frequency over the amplitude: the signature of hysteresis.

    Parameters
    ----------
    responses : sequence of FrequencyResponse
        Measured with several ranges.
    frequency : float
        Of the line, the nearest of which is taken [Hz].
    model : Stage, optional
        A stage whose describing function is drawn over them.
    fig : matplotlib.figure.Figure or SubFigure, optional
        Where to draw; a new figure of pyplot where not given.

    Returns
    -------
    matplotlib.figure.Figure
        The figure drawn in.

    Raises
    ------
    ParameterError
        There is no response.
    """
    if not responses:
        raise ParameterError("responses", "an empty list", "a response or more")
    figure, axes = sheet(fig, (7.0, 5.6), (("gain",), ("phase",)))
    unit, scale = responses[0].shown_unit
    # The peak of a sine with the power of all lines.
    sizes = np.sqrt(2.0) * np.array([one.amplitude for one in responses])
    near = [int(np.argmin(np.abs(one.frequency - frequency))) for one in responses]
    values = np.array([one.value[k] for one, k in zip(responses, near, strict=True)])
    bands = np.array([one.band()[k] for one, k in zip(responses, near, strict=True)])
    marks = {**MARKS, "label": "measured", "capsize": 3.0}
    axes["gain"].errorbar(sizes, scale * np.abs(values), scale * bands, **marks)
    turns = np.degrees(np.arcsin(np.minimum(1.0, bands / np.abs(values))))
    axes["phase"].errorbar(sizes, np.degrees(np.angle(values)), turns, **marks)
    if model is not None:
        over = np.geomspace(0.5 * sizes.min(), 2.0 * sizes.max(), 60)
        found = model.describing_function(over, frequency, offset=responses[0].offset)
        # A held drive shows one sample later.
        found = found * np.exp(-2j * np.pi * frequency * responses[0].dt)
        line = {**SIMULATED, "label": "describing function"}
        axes["gain"].plot(over, scale * np.abs(found), **line)
        axes["phase"].plot(over, np.degrees(np.angle(found)), **line)
    for ax in axes.values():
        ax.set_xscale("log")
    share(axes["gain"], axes["phase"])
    axes["gain"].set(ylabel=f"gain [{unit}]")
    axes["phase"].set(xlabel=f"amplitude [{responses[0].drive_unit}]", ylabel="phase [deg]")
    legend_inside(axes["gain"])
    caption(figure, f"{frequency:.4g} Hz", "medium")
    return whole(figure)
