"""Experiments: a drive out of a device, a log back."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .. import _core
from .._support.arguments import finite, in_range, not_negative, plain
from .._support.arrays import signal_of
from ..data.dataset import Dataset
from ..data.dataset_arguments import MIN_SAMPLES
from ..errors import DataError, DeviceError, ParameterError
from .device import Device, Record
from .excitations import Drive, parse_drive
from .safe_end import led_back

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]

__all__ = [
    "check_device",
    "check_table",
    "filled",
    "measure",
    "obtained_rate",
    "play_table",
    "ramped",
    "rest_of",
]

# Ramps from and to the rest [s].
RAMP = 0.5
# Largest share of samples without a reading that is filled in.
MOST_LOST = 0.01
# Longest time at rest before a record [s].
MOST_LEAD_IN = 3600.0


def check_device(device: object) -> None:
    """Raise ParameterError unless `device` has what the protocol asks for."""
    if isinstance(device, Device):
        return
    wanted = ("limits", "rates", "memory", "channels", "play", "hold", "close")
    missing = [name for name in wanted if not hasattr(device, name)]
    raise ParameterError(
        "device",
        f"{type(device).__name__}, without {', '.join(missing)}",
        "a piezotrack.hardware.Device",
    )


def check_table(device: Device, name: str, volts: Array) -> None:
    """Raise ParameterError where a table is beyond what a device takes: before it gets it."""
    low, high = device.limits
    beyond = np.flatnonzero(~((volts >= low) & (volts <= high)))
    if beyond.size:
        k = int(beyond[0])
        raise ParameterError(
            name,
            f"{volts[k]:g} V at sample {k}",
            f"{low:g} to {high:g} V, the limits of {device.channels[0]}",
        )
    _check_count(device, name, volts.size)


def _check_count(device: Device, name: str, count: int) -> None:
    if count > device.memory:
        raise ParameterError(
            name,
            f"{count} samples",
            f"at most {device.memory}, the memory of {device.channels[0]}; a lower rate or a "
            "shorter drive fits",
            verb="has",
        )


def obtained_rate(device: Device, rate: float) -> tuple[float, tuple[str, ...]]:
    """Return the rate [Hz] at which a device plays, and a note where it is not the one asked."""
    near = device.rates.nearest(rate)
    if abs(near - rate) <= 1e-9 * rate:
        return near, ()
    return near, (f"rate: {near:.7g} Hz, requested {rate:.7g} Hz",)


def play_table(device: Device, volts: Array, rate: float, lead_in: float = 0.0) -> Record:
    """Play a checked table, and check that what comes back belongs to it."""
    record = device.play(volts, rate, lead_in=lead_in)
    if not isinstance(record, Record):
        raise DeviceError(
            f"{type(device).__name__}.play returned {type(record).__name__}: expected a "
            "piezotrack.hardware.Record"
        )
    if record.volts.size != volts.size:
        raise DeviceError(
            f"{device.channels[0]} recorded {record.volts.size} samples: expected {volts.size}, as "
            "many as the table has"
        )
    if abs(record.rate - rate) > 1e-6 * rate:
        raise DeviceError(
            f"{device.channels[0]} played at {record.rate:.7g} Hz: expected {rate:.7g} Hz, which "
            "its rates promise"
        )
    return record


def filled(record: Record) -> tuple[Array, tuple[str, ...]]:
    """Return the readings [m], a few lost ones filled in, and what a person should know."""
    notes = list(record.notes)
    if record.delay > 0.0:
        notes.append(f"delay from output to input: {1e6 * record.delay:.4g} us, not taken away")
    y = record.displacement
    if record.lost == 0:
        return y, tuple(notes)
    known = np.flatnonzero(np.isfinite(y))
    if record.lost > MOST_LOST * y.size or known.size < 2:
        first = int(np.flatnonzero(~np.isfinite(y))[0])
        raise DataError(
            f"the record has {record.lost} of {y.size} samples without a reading, the first at "
            f"{first / record.rate:.6g} s: expected at most {100.0 * MOST_LOST:g} %"
        )
    notes.append(f"lost samples: {record.lost} of {y.size}, filled in linearly")
    return np.interp(np.arange(y.size), known, y[known]), tuple(notes)


def rest_of(device: Device, rest: float | None = None) -> float:
    """Return the voltage before and after an experiment [V]: 0 V, or the limit nearest to it."""
    low, high = device.limits
    home = min(max(0.0, low), high) if rest is None else finite("rest", rest, "V")
    check_table(device, "rest", np.array([home]))
    return home


def ramped(
    device: Device, name: str, volts: Array, rest: float, rate: float, ramp: float
) -> tuple[Array, int]:
    """Return a table that leads from rest to a drive and back [V], and where the drive begins.

    Raises
    ------
    ParameterError
        The table is beyond what the device takes.
    """
    if ramp * rate > device.memory:
        raise ParameterError(
            "ramp",
            f"{ramp:g} s",
            f"at most {device.memory / rate:g} s, which the memory of {device.channels[0]} holds",
        )
    count = max(2, round(ramp * rate))
    # The share of a smooth step: no jump of the acceleration excites a mode.
    s = np.arange(count) / count
    share = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    up, down = rest + (volts[0] - rest) * share, volts[-1] + (rest - volts[-1]) * share
    table = np.concatenate([up, volts, down, [rest]])
    check_table(device, f"{name} with its ramps", table)
    return table, count


def measure(
    device: Device,
    drive: Drive | str | ArrayLike,
    rate: float,
    *,
    rest: float | None = None,
    ramp: float = RAMP,
    lead_in: float = 0.0,
    clip: bool = False,
) -> Dataset:
    """Record a log of a stage: a drive goes out of a device, the displacement comes back.

    The output is led smoothly from `rest` to the drive and back, all in one table on the device's
    clock; it ends at `rest`, also where something fails, or Ctrl-C or SIGTERM comes.

    Parameters
    ----------
    device : Device
        The device.
    drive : Drive, str or array_like, shape (n,)
        Voltage as a function of time, its text as of `hardware.parse_drive`, or samples [V].
    rate : float
        Sampling rate [Hz]. Where the device rounds it, a function of time is sampled at the rate
        obtained; samples are refused.
    rest : float, optional
        Voltage before and after [V]; default 0 V, or the limit nearest to it.
    ramp : float, optional
        Length of the way from rest and back [s].
    lead_in : float, optional
        How long the output is held at rest before the record begins [s]; an hour at most.
    clip : bool, optional
        Whether a drive beyond the limits is clipped to them, before it reaches the device; refused
        by default. The log has the clipped voltage.

    Returns
    -------
    Dataset
        The drive and the displacement, held between samples (``"zoh"``), the way from rest as its
        warm-up. `notes` say the rate obtained, the delay and lost samples.

    Raises
    ------
    ParameterError
        The drive is beyond the limits or the memory, or a number is out of its range.
    DeviceError
        The device does not do what it was asked.
    DataError
        More than 1 % of the samples have no reading.

    Examples
    --------
    >>> import piezotrack as pt
    >>> device = pt.hardware.VirtualDevice(pt.VirtualStage.xu_li_2010(seed=1))
    >>> log = pt.measure(device, "decaying:1Hz,0..75V,6s", rate=500.0)
    >>> fit = pt.identify(log, "prandtl-ishlinskii")
    >>> print(f"{1e6 * fit.cost:.2f} um")
    0.10 um
    """
    check_device(device)
    rate = _core.as_number("rate", rate)
    obtained, notes = obtained_rate(device, rate)
    if isinstance(drive, str):
        drive = parse_drive(drive)
    if isinstance(drive, Drive):
        # Before gigabytes of samples are made.
        _check_count(device, "drive", drive.count(1.0 / obtained))
        volts = drive.sample(1.0 / obtained)
    elif notes:
        raise ParameterError(
            "rate",
            f"{rate:g} Hz",
            f"{obtained:.9g} Hz, which the device plays at, or a drive as a function of time",
        )
    else:
        volts = np.array(signal_of("drive", drive))
    if volts.size < MIN_SAMPLES:
        raise ParameterError(
            "drive", f"{volts.size} samples", f"at least {MIN_SAMPLES}", verb="has"
        )
    low, high = device.limits
    if _core.as_truth("clip", clip) and (beyond := int(np.sum((volts < low) | (volts > high)))):
        volts = np.clip(volts, low, high)
        notes = (*notes, f"drive: {beyond} samples clipped to {plain(low)} and {plain(high)} V")
    check_table(device, "drive", volts)
    home = rest_of(device, rest)
    lead_in = in_range("lead_in", lead_in, MOST_LEAD_IN, "s")
    table, first = ramped(device, "drive", volts, home, obtained, not_negative("ramp", ramp, "s"))
    with led_back(device, home):
        record = play_table(device, table, obtained, lead_in)
    y, more = filled(record)
    log = Dataset(
        u=record.volts,
        y=y,
        dt=1.0 / obtained,
        hold="zoh",
        source=" to ".join(device.channels),
        notes=(*notes, *more),
    )
    start = log.t[0] + (first - 0.5) / obtained
    return log[start : start + volts.size / obtained]
