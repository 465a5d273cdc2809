"""All models on measured logs: fitted to a part of one, validated on its rest and on another.

Run as ``python compare_models.py FOLDER [OUT]``, with training.csv and tracking.csv of Aye and
Ang's piezo stack in the folder (github.com/yan9a/DiscreteBacklashOperator, columns time_s,
voltage_V, displacement_um). Without arguments it makes two logs on the virtual stage. Prints the
table of docs/models.md and writes its picture, comparison.png.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import piezotrack as pt


def virtual_logs() -> tuple[pt.Dataset, pt.Dataset]:
    """Make a log of full cycles and one whose amplitude falls, 12 s at 200 Hz each."""
    stage, dt = pt.VirtualStage.xu_li_2010(seed=1), 1 / 200.0
    phase = 2.0 * np.pi * 0.5 * dt * np.arange(2400)
    logs = [
        stage.record(37.5 - reach * np.cos(phase), dt)
        for reach in (np.full(2400, 37.5), np.linspace(37.5, 2.0, 2400))
    ]
    return logs[0], logs[1]


def main() -> None:
    """Fit each model once, and judge it twice."""
    out = Path(sys.argv[2] if len(sys.argv) > 2 else "comparison")
    out.mkdir(parents=True, exist_ok=True)
    if len(sys.argv) > 1:
        folder = Path(sys.argv[1])
        log, other = pt.read(folder / "training.csv"), pt.read(folder / "tracking.csv")
        # Both begin with a transient from an unknown history.
        train, other = (3.0, 23.0), other[3.0:]
    else:
        (log, other), train = virtual_logs(), (2.0, 8.0)
        other = other[2.0:]
    rest = pt.compare(log, train=train, seed=1)
    found = pt.compare(log, rest.fits.values(), train=train, test=other)
    print("| model | K | fitted | rest of the log | other log |")
    print("| --- | --- | --- | --- | --- |")
    for carried, own in zip(rest.rows, found.rows, strict=True):
        scores = " | ".join(
            f"{score.rms_percent:.2f} %, {1e6 * score.max_error:.2f} um"
            for score in (own.train, carried.test, own.test)
        )
        print(f"| {own.title} | {own.parameters} | {scores} |")
    print(f"\n{found.summary()}")
    found.plot().savefig(out / "comparison.png", dpi=150)


if __name__ == "__main__":
    main()
