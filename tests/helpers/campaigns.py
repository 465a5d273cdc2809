"""Small campaigns, and executors that count, fail or lose a process at a known moment."""

from __future__ import annotations

import os
import signal
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from functools import cache
from threading import Event, Thread
from typing import TYPE_CHECKING, Any

import numpy as np

import piezotrack as pt

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

PLAYS = "prandtl-ishlinskii"
# A tenth of a second or so.
QUICK: dict[str, Any] = {
    "model": "dahl",
    "history": "virgin",
    "method": pt.ParticleSwarm(particles=16, iterations=20, polish=False, runs=1),
}
# Long enough for a worker to be killed in the middle.
LONGER: dict[str, Any] = {
    **QUICK,
    "method": pt.ParticleSwarm(
        particles=64,
        iterations=5000,
        stall_iterations=5000,
        min_improvement=0.0,
        polish=False,
        runs=1,
    ),
}


@cache
def log(factor: float = 1.0, samples: int = 600) -> pt.Dataset:
    """A stage with a stroke of its own."""
    u = 37.5 * (1.0 - np.cos(np.arange(samples) / 50.0))
    y = factor * pt.DahlStage.xu_li_2010().simulate(u, 0.01).x
    return pt.Dataset(u=u, y=y, dt=0.01, source=f"stage {factor:g}.csv")


def flat() -> pt.Dataset:
    """A record of which nothing can be identified."""
    return pt.Dataset(u=np.ones(100), y=np.arange(100) * 1e-9, dt=0.01, source="flat.csv")


class Serial(Executor):
    """Runs each task at once, in this thread, and counts; it may die, or be interrupted."""

    def __init__(self, dies_after: int | None = None, error: BaseException | None = None) -> None:
        self.tasks: list[Any] = []
        self._most = dies_after
        self._error = error

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        if self._most is not None and len(self.tasks) >= self._most:
            assert self._error is not None
            raise self._error
        self.tasks.append(args[0])
        future: Future[Any] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


@contextmanager
def after_some(folder: Path, count: int, then: Callable[[], object]) -> Iterator[None]:
    """Call `then` once when a campaign under way has so many results."""
    ended = Event()

    def watch() -> None:
        while not ended.wait(0.01):
            if len(list(folder.glob("?" * 32 + ".json"))) >= count:
                then()
                return

    watcher = Thread(target=watch)
    watcher.start()
    try:
        yield
    finally:
        ended.set()
        watcher.join()


def kill(process: int) -> None:
    os.kill(process, getattr(signal, "SIGKILL", signal.SIGTERM))


def contents(folder: Path) -> dict[str, bytes]:
    """The files of a folder."""
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def results(folder: Path) -> dict[str, bytes]:
    """The files of tasks."""
    return {name: text for name, text in contents(folder).items() if name != "campaign.json"}
