"""Stopping a search: callbacks, Ctrl-C, and forked processes."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from typing import Any, cast

import numpy as np
import pytest

import piezotrack as pt
from records import bits, quick, quick_fit, search_of

NAMES = ("mass", "damping", "stiffness", "piezo_coefficient", "a1", "a2", "b1", "b0", "up")


def test_the_callback_is_told_of_every_iteration_in_order() -> None:
    seen: list[pt.identification.Progress] = []
    swarm = pt.ParticleSwarm(particles=12, iterations=30)
    fit = quick_fit(callback=seen.append, swarm=swarm, runs=1)
    assert [progress.nit for progress in seen] == list(range(31))
    assert {progress.iterations for progress in seen} == {30}
    assert [progress.nfev for progress in seen] == [12 * (k + 1) for k in range(31)]
    assert [progress.cost for progress in seen] == search_of(fit).history.tolist()
    last: dict[str, Any] = dict(seen[-1].parameters)
    assert tuple(last) == NAMES
    score = pt.identification.IdentifiedModel(
        model=pt.DahlStage(**last),
        offset=0.0,
        offset_fitted=True,
        scale_assumed=False,
        stroke=quick().stroke,
    ).score(quick(), history="virgin")
    # A search steps to within 0.2 nm.
    assert score.rms == pytest.approx(seen[-1].cost, abs=2e-10)
    assert bits(fit) == bits(quick_fit(runs=1))


def test_a_true_answer_stops_with_the_best_so_far() -> None:
    seen: list[pt.identification.Progress] = []

    def enough(progress: pt.identification.Progress) -> bool:
        seen.append(progress)
        return progress.nit == 7

    with pytest.raises(KeyboardInterrupt, match=r"interrupted after \d+ simulations") as caught:
        quick_fit(callback=enough)
    assert type(caught.value) is pt.Interrupted
    partial = caught.value.partial
    assert isinstance(partial, pt.identification.Identification)
    assert len(seen) == 8
    assert partial.cost == seen[-1].cost
    assert partial.model == pt.DahlStage(**cast("dict[str, Any]", seen[-1].parameters))
    assert (search_of(partial).nit, partial.nfev) == (7, 4 * 12 * 8)
    assert (partial.success, partial.stop_reason) == (False, "interrupted")
    assert partial.message == "interrupted"
    assert search_of(partial).history.shape == (8,)
    assert partial.score(quick()).rms == pytest.approx(partial.cost, abs=2e-10)
    assert "interrupted" in partial.summary()


@pytest.mark.parametrize("error", [StopIteration, KeyboardInterrupt])
def test_stop_iteration_and_ctrl_c_in_a_callback_stop(error: type[BaseException]) -> None:
    def stop(progress: pt.identification.Progress) -> None:
        if progress.nit == 3:
            raise error

    with pytest.raises(pt.Interrupted) as caught:
        quick_fit(callback=stop)
    assert caught.value.partial.search.nit == 3


@pytest.mark.parametrize("error", [LookupError("mine"), SystemExit(3), pt.DataError("also mine")])
def test_an_exception_in_a_callback_comes_out_as_it_is(error: BaseException) -> None:
    def fail(progress: pt.identification.Progress) -> None:
        if progress.nit == 2:
            raise error

    with pytest.raises(type(error)) as caught:
        quick_fit(callback=fail)
    assert caught.value is error


def test_an_answer_without_truth_is_an_error() -> None:
    with pytest.raises(ValueError, match="truth value"):
        quick_fit(callback=lambda _: np.ones(2))


def test_a_callback_may_itself_identify() -> None:
    inner: list[float] = []

    def nested(progress: pt.identification.Progress) -> None:
        if progress.nit == 1:
            inner.append(quick_fit(seed=5).cost)

    assert bits(quick_fit(callback=nested)) == bits(quick_fit())
    assert inner == [quick_fit(seed=5).cost]


LONG_SEARCH = """
import sys, time
import numpy as np
import piezotrack as pt

seen = []
callback = seen.append if sys.argv[1] == "callback" else None
u = 37.5 - 37.5 * np.cos(np.pi * np.arange(int(sys.argv[2])) / 1e4)
log = pt.Dataset(u=u, y=1.6e-6 * u, dt=1 / 5000.0)
swarm = pt.ParticleSwarm(
    particles=int(sys.argv[3]), iterations=10**7, stall_iterations=10**7, polish=False, seed=1
)
print("searching", flush=True)
try:
    pt.identify(
        log, "dahl", history="virgin", method=swarm, callback=callback
    )
except KeyboardInterrupt as stopped:
    ended = time.monotonic()
    partial = stopped.partial
    nit = None if partial is None else partial.search.nit
    cost = None if partial is None else partial.cost
    if callback is not None:
        # Ctrl-C may come on the way to the callback, and then the best is newer by one.
        told = seen[-1].nit if seen else -1
        assert nit - told in (0, 1), (nit, told)
        assert nit > told or cost == seen[-1].cost, (cost, seen[-1].cost)
    print(type(stopped).__name__, ended, nit, cost)
"""


@pytest.mark.skipif(os.name == "nt", reason="Windows sends Ctrl-C in another way")
@pytest.mark.parametrize(
    ("watched", "samples", "particles"),
    [
        pytest.param("alone", 20_001, 100, id="alone"),
        pytest.param("callback", 20_001, 100, id="callback", marks=pytest.mark.slow),
        pytest.param(
            "alone", 1_000_001, 50_000, id="before the first cost", marks=pytest.mark.slow
        ),
    ],
)
def test_ctrl_c_stops_at_once_and_keeps_the_best(
    watched: str, samples: int, particles: int
) -> None:
    command = [sys.executable, "-c", LONG_SEARCH, watched, str(samples), str(particles)]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "searching\n"
            # The first cost takes a second on a busy machine.
            time.sleep(3.0)
            sent = time.monotonic()
            process.send_signal(signal.SIGINT)
            output, errors = process.communicate(timeout=30.0)
        finally:
            process.kill()
    assert errors == ""
    name, ended, nit, cost = output.split()
    assert name == "Interrupted"
    # Half a second is meant; a busy machine may take longer.
    assert float(ended) - sent < 2.0
    if samples > 20_001:
        assert nit == cost == "None"
    else:
        assert int(nit) > 0
        assert 0.0 <= float(cost) < 5e-6


FORKED_SEARCH = """
import os, warnings
import numpy as np
import piezotrack as pt

t = np.arange(1001) / 250.0
u = 37.5 - 37.5 * np.cos(0.5 * np.pi * t)
y = pt.DahlStage.xu_li_2010().simulate(u, 1 / 250.0).x
log = pt.Dataset(u=u, y=y, dt=1 / 250.0)

def search():
    swarm = pt.ParticleSwarm(particles=12, iterations=20, seed=1)
    return pt.identify(log, "dahl", method=swarm, threads=3).cost.hex()

before = search()
reading, writing = os.pipe()
with warnings.catch_warnings():
    # From Python 3.12 on a fork beside threads, as NumPy has them, is a warning.
    warnings.simplefilter("ignore", DeprecationWarning)
    child = os.fork()
if child == 0:
    os.write(writing, search().encode())
    os._exit(0)
os.close(writing)
inherited = b"".join(iter(lambda: os.read(reading, 99), b"")).decode()
assert os.waitpid(child, 0)[1] == 0
print(before == inherited == search())
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork here")
def test_a_forked_process_can_search_too() -> None:
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", FORKED_SEARCH],
        capture_output=True,
        text=True,
        timeout=60.0,
        check=False,
    )
    assert (done.stdout, done.stderr, done.returncode) == ("True\n", "", 0)
