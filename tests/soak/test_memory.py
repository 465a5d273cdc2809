"""Nothing is left behind by many calls: memory, threads, open files."""

from __future__ import annotations

import gc
import os
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt
from digests import U

if TYPE_CHECKING:
    from collections.abc import Callable

STATM = Path("/proc/self/statm")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not STATM.exists(), reason="this system does not say what memory is in use"),
]

STAGE = pt.DahlStage.xu_li_2010()
DATA = pt.Dataset(u=U, y=STAGE.simulate(U, 0.02).x, dt=0.02)
SMALL = pt.ParticleSwarm(particles=8, iterations=3)
SINE = pt.sine(frequency=0.5, low=0.0, high=90e-6, duration=2.0)
LOOP = pt.Controller(
    dt=0.02, limits=(0.0, 75.0), feedforward=STAGE.inverse(), feedback=pt.Pid.xu_li_2010(),
    repetitive=pt.Repetitive(period=2.0),
)  # fmt: skip


class StopError(Exception):
    """What a callback may raise."""


def search(callback: Callable[[Any], object] | None = None) -> None:
    with suppress(StopError, pt.Interrupted):
        pt.identify(DATA, "dahl", method=replace(SMALL, runs=1), callback=callback)


def raising(_: Any) -> None:
    raise StopError


def refused() -> None:
    with suppress(pt.DataError):
        STAGE.simulate([np.nan], 0.02)


CALLS: dict[str, tuple[Callable[[], object], int]] = {
    "identify": (search, 400),
    "identify, callback": (lambda: search(lambda _: None), 200),
    "identify, callback raises": (lambda: search(raising), 300),
    "identify, stopped": (lambda: search(lambda _: True), 300),
    "simulate": (lambda: STAGE.simulate(U, 0.02), 3000),
    "simulate, refused": (refused, 10_000),
    "virtual": (lambda: pt.VirtualStage.xu_li_2010().record(U[:50], 0.02), 500),
    "track": (lambda: pt.track(STAGE, LOOP, SINE, unstable=True), 100),
    "session": (lambda: LOOP.start().step(0.0, 0.0), 3000),
    "inverse": (lambda: STAGE.inverse().voltage(SINE, 0.02), 300),
}


def in_use() -> tuple[float, int, int]:
    """Memory [MB], threads and open files of this process."""
    gc.collect()
    pages = int(STATM.read_text().split()[1])
    open_files, threads = (len(os.listdir(f"/proc/self/{what}")) for what in ("fd", "task"))
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6, threads, open_files


@pytest.mark.parametrize("name", CALLS)
def test_nothing_is_left_behind(name: str) -> None:
    call, count = CALLS[name]
    for _ in range(max(20, count // 5)):
        call()
    before = in_use()
    for _ in range(count):
        call()
    after = in_use()
    # An array of 200 samples kept by each call would be 0.2 MB or more.
    assert after[0] - before[0] < 8e-4 * count + 2.0
    assert after[1:] == before[1:]
