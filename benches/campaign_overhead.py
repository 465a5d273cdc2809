"""Cost of a task of a campaign beyond the identification itself: threads, processes, Dask.

Run as ``python benches/campaign_overhead.py`` with the environment of ``make demo`` and
``pip install "dask[distributed]"``. One worker each, so that what is beyond the identification is
not hidden behind that of another worker.
"""

from __future__ import annotations

import multiprocessing
import os
import statistics
import tempfile
import time
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

import piezotrack as pt

if TYPE_CHECKING:
    from collections.abc import Iterator

TASKS, ROUNDS = 40, 5
SAMPLES = (1_000, 100_000)
# The shortest search that there is: two candidates, twice.
QUICK = {
    "model": "dahl",
    "history": "virgin",
    "method": pt.ParticleSwarm(particles=2, iterations=1, polish=False, runs=1),
}


def record(samples: int) -> pt.Dataset:
    """A log of two cycles."""
    u = 37.5 * (1.0 - np.cos(np.linspace(0.0, 4.0 * np.pi, samples)))
    return pt.Dataset(u=u, y=pt.DahlStage.xu_li_2010().simulate(u, 1e-3).x, dt=1e-3)


@contextmanager
def threads() -> Iterator[Executor]:
    with ThreadPoolExecutor(1) as pool:
        yield pool


@contextmanager
def processes() -> Iterator[Executor]:
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        yield pool


@contextmanager
def dask() -> Iterator[Executor]:
    from distributed import Client, LocalCluster

    with (
        LocalCluster(
            n_workers=1, threads_per_worker=1, processes=True, dashboard_address=None
        ) as cluster,
        Client(cluster) as client,
    ):
        yield client.get_executor()


def alone(data: pt.Dataset) -> float:
    """Time of one identification by hand [s]."""
    began = time.perf_counter()
    for seed in range(TASKS):
        # As a task does: the notes go into its file.
        seeded = QUICK | {"method": replace(QUICK["method"], seed=seed)}
        _ = pt.identify(data, threads=1, **seeded).notes
    return (time.perf_counter() - began) / TASKS


def campaign(data: pt.Dataset, executor: Executor) -> float:
    """Time of one task [s]."""
    with tempfile.TemporaryDirectory() as folder:
        began = time.perf_counter()
        pt.campaign([data], {"quick": QUICK}, range(TASKS), executor, folder=folder, progress=False)
        return (time.perf_counter() - began) / TASKS


def main() -> None:
    print(
        f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}; {TASKS} tasks, median of {ROUNDS}"
    )
    print(f"{'':12}{'samples':>9}{'alone ms':>10}{'task ms':>10}{'beyond ms':>11}{'first s':>9}")
    for place in (threads, processes, dask):
        began = time.perf_counter()
        with place() as executor:
            # Workers start, and import what they need.
            campaign(record(1_000), executor)
            start = time.perf_counter() - began
            for samples in SAMPLES:
                data = record(samples)
                rounds = [(alone(data), campaign(data, executor)) for _ in range(ROUNDS)]
                own = statistics.median(by_hand for by_hand, _ in rounds)
                whole = statistics.median(task for _, task in rounds)
                beyond = statistics.median(task - by_hand for by_hand, task in rounds)
                print(
                    f"{place.__name__:12}{samples:>9}{1e3 * own:>10.2f}{1e3 * whole:>10.2f}"
                    f"{1e3 * beyond:>11.2f}{start:>9.1f}"
                )


if __name__ == "__main__":
    main()
