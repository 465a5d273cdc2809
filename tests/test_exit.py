"""A process ends while a daemon thread is inside a long call, as in a window with buttons."""

from __future__ import annotations

import random

import pytest

from children import child

WORK = """
import threading, time
u = 30.0 * (1.0 - np.cos(6.0 * np.arange(20_000) / 5000.0))
log = pt.Dataset(u=u, y=pt.DahlStage.xu_li_2010().simulate(u, 1 / 5000.0).x, dt=1 / 5000.0)
threading.Thread(target=lambda: {call}, daemon=True).start()
time.sleep({seconds})
"""
CALLS = {
    "identify": "pt.identify(log, 'dahl')",
    "callback": "pt.identify(log, 'dahl', callback=lambda progress: None)",
    "progress": "pt.identify(log, 'dahl', progress=True)",
    "simulate": "pt.VirtualStage.xu_li_2010().simulate(np.zeros(3_000_000), 1 / 5000.0)",
}


def ends_well(call: str, seconds: float) -> None:
    ended = child(WORK.format(call=CALLS[call], seconds=seconds))
    # Below 0 it is the number of the signal: 11 is a segmentation fault.
    assert ended.returncode == 0, (call, seconds, ended.returncode, ended.stderr[-500:])


@pytest.mark.slow
@pytest.mark.parametrize("seconds", [0.1, 0.3])
@pytest.mark.parametrize("call", CALLS)
def test_a_daemon_thread_ends_with_the_process(call: str, seconds: float) -> None:
    ends_well(call, seconds)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(60))
def test_a_daemon_thread_ends_with_the_process_at_any_moment(seed: int) -> None:
    moment = random.Random(seed)
    ends_well(moment.choice(list(CALLS)), moment.uniform(0.0, 0.5))
