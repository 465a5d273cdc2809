"""How fast a drive is for its sampling rate: whether straight lines between samples follow it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..dataset import Dataset

    Array = NDArray[np.float64]

__all__ = ["CURVED", "FAST", "is_fast"]

# Share of the sampling rate above which a drive is fast: a straight line falls short by 3 %. And
# that above which it is worth while to interpolate for a known model: by 0.1 %.
FAST, CURVED = 0.1, 0.02
# Share of the power of the drive's changes that lies above it; and of those near half the rate,
# of steps and noise, which have no band.
POWER, EDGE, EDGE_POWER = 0.1, 0.4, 0.01
# Samples of a part of the drive.
PART = 1024


def is_fast(data: Dataset, above: float = FAST) -> bool:
    """Return whether a band-limited drive moves clearly off straight lines between its samples.

    Parameters
    ----------
    data : Dataset
        The record, whose warm-up counts too.
    above : float, optional
        Frequency from which a drive is fast, as a share of the sampling rate.

    Returns
    -------
    bool
        Whether more than a tenth of the power of its first difference is above that frequency, and
        less than a hundredth above 0.4 of the rate. Never of a drive that is held between samples.

    Examples
    --------
    >>> import numpy as np
    >>> import piezotrack as pt
    >>> t = np.arange(3000)
    >>> logs = [pt.Dataset(u=np.sin(k * t), y=np.cos(k * t), dt=1e-3) for k in (0.01, 1.0)]
    >>> [is_fast(log) for log in logs]
    [False, True]
    """
    if data.hold == "zoh":
        return False
    changes = np.diff(data.full.u)
    size = min(PART, changes.size)
    parts = changes[: changes.size // size * size].reshape(-1, size)
    spectra = np.abs(np.fft.rfft(parts * np.hanning(size + 2)[1:-1], axis=1)) ** 2
    power: Array = spectra.sum(axis=0)
    frequencies = np.arange(power.size) / size
    total = float(power.sum())
    fast = float(power[frequencies > above].sum()) > POWER * total
    return fast and float(power[frequencies > EDGE].sum()) < EDGE_POWER * total
