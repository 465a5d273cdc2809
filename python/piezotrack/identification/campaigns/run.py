"""Tasks of a campaign in an executor: each result is written as it comes, whatever comes next."""

from __future__ import annotations

import os
from collections import deque
from concurrent.futures import CancelledError, Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from queue import Empty, SimpleQueue
from threading import Event
from typing import TYPE_CHECKING, Any, NamedTuple

from ..._support.display.progress_bar import ProgressBar
from ...errors import ExecutorError, Interrupted, PiezotrackError
from .task import FAILURE, Task, run_task

if TYPE_CHECKING:
    from collections.abc import Iterator

    from .folder import CampaignFolder

    Document = dict[str, Any]

__all__ = ["Planned", "compute"]

# Tasks that an executor is given ahead: so many, and more while their records are small [bytes].
AHEAD, AHEAD_BYTES = 64, 2**28
# Seconds between two looks for Ctrl-C, which not every system reports to a thread that waits.
LOOK = 0.5
# Seconds without a result after which an executor is asked whether it still takes tasks, the first
# time and at most: one that was closed may leave its tasks without an end.
PATIENCE, MOST_PATIENCE = 2.0, 60.0
# Letters of the reason that an executor gives.
REASON = 160


class Planned(NamedTuple):
    """A task with its name, and the titles that the caller gave."""

    task: Task
    name: str
    record: str
    model: str


class _Workers(NamedTuple):
    """An executor, and how a task is to run there."""

    executor: Executor
    threads: int
    # Ends the searches of this process; None where they run elsewhere.
    stop: Event | None


def compute(
    missing: list[Planned],
    executor: Executor | None,
    place: CampaignFolder,
    total: int,
    progress: bool | None,
) -> dict[str, Document]:
    """Run tasks, and write each result as it comes.

    Parameters
    ----------
    missing : list of Planned
        The tasks.
    executor : Executor or None
        Where they run; None for threads of this process.
    place : CampaignFolder
        Where the results are written.
    total : int
        Tasks of the campaign, those that are done among them.
    progress : bool or None
        Whether progress is shown.

    Returns
    -------
    dict of str to dict
        The results by the names of the tasks.

    Raises
    ------
    ExecutorError
        The executor did not return all of them.
    DataError
        A result cannot be written.
    Interrupted
        Ctrl-C.
    """
    documents: dict[str, Document] = {}
    failed = 0

    def keep(planned: Planned, document: Document) -> None:
        nonlocal failed
        document["campaign"] |= {"record": planned.record, "model": planned.model}
        place.store(document)
        documents[planned.name] = document
        failed += document["format"] == FAILURE

    def done() -> int:
        return total - len(missing) + len(documents)

    def so_far() -> str:
        return f"{done()} of {total} results are in {place.path}, run it again for the others"

    with ProgressBar(progress, "campaign") as bar, _workers(executor, len(missing)) as workers:
        run = _Run(workers, missing)
        try:
            bar.step(done(), total, f"{total} tasks")
            for planned, document in run.outcomes():
                keep(planned, document)
                more = f", {failed} without a model" if failed else ""
                bar.step(done(), total, f"{total} tasks{more}")
        except KeyboardInterrupt:
            for one, document in run.finished():
                keep(one, document)
            raise Interrupted(f"interrupted: {so_far()}") from None
        except PiezotrackError as error:
            raise type(error)(f"{error}; {so_far()}") from None
        finally:
            run.cancel()
    if run.trouble is not None:
        lost = len(missing) - len(documents)
        tasks = "1 task" if lost == 1 else f"{lost} tasks"
        raise ExecutorError(
            f"executor did not return {tasks}, {_reason(run.trouble)}: {so_far()}"
        ) from run.trouble
    return documents


@contextmanager
def _workers(executor: Executor | None, count: int) -> Iterator[_Workers]:
    """Take the executor given, or threads: as many as cores, or as tasks with several each."""
    if executor is not None:
        here = isinstance(executor, ThreadPoolExecutor)
        yield _Workers(executor, 1, Event() if here else None)
        return
    cores = os.cpu_count() or 1
    tasks = min(cores, count)
    pool = ThreadPoolExecutor(tasks, thread_name_prefix="campaign")
    try:
        yield _Workers(pool, cores // tasks, Event())
    finally:
        # What was cancelled is not waited for.
        pool.shutdown(wait=False, cancel_futures=True)


class _Run:
    """Tasks that have been given to an executor, and those that are yet to be."""

    def __init__(self, workers: _Workers, missing: list[Planned]) -> None:
        self._workers = workers
        self._waiting = deque(missing)
        self._ahead: dict[Future[Document], Planned] = {}
        # Bytes of their records.
        self._size = 0
        self._ended: SimpleQueue[Future[Document]] = SimpleQueue()
        # The first of what went wrong in the executor, not in a task.
        self.trouble: Exception | None = None

    def outcomes(self) -> Iterator[tuple[Planned, Document]]:
        """Give tasks to the executor, and return each with its result when that comes.

        What one task did to the executor is no reason to lose the others: all are tried.
        """
        silent, patience = 0.0, PATIENCE
        while self._submit():
            try:
                future = self._ended.get(timeout=LOOK)
            except Empty:
                silent += LOOK
                if silent < patience:
                    continue
                if self._is_closed():
                    return
                silent, patience = 0.0, min(2.0 * patience, MOST_PATIENCE)
                continue
            silent, patience = 0.0, PATIENCE
            try:
                document = future.result()
            except Exception as error:
                self.trouble = self.trouble or error
            else:
                yield self._ahead[future], document
            self._size -= _size(self._ahead.pop(future))

    def finished(self) -> Iterator[tuple[Planned, Document]]:
        """Return what is there already."""
        for future, one in self._ahead.items():
            if future.done() and not future.cancelled() and future.exception() is None:
                yield one, future.result()

    def cancel(self) -> None:
        """Take back what has not begun, and end what computes in this process."""
        if self._workers.stop is not None:
            self._workers.stop.set()
        for future in self._ahead:
            future.cancel()

    def _is_closed(self) -> bool:
        """Whether the executor takes no more tasks, and what it has may never come."""
        try:
            # Not cancelled: a pool of Python 3.11 that breaks just then would never end.
            self._workers.executor.submit(_nothing)
        except Exception as error:
            self.trouble = self.trouble or error
            return True
        return False

    def _submit(self) -> bool:
        """Keep the executor supplied; return whether there is anything to wait for."""
        executor, threads, stop = self._workers
        while self._waiting and (len(self._ahead) < AHEAD or self._size < AHEAD_BYTES):
            planned = self._waiting.popleft()
            arguments = () if stop is None else (stop.is_set,)
            try:
                future = executor.submit(
                    run_task, replace(planned.task, threads=threads), *arguments
                )
            except Exception as error:
                # It takes no more; what it has may still come.
                self.trouble = self.trouble or error
                self._waiting.clear()
                break
            self._size += _size(planned)
            self._ahead[future] = planned
            future.add_done_callback(self._ended.put)
        return bool(self._ahead)


def _nothing() -> None:
    """Do nothing, elsewhere."""


def _size(planned: Planned) -> int:
    """Bytes of a record: times, drive and displacement."""
    (record,) = planned.task.problem.records
    return 24 * (len(record.data) + record.data.warmup)


def _reason(error: Exception) -> str:
    """Write what an executor says, in a part of a sentence."""
    if isinstance(error, CancelledError):
        return "which were cancelled, or it was closed"
    first = str(error).strip().partition("\n")[0].partition(". ")[0].rstrip(".")
    name = type(error).__name__
    if isinstance(error, ExecutorError):
        return first
    return f"{name}: {first[:REASON]}" if first else name
