"""Scheduled gains against one fixed set, on the virtual stage of Xu and Li 2010.

Sines of three amplitudes and three rates about 58.5 um at 50 Hz, PID and low-pass without
feedforward. The gains are tuned with one seed of the sensor and judged on eight others: rms of the
measured error. Prints a table in Markdown.

    python benches/scheduled_gains.py
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import piezotrack as pt

AMPLITUDES = (10e-6, 20e-6, 40e-6)
RATES = (0.1, 0.2, 0.5)
CENTRE = 58.5e-6
LIMITS = (0.0, 75.0)
JUDGED = range(11, 19)


def errors(controller: pt.Controller, amplitude: float, rate: float) -> list[float]:
    """Rms errors [m] along four periods, one for each seed."""
    low, high = CENTRE - amplitude, CENTRE + amplitude
    reference = pt.sine(frequency=rate, low=low, high=high, duration=4.0 / rate)
    return [
        pt.track(pt.VirtualStage.xu_li_2010(seed=seed), controller, reference).metrics.rms_error
        for seed in JUDGED
    ]


def main() -> None:
    stage = pt.VirtualStage.xu_li_2010(seed=1)
    found = pt.control.schedule(stage, AMPLITUDES, RATES, centre=CENTRE, dt=0.02, limits=LIMITS)
    # From the first sample on the gains are those of the motion, as in the grid.
    law = found.controller.feedback
    assert isinstance(law, pt.control.ScheduledPid)
    print("| amplitude um | rate Hz | fixed rms um | scheduled rms um | spread over seeds um |")
    print("| --- | --- | --- | --- | --- |")
    sums = np.zeros(2)
    for amplitude in AMPLITUDES:
        for rate in RATES:
            scheduled = replace(found.controller, feedback=replace(law, first=(amplitude, rate)))
            fixed = 1e6 * np.array(errors(found.fixed.controller, amplitude, rate))
            after = 1e6 * np.array(errors(scheduled, amplitude, rate))
            sums += fixed.mean(), after.mean()
            print(
                f"| {1e6 * amplitude:g} | {rate:g} | {fixed.mean():.3f} | {after.mean():.3f} | "
                f"{fixed.std(ddof=1):.3f} |"
            )
    print(f"| sum | | {sums[0]:.3f} | {sums[1]:.3f} | |")


if __name__ == "__main__":
    main()
