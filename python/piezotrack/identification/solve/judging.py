"""Parts of a record for trials of models, and how good a model is on what it was not fitted to."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from ... import _core
from ..._support.statistics import sample_noise

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...data.dataset import Dataset

    Array = NDArray[np.float64]

__all__ = [
    "NOISY",
    "SAME_PERIOD",
    "is_white",
    "judged",
    "noise_of",
    "period_of",
    "repeated",
    "two_parts",
]

# A residual of so many times the noise has hardly anything but noise in it.
NOISY = 1.05
# Share of the window that is fitted, and turns of the drive that each part needs; and the share
# where it turns too seldom.
FITTED, TURNS, FITTED_OF_ONE_LOOP = 0.6, 2, 0.75
# Fewer samples are not parted.
LEAST_SAMPLES = 100
# Correlation of residuals up to so many samples apart that is that of noise; and what chance makes
# of it, in standard deviations.
APART, CORRELATED, CHANCE = 10, 0.1, 4.0
# Blocks of the drive that differ by this ratio in amplitude or rate are judged apart.
APART_IN_SIZE = 2.0
# A drive repeats where periods of it differ by less than this share.
SAME_PERIOD = 0.01


def two_parts(data: Dataset) -> tuple[Dataset, Dataset, bool]:
    """Part a record for trials.

    Parameters
    ----------
    data : Dataset
        The record.

    Returns
    -------
    part, rest : Dataset
        To fit, and to judge on: the last quarter where the drive turns too seldom.
    few : bool
        Whether it does.
    """
    turns = np.array(_core.turns(data.u, 0.2 * float(np.ptp(data.u))), dtype=np.intp)
    for place in turns[np.argsort(np.abs(turns - FITTED * len(data)))]:
        before, after = int(np.sum(turns < place)), int(np.sum(turns >= place))
        if before >= TURNS and after >= TURNS:
            middle = float(data.t[place])
            return data[data.t[0] : middle], data[middle:], False
    if len(data) < LEAST_SAMPLES:
        return data, data, True
    middle = float(data.t[int(FITTED_OF_ONE_LOOP * (len(data) - 1))])
    return data[data.t[0] : middle], data[middle:], True


def judged(data: Dataset, left: Array) -> float:
    """Return the mean square of a residual [m^2], each amplitude and rate of the drive alike.

    Parameters
    ----------
    data : Dataset
        The record, of n samples.
    left : ndarray, shape (n,)
        The residual [m].

    Returns
    -------
    float
        Mean over the classes of blocks, between reversals, that differ in amplitude or rate.
    """
    left, data = data.at_readings(left), data.measured
    turns = _core.turns(data.u, 0.05 * float(np.ptp(data.u)))
    # Parts of blocks at the ends differ in amplitude by chance.
    blocks = [slice(a, b) for a, b in pairwise(turns)]
    if len(blocks) < 2:
        return float(np.mean(data.counted(left) ** 2))
    if data.left_out is not None:
        left = np.where(data.left_out, np.nan, left)
    size = np.array([np.ptp(data.u[block]) for block in blocks])
    rate = size / np.array([block.stop - block.start for block in blocks])
    classes: dict[tuple[bool, bool], list[slice]] = {}
    for block, large, fast in zip(blocks, _upper(size), _upper(rate), strict=True):
        classes.setdefault((bool(large), bool(fast)), []).append(block)
    means = [
        np.nanmean(np.concatenate([left[one] for one in some]) ** 2) for some in classes.values()
    ]
    return float(np.mean(means))


def _upper(values: Array) -> NDArray[np.bool_]:
    """Return which values are in the upper class; none where all are alike."""
    low, high = float(np.min(values)), float(np.max(values))
    if high <= APART_IN_SIZE * low:
        return np.zeros(values.size, dtype=np.bool_)
    return values > math.sqrt(max(low, 1e-12 * high) * high)


def noise_of(data: Dataset) -> float:
    """Return what no model explains [m]: noise between samples, or what does not repeat."""
    return max(sample_noise(data.y), repeated(data))


def repeated(data: Dataset) -> float:
    """Return what of a displacement does not repeat with a periodic drive, rms [m]; else 0.

    No model of the drive explains more than what repeats, but for what is slow: a first period
    from rest, creep, and a drift.

    Parameters
    ----------
    data : Dataset
        The record.

    Returns
    -------
    float
        Rms of the difference of two periods, less a line and a shift in time, over the root of 2:
        of the neighbours that differ least.
    """
    period = period_of(data)
    if period is None:
        return 0.0
    y = data.y if data.left_out is None else np.where(data.left_out, np.nan, data.y)
    change, slope = y[period:] - y[:-period], np.gradient(y)
    # The period may lie between two samples.
    basis = np.stack(
        [slope[period:] + slope[:-period], np.arange(change.size), np.ones(change.size)]
    )
    left = []
    for first in range(0, max(change.size - period, 0) + 1, period):
        some = slice(first, first + period)
        seen = np.isfinite(change[some]) & np.isfinite(basis[0, some])
        columns, cycle = basis[:, some][:, seen].T, change[some][seen]
        if seen.any():
            fitted = columns @ np.linalg.lstsq(columns, cycle, rcond=None)[0]
            left.append(float(np.sqrt(np.mean((cycle - fitted) ** 2))))
    return min(left, default=0.0) / math.sqrt(2.0)


def period_of(data: Dataset) -> int | None:
    """Return the period of a drive that repeats.

    Parameters
    ----------
    data : Dataset
        The record.

    Returns
    -------
    int or None
        In samples; None where the drive does not repeat within the window.
    """
    u = data.u - data.u.mean()
    turns = np.array(_core.turns(data.u, 0.5 * float(np.ptp(data.u))), dtype=np.intp)
    if turns.size < 4:
        return None
    period = round(float(np.median(turns[2:] - turns[:-2])))
    near = [p for p in (period - 1, period, period + 1) if 8 <= p <= u.size // 2]
    if not near:
        return None
    gap = {p: float(np.std(u[p:] - u[:-p])) for p in near}
    best = min(gap, key=gap.__getitem__)
    if gap[best] > SAME_PERIOD * float(np.std(u)):
        return None
    return best


def is_white(rest: Array) -> bool:
    """Return whether residuals are noise from sample to sample: nothing is left to describe.

    Parameters
    ----------
    rest : ndarray, shape (n,)
        The residuals [m].

    Returns
    -------
    bool
        Whether no correlation is left.
    """
    rest = rest - rest.mean()
    squares = float(rest @ rest)
    if rest.size <= APART or squares == 0.0:
        return True
    most = max(abs(float(rest[:-k] @ rest[k:])) for k in range(1, APART + 1))
    return most < max(CORRELATED, CHANCE / math.sqrt(rest.size)) * squares
