"""Scheduled gains against one fixed set, on the virtual stage of Xu and Li 2010.

Sines of three amplitudes and three rates about 58.5 um at 50 Hz, PID and low-pass without
feedforward; then the nine circles of Table 2 with a schedule for each axis. The gains are tuned
with one seed of the sensor and judged on others: rms of the measured error, of circles of the
contour error. Prints tables in Markdown.

    python benches/scheduled_gains.py
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

import piezotrack as pt

if TYPE_CHECKING:
    from collections.abc import Callable

AMPLITUDES = (10e-6, 20e-6, 40e-6)
RATES = (0.1, 0.2, 0.5)
CENTRE = 58.5e-6
LIMITS = (0.0, 75.0)
JUDGED = range(11, 19)
JUDGED_CIRCLES = range(11, 15)


def errors(controller: pt.Controller, amplitude: float, rate: float) -> list[float]:
    """Rms errors [m] along four periods, one for each seed."""
    low, high = CENTRE - amplitude, CENTRE + amplitude
    reference = pt.sine(frequency=rate, low=low, high=high, duration=4.0 / rate)
    return [
        pt.track(pt.VirtualStage.xu_li_2010(seed=seed), controller, reference).metrics.rms_error
        for seed in JUDGED
    ]


def beginning(controller: pt.Controller, amplitude: float, rate: float) -> pt.Controller:
    """From the first sample on the gains are those of the motion, as in the grid."""
    law = controller.feedback
    assert isinstance(law, pt.control.ScheduledPid)
    return replace(controller, feedback=replace(law, first=(amplitude, rate)))


def contour_errors(pair: tuple[pt.Controller, ...], radius: float, rate: float) -> list[float]:
    """Rms contour errors [m] along three turns, one for each seed."""
    path = pt.circle(frequency=rate, radius=radius)
    stages = (pt.XYStage.xu_li_2010(seed=seed) for seed in JUDGED_CIRCLES)
    return [pt.contour(stage, pair, path).metrics.rms_error for stage in stages]


def table(title: str, figures: Callable[[float, float], tuple[list[float], list[float]]]) -> None:
    """Print rms errors with fixed and with scheduled gains."""
    print(f"\n| {title} um | rate Hz | fixed rms um | scheduled rms um | spread over seeds um |")
    print("| --- | --- | --- | --- | --- |")
    sums = np.zeros(2)
    for amplitude in AMPLITUDES:
        for rate in RATES:
            fixed, after = (1e6 * np.array(one) for one in figures(amplitude, rate))
            sums += fixed.mean(), after.mean()
            print(
                f"| {1e6 * amplitude:g} | {rate:g} | {fixed.mean():.3f} | {after.mean():.3f} | "
                f"{fixed.std(ddof=1):.3f} |",
                flush=True,
            )
    print(f"| sum | | {sums[0]:.3f} | {sums[1]:.3f} | |")


def main() -> None:
    common = {"dt": 0.02, "limits": LIMITS}
    stage = pt.VirtualStage.xu_li_2010(seed=1)
    one = pt.schedule(stage, AMPLITUDES, RATES, centre=CENTRE, **common)
    both = pt.schedule(pt.XYStage.xu_li_2010(seed=1), AMPLITUDES, RATES, **common)

    def sines(amplitude: float, rate: float) -> tuple[list[float], list[float]]:
        after = beginning(one.controller, amplitude, rate)
        return errors(one.fixed.controller, amplitude, rate), errors(after, amplitude, rate)

    def circles(radius: float, rate: float) -> tuple[list[float], list[float]]:
        after = tuple(beginning(axis, radius, rate) for axis in both.controllers)
        fixed = both.fixed.controllers
        return contour_errors(fixed, radius, rate), contour_errors(after, radius, rate)

    table("amplitude", sines)
    table("radius", circles)


if __name__ == "__main__":
    main()
