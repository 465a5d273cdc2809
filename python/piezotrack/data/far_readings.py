"""Single readings of a displacement that are far off, as glitches of a sensor leave them.

A reading is compared with the cubic through two readings on either side of it (Hampel's test on
a local fit). What differs by far more than the noise, the roughness of the readings around, the
motion from sample to sample and what the drive does at that instant is no motion of the stage:
quick motion is rough around each of its samples, and a glitch is not.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from .._support.units import length_text

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Mask = NDArray[np.bool_]

__all__ = ["are_few", "bridged", "far_notes", "far_readings"]

# Largest share of the readings that are single ones far off: more are something else.
MOST = 0.01
# Least distance from the local fit: in standard deviations of it, in the roughness of the readings
# around, in the motion from sample to sample there, in what the drive does there as the mean gain
# makes it, and in steps of a quantised reading.
NOISES, ROUGH, SLOPES, DRIVEN, STEPS = 10.0, 4.0, 1.5, 3.0, 4.0
# Readings on either side of which the roughness is taken, nearest first; the few roughest are left
# out, of another glitch.
NEAR, AROUND, OTHERS = 3, 10, 6
# Samples after a change of the drive in which it may show.
REACH = 3
# Departure from the shape of a single reading, in the readings that are fitted with it.
SHAPE = 0.2
# Readings beside each other that may be off together.
LONGEST = 2
FEWEST = 40
# Share of the largest drive that is rounding.
ROUNDING = 1e-12
# Readings of which a note has the times.
LISTED = 8


def far_readings(u: Array, y: Array) -> Mask:
    """Find the readings that are far off, alone or two beside each other.

    Parameters
    ----------
    u : ndarray, shape (n,)
        Drive [V].
    y : ndarray, shape (n,)
        Displacement [m].

    Returns
    -------
    ndarray of bool, shape (n,)
        Where they are. The first and the last readings, which have no neighbours on one side, are
        never among them.

    Examples
    --------
    >>> import numpy as np
    >>> u = np.sin(np.arange(400) / 30.0)
    >>> y = 1e-6 * u
    >>> y[[100, 301]] += 5e-6
    >>> np.flatnonzero(far_readings(u, y)).tolist()
    [100, 301]
    """
    far = np.zeros(y.size, dtype=np.bool_)
    if y.size < FEWEST:
        return far
    left = y
    # A large reading hides a smaller one beside it.
    for _ in range(4):
        more = _far_once(u, left)
        if not more.any():
            break
        far |= more
        left = bridged(y, far)
    return far


def bridged(values: Array, missing: Mask) -> Array:
    """Put straight lines where values are missing.

    Parameters
    ----------
    values : ndarray, shape (n,)
        The values.
    missing : ndarray of bool, shape (n,)
        Which to replace; at the ends by the nearest that is not.

    Returns
    -------
    ndarray, shape (n,)
        A copy.
    """
    filled = values.copy()
    known = np.flatnonzero(~missing)
    filled[missing] = np.interp(np.flatnonzero(missing), known, values[known])
    return filled


def far_notes(t: Array, y: Array, far: Mask) -> list[str]:
    """Say which single readings are far off.

    Parameters
    ----------
    t, y : ndarray, shape (n,)
        Times [s] and displacement as it was read [m].
    far : ndarray of bool, shape (n,)
        Those that are far off.

    Returns
    -------
    list of str
        One sentence, or none.

    Examples
    --------
    >>> import numpy as np
    >>> t, u = np.arange(4000) / 1000.0, np.sin(np.arange(4000) / 300.0)
    >>> y = 20e-6 * u
    >>> y[1500] += 30e-6
    >>> far_notes(t, y, far_readings(u, y))
    ['1 reading is left out as a single reading far off, by up to 30 um: at 1.5 s']
    """
    count = int(far.sum())
    if not count:
        return []
    if not are_few(far):
        return [
            f"{count} readings, {100.0 * count / far.size:.2g} % of all, are far off those beside "
            f"them: single ones are left out up to {100.0 * MOST:g} %, so none of these is; is the "
            "sensor at fault?"
        ]
    places = np.flatnonzero(far)
    apart = length_text(float(np.abs(y - bridged(y, far))[places].max()))
    times = ", ".join(f"{t[k]:.6g}" for k in places[:LISTED])
    more = f" and {count - LISTED} more" if count > LISTED else ""
    which = "1 reading is left out as a single reading"
    if count > 1:
        which = f"{count} readings are left out as single readings"
    return [f"{which} far off, by up to {apart}: at {times} s{more}"]


def are_few(far: Mask) -> bool:
    """Return whether readings that are far off are so few that they are single ones."""
    return int(far.sum()) <= max(1.0, MOST * far.size)


def _far_once(u: Array, y: Array) -> Mask:
    far = np.zeros(y.size, dtype=np.bool_)
    moves = np.abs(np.diff(y))
    seen = moves[moves > 0.0]
    if not seen.size:
        return far
    size = np.abs(_departures(y, 1))
    noise = max(1.4826 * float(np.median(size)), float(np.quantile(size, 0.9)) / 1.645)
    least = max(NOISES * noise, STEPS * float(seen.min()))
    driven = np.pad(DRIVEN * _driven(u, y, size), (REACH, LONGEST))
    for length in range(1, LONGEST + 1):
        away = size if length == 1 else np.abs(_departures(y, length))
        by_drive = sliding_window_view(driven, REACH + LONGEST + 1).max(axis=1)
        for k in np.flatnonzero(away > np.maximum(least, by_drive)).tolist():
            if _is_alone(y, size, moves, k, length, float(away[k])):
                far[k : k + length] = True
    return far


def _driven(u: Array, y: Array, size: Array) -> Array:
    """Departures of the drive, as large as the gain makes them in the displacement."""
    of_drive = np.abs(_departures(u, 1))
    most = float(of_drive.max())
    # What is left of a constant drive is rounding.
    if most <= ROUNDING * float(np.abs(u).max()):
        return np.zeros(u.size)
    quick = of_drive >= 0.5 * most
    low, high = np.quantile(y, (0.05, 0.95))
    gain = max(
        float(high - low) / float(np.ptp(u)), float(np.median(size[quick] / of_drive[quick]))
    )
    return gain * of_drive


def _is_alone(y: Array, size: Array, moves: Array, k: int, length: int, away: float) -> bool:
    """Whether readings from `k` on depart from all around them."""
    first, end = max(k - AROUND, 0), k + length
    # The departures that a reading far off is no part of.
    around = np.r_[size[first : max(k - NEAR + 1, 0)], size[end + NEAR - 1 : end + AROUND]]
    if around.size > OTHERS and away < ROUGH * float(np.sort(around)[-OTHERS]):
        return False
    near = np.r_[moves[max(k - NEAR - 1, 0) : k - 1], moves[end : end + NEAR]]
    if away < SLOPES * float(near.max()):
        return False
    first = max(k - NEAR - 2, 0)
    part, at = y[first : end + NEAR + 2].copy(), k - first
    part[at : at + length] = _cubic(
        part[at - 2], part[at - 1], part[at + length], part[at + length + 1], length
    )
    return float(np.abs(_departures(part, 1)).max()) < SHAPE * away


def _departures(y: Array, length: int) -> Array:
    """Return how far so many samples from each one on are off the cubic through two on either side.

    Of several the least; 0 where they are off to different sides, and at the ends.
    """
    departures = np.zeros(y.size)
    inner = y.size - length - 3
    before = y[:inner], y[1 : 1 + inner]
    after = y[2 + length : 2 + length + inner], y[3 + length : 3 + length + inner]
    parts = _cubic(before[0], before[1], after[0], after[1], length)
    apart = [y[2 + i : 2 + i + inner] - part for i, part in enumerate(parts)]
    same = np.sign(apart[0])
    least = np.min([same * one for one in apart], axis=0) if length > 1 else np.abs(apart[0])
    departures[2 : 2 + inner] = same * np.maximum(least, 0.0)
    return departures


def _cubic(a: Any, b: Any, c: Any, d: Any, length: int) -> list[Any]:
    """Values between b and c of the cubic through four samples, `length` of which are missing."""
    places = np.array([-2.0, -1.0, float(length), length + 1.0])
    weights = [
        [
            float(np.prod([(at - other) / (one - other) for other in places if other != one]))
            for one in places
        ]
        for at in range(length)
    ]
    return [w[0] * a + w[1] * b + w[2] * c + w[3] * d for w in weights]
