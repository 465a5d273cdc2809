"""Threads for computations that Ctrl-C stops without a wait."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["two_threads"]


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
