"""Threads for computations that Ctrl-C stops without a wait."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import contextmanager
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator
    from concurrent.futures import Future

__all__ = ["one_by_one", "two_threads", "waited_for"]

T = TypeVar("T")
R = TypeVar("R")

# Ctrl-C that comes just before a wait begins does not end it: no wait is longer than this [s].
LONGEST = 0.2


@contextmanager
def two_threads() -> Iterator[ThreadPoolExecutor]:
    """Compute in two threads; the core releases the GIL, so threads suffice.

    Yields
    ------
    ThreadPoolExecutor
        After an exception what has begun is not waited for, and nothing else begins.
    """
    pool = ThreadPoolExecutor(max_workers=2)
    try:
        yield pool
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        raise
    pool.shutdown()


def one_by_one(
    pool: ThreadPoolExecutor, function: Callable[[T], R], values: Iterable[T]
) -> Iterator[R]:
    """Compute a function of each value in a pool.

    Parameters
    ----------
    pool : ThreadPoolExecutor
        Where it is computed.
    function : callable
        Of one value.
    values : iterable
        All of them are given to the pool at once.

    Yields
    ------
    object
        The results, in the order of the values.
    """
    for future in [pool.submit(function, value) for value in values]:
        yield waited_for(future)


def waited_for(future: Future[R]) -> R:
    """Wait for a result, or for Ctrl-C.

    Parameters
    ----------
    future : Future
        What is computed in a pool.

    Returns
    -------
    object
        Its result.
    """
    while not future.done():
        wait([future], timeout=LONGEST)
    return future.result()
