"""Excitations of an experiment: voltage as a function of time."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .._support.arguments import expect, finite, hertz, plain, positive
from .._support.arrays import check_dt
from .._support.messages import quoted
from ..data.reader import read_drive
from ..errors import ParameterError
from ..references.parse import Kind, made_from_text
from ..references.waveforms import chirp, multisine, sine, staircase, triangle

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from ..references.reference import Reference

    Array = NDArray[np.float64]

__all__ = ["Drive", "decaying", "parse_drive"]

# Periods of a drive where no duration is given; of one that decays, enough turns that each is
# crossed by the next at many voltages.
PERIODS, DECAY = 4.0, 12.0
# Displacement that stands for a volt in a waveform [m].
METRES_PER_VOLT = 1e-6
# Part of the range that the last turn of a decaying drive has.
LAST = 0.1
MOST_TURNS = 1e5


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Drive:
    """Voltage as a function of time; `decaying` and `parse_drive` make them.

    Parameters
    ----------
    name : str
        For messages.
    duration : float
        Length [s].
    at : callable
        Takes times [s], an array, and returns voltages [V] of the same shape.
    frequency : float, optional
        The highest that it has [Hz], of triangles that of the turns: `sample` refuses a sampling
        rate below twice of it.

    Examples
    --------
    >>> import numpy as np
    >>> import piezotrack as pt
    >>> pt.hardware.Drive(name="square", duration=2.0, at=lambda t: 5.0 * (np.sin(9.0 * t) > 0.0))
    Drive(square, 2 s)
    """

    name: str
    duration: float
    at: Callable[[Array], Array]
    frequency: float | None = None

    def __post_init__(self) -> None:
        expect("name", self.name, str, "a text")
        if not callable(self.at):
            raise ParameterError("at", quoted(self.at), "a function of times [s]")

    def __repr__(self) -> str:
        return f"Drive({self.name}, {plain(self.duration)} s)"

    def count(self, dt: float) -> int:
        """Return the number of samples at a sampling interval [s]."""
        return math.ceil(self.duration / check_dt(dt) - 1e-3)

    def sample(self, dt: float) -> Array:
        """Return the voltage at even instants [V], those with 0 <= t < `duration`.

        Parameters
        ----------
        dt : float
            Sampling interval [s].

        Returns
        -------
        ndarray, shape (n,)
            Voltage [V].

        Raises
        ------
        ParameterError
            The drive is faster than half the sampling rate: another motion would come out.
        """
        count = self.count(dt)
        if self.frequency is not None and 2.0 * self.frequency * dt > 1.0 + 1e-9:
            raise ParameterError(
                f"drive ({self.name})",
                f"up to {plain(self.frequency)} Hz",
                f"at most half the rate, {plain(0.5 / dt)} Hz",
                verb="goes",
            )
        volts = np.asarray(self.at(dt * np.arange(count, dtype=np.float64)), dtype=np.float64)
        return np.broadcast_to(volts, (count,)).copy()


def decaying(
    *,
    frequency: float,
    low: float,
    high: float,
    duration: float | None = None,
) -> Drive:
    r"""Go up and down in triangles whose range shrinks about its lowest voltage.

    The range of turn k of n falls evenly from all of it to a tenth: minor loops of every size are
    in the record, which is what thresholds and weights are determined by.

    Parameters
    ----------
    frequency : float
        Of the turns [Hz].
    low, high : float
        Lowest and highest voltage [V].
    duration : float, optional
        Length [s], default 12 periods; whole periods are made.

    Returns
    -------
    Drive
        It begins and ends at `low`.

    Raises
    ------
    ParameterError
        A number is out of its range.

    Examples
    --------
    >>> import piezotrack as pt
    >>> drive = pt.hardware.decaying(frequency=1.0, low=0.0, high=75.0)
    >>> drive, float(drive.sample(0.01).max())
    (Drive(decaying 1 Hz, 0 to 75 V, 12 s), 75.0)
    """
    frequency = hertz("frequency", frequency)
    bottom, top = finite("low", low, "V"), finite("high", high, "V")
    if not bottom < top:
        raise ParameterError("low", f"{bottom:g} V", f"less than high, {top:g} V")
    length = DECAY / frequency if duration is None else positive("duration", duration, "s")
    if not 1.0 <= length * frequency <= MOST_TURNS:
        raise ParameterError(
            "duration",
            f"{length:g} s",
            f"{1.0 / frequency:g} to {MOST_TURNS / frequency:g} s, 1 to {MOST_TURNS:g} periods",
        )
    turns = round(length * frequency)

    def at(t: Array) -> Array:
        turn = np.clip(t * frequency, 0.0, turns)
        whole = np.minimum(np.floor(turn), turns - 1)
        size = 1.0 - (1.0 - LAST) * whole / max(turns - 1, 1)
        volts: Array = bottom + (top - bottom) * size * (1.0 - np.abs(2.0 * (turn - whole) - 1.0))
        return volts

    name = f"decaying {plain(frequency)} Hz, {plain(bottom)} to {plain(top)} V"
    return Drive(name=name, duration=turns / frequency, at=at, frequency=frequency)


def _highest_frequency(others: dict[str, Any]) -> float | None:
    """Return the highest frequency among the arguments of a waveform, where it has one [Hz]."""
    several = others.get("frequencies", ())
    single = (others.get(key) for key in ("frequency", "start_frequency", "stop_frequency"))
    return max((one for one in (*several, *single) if one is not None), default=None)


def _named(word: str, others: dict[str, Any]) -> str:
    """Return the name of a waveform with its frequency, where it has one."""
    if "frequency" in others:
        return f"{word} {plain(others['frequency'])} Hz"
    if "stop_frequency" in others:
        ends = (others["start_frequency"], others["stop_frequency"])
        return f"{word} {plain(ends[0])} to {plain(ends[1])} Hz"
    return word


def _in_volts(waveform: Callable[..., Reference], word: str) -> Callable[..., Drive]:
    """Return a waveform of voltage, from one of displacement."""

    def make(*, low: float = math.nan, high: float = math.nan, **others: Any) -> Drive:
        if low >= high:
            raise ParameterError("low", f"{low:g} V", f"less than high, {high:g} V")
        if "levels" in others:
            others["levels"] = [METRES_PER_VOLT * one for one in others["levels"]]
        else:
            others |= {"low": METRES_PER_VOLT * low, "high": METRES_PER_VOLT * high}
        if "frequency" in others and others["frequency"] > 0.0:
            others.setdefault("duration", PERIODS / others["frequency"])
        reference = waveform(**others)
        highest = _highest_frequency(others)
        ends = (reference.low / METRES_PER_VOLT, reference.high / METRES_PER_VOLT)
        return Drive(
            name=f"{_named(word, others)}, {plain(ends[0])} to {plain(ends[1])} V",
            duration=reference.duration,
            frequency=highest,
            at=lambda t: np.clip(reference.at(t)[0] / METRES_PER_VOLT, *ends),
        )

    return make


RANGE: dict[tuple[str, str], tuple[str, ...]] = {
    ("voltage", ".."): ("low", "high"),
    ("time", ""): ("duration",),
}
PERIODIC: dict[tuple[str, str], tuple[str, ...]] = {("frequency", ""): ("frequency",), **RANGE}
EXCITATIONS = {
    "decaying": Kind(
        decaying,
        "decaying:FREQUENCY,LOW..HIGH[,DURATION]",
        "decaying:1Hz,0..75V",
        PERIODIC,
        {},
        ("frequency", "low"),
    ),
    "sine": Kind(
        _in_volts(sine, "sine"),
        "sine:FREQUENCY,LOW..HIGH[,DURATION][,phase=ANGLE][,ramp=TIME]",
        "sine:0.5Hz,0..75V",
        PERIODIC,
        {"phase": "angle", "ramp": "time"},
        ("frequency", "low"),
    ),
    "triangle": Kind(
        _in_volts(triangle, "triangle"),
        "triangle:FREQUENCY,LOW..HIGH[,DURATION][,rounding=SHARE][,ramp=TIME]",
        "triangle:0.5Hz,0..75V",
        PERIODIC,
        {"rounding": "number", "ramp": "time"},
        ("frequency", "low"),
    ),
    "chirp": Kind(
        _in_volts(chirp, "chirp"),
        "chirp:START..STOP,LOW..HIGH,DURATION[,ramp=TIME]",
        "chirp:0.1..50Hz,20..50V,20s",
        {("frequency", ".."): ("start_frequency", "stop_frequency"), **RANGE},
        {"ramp": "time"},
        ("start_frequency", "low", "duration"),
    ),
    "multisine": Kind(
        _in_volts(multisine, "multisine"),
        "multisine:FREQUENCY/FREQUENCY/...,LOW..HIGH,DURATION[,seed=NUMBER][,ramp=TIME]",
        "multisine:0.5/1.3/2.7Hz,0..75V,20s",
        {("frequency", "/"): ("frequencies",), **PERIODIC, ("frequency", ""): ("frequencies",)},
        {"seed": "number", "ramp": "time"},
        ("frequencies", "low", "duration"),
    ),
    "staircase": Kind(
        _in_volts(staircase, "staircase"),
        "staircase:STEPS,LOW..HIGH,dwell=TIME[,rise=TIME][,DURATION]",
        "staircase:5,0..75V,dwell=1s",
        {("number", ""): ("steps",), **RANGE},
        {"levels": "voltage", "dwell": "time", "rise": "time"},
        ("dwell",),
    ),
}


def parse_drive(text: str, *, duration: float | None = None) -> Drive:
    r"""Make a drive from a text, as the command line takes it.

    ============================== =========================================================
    ``decaying:1Hz,0..75V``        triangles whose range shrinks; optional duration
    ``sine:0.5Hz,0..75V``          frequency, lowest and highest voltage; optional duration,
                                   ``phase=90deg``, ``ramp=1s``
    ``triangle:0.5Hz,0..75V``      the same; optional ``rounding=0.2``
    ``chirp:0.1..50Hz,0..75V,20s`` first and last frequency, range, duration
    ``staircase:5,0..75V``         number of steps up, range, and ``dwell=1s``
    ``multisine:1/3Hz,0..75V,9s``  frequencies, range, duration; optional ``seed=1``
    ``drive.csv``                  a file, as `piezotrack.data.read_drive` takes it
    ============================== =========================================================

    Parameters
    ----------
    text : str
        The kind and its items; the unit of voltages is V, mV or kV.
    duration : float, optional
        Length [s], where `text` has none.

    Returns
    -------
    Drive
        Voltage as a function of time.

    Raises
    ------
    ParameterError
        The text cannot be parsed, or a value cannot be used. The message shows the expected form.

    Examples
    --------
    >>> import piezotrack as pt
    >>> pt.hardware.parse_drive("sine:0.5Hz,0..75V")
    Drive(sine 0.5 Hz, 0 to 75 V, 8 s)
    """
    drive: Drive = made_from_text("drive", text, EXCITATIONS, _recorded, duration)
    return drive


def _recorded(path: str, *, duration: float | None = None) -> Drive:
    """Return the drive in a file, linear between its samples."""
    t, u = read_drive(path)
    length = float(t[-1] - t[0]) if duration is None else positive("duration", duration, "s")
    return Drive(
        name=Path(path).name, duration=length, at=lambda at: np.interp(at, np.asarray(t) - t[0], u)
    )
