"""Progress of a whole of several parts, as of all models that one call fits."""

from __future__ import annotations

import math
import time
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

__all__ = ["Part", "Parts", "part_at_work"]

# Share of the whole, and seconds, from which the rest of the time is told.
TOLD, EARLY = 0.02, 2.0


@dataclass
class _Whole:
    """When a whole was begun, and the share of it that was shown last."""

    begun: float = field(default_factory=time.monotonic)
    shown: float = 0.0


@dataclass(frozen=True)
class Part:
    """A part of a whole.

    Attributes
    ----------
    low, high : float
        Shares of the whole at its beginning and its end.
    """

    low: float = 0.0
    high: float = 1.0
    _whole: _Whole = field(default_factory=_Whole)

    def share(self, done: float) -> float:
        """Return the share of the whole that is done; it never falls.

        Parameters
        ----------
        done : float
            Share of the part, 0 to 1.

        Returns
        -------
        float
            0 to 1.
        """
        share = self.low + (self.high - self.low) * min(max(done, 0.0), 1.0)
        self._whole.shown = max(self._whole.shown, share)
        return self._whole.shown

    def words(self, done: float) -> str:
        """Write how much of the whole is done, and how long the rest takes at most at this pace.

        Parameters
        ----------
        done : float
            Share of the part, 0 to 1.

        Returns
        -------
        str
            As ``"40 %, up to 12 s left"``; empty where nothing is known yet.

        Examples
        --------
        >>> Part(0.5, 1.0).words(0.0)
        '50 %'
        """
        share = self.share(done)
        if share == 0.0:
            return ""
        elapsed = time.monotonic() - self._whole.begun
        percent = f"{100.0 * share:.0f} %"
        if share < TOLD or elapsed < EARLY or share >= 1.0:
            return percent
        return f"{percent}, up to {math.ceil(elapsed * (1.0 / share - 1.0))} s left"


_part: ContextVar[Part | None] = ContextVar("_part", default=None)


def part_at_work() -> Part:
    """Return the part that is at work; a whole where there is none."""
    return _part.get() or Part()


class Parts:
    """Parts of a computation, for its progress.

    Parameters
    ----------
    weights : sequence of float
        About how long each part takes, in any unit.

    Examples
    --------
    >>> parts = Parts([1.0, 3.0])
    >>> with parts.begin(1):
    ...     part_at_work().share(0.0)
    0.25
    """

    def __init__(self, weights: Sequence[float]) -> None:
        self._outer, total = part_at_work(), math.fsum(weights)
        self._ends = [math.fsum(weights[:k]) / total for k in range(len(weights) + 1)]

    @contextmanager
    def begin(self, index: int) -> Iterator[None]:
        """Count the progress of what is computed within as that of one part.

        Parameters
        ----------
        index : int
            The part.

        Yields
        ------
        None
        """
        outer = self._outer
        low, high = (
            outer.low + (outer.high - outer.low) * end for end in self._ends[index : index + 2]
        )
        token = _part.set(replace(outer, low=low, high=high))
        try:
            yield
        finally:
            _part.reset(token)
