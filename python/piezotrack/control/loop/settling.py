"""Settling of moves from one level of a reference to the next."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = ["Settling", "settled_moves"]

# Samples for which a level is held, at least, and share of the longest hold: the parts of a shaped
# move are shorter.
HELD, SHARE = 4, 0.2


class Settling(NamedTuple):
    """One move, and when it has settled.

    Attributes
    ----------
    start : float
        When the move begins [s].
    low, high : float
        Level before and after it [m].
    time : float
        Time from `start` until the displacement stays within the band [s]; infinite where it does
        not before the next move.
    travel : float
        Time from `start` until the reference is at the level [s].
    overshoot : float
        Largest displacement beyond the level while it is held, as a share of the move; 0 for none.
    """

    start: float
    low: float
    high: float
    time: float
    travel: float
    overshoot: float


def settled_moves(t: Array, desired: Array, actual: Array, band: float) -> list[Settling]:
    """Find the moves of a reference, and when the displacement has settled after each.

    Parameters
    ----------
    t, desired, actual : ndarray, shape (n,)
        Times [s], reference and displacement [m].
    band : float
        Share of a move.

    Returns
    -------
    list of Settling
        One for each level that is held for `HELD` samples and `SHARE` of the longest hold, but the
        first.

    Examples
    --------
    >>> t = np.arange(100) / 1000.0
    >>> desired = np.where(t < 0.02, 0.0, 1e-6)
    >>> actual = np.where(t < 0.02, 0.0, 1e-6 * (1.0 - np.exp(-(t - 0.02) / 0.005)))
    >>> round(settled_moves(t, desired, actual, 0.02)[0].time, 3)
    0.021
    """
    same = np.abs(np.diff(desired)) <= 1e-9 * max(float(np.ptp(desired)), 1e-30)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], same.astype(np.int8), [0]])))
    holds = [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    longest = max((b - a for a, b in holds), default=0)
    holds = [(a, b) for a, b in holds if b - a >= max(HELD, SHARE * longest)]
    moves = []
    for (_, begin), (first, last) in pairwise(holds):
        low, high = float(desired[begin]), float(desired[first])
        outside = np.flatnonzero(np.abs(actual[begin : last + 1] - high) > band * abs(high - low))
        settled = begin + 1 + int(outside[-1]) if outside.size else begin
        time = math.inf if settled > last else float(t[settled] - t[begin])
        beyond = (actual[begin : last + 1] - high) / (high - low)
        moves.append(
            Settling(
                start=float(t[begin]),
                low=low,
                high=high,
                time=time,
                travel=float(t[first] - t[begin]),
                overshoot=max(0.0, float(beyond.max())),
            )
        )
    return moves
