"""Correlation of drive and displacement of a record: swapped, of the other sign, or not at all."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ... import _core
from ..._support.statistics import sample_noise

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = ["Connection", "unusual_connection"]

# Samples that are looked at: the first ones.
LOOKED_AT = 200_000
FEWEST = 100
# Correlation at the best lag below which a drive does not move the displacement, and how many
# times that which chance gives.
MOVED, CHANCE = 0.08, 2.0
# Share of a displacement that is noise from sample to sample where nothing else is in it.
NOISE = 0.7
# Correlation from which a displacement follows its drive without a lag that could be taken for a
# lead; and by how much it has to lead, in samples and as a share of the travel.
FOLLOWS, SAMPLES, TRAVEL = 0.9, 2.0, 0.005
# Correlation from which a displacement falls, as above a resonance it does not all the time.
FALLS = -0.8
# How many times the noise of the displacement a drive has that is read by a sensor.
NOISIER = 3.0
# Samples that are regressed, on how many before each, and what a drive has to add.
REGRESSED, ORDER, GRANGER = 20_000, 12, 0.005
# Means to which a record is reduced to find its loops.
LOOP_SAMPLES = 4000
# Share of its range by which a drive turns.
TURN = 0.2


class Connection(NamedTuple):
    """Unusual way in which a displacement goes with its drive.

    Attributes
    ----------
    note : str
        A sentence.
    follows : bool
        Whether the displacement follows the drive all the same; else a fit means nothing.
    swapped : bool
        Whether the columns are probably swapped.
    """

    note: str
    follows: bool
    swapped: bool = False


def unusual_connection(u: Array, y: Array) -> Connection | None:
    """Look whether a displacement follows its drive as that of a stage does.

    A stage is passive: over closed cycles the integral of the displacement over the drive is
    negative where the gain is positive, as the displacement lags. Where it leads, what is called
    the drive is the consequence.

    Parameters
    ----------
    u : ndarray, shape (n,)
        Drive [V].
    y : ndarray, shape (n,)
        Displacement [m].

    Returns
    -------
    Connection or None
        None where nothing is unusual.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(4000) / 1000.0
    >>> u, y = np.sin(2.0 * np.pi * t), np.sin(2.0 * np.pi * t - 0.1)
    >>> unusual_connection(u, y)
    >>> unusual_connection(y, u).note.split(":")[0]
    'the displacement leads the drive, by 3.9 % of the travel'
    >>> unusual_connection(u, -y).note
    'the displacement falls as the drive rises: the gain is negative; is the sensor turned round?'
    """
    u, y = u[:LOOKED_AT], y[:LOOKED_AT]
    if u.size < FEWEST or np.ptp(u) == 0.0 or np.ptp(y) == 0.0:
        return None
    sloped = _is_line(u)
    drive, moved = _plain(u, sloped=sloped), _plain(y, sloped=sloped)
    most = _correlation(drive, moved)
    if most < _chance(u.size) and not _foretells(drive, moved):
        share = f"the drive explains {100.0 * most**2:.1f} % of the displacement"
        if sample_noise(y) > NOISE * float(np.std(y)):
            return Connection(f"{share}, which is noise: is the sensor connected?", follows=False)
        other = "does another input move the stage, or is it another axis that is read?"
        return Connection(f"{share}: {other}", follows=False)
    together = float(np.corrcoef(u, y)[0, 1])
    if together < FALLS:
        return Connection(
            "the displacement falls as the drive rises: the gain is negative; is the sensor turned "
            "round?",
            follows=True,
        )
    if together > FOLLOWS and (lead := _lead(u, y)) > TRAVEL:
        noise = [sample_noise(one) / float(np.ptp(one)) for one in (u, y)]
        noisy = ", and the drive has the noise of a sensor" if noise[0] > NOISIER * noise[1] else ""
        return Connection(
            f"the displacement leads the drive, by {100.0 * lead:.2g} % of the travel{noisy}: are "
            "the columns swapped, or is the drive read late?",
            follows=False,
            swapped=True,
        )
    return None


def _level(values: Array) -> Array:
    """Take mean and slope off."""
    along = np.linspace(-1.0, 1.0, values.size)
    left = values - values.mean()
    level: Array = left - along * float(along @ left) / float(along @ along)
    return level


def _is_line(values: Array) -> bool:
    """Return whether nothing is left of a signal without mean and slope."""
    size = float(np.linalg.norm(_level(values)))
    return size <= 1e-6 * float(np.ptp(values)) * math.sqrt(values.size)


def _plain(values: Array, *, sloped: bool) -> Array:
    """Take the mean off, and the slope but of a drive that is its slope; scale to a norm of 1."""
    left = values - values.mean() if sloped or _is_line(values) else _level(values)
    plain: Array = left / np.linalg.norm(left)
    return plain


def _correlation(u: Array, y: Array) -> float:
    """Return the largest correlation of two signals at any lag."""
    size = 1 << (u.size + y.size).bit_length()
    product = np.fft.rfft(y, size) * np.fft.rfft(u, size).conj()
    return float(np.abs(np.fft.irfft(product, size)).max())


def _chance(count: int) -> float:
    """Return the correlation below which two signals have nothing in common."""
    return max(MOVED, CHANCE * math.sqrt(2.0 * math.log(count) / count))


def _foretells(u: Array, y: Array) -> bool:
    """Whether a drive tells of the next sample of a signal what the signal itself does not.

    Granger's test, which finds the drive of a resonance too, that rings on long after it.
    """
    u, y = u[:REGRESSED], y[:REGRESSED]
    count = y.size - ORDER
    rows = [one[ORDER - k : ORDER - k + count] for one in (y, u) for k in range(1, ORDER + 1)]
    rows += [u[ORDER:], np.ones(count)]
    table, goal = np.column_stack(rows), y[ORDER:]

    def left(columns: Array) -> float:
        rest = goal - columns @ np.linalg.lstsq(columns, goal, rcond=None)[0]
        return float(rest @ rest)

    alone = left(np.column_stack([table[:, :ORDER], table[:, -1]]))
    return alone - left(table) > (GRANGER + 5.0 * ORDER / count) * alone


def _lead(u: Array, y: Array) -> float:
    """Return by what share of the travel a displacement leads; less than 0 where it lags.

    0 where there is no whole cycle, and where the lead is no more than the time between two samples
    that are taken one after the other.
    """
    # Means of many samples, in which noise makes no travel.
    each = max(1, u.size // LOOP_SAMPLES)
    u, y = (one[: one.size // each * each].reshape(-1, each).mean(axis=1) for one in (u, y))
    # Whole cycles, from a turn to one of the same side.
    turns = _core.turns(u, TURN * float(np.ptp(u)))
    if len(turns) < 3:
        return 0.0
    part = slice(turns[0], turns[-1 if len(turns) % 2 else -2] + 1)
    u, y = u[part], y[part]
    moves = np.diff(u)
    middle = 0.5 * (y[1:] + y[:-1])
    # The way back from the last sample to the first closes the loop.
    area = float(middle @ moves) - 0.5 * float(y[0] + y[-1]) * float(u[-1] - u[0])
    # Of y = gain u(t + tau) it is the gain times tau times the square of the rate.
    gain = float(np.ptp(y)) / float(np.ptp(u))
    samples = each * area / (gain * float(moves @ moves))
    travel = area / (float(np.abs(moves).sum()) * float(np.ptp(y)))
    return travel if samples > SAMPLES else min(travel, 0.0)
