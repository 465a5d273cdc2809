"""Identify the stage of one case by the default call, and judge it; prints a line of JSON.

python benches/records/judge.py SEED NUMBER
"""

from __future__ import annotations

import json
import re
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from cases import Case, make

import piezotrack as pt


def read(case: Case) -> tuple[pt.Dataset | None, list[str]]:
    """Return the record and what was said against it.

    Where it is refused with ``missing=`` as the remedy, that is followed.
    """
    try:
        return pt.Dataset(u=case.u, y=case.y, dt=case.dt), []
    except pt.PiezotrackError as refusal:
        sentence = str(refusal)
    remedy = re.search(r"missing\W+(drop|fill)\b", sentence)
    if remedy is None:
        return None, [sentence]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "record.csv"
        t = np.arange(len(case.u)) * case.dt
        columns = np.column_stack([t, case.u, 1e6 * case.y])
        header = "time [s],voltage [V],displacement [um]"
        np.savetxt(path, columns, fmt="%.10g", delimiter=",", header=header, comments="")
        options: dict[str, Any] = {"missing": remedy[1]}
        return pt.read(path, **options), [sentence]


def judge(case: Case) -> dict[str, Any]:
    """Return the figures of a case: residual, another motion, seconds and notes."""
    data, notes = read(case)
    if data is None:
        return {"samples": len(case.u), "notes": notes}
    wall, cpu = time.perf_counter(), time.process_time()
    try:
        fit = pt.identify(data)
    except pt.PiezotrackError as refusal:
        return {"samples": len(case.u), "notes": [*notes, str(refusal)]}
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    score = fit.score(pt.Dataset(u=case.other_u, y=case.other_y, dt=case.dt))
    return {
        "samples": len(case.u),
        "model": fit.model.info.name,
        "cpu_s": cpu,
        "wall_s": wall,
        "residual_noises": fit.cost / case.noise,
        "other_percent": 100.0 * score.rms / case.stroke,
        "other_noises": score.rms / case.noise,
        "notes": [
            *notes,
            *data.notes,
            *fit.notes,
            # How the record begins, and a drift or a delay that was fitted.
            *re.findall(r"^  ((?:start|drift|delay) .*)$", fit.summary(), re.MULTILINE),
            *(f"other motion: {note}" for note in score.notes),
        ],
    }


if __name__ == "__main__":
    print(json.dumps(judge(make(int(sys.argv[1]), int(sys.argv[2])))))
