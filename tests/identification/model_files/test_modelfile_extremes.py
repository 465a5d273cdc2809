"""Model files with numbers at the ends of float64: a sentence or a result, and no warning."""

from __future__ import annotations

import json
from contextlib import suppress
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt

if TYPE_CHECKING:
    from pathlib import Path

T = np.arange(200) / 50.0
VOLTS = 30.0 * (1.0 - np.cos(6.0 * T))
CREEPING = pt.PrandtlIshlinskiiStage(
    linear=1e-6, thresholds=(5.0,), weights=(2e-7,), creep_weights=(3e-8,), creep_times=(0.5,)
)
LOG = pt.Dataset(
    u=VOLTS, y=CREEPING.simulate(VOLTS, 0.02).x + 1e-7 * np.exp(-T / 2.0), dt=0.02, source="a.csv"
)


@cache
def saved(kind: str) -> str:
    """A model file: of plays, with a drift, or with creep."""
    if kind == "plays":
        return json.dumps(pt.identify(LOG, "prandtl-ishlinskii").document())
    creeps = kind == "creep"
    few = pt.ParticleSwarm(particles=8, iterations=4, runs=1)
    fit = pt.identify(
        LOG, "dahl", method=few, threads=1, drift=True, creep=[0.5] if creeps else None
    )
    return json.dumps(fit.document())


CASES = {
    "drift that fades at once": ("drift", ("drift", "time"), 5e-324),
    "drift before all time": ("drift", ("drift", "begin"), -1e308),
    "drift that begins after its end": ("drift", ("drift", "begin"), 1e99),
    "drift that ends before its begin": ("drift", ("drift", "end"), -1e308),
    "drift beyond float64": ("drift", ("drift", "amplitude"), 1e308),
    "displacement beyond float64": ("plays", ("parameters", "linear"), 1e200),
    "creep that never ends": ("creep", ("parameters", "creep_times"), [1e30]),
    "creep that ends at once": ("creep", ("parameters", "creep_times"), [5e-324]),
    "creep without weight": ("creep", ("parameters", "creep_weights"), [5e-324]),
}


@pytest.mark.parametrize("case", CASES)
def test_a_number_at_the_end_of_float64_is_refused_or_used(case: str, tmp_path: Path) -> None:
    kind, (part, name), value = CASES[case]
    document = json.loads(saved(kind))
    document[part][name]["value"] = value
    path = tmp_path / "model.json"
    path.write_text(json.dumps(document), encoding="utf-8")
    with suppress(pt.PiezotrackError):
        model = pt.load(path)
        states: dict[str, Any] = {}
        for history in ("virgin", "settled", "fit", None):
            with suppress(pt.PiezotrackError):
                states[str(history)] = model.score(LOG, history=history).rms
        assert np.isfinite(list(states.values())).all()


def test_what_is_saved_is_what_is_read(tmp_path: Path) -> None:
    path = tmp_path / "model.json"
    for kind in ("drift", "creep"):
        path.write_text(saved(kind), encoding="utf-8")
        model = pt.load(path)
        assert model.score(LOG).rms_percent < 20.0


def test_a_drift_that_fades_within_a_picosecond_is_no_drift() -> None:
    with pytest.raises(pt.ParameterError, match=r"drift is .*e-324 s: expected"):
        pt.identify(LOG, "prandtl-ishlinskii", drift=5e-324)
