"""Readings where the sensor or the stage is at its end: the drive goes on, and they do not."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from .._support.arrays import runs
from .._support.statistics import sample_noise
from .._support.units import drive_text, length_text

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Mask = NDArray[np.bool_]

__all__ = ["SensorEnd", "end_mask", "end_note", "sensor_ends"]

# Readings beside each other, at least; how far they may lie from the outermost one, as a share of
# the stroke and in standard deviations of the noise; and how far the drive goes further and back,
# as a share of its range and in such distances.
FEWEST, SHARE, NOISES, FURTHER, DISTANCES = 10, 1e-3, 8.0, 0.05, 3.0
# How far its mean lies above that of as many samples before, and after, as a share of that: a
# quick drive that the stage does not follow goes to and fro.
RISEN = 0.3
# Readings that are equal: how far the drive goes further, in its range and in steps of the sensor.
FURTHER_EQUAL, STEPS = 0.01, 4.0
# Readings that differ by noise, as a share of the stroke, are not equal by chance, whatever the
# drive does.
NOISY = 1e-6
# Most of the readings that may lie there.
MOST = 0.5


class SensorEnd(NamedTuple):
    """An end of the sensor or of the stage.

    Attributes
    ----------
    level : float
        Outermost reading [m].
    further : float
        How far the drive goes further and back while readings stay there, in its unit.
    mask : ndarray of bool, shape (n,)
        Readings there.
    spans : list of (int, int)
        First sample of each such motion of the drive, and that after its last.
    """

    level: float
    further: float
    mask: Mask
    spans: list[tuple[int, int]]


def sensor_ends(u: Array, y: Array) -> list[SensorEnd]:
    """Find the ends at which readings stay while the drive goes on and comes back.

    Parameters
    ----------
    u : ndarray, shape (n,)
        Drive [V].
    y : ndarray, shape (n,)
        Displacement [m].

    Returns
    -------
    list of SensorEnd
        Of the largest and of the smallest reading; none for a sound record.

    Examples
    --------
    >>> u = np.sin(np.arange(4000) / 300.0)
    >>> end, = sensor_ends(u, np.minimum(1e-5 * u, 9e-6))
    >>> f"{1e6 * end.level:.1f} um, {end.further:.2f} V"
    '9.0 um, 0.10 V'
    """
    swing, stroke = float(np.ptp(u)), float(np.ptp(y))
    if swing == 0.0 or stroke == 0.0:
        return []
    gain = stroke / swing
    # The drive goes on in the direction in which the displacement went.
    onward = 1.0 if float((u - u.mean()) @ y) >= 0.0 else -1.0
    steps = np.abs(np.diff(y))
    step, noise = float(steps[steps > 0.0].min()), sample_noise(y)
    near = max(SHARE * stroke, NOISES * noise)
    kinds = [
        (near, max(FURTHER * swing, DISTANCES * near / gain)),
        (0.0, max(FURTHER_EQUAL * swing, STEPS * step / gain)),
    ]
    if noise > max(step, NOISY * stroke):
        kinds.append((0.0, -math.inf))
    found = []
    for level, side in ((float(y.max()), onward), (float(y.min()), -onward)):
        for distance, least in kinds:
            spans, furthest = [], 0.0
            for first, last in runs(np.abs(y - level) <= distance):
                further, risen = _motion(side * u, first, last)
                goes_on = further > least and risen > RISEN * further
                if last - first >= FEWEST and (goes_on or least < 0.0):
                    spans.append((first, last))
                    furthest = max(furthest, further)
            if spans:
                mask = np.abs(y - level) <= max(distance, SHARE * stroke)
                found.append(SensorEnd(level, furthest, mask, spans))
                break
    return found


def _motion(u: Array, first: int, last: int) -> tuple[float, float]:
    """Return how far a drive goes beyond where it is at both ends of a run, and its mean there."""
    part, length = u[first:last], last - first
    further = float(part.max()) - float(max(part[0], part[-1]))
    beside = [
        one for one in (u[max(first - length, 0) : first], u[last : last + length]) if one.size
    ]
    level = max((float(one.mean()) for one in beside), default=-math.inf)
    return further, float(part.mean()) - level


def end_mask(ends: list[SensorEnd], count: int) -> Mask:
    """Return the readings at ends that are left out: none where they are most of a record.

    Parameters
    ----------
    ends : list of SensorEnd
        The ends.
    count : int
        Number of readings.

    Returns
    -------
    ndarray of bool, shape (count,)
        Where they are.
    """
    mask = np.zeros(count, dtype=np.bool_)
    for end in ends:
        mask |= end.mask
    return mask if mask.mean() <= MOST else np.zeros(count, dtype=np.bool_)


def end_note(end: SensorEnd, unit: str, *, left_out: bool) -> str:
    """Say where the sensor or the stage is at its end.

    Parameters
    ----------
    end : SensorEnd
        The end.
    unit : str
        Unit of the drive.
    left_out : bool
        Whether the readings there are left out.

    Returns
    -------
    str
        A sentence.

    Examples
    --------
    >>> u = np.sin(np.arange(4000) / 300.0)
    >>> end, = sensor_ends(u, np.minimum(1e-5 * u, 9e-6))
    >>> print(end_note(end, "V", left_out=True))
    the displacement stays at 9 um while the drive goes 0.101 V further and back: is the sensor or \
the stage at its end? 546 readings there are left out
    """
    fate = "are left out" if left_out else "are most of the record: all of them count"
    why = "without the noise of others"
    if end.further > 0.0:
        why = f"while the drive goes {drive_text(end.further, unit, 3)} further and back"
    return (
        f"the displacement stays at {length_text(end.level)} {why}: is the sensor or the stage at "
        f"its end? {int(end.mask.sum())} readings there {fate}"
    )
