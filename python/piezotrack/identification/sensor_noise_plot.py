"""Picture of a sensor at rest."""

from __future__ import annotations

from typing import TYPE_CHECKING

import matplotlib.pyplot as plt
import numpy as np

from .._support.plot_style import above, plain_log_ticks
from .._support.units import best_length_unit

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from .sensor_noise import Noise

__all__ = ["plot_noise"]


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
    # Long enough for the trend, short enough to resolve the steps.
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
