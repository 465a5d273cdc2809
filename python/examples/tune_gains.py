"""Tuned gains beside the published ones of Xu and Li 2010, along the sine of Fig. 12 at 50 Hz.

Run as ``python tune_gains.py [OUT]``. Writes the picture of docs/control.md, tuning.png: the error
over time, and the margins that both keep at the highest gain of the stage.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

import piezotrack as pt

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DT, LIMITS = 0.02, (0.0, 75.0)
COLOURS = {"published gains": "#c0341d", "tuned gains": "#1b6ca8"}
# What is asked for, in dB, degrees and as a factor: the default of `pt.Margins`.
ASKED = (20.0 * math.log10(2.0), math.degrees(0.5), 2.0)


def model(stage: pt.VirtualStage) -> pt.identification.Identification:
    """Identify a Dahl model as the paper does, from 4 s of a slow sine."""
    t = np.arange(20001) / 5000.0
    log = stage.record(37.5 * (1.0 - np.cos(2.0 * np.pi * 0.25 * t)), 1.0 / 5000.0)
    return pt.identify(
        log,
        "dahl",
        parameters={
            "mass": (0.1, 0.2),
            "damping": (1000.0, 5000.0),
            "stiffness": (1e4, 5e4),
            "piezo_coefficient": (0.01, 0.1),
            "a1": 121.9874,
            "a2": 1.1773e6,
            "b1": 1.8485e6,
        },
        method=pt.Descents(seed=1),
    )


def main() -> None:
    """Tune with one seed of the sensor, judge with another, and draw."""
    out = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
    out.mkdir(parents=True, exist_ok=True)
    stage = pt.VirtualStage.xu_li_2010(seed=1)
    inverse = model(stage).inverse()
    reference = pt.sine(frequency=0.2, low=0.0, high=110e-6, duration=20.0)
    published = pt.Controller(
        dt=DT, limits=LIMITS, feedforward=inverse, feedback=pt.Pid.xu_li_2010()
    )
    # The lowest point of the sine is the end of the stroke: noise clips the command there.
    found = pt.tune(
        stage,
        reference,
        dt=DT,
        limits=LIMITS,
        feedforward=inverse,
        parts=("pid", "low-pass"),
        goal=pt.Goal(largest_saturation=1.0),
    )
    print(found)
    figure = Figure(figsize=(9.5, 3.8), layout="constrained")
    error, margins = figure.subplots(1, 2, width_ratios=(1.4, 1.0))
    for k, (name, loop) in enumerate(
        {"published gains": published, "tuned gains": found.controller}.items()
    ):
        run = pt.track(pt.VirtualStage.xu_li_2010(seed=11), loop, reference)
        rms = f"{1e6 * run.metrics.rms_error:.2f}"
        print(f"{name}: {run.metrics}")
        error.plot(
            run.t, 1e6 * run.error, color=COLOURS[name], lw=0.9, label=f"{name}, rms {rms} µm"
        )
        bars(margins, pt.check_loop(stage, loop).high, name, k)
    error.axhline(0.0, color="0.6", lw=0.8, zorder=0)
    error.set(xlabel="time [s]", ylabel="desired less measured [µm]")
    error.legend(fontsize="small")
    for k in range(3):
        margins.plot([k - 0.45, k + 0.45], [1.0, 1.0], "k--", lw=1.0)
    labels = ("gain margin\n(at least {:.3g} dB)", "phase margin\n(at least {:.3g}°)")
    words = [one.format(bound) for one, bound in zip(labels, ASKED, strict=False)]
    margins.set_xticks(range(3), [*words, f"Ms\n(at most {ASKED[2]:.3g})"], fontsize="small")
    highest = 1.1 * margins.get_ylim()[1]
    margins.set(ylabel="multiple of the required value", ylim=(0.0, highest))
    figure.savefig(out / "tuning.png", dpi=150)


def bars(ax: Axes, loop: pt.control.LoopCheck, name: str, k: int) -> None:
    """Draw gain margin, phase margin and sensitivity over what was asked for."""
    gain, phase = loop.gain_margin or math.inf, loop.phase_margin or math.pi
    values = (20.0 * math.log10(gain), math.degrees(phase), loop.sensitivity)
    at = np.arange(3.0) + (0.4 * k - 0.2)
    heights = [value / bound for value, bound in zip(values, ASKED, strict=True)]
    drawn = ax.bar(at, heights, 0.38, color=COLOURS[name], label=name)
    words = [f"{value:.3g}" for value in values]
    white = {"facecolor": "white", "edgecolor": "none", "pad": 0.5}
    ax.bar_label(drawn, words, fontsize="small", padding=2, bbox=white)


if __name__ == "__main__":
    main()
