"""Period of the drive of a log."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..errors import ParameterError

if TYPE_CHECKING:
    from ..data.dataset import Dataset

__all__ = ["period_of"]

# Largest rms difference of two periods of a drive, as a part of its own, where it is read back.
REPEATS = 0.02


def period_of(log: Dataset, period: float | None) -> int | None:
    """Return the samples of a period of the drive of a log.

    Parameters
    ----------
    log : Dataset
        The log.
    period : float or None
        The period [s]; None to find it.

    Returns
    -------
    int or None
        At most half the log; None where it is sought and there is none.

    Raises
    ------
    ParameterError
        `period` is not whole samples, or the log has not two of it.

    Examples
    --------
    >>> import numpy as np
    >>> import piezotrack as pt
    >>> t = 1e-3 * np.arange(5000)
    >>> u = np.sin(2.0 * np.pi * t) + np.cos(6.0 * np.pi * t)
    >>> period_of(pt.Dataset(t=t, u=u, y=1e-6 * u), None)
    1000
    """
    u, size = log.u, len(log)
    if period is not None:
        count = round(period / log.dt)
        if abs(count * log.dt - period) > 1e-3 * log.dt * max(1, count) ** 0.5:
            raise ParameterError(
                "period",
                f"{period:.9g} s",
                f"whole samples of {log.dt:.6g} s, as {count * log.dt:.9g} s",
            )
        if not 4 <= count <= size // 2:
            raise ParameterError(
                "period", f"{period:.6g} s", f"at most half the log, {0.5 * log.duration:.6g} s"
            )
        return count
    moved = u - u.mean()
    power = float(moved @ moved) / size
    if power == 0.0:
        return None
    # Rms difference to itself later, from the correlation and the energies of both parts.
    padded = 1 << (2 * size - 1).bit_length()
    transform = np.fft.rfft(moved, padded)
    overlap = np.fft.irfft(transform * transform.conj(), padded)[:size]
    energy = np.concatenate([[0.0], np.cumsum(moved * moved)])
    later = np.arange(size)
    difference = (energy[size - later] + energy[size] - energy[later] - 2.0 * overlap) / (
        size - later
    )
    candidates = np.flatnonzero(difference[: size // 2 + 1] < REPEATS**2 * power)
    # What follows 0 is the width of the correlation of a slow drive.
    apart = candidates[candidates > np.argmax(difference > 0.1 * power)]
    if np.all(difference <= 0.1 * power) or apart.size == 0:
        return None
    near = apart[apart <= apart[0] + max(1, int(0.01 * apart[0]))]
    best = int(near[np.argmin(difference[near])])
    return best if best >= 4 else None
