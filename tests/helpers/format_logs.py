"""The same log in files of every format, and what a reader may say of a bad one."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt

if TYPE_CHECKING:
    from pathlib import Path

DT = 0.005
T = DT * np.arange(400)
U = 20.0 - 20.0 * np.cos(2.0 * np.pi * T)
# In micrometres, as a sensor's software has it.
Y = 1.2 * U + 0.3 * np.sin(2.0 * np.pi * T)
TEMPERATURE = np.linspace(293.0, 294.0, 40)


def is_the_log(log: pt.Dataset, *, tolerance: float = 0.0) -> bool:
    """Whether a record has the samples above: exactly, or within a tolerance of text [V, um]."""
    return (
        log.u.size == U.size
        and bool(np.abs(log.t - log.t[0] - T).max() < 1e-9)
        and bool(np.abs(log.u - U).max() <= tolerance)
        and bool(np.abs(log.y - Y / 1e6).max() <= max(1e-6 * tolerance, 1e-20))
    )


def refusal(path: Path, **arguments: Any) -> str:
    """Read a file that has to be refused, within a second and in one sentence that names it."""
    began = time.process_time()
    with pytest.raises(pt.PiezotrackError) as caught:
        pt.read(path, **arguments)
    message = str(caught.value)
    assert time.process_time() - began < 1.0, message
    assert message.startswith(f"{path.name}:"), message
    assert message.count("\n") == 0
    assert len(message) < 500
    return message


def damaged(content: bytes, seed: int) -> list[bytes]:
    """Cut a file off at many places, and change some of its bytes."""
    rng = np.random.default_rng(seed)
    cuts = [content[: int(k)] for k in np.linspace(1, len(content) - 1, 20)]
    changed = []
    for _ in range(60):
        data = bytearray(content)
        # Most sizes are in the first bytes.
        end = len(data) if rng.random() < 0.5 else min(400, len(data))
        for place in rng.integers(0, end, size=int(rng.integers(1, 4))):
            data[int(place)] = int(rng.choice([0, 1, 127, 255, int(rng.integers(256))]))
        changed.append(bytes(data))
    return cuts + changed


def survives(path: Path, seed: int = 1) -> int:
    """Read damaged copies of a file: each is read, or refused in a sentence; count the latter."""
    refused = 0
    copy = path.with_name(f"damaged{path.suffix}")
    for content in damaged(path.read_bytes(), seed):
        copy.write_bytes(content)
        began = time.process_time()
        message = f"{copy.name}:"
        try:
            log = pt.read(copy)
            assert np.isfinite(log.u).all()
            assert np.isfinite(log.y).all()
        except pt.PiezotrackError as error:
            refused += 1
            message = str(error)
        assert message.startswith(f"{copy.name}:")
        assert len(message) < 500
        assert time.process_time() - began < 1.0
    return refused
