"""Accuracy against time of the three integrators: writes docs/accuracy.png.

Run as ``python benches/accuracy_time.py`` after ``make demo``, with the environment it made.
"""

from __future__ import annotations

import math
import time
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.ticker import FuncFormatter

import piezotrack as pt

METHODS = {"exponential": "o-", "rk4": "s--", "rk45": "^:"}
LABELS = {"exponential": "exponential (default)", "rk4": "RK4", "rk45": "RK4(5), adaptive"}


def light_stage() -> pt.DahlStage:
    """A stage with a 160 Hz mode of zeta = 0.065, as the paper's step response shows it."""
    mass = 0.1828
    stiffness = mass * (2 * math.pi * 160) ** 2
    return pt.DahlStage(
        mass=mass,
        damping=2 * 0.065 * math.sqrt(stiffness * mass),
        stiffness=stiffness,
        piezo_coefficient=1.6e-6 * stiffness,
        a1=121.9874,
        a2=1.1773e6,
        b1=1.8485e6 * stiffness / 26065.0,
    )


def measured(stage: pt.DahlStage, u: np.ndarray, dt: float, hold: str) -> dict[str, list]:
    """Error and time for accuracies asked from 1 um to 0.1 pm."""
    exact = stage.simulate(u, dt, hold=hold, accuracy=1e-15).x
    found: dict[str, list] = {}
    for method in METHODS:
        for digits in range(6, 14):
            start = time.perf_counter()
            rounds: list[float] = []
            # The fastest, which other programs on the computer disturb least.
            while len(rounds) < 3 or time.perf_counter() - start < 0.05:
                began = time.perf_counter()
                x = stage.simulate(u, dt, hold=hold, method=method, accuracy=10.0**-digits).x
                rounds.append(time.perf_counter() - began)
            each = min(rounds)
            error = max(float(np.abs(x - exact).max()), 1e-16)
            found.setdefault(method, []).append((1e3 * each, error))
            print(f"{method:12} asked 1e-{digits:02} m: error {error:.1e} m, {1e3 * each:8.3f} ms")
    return found


def main() -> None:
    """Measure and draw."""
    drive = 75.0 * (np.arange(1000) // 50 % 2)
    figure, ax = plt.subplots(figsize=(7.0, 4.0), layout="constrained")
    for method, points in measured(light_stage(), drive, 1 / 1000.0, "zoh").items():
        times, errors = zip(*points, strict=True)
        ax.loglog(times, errors, METHODS[method], label=LABELS[method])
    ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.axhline(1e-10, color="0.6", linewidth=0.8)
    ax.annotate("0.1 nm", (0.99, 1.3e-10), xycoords=("axes fraction", "data"), ha="right")
    title = "Mode of 160 Hz, zeta 0.065, steps of 75 V at 1 kHz"
    ax.set(title=title, xlabel="time of one call [ms]", ylabel="largest error [m]")
    ax.legend(loc="upper right")
    figure.savefig(Path(__file__).parent.parent / "docs" / "accuracy.png", dpi=150)


if __name__ == "__main__":
    main()
