"""Seconds of the default call, which compares models, on records of several sorts and lengths.

    python benches/default_call.py [times]

The measured log, and records of a virtual stage of plays that creeps: a slow sine, a decaying one,
steps, and noise. Printed for each: least time by the clock and of the processors, the model taken.
"""

from __future__ import annotations

import sys
import time
import warnings

import numpy as np
from numpy.typing import NDArray

import piezotrack as pt

Array = NDArray[np.float64]

THRESHOLDS = np.linspace(1.0, 50.0, 30)
STAGE = pt.PrandtlIshlinskiiStage(
    linear=1e-7,
    thresholds=THRESHOLDS.tolist(),
    weights=(1e-8 * np.exp(-THRESHOLDS / 25.0)).tolist(),
    creep_weights=[0.02],
    creep_times=[2.0],
)
NOISE = 5e-9  # m


def record(u: Array, dt: float, hold: pt.data.Hold = "foh") -> pt.Dataset:
    """Return a record of the stage under a drive [V]."""
    return pt.VirtualStage.of(STAGE, noise=NOISE, seed=1).record(u, dt, hold=hold)


def records() -> dict[str, pt.Dataset]:
    """Return the records by their names."""
    rng = np.random.default_rng(3)
    slow, long = 2e-4 * np.arange(50_001), 1e-3 * np.arange(100_000)
    lines = np.fft.rfft(rng.normal(size=20_000))
    lines[np.fft.rfftfreq(20_000, 1e-3) > 15.0] = 0.0
    noise = np.fft.irfft(lines, 20_000)
    levels = np.random.default_rng(4).uniform(0.0, 100.0, 20)
    decaying = np.cos(np.pi * long) * np.exp(-long / 80.0)
    return {
        "measured log, 20 s": pt.datasets.dbo_training()[3.0:23.0],
        "sine of 1 Hz at 5 kHz": record(50.0 - 50.0 * np.cos(2.0 * np.pi * slow), 2e-4),
        "steps": record(np.repeat(rng.uniform(0.0, 100.0, 18), 500), 1e-3, "zoh"),
        "long steps": record(np.repeat(levels, 5000), 1e-3, "zoh"),
        "decaying sine": record(50.0 - 50.0 * decaying, 1e-3),
        "noise up to 15 Hz": record(50.0 + 45.0 * noise / np.abs(noise).max(), 1e-3),
    }


def main() -> None:
    """Print the table."""
    warnings.simplefilter("ignore")
    times = int(sys.argv[1]) if len(sys.argv) > 1 else 3
    print("record                  samples   clock     CPU  model")
    for name, data in records().items():
        clocks, processors = [], []
        for _ in range(times):
            begun = time.perf_counter(), time.process_time()
            fit = pt.identify(data, progress=False)
            clocks.append(time.perf_counter() - begun[0])
            processors.append(time.process_time() - begun[1])
        seconds = f"{min(clocks):7.2f} {min(processors):7.2f}"
        print(f"{name:22s} {len(data):8d} {seconds}  {fit.model.info.name}", flush=True)


if __name__ == "__main__":
    main()
