"""Judge modal models of a measured fine steering mirror on realisations that were not fitted.

Run as ``python benches/mirror.py training.npz``. Data: M. Floren and others, CubeSpec Fine Steering
Mirror benchmark dataset, CC BY 4.0; arrays u_100, y_100 and so on, converted to um. One
realisation of each level is left out in turn, and one model made of all others; the errors are rms
over the three sensors relative to the signal, in steady state, the first 100 samples of each period
left out.
"""

from __future__ import annotations

import sys
import time

import numpy as np

from piezotrack.multiaxis import MultiAxisRecord, approximate_axes, identify_axes

RATE = 6400.0
LEVELS = (100, 200, 300)
# What `identify_axes` is told of the distortion; nothing for the response of each level.
COLUMNS: dict[str, bool | int | None] = {
    "own response": None,
    "modes": False,
    "28 numbers": 28,
    "with distortion": True,
}


def spread(errors: list[float]) -> str:
    """Write the median and the ends of errors in percent."""
    percent = 100.0 * np.array(errors)
    return f"{np.median(percent):.2f} % ({percent.min():.2f} to {percent.max():.2f})"


def main(path: str) -> None:
    """Print the errors of responses and modes, and the times."""
    records = {
        level: MultiAxisRecord.from_npz(
            path, drive=f"u_{level}", output=f"y_{level}", dt=1.0 / RATE
        )
        for level in LEVELS
    }
    begun = time.perf_counter()
    model = identify_axes(list(records.values()))
    print(f"identified in {time.perf_counter() - begun:.1f} s: {model!r}")
    drive = np.tile(records[300].u[:, :, 0, 0], (2, 1))
    times = []
    for _ in range(5):
        begun = time.perf_counter()
        model.simulate(drive)
        times.append(time.perf_counter() - begun)
    print(f"simulated {drive.shape[0]} samples in {1e3 * np.median(times):.1f} ms")
    found: dict[str, list[list[float]]] = {name: [[] for _ in LEVELS] for name in COLUMNS}
    for left in range(records[100].realisations):
        kept = [
            record.only([k for k in range(record.realisations) if k != left])
            for record in records.values()
        ]
        for name, distortion in COLUMNS.items():
            joint = None if distortion is None else identify_axes(kept, distortion=distortion)
            for k, record in enumerate(records.values()):
                one = joint or approximate_axes(kept[k])
                found[name][k].append(float(one.score(record.only([left]))[0]))
        last = [f"{name} {100 * errors[0][-1]:.2f}" for name, errors in found.items()]
        print(f"{left} left out: " + ", ".join(last))
    for k, level in enumerate(LEVELS):
        cells = " | ".join(f"{spread(errors[k])}" for errors in found.values())
        print(f"| {level} mV | {cells} |")
    medians = [
        " / ".join(f"{100.0 * np.median(level):.2f}" for level in errors) + " %"
        for errors in found.values()
    ]
    print(f"| mirror, {' / '.join(map(str, LEVELS))} mV rms | {' | '.join(medians)} |")
    for level in LEVELS:
        others = [records[other] for other in LEVELS if other != level]
        errors = [
            spread(list(identify_axes(others, distortion=flag).score(records[level])))
            for flag in (False, True)
        ]
        print(f"{level} mV from the others: modes {errors[0]}, with distortion {errors[1]}")


if __name__ == "__main__":
    main(sys.argv[1])
