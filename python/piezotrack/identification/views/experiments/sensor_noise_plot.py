"""Picture of a sensor at rest."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...._support.display.plot_style import (
    RECORDED,
    SIMULATED,
    drawing,
    heading,
    legend_inside,
    literal,
    plain_log_ticks,
    sheet,
    trace,
    whole,
)
from ...._support.units import best_length_unit

if TYPE_CHECKING:
    from matplotlib.figure import Figure, SubFigure

    from ...experiments.sensor_noise import Noise

__all__ = ["plot_noise"]


@drawing
def plot_noise(noise: Noise, fig: Figure | SubFigure | None = None) -> Figure:
    """Plot a record at rest: the beginning of it with its steps, and its spectrum."""
    figure, axes = sheet(fig, (11.0, 4.4), (("rest", "spectrum"),))
    left, right = axes["rest"], axes["spectrum"]
    data = noise.data
    unit, scale = best_length_unit(noise.spread.peak_to_peak)
    # Long enough for the trend, short enough to resolve the steps.
    shown = slice(0, min(len(data), 400))
    ms, y = 1e3 * (data.t[shown] - data.t[0]), scale * (data.y[shown] - data.y[shown].mean())
    few = f"time [ms], of {data.duration:.3g} s" if len(data) > ms.size else "time [ms]"
    trace(
        left, ms, y, RECORDED, steps=True, xlabel=few, ylabel=f"displacement from the mean [{unit}]"
    )
    resolution = noise.resolution
    steps = f", steps of {scale * resolution:.4g} {unit}" if resolution else ""
    source = f" in {literal(data.source)}" if data.source else ""
    heading(left, f"Sensor at rest{source}: {scale * noise.rms:.4g} {unit} rms{steps}")
    f, density = noise.spectrum()
    right.loglog(f, 1e9 * density, **{**RECORDED, "color": "0.6"})
    colour = "white" if np.isinf(noise.bandwidth) else f"low-pass {noise.bandwidth:.4g} Hz"
    model = {**SIMULATED, "linewidth": 1.6, "linestyle": "--"}
    model["label"] = f"model: {scale * noise.noise:.4g} {unit} rms, {colour}"
    right.loglog(f, 1e9 * noise.density(f), **model)
    heading(right, "Noise spectrum")
    right.set(xlabel="frequency [Hz]", ylabel="amplitude spectral density [nm/\N{SQUARE ROOT}Hz]")
    legend_inside(right, ncols=2)
    plain_log_ticks(right)
    return whole(figure)
