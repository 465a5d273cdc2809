"""Calibrate the virtual stage to what Xu and Li 2010 publish.

``python calibrate_virtual_stage.py [FILE [PARTICLES [ITERATIONS [RUNS]]]]`` writes what
``piezotrack reproduce`` loads, which is kept as ``python/piezotrack/xu_li_2010/calibrated.json``:
40 particles, 40 iterations and 2 runs, half an hour on two cores. Without arguments it runs a
small search as a demonstration.
"""

import sys
from itertools import zip_longest
from pathlib import Path

from piezotrack._support.files.writing import write_document
from piezotrack.xu_li_2010.calibration import calibrate

file = Path(sys.argv[1] if len(sys.argv) > 1 else "calibration.txt")
particles, iterations, runs = (
    int(given or small) for given, small in zip_longest(sys.argv[2:5], ("4", "2", "1"))
)
found = calibrate(
    particles=particles,
    iterations=iterations,
    runs=runs,
    progress=lambda k, best, _: print(f"{k:>4}  {best:.4f}", flush=True),
)
for one in found["free"]:
    print(f"{one['name']:<16} {one['value']:>10.4g}  {one['meaning']}")
print(f"written: {write_document(file, found)}")
