"""Runs a fuzzer up to its number of calls, with Hypothesis drawing what is called."""

from __future__ import annotations

import zlib
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st
from hypothesis.errors import Flaky

from soak import Script, Tally

if TYPE_CHECKING:
    from collections.abc import Callable

# Hypothesis remembers what it has drawn: a new start for every so many keeps that small.
BATCH = 250


def fuzz(tally: Tally, body: Callable[[Script, Any], None], *, calls: int, start: int) -> None:
    """Call `body(script, draw)` with seeds from `start` on until `calls` calls are made.

    Nothing is shrunk: a failure is counted, and its calls kept as a script.
    """
    first, batch = start * 1_000_003 + zlib.crc32(tally.target.encode()), 0
    while tally.tries < calls:
        before = tally.tries

        @seed(first + batch)
        @settings(
            max_examples=min(BATCH, calls - tally.tries),
            database=None,
            deadline=None,
            phases=[Phase.generate],
            suppress_health_check=list(HealthCheck),
        )
        @given(st.data())
        def trial(data: st.DataObject) -> None:
            body(Script(tally), data.draw)

        # A call stopped for its time draws less than the next time.
        with suppress(Flaky):
            trial()
        batch += 1
        assert tally.tries > before, f"{tally.target} makes no call"
