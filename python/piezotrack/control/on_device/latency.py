"""How late a loop on this computer is: the time from a tick until the new voltage is out."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..._support.arrays import check_dt
from ...errors import ParameterError
from ...hardware.device import Exchanging
from ...hardware.measuring import check_device, rest_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = [
    "Latency",
    "check_exchanging",
    "latency_of",
    "measure_latency",
    "refuse_slow",
    "wait_until",
]

# Ticks of a measurement: enough that one in a hundred is among them, within some seconds.
TICKS, FEWEST, LONGEST = 300, 100, 2.0
# A sleep may end late by this much [s]: the rest of the way the clock is watched.
WATCHED = 3e-4
# Largest share of the interval that the 99th percentile may take.
MOST = 1.0 / 3.0


@dataclass(frozen=True, kw_only=True)
class Latency:
    """Times from the ticks of a clock until the voltages were out.

    Attributes
    ----------
    median, p99, worst : float
        Median, 99th percentile and largest [s].
    ticks : int
        How many there were.
    """

    median: float
    p99: float
    worst: float
    ticks: int

    def __str__(self) -> str:
        median, p99, worst = (1e3 * one for one in (self.median, self.p99, self.worst))
        return (
            f"median {median:.3g} ms, 99th percentile {p99:.3g} ms, worst {worst:.3g} ms of "
            f"{self.ticks} ticks"
        )


def latency_of(times: Array) -> Latency:
    """Return the figures of some times [s].

    Examples
    --------
    >>> import numpy as np
    >>> from piezotrack.control.on_device.latency import latency_of
    >>> print(latency_of(np.array([1e-4, 2e-4, 6e-4])))
    median 0.2 ms, 99th percentile 0.592 ms, worst 0.6 ms of 3 ticks
    """
    median, p99 = np.percentile(times, (50.0, 99.0))
    return Latency(median=float(median), p99=float(p99), worst=times.max().item(), ticks=times.size)


def refuse_slow(late: Latency, dt: float) -> None:
    """Raise ParameterError where the 99th percentile is above a third of an interval [s]."""
    if late.p99 > MOST * dt:
        slowest = late.p99 / MOST
        raise ParameterError(
            "dt of the controller",
            f"{1e3 * dt:.4g} ms",
            f"{1e3 * slowest:.3g} ms or more on this computer with this device, whose voltage "
            f"is late by {late}; a table (pt.play, pt.learn) goes out on the device's own clock",
        )


def wait_until(instant: float, clock: Callable[[], float] = time.perf_counter) -> None:
    """Return at an instant of a clock [s], or at once where it is over."""
    while (left := instant - clock()) > 0.0:
        if left > WATCHED:
            time.sleep(left - WATCHED)


def check_exchanging(device: object) -> Exchanging:
    """Return a device that reads sample by sample, or raise ParameterError."""
    check_device(device)
    if not isinstance(device, Exchanging):
        raise ParameterError(
            "device",
            f"{type(device).__name__}, which has no exchange",
            "one that reads sample by sample; pt.play and pt.learn need none",
        )
    return device


def measure_latency(device: Exchanging, dt: float, *, rest: float | None = None) -> Latency:
    """Measure how late a loop would be: exchanges at even ticks, the output at rest.

    Parameters
    ----------
    device : Device
        One with `exchange`.
    dt : float
        Interval of the ticks [s].
    rest : float, optional
        Voltage that is put out meanwhile [V]; default 0 V, or the limit nearest to it.

    Returns
    -------
    Latency
        From each tick until the voltage was out.

    Raises
    ------
    ParameterError
        The device has no `exchange`, or a number is out of its range.
    DeviceError
        The device does not answer.

    Examples
    --------
    >>> import piezotrack as pt
    >>> device = pt.hardware.connect("virtual:")
    >>> pt.control.measure_latency(device, 0.002).ticks
    300
    """
    device = check_exchanging(device)
    interval, volts = check_dt(dt), rest_of(device, rest)
    count = max(FEWEST, min(TICKS, math.ceil(LONGEST / interval)))
    times = []
    # Past the first exchange, which may open what the others use.
    device.exchange(volts)
    start = time.perf_counter()
    for k in range(1, count + 1):
        tick = start + k * interval
        wait_until(tick)
        device.exchange(volts)
        device.hold(volts)
        times.append(time.perf_counter() - tick)
    return latency_of(np.array(times))
