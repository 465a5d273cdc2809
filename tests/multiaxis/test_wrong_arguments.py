"""Arguments of wrong kinds: refused by an error of the package, or taken, and nothing else."""

from __future__ import annotations

import contextlib
from typing import Any

import numpy as np
import pytest

import piezotrack as pt
from piezotrack import multiaxis as axes

STAGE = axes.VirtualAxes.three(noise=1e-9, seed=1)
RECORD = STAGE.record(samples=64)
MODEL = axes.identify_axes(RECORD, states=4)
RESPONSE = axes.approximate_axes(RECORD)
WANTED = RECORD.y[:, :, 0, 0]
DRIVE = RECORD.u[:, :, 0, 0]
LAW = pt.Pid(kp=0.005, ti=5e-4)
BAD: tuple[Any, ...] = (
    *(None, "a", b"x", 1.0, -1, 0, True, 1j, np.nan, np.inf, 1e300, 10**400, object()),
    *([], [1, 2], {}, range(3), [[1, "a"]], [None], np.array(3), np.zeros((0, 3))),
    *(np.full((4, 3), np.nan), np.ones((4, 3)) * 1j, np.ones((5, 3, 2, 2, 2))),
    np.ma.array(np.ones((4, 3)), mask=True),
)


def one_mode(**changed: Any) -> axes.VirtualAxes:
    parts = {"frequencies": [10.0], "damping_ratios": [0.1], "drive_shapes": [[1.0]]}
    return axes.VirtualAxes(**{**parts, "sensor_shapes": [[1.0]], "dt": 1e-3, **changed})


def track(**changed: Any) -> axes.MultiAxisTracking:
    arguments: dict[str, Any] = {"stage": MODEL, "reference": WANTED, "feedback": LAW, **changed}
    return axes.track_axes(**arguments)


def record(**changed: Any) -> axes.MultiAxisRecord:
    return axes.MultiAxisRecord(**{"u": RECORD.u, "y": RECORD.y, "dt": RECORD.dt, **changed})


CALLS: dict[str, Any] = {
    **{
        f"record {name}": lambda b, n=name: record(**{n: b}) for name in ("u", "y", "dt", "periods")
    },
    "joined": axes.MultiAxisRecord.joined,
    "only": RECORD.only,
    "from_npz": lambda b: axes.MultiAxisRecord.from_npz(b, drive="u", output="y", dt=1.0),
    "read": lambda b: axes.read_axes(b, drives="a", displacements="b"),
    "read drives": lambda b: axes.read_axes("none.csv", drives=b, displacements="b"),
    "read period": lambda b: axes.read_axes("none.csv", drives="a", displacements="b", period=b),
    "load": axes.load_axes,
    "approximate": axes.approximate_axes,
    "band": RESPONSE.band,
    "response score": lambda b: RESPONSE.score(RECORD, skip=b),
    "identify": axes.identify_axes,
    "states": lambda b: axes.identify_axes(RECORD, states=b),
    "most": lambda b: axes.identify_axes(RECORD, most=b),
    "simulate": MODEL.simulate,
    "level": lambda b: MODEL.simulate(DRIVE, level=b),
    "start": lambda b: MODEL.simulate(DRIVE, start=b),
    "at": lambda b: MODEL.at(b),
    "response": MODEL.response,
    "score": MODEL.score,
    "skip": lambda b: MODEL.score(RECORD, skip=b),
    "score start": lambda b: MODEL.score(RECORD, start=b),
    "decoupling": axes.decoupling_matrix,
    "kind": lambda b: axes.decoupling_matrix(MODEL, b),
    "repeating": lambda b: axes.repeating_drive(MODEL, b),
    "regularisation": lambda b: axes.repeating_drive(MODEL, WANTED, regularisation=b),
    "highest": lambda b: axes.repeating_drive(MODEL, WANTED, highest=b),
    "check": lambda b: axes.check_axes(b, LAW),
    **{
        f"track {name}": lambda b, n=name: track(**{n: b})
        for name in (
            *("stage", "reference", "feedback", "decoupling", "feedforward", "level", "model"),
            *("limits", "noise", "seed"),
        )
    },
    **{
        f"stage {name}": lambda b, n=name: one_mode(**{n: b})
        for name in (
            *("frequencies", "damping_ratios", "drive_shapes", "sensor_shapes", "dt"),
            *("cubic", "noise", "seed"),
        )
    },
    **{
        f"excited {name}": lambda b, n=name: STAGE.record(**{"samples": 64, n: b})
        for name in ("realisations", "periods", "samples", "level")
    },
    "stage simulate": STAGE.simulate,
}


@pytest.mark.parametrize("name", CALLS)
def test_a_wrong_argument_is_refused_by_an_error_of_the_package(name: str) -> None:
    for bad in BAD:
        with contextlib.suppress(pt.PiezotrackError):
            CALLS[name](bad)
