"""What reads a file from outside, and what is done with what it read."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import piezotrack as pt
from soak import not_finite, verdict_of

if TYPE_CHECKING:
    from collections.abc import Callable

SINE = pt.sine(frequency=1.0, low=0.0, high=1e-5, duration=0.5)
VOLTS = 30 * (1 - np.cos(0.12 * np.arange(10)))


def use_log(path: str) -> Any:
    data = pt.read(path)
    assert data.dt > 0
    assert len(data) == data.u.size == data.y.size
    return data.t, data.u, data.y, data.dt


def use_drive(path: str) -> Any:
    return tuple(pt.data.read_drive(path))


def use_reference(path: str) -> Any:
    sampled = pt.references.read_reference(path).sample(0.02)
    return sampled.x, sampled.v, sampled.a


def use_path(path: str) -> Any:
    sampled = pt.references.read_path(path).x.sample(0.02)
    return sampled.x, sampled.v, sampled.a


def use_model(path: str) -> Any:
    """Follow a drive and a reference with a model, and save it: it has to be the same again."""
    loaded = pt.load(path)
    results = []
    for use in (
        lambda: loaded.displacement(VOLTS, 0.02),
        lambda: loaded.inverse().voltage(SINE, 0.02),
        lambda: loaded.drive_range,
    ):
        try:
            results.append(use())
        except pt.PiezotrackError:
            results.append(None)
    loaded.save("again.json")
    again = pt.load("again.json")
    assert again.model == loaded.model
    assert (again.offset, again.delay) == (loaded.offset, loaded.delay)
    return results


# What a file of each kind goes through, and the ending of its name.
READERS: dict[str, tuple[Callable[[str], Any], str]] = {
    "log": (use_log, ".csv"),
    "drive": (use_drive, ".csv"),
    "reference": (use_reference, ".csv"),
    "path": (use_path, ".csv"),
    "model": (use_model, ".json"),
    **{
        ending: (use_log, ending) for ending in (".npz", ".mat", ".parquet", ".h5", ".tdms", ".mf4")
    },
}


def faults_of_file(kind: str, content: bytes) -> tuple[list[str], bool]:
    """What a reader did that it may not, and whether it read the file."""
    use, ending = READERS[kind]
    name = f"given{ending}"
    Path(name).write_bytes(content)
    faults, value = verdict_of(lambda: use(name))
    faults += [f"not finite: {where}" for where in not_finite(value)][:1]
    return faults, isinstance(value, (tuple, list))
