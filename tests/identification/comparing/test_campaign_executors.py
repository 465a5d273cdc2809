"""Campaigns on processes and on a cluster of dask.distributed: a worker is killed in the middle."""

from __future__ import annotations

import multiprocessing
import os
from concurrent.futures import ProcessPoolExecutor
from threading import Thread
from typing import TYPE_CHECKING, Any

import pytest

import piezotrack as pt
from campaigns import LONGER, Serial, after_some, kill, log, results
from commands import ran
from piezotrack.data.log_file import write_log

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

MODELS = {"dahl": LONGER}
SEEDS = range(5)
PICTURE = ("campaign.png", "campaign.svg")


def records() -> list[pt.Dataset]:
    # Small: before Python 3.11.5 a pool whose process is killed never ends where waiting tasks fill
    # a pipe of 64 kB (cpython issue 94777).
    return [log(1.0, 400), log(0.9, 400)]


@pytest.fixture(scope="module")
def serial(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """The files of the same campaign in one thread."""
    folder = tmp_path_factory.mktemp("serial")
    pt.campaign(records(), MODELS, SEEDS, Serial(), folder=folder)
    return results(folder)


def missing(folder: Path, seeds: range = SEEDS) -> int:
    """Finish a campaign, and return how many tasks that took."""
    counting = Serial()
    assert len(pt.campaign(records(), MODELS, seeds, counting, folder=folder)) == 2 * len(seeds)
    return len(counting.tasks)


# Processes.


@pytest.mark.slow
def test_a_process_that_is_killed_loses_no_result(tmp_path: Path, serial: dict[str, bytes]) -> None:
    # Not forked: there are threads in this process.
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn")) as pool:
        with (
            pytest.raises(pt.ExecutorError, match=r"did not return .* BrokenProcessPool: A proc"),
            after_some(tmp_path, 3, lambda: kill(next(iter(pool._processes)))),
        ):
            pt.campaign(records(), MODELS, SEEDS, pool, folder=tmp_path)
        kept = results(tmp_path)
        assert 3 <= len(kept) < len(serial)
        assert kept.items() <= serial.items()
        # A pool that has died takes nothing.
        with pytest.raises(pt.ExecutorError, match="BrokenProcessPool"):
            pt.campaign(records(), MODELS, SEEDS, pool, folder=tmp_path)
    assert missing(tmp_path) == len(serial) - len(kept)
    assert results(tmp_path) == serial


# A cluster.


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    """Four worker processes on this computer, and a scheduler."""
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=4,
        threads_per_worker=1,
        processes=True,
        host="127.0.0.1",
        dashboard_address=None,
        worker_dashboard_address=None,
        silence_logs=50,
    ) as cluster:
        yield cluster


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_dask_worker_that_is_killed_changes_no_bit(
    tmp_path: Path, serial: dict[str, bytes], cluster: Any
) -> None:
    import distributed

    with distributed.Client(cluster, timeout="60s") as client:  # type: ignore[no-untyped-call]
        client.wait_for_workers(4, timeout=60)
        processes = client.run(os.getpid)
        assert len({os.getpid(), *processes.values()}) == 5
        ended: list[int] = []

        def kill_a_busy_worker() -> None:
            busy = [processes[name] for name, tasks in client.processing().items() if tasks]
            ended.append(busy[0])
            kill(busy[0])

        with after_some(tmp_path, 3, kill_a_busy_worker):
            campaign = pt.campaign(records(), MODELS, SEEDS, client.get_executor(), folder=tmp_path)
        # It was at work, and has gone; what it had was computed elsewhere.
        assert ended
        assert ended[0] not in client.run(os.getpid).values()
        assert len(campaign) == len(serial)
        assert campaign.failed == ()
    assert results(tmp_path) == serial
    assert missing(tmp_path) == 0


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_the_command_takes_the_address_of_a_scheduler(
    tmp_path: Path, cluster: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    logs = [str(write_log(one, tmp_path / one.source)) for one in (log(), log(0.9)) if one.source]
    kind = ("--model", "prandtl-ishlinskii")
    address = cluster.scheduler_address.removeprefix("tcp://")
    ran("campaign", *logs, *kind, "--dask", address, "--out", "there")
    ran("campaign", *logs, *kind, "--threads", "1", "--out", "here")
    assert len(results(tmp_path / "here")) == 2 + len(PICTURE)
    assert results(tmp_path / "there") == results(tmp_path / "here")


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_dask_client_that_is_closed_loses_no_result(
    tmp_path: Path, serial: dict[str, bytes], cluster: Any
) -> None:
    import distributed

    client: Any = distributed.Client(cluster, timeout="60s")  # type: ignore[no-untyped-call]
    closing = Thread(target=client.close)
    with (
        pytest.raises(pt.ExecutorError, match=r"executor did not return .* run it again for the"),
        after_some(tmp_path, 2, closing.start),
    ):
        pt.campaign(records(), MODELS, SEEDS, client.get_executor(), folder=tmp_path)
    closing.join()
    kept = results(tmp_path)
    assert 2 <= len(kept) < len(serial)
    assert missing(tmp_path) == len(serial) - len(kept)
    assert results(tmp_path) == serial
