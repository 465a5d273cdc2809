"""Flags of a record: what is unusual in it, and where."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from ..._support.arrays import runs
from ..._support.units import drive_text, length_text
from ..sensor_end import end_note
from .connections import unusual_connection
from .diagnostics import has_steps, turns
from .hum import hum_notes, quick_part

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from ..dataset import Dataset
    from .hum import Quick

    Array = NDArray[np.float64]

__all__ = ["RecordFlag", "record_flags", "record_warnings"]

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
# A displacement jumps where it changes from sample to sample by this share of its range, and by as
# many standard deviations of such changes, more than the drive explains; and stays there.
LEAP, UNLIKELY, STAYS = 0.01, 15.0, 0.7
# Changes beside it, and how large they are at most, as a share of it.
BESIDE, ALONE = 12, 0.3


class RecordFlag(NamedTuple):
    """Something unusual in a record.

    Attributes
    ----------
    kind : str
        "note" of the reader, "far" readings, "connection", "swapped" columns, "unit", "period",
        "clipped" drive, "end" of the sensor, "jump", or "hum" of the mains.
    note : str
        A sentence.
    spans : tuple of (float, float)
        First and last time of each place [s]; empty where it is the whole record.
    quick : Quick or None
        Spectrum in which the hum is, of "hum".
    """

    kind: Literal[
        "note", "far", "connection", "swapped", "unit", "period", "clipped", "end", "jump", "hum"
    ]
    note: str
    spans: tuple[tuple[float, float], ...] = ()
    quick: Quick | None = None


def record_flags(data: Dataset) -> list[RecordFlag]:
    """Look for what is unusual in a record, whatever the model.

    Parameters
    ----------
    data : Dataset
        The record.

    Returns
    -------
    list of RecordFlag
        None for a sound record.

    Examples
    --------
    >>> import numpy as np
    >>> import piezotrack as pt
    >>> t = np.arange(4000) / 1000.0
    >>> y = 1e-5 * np.sin(5.0 * t) + np.where(t > 2.5, 1e-6, 0.0)
    >>> flag, = record_flags(pt.Dataset(u=10.0 * np.sin(5.0 * t), y=y, t=t))
    >>> flag.kind, flag.spans
    ('jump', ((2.5, 2.501),))
    """
    whole = data.measured.without_faulty_readings()
    quick = quick_part(whole.u, whole.y, whole.dt)
    notes = hum_notes(quick.hum, "in the displacement")
    hum = [RecordFlag("hum", note, quick=quick) for note in notes]
    return [*_flags(data.measured), *hum]


def _flags(data: Dataset) -> list[RecordFlag]:
    """Return all flags but hum."""
    flags = [RecordFlag("note", note) for note in data.notes]
    if np.ptp(data.u) == 0.0 or np.ptp(data.y) == 0.0:
        return flags
    far = tuple((float(data.t[k]), float(data.t[k])) for k in np.flatnonzero(data.far))
    flags += [RecordFlag("far", note, far) for note in data.far_notes]
    whole = data.without_faulty_readings()
    jumps = [*_jumps(whole)]
    # A displacement that jumps lags or leads by chance.
    connection = None if jumps else unusual_connection(whole.u, whole.y)
    if connection is not None:
        kind: Literal["swapped", "connection"] = "swapped" if connection.swapped else "connection"
        flags.append(RecordFlag(kind, connection.note))
        if not connection.follows:
            return flags
    units = [*_units(whole), *_seldom(data)]
    flags += [RecordFlag("unit", note) for note in units]
    flags += [RecordFlag("period", note) for note in _periods(whole)]
    return [*flags, *_clipping(whole), *_at_end(data), *jumps]


def record_warnings(data: Dataset) -> list[str]:
    """Warnings about a record that do not depend on the model.

    Without hum, which a fit finds in its residual.

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
    return [flag.note for flag in _flags(data.measured)]


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
    if has_steps(u):
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


def _clipping(data: Dataset) -> Iterator[RecordFlag]:
    """Find where the drive is clipped."""
    u = data.u
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
            note = (
                f"the drive is cut off at {_drive(data, level)}, its {end}, for "
                f"{100 * share:.0f} % of the window: was it clipped? A constant drive "
                "does not determine the hysteresis"
            )
            yield RecordFlag("clipped", note, _at_times(data, held))


def _at_end(data: Dataset) -> Iterator[RecordFlag]:
    """Say where the sensor or the stage is at its end."""
    left_out = bool(data.at_end.any())
    for end in data.ends:
        note = end_note(end, data.drive_unit, left_out=left_out)
        yield RecordFlag("end", note, _at_times(data, end.spans))


def _cut_off(moves: Array, first: int, last: int, quick: float, swing: float) -> bool:
    """Whether a drive that is constant from `first` to `last` was moving before."""
    if first < 4:
        return False
    into = moves[first - 4 : first]
    return bool(into[:3].mean() >= 0.25 * quick and into.max() <= 0.1 * swing and last > first)


def _at_times(data: Dataset, spans: list[tuple[int, int]]) -> tuple[tuple[float, float], ...]:
    return tuple((float(data.t[a]), float(data.t[min(b, len(data)) - 1])) for a, b in spans)


def _jumps(data: Dataset) -> Iterator[RecordFlag]:
    """Find where the displacement jumps and stays, and the drive does not."""
    u, y = data.u, data.y
    if u.size < 10 * BESIDE or has_steps(u):
        return
    du, dy = np.diff(u), np.diff(y)
    left = dy - float(du @ dy) / float(du @ du) * du
    usual = 1.4826 * float(np.median(np.abs(left - np.median(left))))
    least = max(LEAP * data.stroke, UNLIKELY * usual)
    found = []
    for k in np.flatnonzero(np.abs(left) > least):
        # A single reading comes back, and a mode that rings goes on.
        around = left[max(k - BESIDE, 0) : k + BESIDE + 1]
        alone = np.sort(np.abs(around))[-2] < ALONE * abs(left[k])
        if alone and around.size > BESIDE and around.sum() / left[k] > STAYS:
            found.append((int(k), float(left[k])))
    if found:
        largest, size = max(found, key=lambda one: abs(one[1]))
        others = f", and at {len(found) - 1} more places" if len(found) > 1 else ""
        spans = tuple((float(data.t[k]), float(data.t[k + 1])) for k, _ in found)
        note = (
            f"the displacement jumps by {length_text(abs(size), 3)} at {data.t[largest + 1]:.6g} s"
            f"{others}, where the drive does not: did the sensor lose count, or was the stage "
            "touched?"
        )
        yield RecordFlag("jump", note, spans)


def _drive(data: Dataset, value: float, digits: int = 4) -> str:
    """Write a drive of a record with its unit."""
    return drive_text(value, data.drive_unit, digits)


def _power(factor: float) -> str:
    return f"1e{round(math.log10(factor))}"
