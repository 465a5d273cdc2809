"""Diagnostics of a record: errors before an identification, warnings with its result."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from ... import _core
from ..._support.units import best_length_unit, drive_text, length_text
from ...errors import DataError
from .connections import unusual_connection

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from numpy.typing import NDArray

    from ..dataset import Dataset

    Array = NDArray[np.float64]

__all__ = [
    "amplitudes",
    "check_record",
    "fit_warnings",
    "jumps",
    "record_warnings",
    "runs",
    "turns",
]

# A signal reverses where it goes back by this share of its range.
TURN = 0.05
# A change between two samples that counts as a step, as a share of the range.
JUMP = 0.2
# Largest distance of the window's ends in a closed period, as a share of the range.
CLOSED = 0.1
# A drive held at its extreme for this share of the window counts as clipped.
CLIPPED = 0.1
# Sampling interval of a record whose time is probably in ms [s].
SELDOM = 0.5
# Voltages [V], gains [m/V] and strokes [m] beyond which a piezo stage is implausible.
TOO_MANY_VOLTS = 1500.0
HIGHEST_GAIN, LONGEST = 2e-4, 5e-3
LOWEST_GAIN, LOWEST_GAIN_OF_COMMAND, COMMAND_VOLTS, SHORTEST = 3e-9, 2e-8, 20.0, 1e-9
# A typical stroke [m], to distinguish a factor of 1e3 from one of 1e6.
USUAL = 30e-6
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
    if len(data) < FEWEST or not searches_hysteresis or _steps(whole.u) or np.ptp(whole.u) == 0.0:
        return
    if not turns(whole.u) and not turns(whole.y):
        raise DataError(
            f"the drive never reverses: it goes from {_drive(data, whole.u[0])} to "
            f"{_drive(data, whole.u[-1])} and never back, where hysteresis does not show; record a "
            "drive that goes up and down, or hold the parameters of the hysteresis in parameters="
        )


def record_warnings(data: Dataset) -> list[str]:
    """Warnings about a record that do not depend on the model.

    Parameters
    ----------
    data : Dataset
        The record.

    Returns
    -------
    list of str
        Sentences, none for a sound record.

    Examples
    --------
    >>> import numpy as np
    >>> import piezotrack as pt
    >>> u = 5.0 * np.sin(np.arange(5000) / 500.0)
    >>> record_warnings(pt.Dataset(u=u, y=4e-6 * u, dt=0.005))
    []
    >>> print(record_warnings(pt.Dataset(u=u, y=4.0 * u, dt=0.005))[0])
    a stroke of 40 m is not that of a nanopositioner: is the unit of the displacement right? It \
would be 40 um if it is 1e6 too large, as um taken as m
    """
    data = data.measured
    if np.ptp(data.u) == 0.0 or np.ptp(data.y) == 0.0:
        return [*data.notes]
    notes = [*data.notes, *data.far_notes]
    whole = data.without_far_readings()
    connection = unusual_connection(whole.u, whole.y)
    if connection is not None:
        notes.append(connection.note)
        if not connection.follows:
            return notes
    return [*notes, *_units(whole), *_seldom(data), *_periods(whole), *_clipping(whole)]


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
    if cost_percent <= REMAINS or rest.size < 10 * BINS or _steps(u):
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


def _steps(u: Array) -> bool:
    """Whether a drive has steps, or is constant between steps."""
    if u.size < 2:
        return False
    moves = np.abs(np.diff(u))
    return jumps(u) or bool(np.mean(moves > 0.01 * float(moves.max())) < 0.1)


def jumps(u: Array) -> bool:
    """Return whether a drive jumps by a fifth of its range or more from sample to sample."""
    return bool(float(np.abs(np.diff(u)).max()) >= JUMP * np.ptp(u))


def _seldom(data: Dataset) -> list[str]:
    """Warn of a sampling interval that only a wrong unit explains."""
    if data.dt < SELDOM:
        return []
    return [
        f"it is sampled every {data.dt:g} s: is the time in ms? It would be {1e3 / data.dt:g} Hz"
    ]


def _units(data: Dataset) -> list[str]:
    """Warn of voltages, strokes and gains that only a wrong unit explains."""
    if data.drive_unit != "V":
        return []
    most, swing, stroke = float(np.abs(data.u).max()), float(np.ptp(data.u)), data.stroke
    gain = stroke / swing
    if most > TOO_MANY_VOLTS:
        return [
            f"a drive of {most:.6g} V is not that of a piezo: is it in mV? It would be "
            f"{most / 1e3:.4g} V"
        ]
    doubt = f"a stroke of {length_text(stroke)} is not that of a nanopositioner"
    if stroke > LONGEST:
        factor = min((1e3, 1e6, 1e9), key=lambda f: abs(math.log(stroke / f / USUAL)))
        taken = {1e3: "um taken as mm", 1e6: "um taken as m", 1e9: "nm taken as m"}[factor]
        return [
            f"{doubt}: is the unit of the displacement right? It would be "
            f"{length_text(stroke / factor)} if it is {_power(factor)} too large, as {taken}"
        ]
    if gain > HIGHEST_GAIN:
        return [
            f"{length_text(stroke)} under {swing:.3g} V are {1e6 * gain:.3g} um/V, more than piezo "
            f"stages give: is the drive in V and taken as mV, 1e3 too small, or the displacement "
            "1e3 too large?"
        ]
    least = LOWEST_GAIN_OF_COMMAND if swing <= COMMAND_VOLTS else LOWEST_GAIN
    if gain < least or stroke < SHORTEST:
        factor = min((1e3, 1e6), key=lambda f: abs(math.log(stroke * f / USUAL)))
        taken = {1e3: "um taken as nm", 1e6: "um taken as pm"}[factor]
        return [
            f"{length_text(stroke)} under {swing:.4g} V are {1e9 * gain:.3g} nm/V, less than piezo "
            f"stages give: is the unit of the displacement right? It would be "
            f"{length_text(stroke * factor)} if it is {_power(factor)} too small, as {taken}"
        ]
    return []


def _periods(data: Dataset) -> list[str]:
    """Warn of a drive with less than one period."""
    u = data.u
    if _steps(u):
        return []
    turning = len(turns(u))
    if turning == 0 and not turns(data.full.u):
        if turns(data.y):
            return []
        return ["the drive never reverses: this record does not determine the hysteresis"]
    open_end = abs(float(u[-1] - u[0])) > CLOSED * np.ptp(u)
    if turning <= 1 and open_end:
        return [
            f"the window, {data.duration:.4g} s, is shorter than a period of the drive, which "
            f"begins at {_drive(data, u[0])} and ends at {_drive(data, u[-1])}, within "
            f"{_drive(data, u.min())} to {_drive(data, u.max())}: the loop is not closed, "
            "and a fit to a part of it may not hold for the rest"
        ]
    return []


def _clipping(data: Dataset) -> list[str]:
    """Warn of a drive or a displacement that is clipped."""
    u, y = data.u, data.y
    warnings = []
    swing, moves = float(np.ptp(u)), np.abs(np.diff(u))
    quick = float(np.quantile(moves, 0.9))
    still = moves <= 1e-4 * swing
    # A drive that rests elsewhere too, as a staircase does, is not clipped.
    rests = float(
        np.mean(
            still
            & (np.abs(u[1:] - u.min()) > 0.005 * swing)
            & (np.abs(u[1:] - u.max()) > 0.005 * swing)
        )
    )
    for end, level in (("highest", float(u.max())), ("lowest", float(u.min()))):
        held = [
            (first, last)
            for first, last in runs(np.abs(u - level) <= 0.005 * swing)
            if last - first >= 5 and _cut_off(moves, first, last, quick, swing)
        ]
        share = sum(last - first for first, last in held) / u.size
        if share >= CLIPPED and rests < 0.1 * share:
            warnings.append(
                f"the drive is cut off at {_drive(data, level)}, its {end}, for "
                f"{100 * share:.0f} % of the window: was it clipped? A constant drive "
                "does not determine the hysteresis"
            )
    for level in (float(y.max()), float(y.min())):
        for first, last in runs(np.abs(y - level) <= 1e-3 * data.stroke):
            part = u[first:last]
            ends = part[[0, -1]]
            further = max(float(part.max() - ends.max()), float(ends.min() - part.min()))
            if last - first >= 10 and further > TURN * swing:
                warnings.append(
                    f"the displacement stays at {length_text(level)} while the drive goes "
                    f"{_drive(data, further, 3)} further and back: is the sensor or the "
                    "stage at its end?"
                )
                break
    return warnings


def _cut_off(moves: Array, first: int, last: int, quick: float, swing: float) -> bool:
    """Whether a drive that is constant from `first` to `last` was moving before."""
    if first < 4:
        return False
    into = moves[first - 4 : first]
    return bool(into[:3].mean() >= 0.25 * quick and into.max() <= 0.1 * swing and last > first)


def runs(mask: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return the first sample, and that after the last, of each run of true entries."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _drive(data: Dataset, value: float, digits: int = 4) -> str:
    """Write a drive of a record with its unit."""
    return drive_text(value, data.drive_unit, digits)


def _power(factor: float) -> str:
    return f"1e{round(math.log10(factor))}"
