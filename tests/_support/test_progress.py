"""Progress of a whole of several parts."""

from __future__ import annotations

import itertools
import re
import time
from typing import TYPE_CHECKING

import numpy as np

import piezotrack as pt
from piezotrack._support.display import progress_bar, progress_parts
from piezotrack._support.display.progress_parts import Parts, part_at_work

if TYPE_CHECKING:
    import pytest


def test_parts_of_parts_add_up_and_never_fall() -> None:
    seen, parts = [], Parts([1.0, 3.0])
    for i in range(2):
        with parts.begin(i):
            inner = Parts([1.0, 1.0])
            for k in range(2):
                with inner.begin(k):
                    # A part that is begun anew does not go back.
                    seen += [part_at_work().share(done) for done in (0.0, 0.5, 0.0, 1.0)]
    ends = [0.0, 0.0625, 0.0625, 0.125, 0.125, 0.1875, 0.1875, 0.25]
    later = [0.25, 0.4375, 0.4375, 0.625, 0.625, 0.8125, 0.8125, 1.0]
    assert np.allclose(seen, ends + later)


def test_the_time_left_is_that_of_the_pace_so_far(monkeypatch: pytest.MonkeyPatch) -> None:
    now = time.monotonic()
    parts = Parts([1.0, 1.0, 2.0])
    with parts.begin(0):
        pass
    with parts.begin(1):
        part = part_at_work()
        assert part.words(0.0) == "25 %"
        monkeypatch.setattr(time, "monotonic", lambda: now + 30.0)
        # 30 s for a half: 30 s more.
        left = re.fullmatch(r"50 %, up to (\d+) s left", part.words(1.0))
        assert left is not None
        assert 29 <= int(left[1]) <= 31


def test_progress_is_that_of_all_models(monkeypatch: pytest.MonkeyPatch) -> None:
    shares: list[float] = []
    tasks: list[str] = []

    class View:
        def __init__(self, _: object, task: str) -> None:
            tasks.append(task)

        def start(self, share: float, words: str) -> None:
            del words
            shares.append(share)

        def step(self, share: float, words: str) -> None:
            del words
            shares.append(share)

        def stop(self) -> None:
            pass

    monkeypatch.setattr(progress_bar, "_Words", View)
    t = np.arange(1200) / 200.0
    u = (30.0 - 3.0 * t) * (1.0 - np.cos(2.0 * np.pi * t))
    log = pt.Dataset(u=u, y=1e-6 * u + 1e-8 * np.sin(37.0 * t), dt=0.005)
    pt.compare(log, ["prandtl-ishlinskii", "preisach", "duhem"], progress=True)
    assert len(tasks) >= 3
    # Models by least squares report nothing, and count as parts.
    assert shares[0] == 0.0
    assert max(shares) >= 2.0 / 3.0 - 1e-9
    assert all(a <= b for a, b in itertools.pairwise(shares))
    shares.clear()
    pt.identify(log, progress=True)
    assert 0.0 < max(shares) <= 1.0
    assert all(a <= b for a, b in itertools.pairwise(shares))
    # Nothing is left of a whole that has ended.
    assert progress_parts.part_at_work().low == 0.0
