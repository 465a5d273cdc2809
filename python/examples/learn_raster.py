"""Scan a test pattern forward and backward, before and after learning between the lines.

Writes raster.png: what a microscope shows whose fast axis follows a triangle at 20 Hz.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

import piezotrack as pt

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

DT, PIXELS = 1e-4, 256
LOW, HIGH = 10e-6, 50e-6
# The middle three quarters of a line are shown: the rest is for the rounded turns.
SHOWN = (15e-6, 45e-6)


def virtual_stage(seed: int = 1) -> pt.VirtualStage:
    """Return a stage with 15 % hysteresis, creep, a mode at 400 Hz and 5 nm of noise."""
    plays = pt.PrandtlIshlinskiiStage(
        linear=0.8e-6, thresholds=(2.0, 6.0, 12.0, 20.0, 30.0), weights=(5e-8,) * 5
    )
    return pt.VirtualStage.of(
        plays,
        noise=5e-9,
        delay=2e-4,
        bandwidth=2000.0,
        mode=(400.0, 0.05),
        creep={0.1: 0.004, 1.0: 0.004, 10.0: 0.004},
        seed=seed,
    )


def identified(stage: pt.VirtualStage) -> pt.identification.IdentifiedModel:
    """Return a model of the stage, from a record with steps and a slow loop."""
    t = DT * np.arange(20000)
    slow = 37.5 * (1.0 - np.cos(2.0 * np.pi * 1.0 * t))
    chirp = 3.0 * np.sin(2.0 * np.pi * (5.0 * t + 150.0 * t**2)) * (t > 0.1)
    log = stage.record(np.clip(slow + chirp, 0.0, 75.0), DT, hold="zoh")
    # The sensor is late by its filter, which its manual says.
    return pt.identify(log, "prandtl-ishlinskii", delay=2e-4)


def pattern(x: Array, y: Array) -> Array:
    """Return the height of the sample: a grating of 3 um with a ring, and some points."""
    across, along = x - 30e-6, y - 15e-6
    height = 0.5 + 0.35 * np.tanh(4.0 * np.sin(2.0 * np.pi * across / 3e-6))
    ring = np.abs(np.hypot(across, along) - 9e-6) < 1.2e-6
    return np.where(ring, 1.0, height)


def pixels(desired: Array, actual: Array) -> tuple[Array, Array]:
    """Return where the tip is [m] at the pixels of a line, forward and backward.

    A microscope takes the pixel of an instant from the reference, not from where the tip is.
    """
    at = np.linspace(*SHOWN, PIXELS)
    top = int(np.argmax(desired))
    forward = np.interp(at, desired[: top + 1], actual[: top + 1])
    backward = np.interp(at, desired[top:][::-1], actual[top:][::-1])
    return forward, backward


def main(path: str = "raster.png") -> None:
    """Learn, print the errors, and draw."""
    stage = virtual_stage()
    model = identified(stage)
    reference = pt.triangle(frequency=20.0, low=LOW, high=HIGH, duration=0.2, rounding=0.2)
    loop = pt.Controller.of(model, limits=(0.0, 75.0))
    found = pt.learn(stage, reference, loop, model=model, mode_scales=(0.97, 1.0, 1.03))
    print(found.summary())
    figure = Figure(figsize=(9.0, 6.6), layout="constrained")
    grid = figure.subplots(2, 3, width_ratios=(1.0, 1.0, 1.25))
    count = found.learner.t.size
    for axes, run, words in (
        (grid[0], found.first, "inverse of the model alone"),
        (grid[1], found.final, f"learnt in {found.best} trials"),
    ):
        draw(axes, found.learner.desired, run.displacement[-count:], words)
    figure.savefig(path, dpi=110)


def draw(axes: NDArray[np.object_], desired: Array, actual: Array, words: str) -> None:
    """Draw the two images of a run, and how far the tip is from its pixel."""
    forward, backward = pixels(desired, actual)
    at = np.linspace(*SHOWN, PIXELS)
    pixel = (SHOWN[1] - SHOWN[0]) / PIXELS
    for ax, x, way in ((axes[0], forward, "forward"), (axes[1], backward, "backward")):
        shown(ax, x, f"{words}\n{way}" if way == "forward" else f"\n{way}")
    apart = float(np.sqrt(np.mean((forward - backward) ** 2)))
    print(f"{words}: lines {1e9 * apart:.0f} nm, {apart / pixel:.2f} pixels apart (rms)")
    errors: Axes = axes[2]
    errors.plot(1e6 * at, (forward - at) / pixel, color="#c0341d", label="forward")
    errors.plot(1e6 * at, (backward - at) / pixel, "--", color="#1b6ca8", label="backward")
    errors.set(
        xlabel="pixel at [µm]",
        ylabel="tip beside its pixel [pixels]",
        title=f"lines {1e9 * apart:.0f} nm apart,\n{apart / pixel:.2f} pixels (rms)",
    )
    errors.legend(fontsize="small")
    errors.secondary_yaxis(
        "right", functions=(lambda one: 1e9 * pixel * one, lambda one: one / (1e9 * pixel))
    ).set_ylabel("nm")


def shown(ax: Axes, x: Array, title: str) -> None:
    """Show the image of a line that is at `x` [m] at its pixels."""
    height = pattern(x[None, :], np.linspace(0.0, 30e-6, PIXELS)[:, None])
    ax.imshow(height, cmap="afmhot", extent=(15.0, 45.0, 30.0, 0.0), vmin=0.0, vmax=1.1)
    ax.set(title=title, xlabel="x [µm]", ylabel="y [µm]")


if __name__ == "__main__":
    main(*sys.argv[1:])
