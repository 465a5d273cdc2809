"""Diagnostics of a record and of a fit: what is refused, and what the residual tells."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from ... import _core
from ..._support.units import best_length_unit, drive_text
from ...errors import DataError

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from numpy.typing import NDArray

    from ..dataset import Dataset

    Array = NDArray[np.float64]

__all__ = [
    "amplitudes",
    "check_record",
    "fit_warnings",
    "has_steps",
    "jumps",
    "turns",
]

# A signal reverses where it goes back by this share of its range.
TURN = 0.05
# A change between two samples that counts as a step, as a share of the range.
JUMP = 0.2
# Residual [% of stroke] from which a warning is due, and its systematic share.
REMAINS, FOLLOWS = 1.5, 0.6
BINS = 16
FEWEST = 10
# Share of the loop's width, squared, that is not the same above and below the middle.
LOPSIDED = 0.05


def check_record(data: Dataset, *, searches_hysteresis: bool) -> None:
    """Refuse a record from which hysteresis parameters cannot be identified.

    Parameters
    ----------
    data : Dataset
        The record.
    searches_hysteresis : bool
        Whether a hysteresis parameter is to be identified.

    Raises
    ------
    DataError
        Neither drive nor displacement reverses, and a hysteresis parameter is to be identified.
    """
    whole = data.full
    # Constant or too short records are refused by the core.
    if (
        len(data) < FEWEST
        or not searches_hysteresis
        or has_steps(whole.u)
        or np.ptp(whole.u) == 0.0
    ):
        return
    if not turns(whole.u) and not turns(whole.y):
        raise DataError(
            f"the drive never reverses: it goes from {_drive(data, whole.u[0])} to "
            f"{_drive(data, whole.u[-1])} and never back, where hysteresis does not show; record a "
            "drive that goes up and down, or hold the parameters of the hysteresis in parameters="
        )


def fit_warnings(
    data: Dataset,
    x: Array,
    cost_percent: float,
    hysteresis: Sequence[str],
    held: Collection[str],
) -> list[str]:
    """Warning that the residual of a fit is systematic, not noise.

    Parameters
    ----------
    data : Dataset
        The record.
    x : ndarray, shape (n,)
        Displacement of the model in the window, with the offset [m].
    cost_percent : float
        Residual rms, in per cent of the stroke.
    hysteresis : sequence of str
        The parameters of the model's hysteresis.
    held : collection of str
        The parameters that were held fixed.

    Returns
    -------
    list of str
        One sentence, or none.
    """
    rest, u = data.y - x, data.u
    if cost_percent <= REMAINS or rest.size < 10 * BINS or has_steps(u):
        return []
    rest = rest - rest.mean()
    # The residual as a function of drive and direction.
    means, counts = _branches(u, rest)
    share = float(np.sum(counts * means**2) / np.sum(rest**2))
    if share <= FOLLOWS:
        return []
    direction, place = np.unravel_index(int(np.argmax(np.abs(means))), means.shape)
    volts = float(u.min() + np.ptp(u) * (place + 0.5) / BINS)
    unit, scale = best_length_unit(data.stroke)
    where = (
        f"{100 * share:.0f} % of the residual is a function of drive and direction, "
        f"{scale * means[direction, place]:+.3g} {unit} near {_drive(data, volts, 3)} with "
        f"the drive going {('up', 'down')[direction]}"
    )
    kept = [name for name in hysteresis if name in held]
    if kept:
        *first, last = hysteresis
        return [
            f"the loop does not have the shape of the model: {where}; {', '.join(kept)} "
            f"{'were' if len(kept) > 1 else 'was'} held fixed: identify all of "
            f"{', '.join(first)} and {last}"
        ]
    what = "is asymmetric, which" if _lopsided(data) else "has a shape that"
    return [f"the loop {what} this model cannot describe: {where}"]


def _branches(u: Array, values: Array) -> tuple[Array, Array]:
    """Return means of values by drive and direction, up then down, and their counts."""
    place = np.minimum((BINS * (u - u.min()) / np.ptp(u)).astype(np.intp), BINS - 1)
    group = place + BINS * (np.gradient(u) < 0.0)
    counts = np.bincount(group, minlength=2 * BINS).astype(np.float64)
    sums = np.bincount(group, weights=values, minlength=2 * BINS)
    means: Array = sums / np.maximum(counts, 1.0)
    return means.reshape(2, BINS), counts.reshape(2, BINS)


def _lopsided(data: Dataset) -> bool:
    """Whether the loop is wider on one side of its middle."""
    means, counts = _branches(data.u, data.y)
    width = means[1] - means[0]
    odd = (width - width[::-1]) / 2.0
    return bool(counts.min() > 0 and np.sum(odd**2) > LOPSIDED * np.sum(width**2))


def turns(signal: Array) -> list[int]:
    """Return the samples at which a signal reverses by 5 % of its range or more."""
    return _core.turns(signal, TURN * float(np.ptp(signal)))


def amplitudes(u: Array) -> Array:
    """Return half of the travel of a drive between the turning points around each sample.

    Parameters
    ----------
    u : ndarray, shape (n,)
        The drive [V].

    Returns
    -------
    ndarray, shape (n,)
        The amplitudes [V].
    """
    amplitude = np.zeros(u.size)
    for first, last in pairwise([0, *turns(u), u.size - 1]):
        amplitude[first : last + 1] = np.ptp(u[first : last + 1]) / 2.0
    return amplitude


def has_steps(u: Array) -> bool:
    """Return whether a drive has steps, or is constant between steps."""
    if u.size < 2:
        return False
    moves = np.abs(np.diff(u))
    return jumps(u) or bool(np.mean(moves > 0.01 * float(moves.max())) < 0.1)


def jumps(u: Array) -> bool:
    """Return whether a drive jumps by a fifth of its range or more from sample to sample."""
    return bool(float(np.abs(np.diff(u)).max()) >= JUMP * np.ptp(u))


def _drive(data: Dataset, value: float, digits: int = 4) -> str:
    """Write a drive of a record with its unit."""
    return drive_text(value, data.drive_unit, digits)
