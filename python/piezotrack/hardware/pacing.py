"""Play sample by sample, on the computer's clock: for devices that have no buffer of their own."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .. import _core
from .._support.arguments import finite, not_negative, positive
from .._support.arrays import signal_of
from ..errors import DeviceError, ParameterError
from .device import Exchanging, Record

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = ["RoundTrip", "play_paced", "round_trip"]

# How far behind its clock a play may fall before it is ended [s]: the drive would be another one.
BEHIND = 1.0


@dataclass(frozen=True)
class RoundTrip:
    """How long exchanges with a device took.

    Attributes
    ----------
    count : int
        Number of exchanges.
    median, p99, worst : float
        Times [s]: median, 99th percentile, largest.
    """

    count: int
    median: float
    p99: float
    worst: float

    @classmethod
    def of(cls, times: Sequence[float]) -> RoundTrip:
        """Summarise times [s]."""
        median, p99 = np.percentile(np.asarray(times), [50.0, 99.0])
        return cls(len(times), float(median), float(p99), float(max(times)))

    def __str__(self) -> str:
        return (
            f"round trip {1e3 * self.median:.3g} ms median, {1e3 * self.p99:.3g} ms 99 %, "
            f"{1e3 * self.worst:.3g} ms worst of {self.count}"
        )


def round_trip(device: Exchanging, volts: float, count: int = 1000) -> RoundTrip:
    """Measure how long an exchange with a device takes, at a constant voltage.

    Parameters
    ----------
    device : Exchanging
        The device.
    volts : float
        Voltage that it puts out meanwhile and afterwards [V].
    count : int, optional
        Number of exchanges.

    Returns
    -------
    RoundTrip
        Median, 99th percentile and worst; ``print`` shows them.

    Raises
    ------
    ParameterError
        The device cannot be asked sample by sample.
    DeviceError
        An exchange failed.

    Examples
    --------
    >>> import piezotrack as pt
    >>> pt.hardware.round_trip(pt.hardware.connect("virtual:"), 0.0, count=10).count
    10
    """
    if not isinstance(device, Exchanging):
        raise ParameterError(
            "device",
            f"{type(device).__name__}, without exchange",
            "a piezotrack.hardware.Exchanging",
        )
    volts, times = finite("volts", volts, "V"), []
    for _ in range(_core.as_count("count", count)):
        before = time.perf_counter()
        device.exchange(volts)
        times.append(time.perf_counter() - before)
    return RoundTrip.of(times)


def play_paced(
    exchange: Callable[[float], float],
    volts: Array,
    rate: float,
    *,
    lead_in: float = 0.0,
    channels: tuple[str, ...] = ("device",),
    clock: Callable[[], float] = time.perf_counter,
    sleep: Callable[[float], None] = time.sleep,
) -> Record:
    """Play a table by exchanges, paced by the computer: a `Device.play` for slow drives.

    Parameters
    ----------
    exchange : callable
        As `Exchanging.exchange`: puts out a voltage [V], returns a reading [m].
    volts : ndarray, shape (n,)
        Table [V].
    rate : float
        Sampling rate [Hz].
    lead_in : float, optional
        How long the first voltage is held before the record begins [s].
    channels : tuple of str, optional
        Names of output and input.
    clock, sleep : callable, optional
        Time [s] and how to wait, default those of the computer.

    Returns
    -------
    Record
        NaN where an exchange began more than half an interval late; the notes say how many, and
        the round trip.

    Raises
    ------
    DeviceError
        It falls behind its clock by more than a second: the rate is too high for the device.

    Examples
    --------
    >>> import piezotrack as pt
    >>> device = pt.hardware.connect("virtual:")
    >>> record = pt.hardware.play_paced(device.exchange, [0.0, 1.0, 2.0], 100.0)
    >>> record.volts
    array([0., 1., 2.])
    """
    table, rate = signal_of("volts", volts), positive("rate", rate, "Hz")
    readings = np.full(table.size, np.nan)
    times: list[float] = []
    exchange(float(table[0]))
    sleep(not_negative("lead_in", lead_in, "s"))
    start, worst, delayed = clock(), 0.0, 0
    for k, voltage in enumerate(table):
        due = start + k / rate
        if (wait := due - clock()) > 0.0:
            sleep(wait)
        began = clock()
        late = began - due
        if late > BEHIND:
            trip = RoundTrip.of(times or [late])
            raise DeviceError(
                f"{channels[0]} is {late:.3g} s behind after {k} samples at {rate:g} Hz, {trip}: "
                "expected a lower rate, or a device with a buffer"
            )
        worst = max(worst, late)
        reading = exchange(float(voltage))
        times.append(clock() - began)
        if late <= 0.5 / rate:
            readings[k] = reading
        else:
            delayed += 1
    note = f"paced by the computer: {1e3 * worst:.3g} ms late at worst, {RoundTrip.of(times)}"
    if delayed:
        note += f"; {delayed} samples more than half an interval late, without a reading"
    return Record(volts=table, displacement=readings, rate=rate, channels=channels, notes=(note,))
