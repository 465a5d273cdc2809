"""Objects that several threads share: the bits of one thread, with the GIL and without it."""

from __future__ import annotations

import sys
import sysconfig
import threading
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING

import numpy as np
import pytest

import piezotrack as pt

if TYPE_CHECKING:
    from collections.abc import Callable

THREADS = 8
FREE = bool(sysconfig.get_config_var("Py_GIL_DISABLED"))
DT = 1e-3
VOLTS = 30.0 - 30.0 * np.cos(0.02 * np.arange(1500))
PLAYS = pt.stages.PrandtlIshlinskiiStage(
    linear=1e-6, thresholds=(10.0, 20.0), weights=(0.2e-6, 0.1e-6)
)
DAHL = pt.DahlStage.xu_li_2010()
LOG = pt.Dataset(u=VOLTS, y=DAHL.simulate(VOLTS, DT).x, dt=DT)
LOOP = pt.Controller(
    dt=DT,
    limits=(0.0, 75.0),
    feedforward=pt.stages.Inverse(stage=PLAYS),
    feedback=pt.Pid(kp=1e5, ti=0.01, td=0.0),
)
REFERENCE = pt.sine(frequency=2.0, low=10e-6, high=40e-6, duration=1.5)


def at_once(task: Callable[[], bytes]) -> list[bytes]:
    """Run a task in all threads, begun at the same moment."""
    barrier = threading.Barrier(THREADS)

    def begin() -> bytes:
        barrier.wait()
        return task()

    with ThreadPoolExecutor(THREADS) as pool:
        return [one.result() for one in [pool.submit(begin) for _ in range(THREADS)]]


def test_simulations_of_one_stage() -> None:
    for stage in (DAHL, PLAYS):
        assert set(at_once(lambda stage=stage: stage.simulate(VOLTS, DT).x.tobytes())) == {  # type: ignore[misc]
            stage.simulate(VOLTS, DT).x.tobytes()
        }


def test_searches_on_one_record() -> None:
    swarm = pt.ParticleSwarm(particles=8, iterations=6, seed=1)

    def fit() -> bytes:
        return repr(pt.identify(LOG, "dahl", method=swarm).parameters).encode()

    assert set(at_once(fit)) == {fit()}


def test_loops_with_one_controller() -> None:
    def run() -> bytes:
        tracking = pt.track(PLAYS, LOOP, REFERENCE)
        return tracking.displacement.tobytes() + tracking.voltage.tobytes()

    assert set(at_once(run)) == {run()}


def test_sessions_of_one_controller() -> None:
    def steps() -> bytes:
        session = LOOP.start()
        return np.array([session.step(1e-8 * k, 0.9e-8 * k) for k in range(2000)]).tobytes()

    assert set(at_once(steps)) == {steps()}


def test_one_session_of_all_threads_is_never_outside_its_limits() -> None:
    session = LOOP.start()

    def steps() -> bytes:
        out = []
        for _ in range(300):
            try:
                out.append(session.step(20e-6, 10e-6))
            except (RuntimeError, pt.PiezotrackError):
                # Another thread has it at this moment, or is further on.
                continue
        return np.array(out).tobytes()

    volts = np.concatenate([np.frombuffer(one) for one in at_once(steps)])
    assert volts.size > 0
    assert ((volts >= 0.0) & (volts <= 75.0)).all()


@pytest.mark.skipif(not FREE, reason="this Python has the GIL")
def test_the_core_does_not_switch_the_gil_on() -> None:
    """A module that does not say that it runs without the GIL switches it on for everybody."""
    assert not sys._is_gil_enabled()  # type: ignore[attr-defined]
