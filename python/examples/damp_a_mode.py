"""Damping of the first mode beside PI and PID: a mode of 160 Hz, damping ratio 0.02, at 5 kHz.

Run as ``python damp_a_mode.py``. All gains follow from the same margins alone (a factor of 2,
0.5 rad, Ms of 2), with half a sample of delay. Prints the table of docs/control.md: bandwidth from
the reference, time until a step of 10 um stays within 2 %, rms error along a triangle of 10 um with
50 lines a second, without and with the inverse of a model that is somewhat off, and with 100 lines,
and what 1 nm of sensor noise does to the command at rest. Writes damped.png, two periods of that
triangle with each law.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

import piezotrack as pt

DT, LIMITS, MODE = 2e-4, (0.0, 100.0), 160.0
LATE = pt.Timing(delay=0.5 * DT)
LAWS = {
    "PI": "pi",
    "PID": "pid",
    "integral resonant control": "integral-resonant",
    "positive position feedback": "positive-position",
    "positive velocity and position feedback": "positive-velocity-position",
}


class Judged(NamedTuple):
    """Bandwidth [Hz], settling [s], rms errors [m], change of the command at rest [V rms], run.

    Of the errors the second is with the inverse, the third at twice the rate.
    """

    bandwidth: float
    settling: float
    error: float
    with_inverse: float
    fast_error: float
    change: float
    lines: pt.control.Tracking


def moves(mode: float, gain: float = 1e-6) -> pt.stages.PrandtlIshlinskiiStage:
    """Make a stage of one mode, with no hysteresis."""
    return pt.stages.PrandtlIshlinskiiStage(
        linear=gain, thresholds=(), weights=(), frequency=mode, damping_ratio=0.02
    )


def stage(mode: float = MODE) -> pt.VirtualStage:
    """Make the stage, 1 um/V, and a sensor with 1 nm of noise."""
    return pt.VirtualStage(stage=moves(mode), sensor=pt.stages.Sensor(noise=1e-9, seed=1))


# Of a model with 5 % more gain, whose mode is 3 % lower.
INVERSE = moves(0.97 * MODE, 1.05e-6).inverse()


def tuned(law: str) -> pt.Controller:
    """Find the gains of a law from the margins."""
    found = pt.tune(stage(), dt=DT, limits=LIMITS, law=law, parts="pid", timing=LATE)  # type: ignore[arg-type]
    return found.controller


def judged(controller: pt.Controller) -> Judged:
    """Move, scan and hold with a controller."""
    step = pt.staircase(dwell=1.5, steps=1, low=20e-6, high=30e-6, rise=DT)
    lines, fast = (
        pt.triangle(frequency=rate, low=20e-6, high=30e-6, duration=20.0 / rate)
        for rate in (25.0, 50.0)
    )
    rest = pt.staircase(dwell=0.5, levels=[20e-6, 20e-6])
    both = pt.track(stage(), replace(controller, feedforward=INVERSE), lines, timing=LATE)
    runs = [pt.track(stage(), controller, one, timing=LATE) for one in (step, lines, fast, rest)]
    bandwidth = pt.check_loop(stage(), controller, delay=LATE.delay).middle.bandwidth
    change = np.diff(runs[3].voltage[len(runs[3].voltage) // 2 :])
    return Judged(
        bandwidth=bandwidth or 0.0,
        settling=runs[0].settling()[0].time,
        error=runs[1].metrics.rms_error,
        with_inverse=both.metrics.rms_error,
        fast_error=runs[2].metrics.rms_error,
        change=float(np.sqrt(np.mean(change**2))),
        lines=runs[1],
    )


def plotted(runs: dict[str, pt.control.Tracking]) -> Figure:
    """Draw two periods of the triangle with each law."""
    figure = Figure(figsize=(7.6, 3.6), layout="constrained")
    ax = figure.subplots()
    for (name, run), dash in zip(runs.items(), ("-.", ":", "--", "-", (0, (5, 1))), strict=True):
        shown = (run.t > 0.6) & (run.t < 0.68)
        ax.plot(1e3 * run.t[shown], 1e6 * run.displacement[shown], linestyle=dash, label=name)
    ax.plot(1e3 * run.t[shown], 1e6 * run.desired[shown], "k", linewidth=0.8, label="desired")
    ax.set(xlabel="time [ms]", ylabel="displacement [um]")
    ax.margins(x=0.0)
    figure.legend(loc="outside right center", frameon=False)
    return figure


def main() -> None:
    """Print the table, and draw the motion."""
    runs = {}
    print("| law | bandwidth | settling | 50 lines/s | inverse | 100 lines/s | noise, command |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for name, law in LAWS.items():
        one = judged(tuned(law))
        runs[name] = one.lines
        print(
            f"| {name} | {one.bandwidth:.3g} Hz | {1e3 * one.settling:.1f} ms "
            f"| {1e6 * one.error:.3f} µm | {1e6 * one.with_inverse:.3f} µm "
            f"| {1e6 * one.fast_error:.3f} µm "
            f"| {1e3 * one.change:.2f} mV |",
            flush=True,
        )
    open_loop = pt.Controller(dt=DT, limits=LIMITS, feedforward=INVERSE)
    alone = pt.track(stage(), open_loop, runs["PI"].reference, timing=LATE).metrics.rms_error
    print(f"the inverse alone, 50 lines/s: {1e6 * alone:.3f} µm")
    plotted(runs).savefig("damped.png", dpi=150)


if __name__ == "__main__":
    main()
