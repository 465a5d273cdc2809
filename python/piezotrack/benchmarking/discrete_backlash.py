"""The discrete backlash operator of Aye and Ang 2018, the method of the measured log's authors.

Y. N. Aye and W. T. Ang, "A Discrete Backlash Operator for Identification and Compensation of
Hysteresis and Non-linearity for Piezoelectric Micromanipulator", ICSTSD 2018. Their paper is not
available as text, so the equations here are those of the programs that they publish with the data
(github.com/yan9a/DiscreteBacklashOperator, MIT licence), written anew. From the same cycle the
corners agree with the numbers that they publish to six digits.

One cycle of the drive is turned by 45 degrees; the mean of its two branches is a curve without
hysteresis, and what the rising branch differs from it is the backlash, both in 25 straight
pieces. The model is the backlash and then the curve; with the axes of both exchanged and in the
other order it is the inverse.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..errors import DataError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = ["DiscreteBacklash", "Pieces", "identify_backlash", "last_cycle"]

# Pieces of each curve, and the share of the last one's height within which it is taken whole.
PIECES, SNAP = 25, 0.1


class Pieces(NamedTuple):
    """Straight pieces of a curve from the origin.

    Attributes
    ----------
    dx, dy : ndarray, shape (n,)
        Length and height of each.
    """

    dx: Array
    dy: Array

    def exchanged(self) -> Pieces:
        """Return the pieces of the inverse curve."""
        return Pieces(self.dy, self.dx)


@dataclass(frozen=True, kw_only=True, eq=False)
class DiscreteBacklash:
    """Backlash and a curve in pieces.

    Attributes
    ----------
    backlash, curve : Pieces
        Of the drive [V] after `slope`.
    slope : float
        Height of the loop over its width [m/V].
    level, low : float
        Lowest displacement [m] and lowest drive [V] of the cycle.
    """

    backlash: Pieces
    curve: Pieces
    slope: float
    level: float
    low: float

    @property
    def values(self) -> int:
        """Number of values: free corners of three curves, and what scales them."""
        return 3 * (self.curve.dx.size - 1) + 3

    def simulate(self, u: Array) -> Array:
        """Displacement under a drive.

        Parameters
        ----------
        u : ndarray, shape (n,)
            Drive [V].

        Returns
        -------
        ndarray, shape (n,)
            Displacement [m].
        """
        return self.level + self.slope * _along(self.curve, _backlash(self.backlash, u - self.low))

    def inverse(self, y: Array) -> Array:
        """Drive for a displacement.

        Parameters
        ----------
        y : ndarray, shape (n,)
            Displacement [m].

        Returns
        -------
        ndarray, shape (n,)
            Drive [V].
        """
        bent = _along(self.curve.exchanged(), (y - self.level) / self.slope)
        return self.low + _backlash(self.backlash.exchanged(), bent)


def identify_backlash(u: Array, y: Array) -> DiscreteBacklash:
    """Find backlash and curve from one cycle that begins at its lowest drive.

    Parameters
    ----------
    u, y : ndarray, shape (n,)
        Drive [V] and displacement [m]; the first half rises, the second falls.

    Returns
    -------
    DiscreteBacklash
        The model.

    Raises
    ------
    DataError
        The loop is not one of 25 pieces that rise.
    """
    low, level = float(u.min()), float(y.min())
    reach = float(np.ptp(u))
    slope = float(np.ptp(y)) / reach
    x, z = u - low, (y - level) / slope
    half = x.size // 2
    up, down = slice(0, half), slice(half, None)
    # Corners that are even in the displacement, and so closer together where the loop is steep.
    even = np.linspace(0.0, reach, PIECES + 1)
    along = np.sqrt(2.0) * _corners(even, (z[up], x[up]), (0.0, reach))
    across, beside = (x + z) / np.sqrt(2.0), (z - x) / np.sqrt(2.0)
    rising = _corners(along, (across[up], beside[up]), (0.0, 0.0))
    turned = along[-1] - along[::-1]
    falling = _corners(turned, (across[down], beside[down]), (0.0, 0.0))
    mean = 0.5 * (rising + falling[::-1])
    backlash, curve = _pieces(along, rising - mean), _pieces(along, mean)
    # Shorter ones would be passed to and fro within what is snapped.
    least = min(float(part.min()) for part in backlash)
    if not least > 2.0 * SNAP * max(backlash.dx[-1], backlash.dy[-1]) or not all(
        np.all(part > 0.0) for part in curve
    ):
        raise DataError(
            f"the loop does not have {PIECES} pieces that rise: expected a slow drive, and a "
            "displacement that rises and falls with it"
        )
    return DiscreteBacklash(
        backlash=backlash,
        curve=curve,
        slope=slope,
        level=level,
        low=low,
    )


def last_cycle(u: Array, y: Array) -> tuple[Array, Array]:
    """Cut the last whole cycle of a slow periodic drive, from its lowest sample on.

    Parameters
    ----------
    u, y : ndarray, shape (n,)
        Drive [V] and displacement [m].

    Returns
    -------
    u, y : ndarray, shape (m,)
        One cycle.

    Raises
    ------
    DataError
        The drive does not repeat with two branches of 50 samples or more.
    """
    middle = 0.5 * (float(u.min()) + float(u.max()))
    up = np.flatnonzero((u[:-1] < middle) & (u[1:] >= middle))
    count = int(up[-1] - up[-2]) if up.size > 3 else 0
    repeats = count >= 100 and all(abs(int(gap) - count) <= 1 for gap in np.diff(up))
    if not repeats:
        raise DataError(
            "the drive does not repeat: expected cycles of one length, 100 samples or more"
        )
    first = int(up[-2]) - count // 2
    first += int(np.argmin(u[first : first + count]))
    first -= count if first + count > u.size else 0
    cycle, halves = u[first : first + count], count // 2
    steady = np.ptp(cycle) > 0.98 * np.ptp(u)
    if not (steady and np.all(np.diff(cycle[:halves]) >= 0.0)):
        raise DataError(
            "the drive's last cycle is not a rise and a fall over its whole range: expected both"
        )
    return cycle, y[first : first + count]


def _corners(at: Array, points: tuple[Array, Array], ends: tuple[float, float]) -> Array:
    """Heights of a broken line with given ends that is nearest to points, by least squares."""
    x, y = points
    piece = np.clip(np.searchsorted(at, x, side="left"), 1, at.size - 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.nan_to_num((x - at[piece - 1]) / (at[piece] - at[piece - 1]))
    hats = np.zeros((x.size, at.size))
    rows = np.arange(x.size)
    hats[rows, piece - 1], hats[rows, piece] = 1.0 - share, share
    rest = y - hats[:, 0] * ends[0] - hats[:, -1] * ends[1]
    inner = np.linalg.lstsq(hats[:, 1:-1], rest, rcond=None)[0]
    return np.concatenate([[ends[0]], inner, [ends[1]]])


def _pieces(along: Array, across: Array) -> Pieces:
    """Turn a curve back by 45 degrees, as pieces."""
    return Pieces(
        np.diff(along - across) / np.sqrt(2.0),
        np.diff(along + across) / np.sqrt(2.0),
    )


def _along(curve: Pieces, x: Array) -> Array:
    """Follow a curve without memory; beyond its ends it is level."""
    at, height = (np.concatenate([[0.0], np.cumsum(part)]) for part in curve)
    return np.asarray(np.interp(x, at, height), dtype=np.float64)


def _backlash(pieces: Pieces, x: Array) -> Array:
    """Follow the backlash: pieces are passed from the first on, upwards and downwards alike.

    `passed` tells which of the pieces lie below the present corner. A rise takes the first that
    does not, a fall the first that does.
    """
    dx, dy = pieces.dx.tolist(), pieces.dy.tolist()
    count, snap = len(dx), SNAP * dy[-1]
    passed = [False] * count
    at_x = at_y = 0.0
    y = np.empty(x.size)
    for k, wanted in enumerate(x.tolist()):
        while True:
            rising = wanted >= at_x
            next_one = next((i for i in range(count) if passed[i] is not rising), None)
            if next_one is None:
                y[k] = at_y
                break
            sign = 1.0 if rising else -1.0
            if sign * (wanted - at_x) < dx[next_one] - snap:
                y[k] = at_y + dy[next_one] / dx[next_one] * (wanted - at_x)
                break
            passed[next_one] = rising
            at_x += sign * dx[next_one]
            at_y += sign * dy[next_one]
    return y
