"""Features of a record that decide which models it can determine."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from ..._support.arrays import MOST_SAMPLES, runs
from ..._support.statistics import sample_noise
from ..._support.units import drive_text
from .diagnostics import jumps, turns

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = [
    "Determination",
    "DriveFeatures",
    "TimeFeatures",
    "determinations",
    "drive_features",
    "has_one_amplitude",
    "reversals_text",
    "time_features",
]

# A step in time longer than so many usual ones is a gap.
GAP = 1.5
# A drive rests where it stays within this share of its range for this share of a half cycle.
STILL, LONG = 2e-3, 0.25
SHORTEST_REST = 10
# Levels of reversals and half cycles that differ by less than this share of the range are one.
SAME = 0.02
# Share of the largest half cycle below which one is a small loop, and ratio of frequencies that
# tells a lag from hysteresis.
SMALL, DECADE = 0.5, 10.0
# Frequencies above this share of the sampling rate are not searched for modes.
HIGHEST = 0.45
# Times the noise that a motion has to be to show.
VISIBLE = 3.0


class Determination(NamedTuple):
    """Whether a record determines a property of the stage.

    Attributes
    ----------
    subject : {"record", "loop", "minor loops", "rate", "mode", "creep"}
        The property; ``"record"`` for what holds for all of them.
    verdict : {"yes", "partly", "no"}
        Whether the record determines it.
    text : str
        That in words, with numbers; it is what is printed.
    """

    subject: Literal["record", "loop", "minor loops", "rate", "mode", "creep"]
    verdict: Literal["yes", "partly", "no"]
    text: str

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True)
class TimeFeatures:
    """Sampling of a record.

    Attributes
    ----------
    samples : int
        Number of samples.
    begin, end : float
        Times of the first and the last one [s].
    interval : float
        Mean sampling interval without gaps [s].
    jitter : float
        Root mean square of the departure of the intervals from it, without gaps [s].
    gaps : tuple of (float, float, int)
        Time before each gap and behind it [s], and the number of samples that are missing there.
    backward : int
        Number of samples that are not later than the one before.
    """

    samples: int
    begin: float
    end: float
    interval: float
    jitter: float
    gaps: tuple[tuple[float, float, int], ...]
    backward: int


@dataclass(frozen=True)
class DriveFeatures:
    """Features of the drive of a record.

    Attributes
    ----------
    unit : str
        Unit of the drive, SI.
    low, high : float
        Range of the drive [unit].
    turns : int
        Number of reversals of more than 5 % of the range.
    levels : tuple of (float, int)
        Where it reverses [unit], and how often there.
    swings : tuple of (float, float)
        Smallest and largest change between two reversals [unit]; empty without two reversals.
    frequencies : tuple of (float, float)
        Lowest and highest frequency of its large cycles [Hz], those of half the largest change or
        more; empty without two reversals.
    rests : tuple of (float, float, float)
        Beginning, end [s] and drive [unit] of the times for which it stands.
    steps : bool
        Whether it jumps by a fifth of its range or more from sample to sample.
    mode_limit : float
        Natural frequency up to which a mode would show above the sensor's noise [Hz]; NaN where
        there is no displacement.
    """

    unit: str
    low: float
    high: float
    turns: int
    levels: tuple[tuple[float, int], ...]
    swings: tuple[float, ...]
    frequencies: tuple[float, ...]
    rests: tuple[tuple[float, float, float], ...]
    steps: bool
    mode_limit: float


def time_features(t: Array) -> TimeFeatures:
    """Describe the times of the samples.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Times [s], two or more.

    Returns
    -------
    TimeFeatures
        The sampling.

    Examples
    --------
    >>> import numpy as np
    >>> time_features(np.array([0.0, 1.0, 2.0, 5.0, 6.0])).gaps
    ((2.0, 5.0, 2),)
    """
    intervals = np.diff(t)
    typical = float(np.median(intervals))
    far = intervals > GAP * typical
    near = intervals[~far & (intervals > 0.0)]
    gaps = tuple(
        (float(t[k]), float(t[k + 1]), _missing(float(intervals[k]) / typical))
        for k in np.flatnonzero(far)
        if typical > 0.0
    )
    # Of rounded times the median is that of the rounding.
    interval = float(np.mean(near)) if near.size else typical
    jitter = float(np.std(near)) if near.size else 0.0
    backward = int(np.sum(intervals <= 0.0))
    return TimeFeatures(t.size, float(t[0]), float(t[-1]), interval, jitter, gaps, backward)


def _missing(intervals: float) -> int:
    """Return how many samples are missing in a gap of so many intervals."""
    return max(1, round(min(intervals, MOST_SAMPLES)) - 1)


def drive_features(t: Array, u: Array, y: Array | None, unit: str) -> DriveFeatures:
    """Describe what a drive does.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Times [s].
    u : ndarray, shape (n,)
        Drive [unit].
    y : ndarray, shape (n,), or None
        Displacement [m].
    unit : str
        Unit of the drive, SI.

    Returns
    -------
    DriveFeatures
        Its reversals, rates and rests.
    """
    low, high = float(u.min()), float(u.max())
    swing = high - low
    places = turns(u) if swing > 0.0 else []
    between = np.abs(np.diff(u[places]))
    lasting = np.diff(t[places])
    large = (
        lasting[(between >= SMALL * between.max()) & (lasting > 0.0)] if between.size else lasting
    )
    steps = swing > 0.0 and jumps(u)
    return DriveFeatures(
        unit=unit,
        low=low,
        high=high,
        turns=len(places),
        levels=_levels(u[places], SAME * swing),
        swings=(float(between.min()), float(between.max())) if between.size else (),
        frequencies=(0.5 / float(large.max()), 0.5 / float(large.min())) if large.size else (),
        rests=_rests(t, u, places),
        steps=steps,
        mode_limit=_mode_limit(t, y, between / swing, lasting, steps),
    )


def _levels(values: Array, same: float) -> tuple[tuple[float, int], ...]:
    """Gather values that are nearly the same, lowest first."""
    ordered = np.sort(values)
    if not ordered.size:
        return ()
    parts = np.split(ordered, np.flatnonzero(np.diff(ordered) > same) + 1)
    return tuple((float(part.mean()), part.size) for part in parts)


def _rests(t: Array, u: Array, places: list[int]) -> tuple[tuple[float, float, float], ...]:
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    swing = float(np.ptp(u))
    half = float(np.median(np.diff(places))) if len(places) > 1 else float(u.size)
    width = max(SHORTEST_REST, round(LONG * half)) | 1
    if swing == 0.0 or width > u.size:
        return ()
    # A window in which the drive is still, around each sample; then all samples of such windows.
    middle = maximum_filter1d(u, width) - minimum_filter1d(u, width) <= STILL * swing
    middle[: width // 2] = middle[u.size - width // 2 :] = False
    still = maximum_filter1d(middle.astype(np.int8), width) > 0
    rests = []
    for first, last in runs(still):
        jumps = first + 1 + np.flatnonzero(np.abs(np.diff(u[first:last])) > STILL * swing)
        for begin, end in pairwise([first, *jumps.tolist(), last]):
            if end - begin >= width // 2:
                level = float(np.median(u[begin:end]))
                rests.append((float(t[begin]), float(t[end - 1]), level))
    return tuple(rests)


def _mode_limit(t: Array, y: Array | None, shares: Array, lasting: Array, steps: bool) -> float:
    """Return the natural frequency [Hz] up to which inertia moves the sensor visibly.

    At f Hz a mode of fn Hz changes a motion by (f/fn)^2 of it, which has to be more than the noise.
    """
    if y is None or t.size < 2:
        return math.nan
    interval = float(np.median(np.diff(t)))
    rate = 1.0 / interval if interval > 0.0 else math.nan
    if steps:
        return HIGHEST * rate
    if not shares.size or np.ptp(y) == 0.0:
        return 0.0
    noise = VISIBLE * sample_noise(y)
    with np.errstate(all="ignore"):
        motion = 0.5 * shares * float(np.ptp(y))
        limits = 0.5 / lasting * np.sqrt(motion / noise)
    known = limits[~np.isnan(limits)]
    return min(HIGHEST * rate, float(known.max())) if known.size else 0.0


def determinations(
    time: TimeFeatures, drive: DriveFeatures, stroke: float | None
) -> list[Determination]:
    """Return which properties of a stage a record determines.

    Parameters
    ----------
    time : TimeFeatures
        Its sampling.
    drive : DriveFeatures
        Its drive.
    stroke : float or None
        Range of the displacement [m]; None where there is none.

    Returns
    -------
    list of Determination
        One for each property, or one on the record where it determines none.
    """
    nothing = ""
    if stroke is None:
        nothing = "no displacement: a drive to simulate a model with (piezotrack simulate)"
    elif drive.high == drive.low:
        nothing = (
            f"the drive stands at {_drive(drive.high, drive)}: no model of the stage; the noise of "
            "the sensor (piezotrack noise)"
        )
    elif stroke == 0.0:
        nothing = "the displacement never changes: no model, is the sensor connected?"
    if nothing:
        return [Determination("record", "no", nothing)]
    return [
        *_of_time(time),
        _of_reversals(drive),
        *(_of_amplitudes(drive) if drive.turns >= 2 else []),
        *(_of_frequencies(drive, time) if drive.turns >= 2 and not drive.steps else []),
        _of_mode(time, drive),
        _of_rests(time, drive),
    ]


def has_one_amplitude(drive: DriveFeatures) -> bool:
    """Return whether all changes between two reversals are alike.

    Parameters
    ----------
    drive : DriveFeatures
        The drive.

    Returns
    -------
    bool
        False without two reversals.
    """
    return bool(drive.swings) and drive.swings[0] >= (1.0 - 2.0 * SAME) * drive.swings[1]


def _of_time(time: TimeFeatures) -> list[Determination]:
    if time.backward:
        words = f"the time does not increase at {time.backward} samples: no model before it does"
        return [Determination("record", "no", words)]
    if time.gaps or time.jitter > 0.05 * time.interval:
        words = (
            "the samples are not evenly spaced: read it with resample=, or with dt= where only the "
            "times are coarse"
        )
        return [Determination("record", "no", words)]
    return []


def _of_reversals(drive: DriveFeatures) -> Determination:
    if drive.turns >= 2:
        return Determination(
            "loop",
            "yes",
            f"the loop between {_drive(drive.low, drive)} and {_drive(drive.high, drive)}: any "
            "model of hysteresis",
        )
    if drive.turns == 1:
        return Determination(
            "loop",
            "partly",
            "one reversal: the loop is not closed, and a model of hysteresis may not hold for the "
            "part that is not there",
        )
    words = "no reversal: no hysteresis; the gain only"
    if drive.steps:
        words = "no reversal: no hysteresis; gain, lag and mode from the step (piezotrack step)"
    return Determination("loop", "no", words)


def _of_amplitudes(drive: DriveFeatures) -> list[Determination]:
    least, most = drive.swings
    if has_one_amplitude(drive):
        words = f"one amplitude, {_drive(most, drive)}: minor loops are extrapolated from it"
        return [Determination("minor loops", "no", words)]
    between = f"amplitudes from {_drive(least, drive)} to {_drive(most, drive)}"
    if least > SMALL * most:
        words = f"{between} only: smaller loops are not in it"
        return [Determination("minor loops", "partly", words)]
    words = f"{between}: smaller loops too, models of plays (prandtl-ishlinskii) in full"
    return [Determination("minor loops", "yes", words)]


def _of_frequencies(drive: DriveFeatures, time: TimeFeatures) -> list[Determination]:
    if not drive.frequencies:
        return []
    least, most = drive.frequencies
    if most < 2.0 * least:
        # A rest shows creep.
        what = "lag, delay" if _longest_rest(time, drive) else "lag, delay, creep"
        words = f"one rate, {most:.3g} Hz: {what} and hysteresis cannot be distinguished"
        return [Determination("rate", "no", words)]
    apart = most >= DECADE * least
    known = "lag and delay can" if apart else "a lag can partly"
    words = f"rates from {least:.3g} Hz to {most:.3g} Hz: {known} be distinguished from hysteresis"
    return [Determination("rate", "yes" if apart else "partly", words)]


def _of_mode(time: TimeFeatures, drive: DriveFeatures) -> Determination:
    rate = 1.0 / time.interval if time.interval > 0.0 else math.nan
    limit = f"{drive.mode_limit:.3g} Hz"
    if drive.steps:
        words = f"steps: a mode up to {limit}, 0.45 of the sampling rate"
        return Determination("mode", "yes", words)
    if drive.mode_limit >= HIGHEST * rate * (1.0 - 1e-9):
        words = f"fast enough for a mode up to {limit}, 0.45 of the sampling rate"
        return Determination("mode", "yes", words)
    if drive.mode_limit == 0.0:
        words = "too slow for a mode: record steps or a chirp through it"
        return Determination("mode", "no", words)
    words = f"a mode up to about {limit} would show above the noise; for a higher one record steps"
    return Determination("mode", "partly", words)


def _of_rests(time: TimeFeatures, drive: DriveFeatures) -> Determination:
    longest = _longest_rest(time, drive)
    if not longest:
        words = (
            "no rests after the first motion: creep and hysteresis cannot be distinguished; record "
            "a step and a hold of minutes"
        )
        return Determination("creep", "no", words)
    words = f"the drive rests for up to {longest:.3g} s: creep with time constants up to that"
    return Determination("creep", "yes", words)


def _longest_rest(time: TimeFeatures, drive: DriveFeatures) -> float:
    """Return the longest rest after the first motion [s]; 0 where there is none."""
    # Before it there is nothing to creep after.
    return max((stop - start for start, stop, _ in drive.rests if start > time.begin), default=0.0)


def _drive(value: float, drive: DriveFeatures) -> str:
    return drive_text(value, drive.unit, 4)


def reversals_text(drive: DriveFeatures) -> str:
    """Write how often a drive reverses, and where."""
    if not drive.turns:
        return "never"
    shown = [f"{count} at {_drive(level, drive)}" for level, count in drive.levels[:6]]
    more = len(drive.levels) - len(shown)
    return f"{drive.turns}: {', '.join(shown)}" + (f" and {more} more levels" if more else "")
