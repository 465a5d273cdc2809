"""Judge modal models of a measured fine steering mirror on realisations that were not fitted.

Run as ``python benches/mirror.py training.npz``. Data: M. Floren and others, CubeSpec Fine Steering
Mirror benchmark dataset, CC BY 4.0; arrays u_100, y_100 and so on, converted to um. For each level
each realisation is left out in turn; the errors are rms over the three sensors relative to the
signal, in steady state, the first 100 samples of each period left out.
"""

from __future__ import annotations

import sys
import time

import numpy as np

from piezotrack.multiaxis import MultiAxisRecord, approximate_axes, identify_axes

RATE = 6400.0
LEVELS = (100, 200, 300)


def spread(errors: list[float]) -> str:
    """Write the median and the ends of errors in percent."""
    percent = 100.0 * np.array(errors)
    return f"{np.median(percent):.2f} ({percent.min():.2f} to {percent.max():.2f})"


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
    medians: dict[str, list[str]] = {"response": [], "modes": [], "with distortion": []}
    for level, record in records.items():
        own: list[float] = []
        modes: list[float] = []
        distorted: list[float] = []
        for left in range(record.realisations):
            kept = record.only([k for k in range(record.realisations) if k != left])
            test = record.only([left])
            own.append(float(approximate_axes(kept).score(test)[0]))
            modes.append(float(identify_axes(kept, distortion=False).score(test)[0]))
            distorted.append(float(identify_axes(kept).score(test)[0]))
            print(
                f"{level} mV, {left} left out: response {own[-1]:.4f}, modes {modes[-1]:.4f}, "
                f"with distortion {distorted[-1]:.4f}"
            )
        for name, errors in zip(medians, (own, modes, distorted), strict=True):
            print(f"{level} mV, {name}: {spread(errors)} %")
            medians[name].append(f"{100.0 * np.median(errors):.2f}")
    cells = " | ".join(f"{' / '.join(values)} %" for values in medians.values())
    print(f"| mirror, {' / '.join(map(str, LEVELS))} mV rms | {cells} |")
    for level in LEVELS:
        others = identify_axes([one for other, one in records.items() if other != level])
        print(f"{level} mV from the others: modes {spread(list(others.score(records[level])))} %")


if __name__ == "__main__":
    main(sys.argv[1])
