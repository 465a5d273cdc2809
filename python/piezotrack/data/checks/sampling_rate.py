"""Sampling rate of a record beside what its drive needs."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ..._support.statistics import sample_noise
from .diagnostics import jumps, turns

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = ["sampling_notes", "spare_factor"]

# Samples per period of the fastest cycle that are enough: a line between them is off by 1.2e-4 of
# the amplitude of a sine.
PER_PERIOD = 200
# Factor from which a record is sampled far above that, and fewest samples that remain.
SPARE, FEWEST = 4, 2000
# Times the noise of the drive that is no motion.
NOISE = 6.0
# Share of the sampling rate up to which modes are searched.
HIGHEST = 0.45


def spare_factor(u: Array, dt: float) -> int:
    """Return by what factor a record may be decimated without losing its drive.

    The lower rate has 200 samples per period of the fastest cycle, from reversal to reversal, or of
    a sine of the same range that moves as fast as the drive does at most.

    Parameters
    ----------
    u : ndarray, shape (n,)
        Drive [V].
    dt : float
        Sampling interval [s].

    Returns
    -------
    int
        1 where there is nothing to spare, or where the drive jumps: after a step the stage moves
        faster than its drive.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(50_000) / 5000.0
    >>> spare_factor(np.sin(2.0 * np.pi * t), 2e-4), spare_factor(np.sign(np.sin(t)), 2e-4)
    (25, 1)
    """
    return _factor(_fastest(u, dt), u.size, dt)


def sampling_notes(u: Array, dt: float, mode_limit: float = 0.0) -> list[str]:
    """Say where a record is sampled far above what its drive needs.

    Parameters
    ----------
    u : ndarray, shape (n,)
        Drive [V].
    dt : float
        Sampling interval [s].
    mode_limit : float, optional
        Natural frequency up to which a mode would show [Hz].

    Returns
    -------
    list of str
        One sentence, or none.

    Examples
    --------
    >>> import numpy as np
    >>> sampling_notes(np.sin(2.0 * np.pi * np.arange(50_000) / 5000.0), 2e-4)
    ['5 kHz for a 1 Hz drive: 200 Hz are enough, log.decimate(25)']
    """
    frequency = _fastest(u, dt)
    factor = _factor(frequency, u.size, dt)
    if factor == 1:
        return []
    rate, lower = _hertz(1.0 / dt), _hertz(1.0 / (factor * dt))
    needed = f"{rate} for a {_hertz(frequency, 2)} drive: {lower} are enough"
    # A mode that would show now and not at the lower rate.
    highest = HIGHEST / (factor * dt)
    lost = f"; not for a mode above {_hertz(highest, 2)}" if mode_limit > highest else ""
    return [f"{needed}, log.decimate({factor}){lost}"]


def _fastest(u: Array, dt: float) -> float:
    """Return the frequency of the fastest motion of a drive [Hz]; infinite where it jumps."""
    swing = float(np.ptp(u))
    if u.size < FEWEST or not swing > 0.0 or jumps(u):
        return math.inf
    between = np.diff(turns(u))
    shortest = int(between.min()) if between.size else u.size
    cycles = 0.5 / (shortest * dt) if between.size else 0.0
    # A sine moves by pi times its frequency times its range per second at most.
    apart = max(1, 2 * shortest // PER_PERIOD)
    moved = float(np.abs(u[apart:] - u[:-apart]).max()) - NOISE * sample_noise(u)
    return max(cycles, moved / (math.pi * swing * apart * dt))


def _factor(frequency: float, count: int, dt: float) -> int:
    spare = 1.0 / (PER_PERIOD * frequency * dt) if frequency > 0.0 else math.inf
    factor = round(min(spare, count / FEWEST))
    return factor if factor >= SPARE else 1


def _hertz(value: float, digits: int = 3) -> str:
    return f"{value / 1e3:.{digits}g} kHz" if value >= 999.5 else f"{value:.{digits}g} Hz"
