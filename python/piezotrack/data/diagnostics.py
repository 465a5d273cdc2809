"""Diagnostics of a record: errors before an identification, warnings with its result."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from .. import _core
from .._support.units import best_length_unit
from ..errors import DataError

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from numpy.typing import NDArray

    from .dataset import Dataset

    Array = NDArray[np.float64]

__all__ = ["of_fit", "of_record", "refuse"]

# A signal turns where it goes back by this share of its range.
TURN = 0.05
# A drive that does so much of its range between two samples steps.
JUMP = 0.2
# How near the window's end has to come to its beginning to close a period, of the range.
CLOSED = 0.1
# Held at its end for this share of the window, a drive counts as clipped.
CLIPPED = 0.1
# Voltage [V] that no piezo is driven with, and gains [m/V] and strokes [m] that none has.
TOO_MANY_VOLTS = 1500.0
HIGHEST_GAIN, LONGEST = 2e-4, 5e-3
LOWEST_GAIN, LOWEST_GAIN_OF_COMMAND, COMMAND_VOLTS, SHORTEST = 3e-9, 2e-8, 20.0, 1e-9
# A stroke in the middle of what there is [m], to tell a factor of 1e3 from one of 1e6.
USUAL = 30e-6
# A remainder [% of stroke] worth a remark, and the share of it that has to follow the loop.
REMAINS, FOLLOWS = 1.5, 0.6
BINS = 16
FEWEST = 10
# Share of the loop's width, squared, that is not the same above and below the middle.
LOPSIDED = 0.05


def refuse(data: Dataset, *, searches_hysteresis: bool) -> None:
    """Refuse a record on which a search makes no sense.

    Parameters
    ----------
    data : Dataset
        The record.
    searches_hysteresis : bool
        Whether a parameter of the hysteresis is searched.

    Raises
    ------
    DataError
        Neither drive nor displacement turns back, and hysteresis is searched.
    """
    whole = data.full
    # What is constant or too short is refused by the core, in its own words.
    if len(data) < FEWEST or not searches_hysteresis or _steps(whole.u) or np.ptp(whole.u) == 0.0:
        return
    if not _turns(whole.u) and not _turns(whole.y):
        raise DataError(
            f"the drive never reverses: it goes from {whole.u[0]:.4g} to {whole.u[-1]:.4g} "
            f"{data.drive_unit} and never back, where hysteresis does not show; record a drive "
            "that goes up and down, or hold the parameters of the hysteresis with fixed="
        )


def of_record(data: Dataset) -> list[str]:
    """Say what is odd about a record, whatever the model.

    Parameters
    ----------
    data : Dataset
        The record.

    Returns
    -------
    list of str
        Sentences, none for a good record.

    Examples
    --------
    >>> import numpy as np
    >>> import piezotrack as pt
    >>> u = 5.0 * np.sin(np.arange(5000) / 500.0)
    >>> of_record(pt.Dataset(u=u, y=4e-6 * u, dt=0.005))
    []
    >>> print(of_record(pt.Dataset(u=u, y=4.0 * u, dt=0.005))[0])
    a stroke of 40 m is not that of a nanopositioner: is the unit of the displacement right? It \
would be 40 um if it is 1e6 too large, as um taken as m
    """
    if np.ptp(data.u) == 0.0 or np.ptp(data.y) == 0.0:
        return []
    return [*_units(data), *_periods(data), *_clipping(data)]


def of_fit(
    data: Dataset,
    x: Array,
    cost_percent: float,
    hysteresis: Sequence[str],
    held: Collection[str],
) -> list[str]:
    """Say where what a fit leaves is the loop's shape and not noise.

    Parameters
    ----------
    data : Dataset
        The record.
    x : ndarray, shape (n,)
        Displacement of the model in the window, with the offset [m].
    cost_percent : float
        What remains, in per cent of the stroke.
    hysteresis : sequence of str
        The parameters of the model's hysteresis.
    held : collection of str
        The parameters that were not searched.

    Returns
    -------
    list of str
        One sentence, or none.
    """
    rest, u = data.y - x, data.u
    if cost_percent <= REMAINS or rest.size < 10 * BINS or _steps(u):
        return []
    rest = rest - rest.mean()
    # What remains as one function of drive and direction.
    means, counts = _branches(u, rest)
    share = float(np.sum(counts * means**2) / np.sum(rest**2))
    if share <= FOLLOWS:
        return []
    way, place = np.unravel_index(int(np.argmax(np.abs(means))), means.shape)
    volts = float(u.min() + np.ptp(u) * (place + 0.5) / BINS)
    unit, scale = best_length_unit(data.stroke)
    where = (
        f"{100 * share:.0f} % of what remains follows drive and direction, "
        f"{scale * means[way, place]:+.3g} {unit} near {volts:.3g} {data.drive_unit} on the way "
        f"{('up', 'down')[way]}"
    )
    kept = [name for name in hysteresis if name in held]
    if kept:
        *first, last = hysteresis
        return [
            f"the loop is not of the model's shape: {where}; {', '.join(kept)} "
            f"{'were' if len(kept) > 1 else 'was'} held: search all of "
            f"{', '.join(first)} and {last}"
        ]
    what = "is asymmetric, which" if _lopsided(data) else "has a shape that"
    return [f"the loop {what} this model cannot describe: {where}"]


def _branches(u: Array, values: Array) -> tuple[Array, Array]:
    """Return means of values over drive and direction, up then down, and their counts."""
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


def _turns(signal: Array) -> list[int]:
    return _core.turns(signal, TURN * float(np.ptp(signal)))


def _steps(u: Array) -> bool:
    """Whether a drive jumps, or stands still but for jumps."""
    if u.size < 2:
        return False
    moves = np.abs(np.diff(u))
    most = float(moves.max())
    return bool(most >= JUMP * np.ptp(u) or np.mean(moves > 0.01 * most) < 0.1)


def _units(data: Dataset) -> list[str]:
    """Remark on voltages, strokes and gains that only a mistaken unit explains."""
    if data.drive_unit == "N":
        return []
    most, swing, stroke = float(np.abs(data.u).max()), float(np.ptp(data.u)), data.stroke
    gain = stroke / swing
    if most > TOO_MANY_VOLTS:
        return [
            f"a drive of {most:.6g} V is not that of a piezo: is it in mV? It would be "
            f"{most / 1e3:.4g} V"
        ]
    doubt = f"a stroke of {_length(stroke)} is not that of a nanopositioner"
    if stroke > LONGEST:
        factor = min((1e3, 1e6, 1e9), key=lambda f: abs(math.log(stroke / f / USUAL)))
        taken = {1e3: "um taken as mm", 1e6: "um taken as m", 1e9: "nm taken as m"}[factor]
        return [
            f"{doubt}: is the unit of the displacement right? It would be "
            f"{_length(stroke / factor)} if it is {_power(factor)} too large, as {taken}"
        ]
    if gain > HIGHEST_GAIN:
        return [
            f"{_length(stroke)} under {swing:.3g} V are {1e6 * gain:.3g} um/V, more than piezo "
            f"stages give: is the drive in V and taken as mV, 1e3 too small, or the displacement "
            "1e3 too large?"
        ]
    least = LOWEST_GAIN_OF_COMMAND if swing <= COMMAND_VOLTS else LOWEST_GAIN
    if gain < least or stroke < SHORTEST:
        factor = min((1e3, 1e6), key=lambda f: abs(math.log(stroke * f / USUAL)))
        taken = {1e3: "um taken as nm", 1e6: "um taken as pm"}[factor]
        return [
            f"{_length(stroke)} under {swing:.4g} V are {1e9 * gain:.3g} nm/V, less than piezo "
            f"stages give: is the unit of the displacement right? It would be "
            f"{_length(stroke * factor)} if it is {_power(factor)} too small, as {taken}"
        ]
    return []


def _periods(data: Dataset) -> list[str]:
    """Remark on a drive that does not go round once."""
    u = data.u
    if _steps(u):
        return []
    turning = len(_turns(u))
    if turning == 0 and not _turns(data.full.u):
        if _turns(data.y):
            return []
        return ["the drive never reverses: this record says nothing of hysteresis"]
    open_end = abs(float(u[-1] - u[0])) > CLOSED * np.ptp(u)
    if turning <= 1 and open_end:
        return [
            f"the window, {data.duration:.4g} s, is shorter than a period of the drive, which "
            f"goes from {u[0]:.4g} to {u[-1]:.4g} {data.drive_unit}: the loop is not closed, and "
            "a fit to a part of it may not hold for the rest"
        ]
    return []


def _clipping(data: Dataset) -> list[str]:
    """Remark on a drive or a displacement that is cut off at its end."""
    u, y = data.u, data.y
    remarks = []
    swing, moves = float(np.ptp(u)), np.abs(np.diff(u))
    quick = float(np.quantile(moves, 0.9))
    still = moves <= 1e-4 * swing
    # A drive that rests in between as well, as a staircase does, rests on purpose.
    rests = float(
        np.mean(
            still
            & (np.abs(u[1:] - u.min()) > 0.005 * swing)
            & (np.abs(u[1:] - u.max()) > 0.005 * swing)
        )
    )
    for end, level in (("highest", float(u.max())), ("lowest", float(u.min()))):
        runs = [
            (first, last)
            for first, last in _runs(np.abs(u - level) <= 0.005 * swing)
            if last - first >= 5 and _cut_off(moves, first, last, quick, swing)
        ]
        share = sum(last - first for first, last in runs) / u.size
        if share >= CLIPPED and rests < 0.1 * share:
            remarks.append(
                f"the drive is cut off at {level:.4g} {data.drive_unit}, its {end}, for "
                f"{100 * share:.0f} % of the window: was it clipped? While it stands still, "
                "it tells nothing of hysteresis"
            )
    for level in (float(y.max()), float(y.min())):
        for first, last in _runs(np.abs(y - level) <= 1e-3 * data.stroke):
            part = u[first:last]
            ends = part[[0, -1]]
            further = max(float(part.max() - ends.max()), float(ends.min() - part.min()))
            if last - first >= 10 and further > TURN * swing:
                remarks.append(
                    f"the displacement stays at {_length(level)} while the drive goes "
                    f"{further:.3g} {data.drive_unit} further and back: is the sensor or the "
                    "stage at its end?"
                )
                break
    return remarks


def _cut_off(moves: Array, first: int, last: int, quick: float, swing: float) -> bool:
    """Whether a drive that stands still from `first` to `last` was moving up to there."""
    if first < 4:
        return False
    into = moves[first - 4 : first]
    return bool(into[:3].mean() >= 0.25 * quick and into.max() <= 0.1 * swing and last > first)


def _runs(mask: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and behind-the-last sample of each stretch where a mask holds."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _length(metres: float) -> str:
    """Write a length in the unit in which it is easy to read."""
    size = abs(metres)
    if size >= 1.0:
        return f"{metres:.4g} m"
    if size < 1e-9:
        return f"{1e12 * metres:.4g} pm"
    unit, scale = best_length_unit(metres)
    return f"{scale * metres:.4g} {unit}"


def _power(factor: float) -> str:
    return f"1e{round(math.log10(factor))}"
