"""Samples of long signals that are enough for a picture."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Indices = NDArray[np.intp]

__all__ = ["extremes", "path_cells"]


def extremes(values: Array, points: int) -> Indices:
    """Choose samples of a signal over time: the extrema of each part, so that a glitch stays.

    Parameters
    ----------
    values : ndarray, shape (n,)
        The signal.
    points : int
        About how many to choose; all where there are fewer than one and a half times as many.

    Returns
    -------
    ndarray of int
        Samples, increasing; the first and the last are among them.

    Examples
    --------
    >>> values = np.zeros(100_000)
    >>> values[31_416] = 1.0
    >>> kept = extremes(values, 1000)
    >>> kept.size < 1100, 31_416 in kept
    (True, True)
    """
    stretch = max(1, values.size // max(points // 2, 1))
    if stretch < 3:
        return np.arange(values.size)
    whole = values.size // stretch * stretch
    rows = values[:whole].reshape(-1, stretch)
    first = np.arange(0, whole, stretch)
    found = np.stack([first + rows.argmin(axis=1), first + rows.argmax(axis=1)])
    ends = [0, values.size - 1]
    tail = np.arange(whole, values.size)
    return np.unique(np.concatenate([found.ravel(), tail, ends]))


def path_cells(x: Array, y: Array, columns: int, rows: int) -> Indices:
    """Choose samples of a path in the plane: each way from one cell of a grid to the next once.

    A loop that is run through a thousand times is drawn as once, to the width of a cell.

    Parameters
    ----------
    x, y : ndarray, shape (n,)
        The path; a sample that is not finite interrupts it.
    columns, rows : int
        Cells of the grid, as pixels of a picture.

    Returns
    -------
    ndarray of int
        Samples, with -1 where the line is interrupted.

    Examples
    --------
    >>> angle = np.linspace(0.0, 2000.0 * np.pi, 1_000_000)
    >>> kept = path_cells(np.cos(angle), np.sin(angle), 300, 300)
    >>> kept.size < 20_000
    True
    """
    known = np.flatnonzero(np.isfinite(x) & np.isfinite(y))
    if not known.size:
        return known
    cell = _cells(x[known], columns) * rows + _cells(y[known], rows)
    moves = np.flatnonzero(np.diff(cell)) + 1
    kept = np.concatenate([[0], moves])
    # A way is known by the cells at its ends.
    way = cell[kept[:-1]] * (columns * rows) + cell[kept[1:]]
    _, first = np.unique(way, return_index=True)
    new = np.zeros(kept.size, dtype=np.bool_)
    new[first + 1] = True
    new[0] = True
    # The sample before each new way is needed as its beginning.
    drawn = new.copy()
    drawn[:-1] |= new[1:]
    chosen = np.flatnonzero(drawn)
    ends = known[kept[chosen]]
    broken = np.flatnonzero(np.diff(chosen) > 1) + 1
    gaps = np.flatnonzero(_gaps(known, kept[chosen])) + 1
    found: Indices = np.insert(ends, np.union1d(broken, gaps), -1)
    return found


def _cells(values: Array, count: int) -> Indices:
    low, high = float(values.min()), float(values.max())
    if high <= low:
        return np.zeros(values.size, dtype=np.intp)
    return np.minimum(((values - low) * (count / (high - low))).astype(np.intp), count - 1)


def _gaps(known: Indices, chosen: Indices) -> NDArray[np.bool_]:
    """Whether samples that are not finite lie between neighbours of those chosen."""
    missing = known - np.arange(known.size)
    return np.diff(missing[chosen]) > 0
