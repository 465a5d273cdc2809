"""The same bits of a model of several axes for any number of threads."""

from __future__ import annotations

import os
import subprocess
import sys

SCRIPT = """
import hashlib, json
import piezotrack as pt

axes = pt.multiaxis
stage = axes.VirtualAxes.three(cubic=0.04, noise=2e-9, seed=1)
records = [stage.record(realisations=4, samples=1024, level=level) for level in (0.5, 1.5)]
model = axes.identify_axes(records, states=16)
margins = axes.check_axes(model, pt.Pid(kp=0.005, ti=5e-4))
found = [
    json.dumps(model.document()),
    model.score(records[0]).tobytes().hex(),
    model.response(range(1, 900)).tobytes().hex(),
    margins.poles.tobytes().hex(),
    repr(margins.sensitivity),
]
for one in found:
    print(hashlib.sha256(one.encode()).hexdigest())
"""


def bits(threads: int) -> list[str]:
    """Identify a stage with a number of threads of all libraries; digests of what was found."""
    counts = dict.fromkeys(("OPENBLAS_NUM_THREADS", "RAYON_NUM_THREADS"), str(threads))
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT],
        env={**os.environ, **counts},
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.split()


def test_a_model_has_the_same_bits_for_any_number_of_threads() -> None:
    alone = bits(1)
    assert len(alone) == 5
    assert bits(2) == alone
