"""A loop that this computer closes on a device, point by point, and that always ends safe."""

from __future__ import annotations

import math
import time
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from ...errors import DeviceError, Interrupted, ParameterError
from ...hardware.measuring import rest_of
from ...hardware.safe_end import lead, terminated
from ..loop.preconditions import check_period
from ..loop.run import Run
from ..loop.tracking import Tracking
from ..plant import plant_of_inverse
from .guard import Guard
from .latency import (
    check_exchanging,
    measure_latency,
    refuse_slow,
    wait_until,
)
from .playing import check_limits, shift_words

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from numpy.typing import NDArray

    from ...hardware.device import Device, Exchanging
    from ...references.reference import Reference
    from ..controller.controller import Controller
    from .latency import Latency

    Array = NDArray[np.float64]

__all__ = ["DeviceTracking", "track_on"]


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class DeviceTracking(Tracking):
    """A motion that was tracked on a device; the true displacement is the measured one.

    Attributes
    ----------
    latency : Latency
        Latency measured before the loop began.
    lateness : ndarray, shape (n,)
        Time from each tick until its voltage was out [s]; NaN where the tick was left out.
    """

    views: ClassVar[Mapping[str, str]] = {
        **Tracking.views,
        "summary": "control.views.tracking_text:device_tracking_text",
    }

    latency: Latency
    lateness: Array

    @property
    def overruns(self) -> int:
        """Ticks whose voltage was not out within their interval, those left out included."""
        return int(np.sum(~(self.lateness <= self.controller.dt)))


class _Log:
    """Samples of a loop along a run, as they come."""

    def __init__(self, run: Run) -> None:
        self.run, count = run, len(run.samples)
        self.rows = np.full((count, 7), np.nan)
        self.lateness = np.full(count, np.nan)
        self.done = 0

    def tracking(self, latency: Latency, note: str) -> DeviceTracking | None:
        """Return what was tracked up to now; a tick that was left out has the values before it."""
        n = self.done
        if n < 2:
            return None
        samples = self.run.samples
        kept = np.maximum.accumulate(np.where(np.isfinite(self.lateness[:n]), np.arange(n), 0))
        y, volts, feedforward, feedback, repetitive, error, saturated = self.rows[:n][kept].T
        t = samples.t[:n]
        return DeviceTracking(
            reference=self.run.reference,
            controller=self.run.controller,
            t=t,
            desired=samples.x[:n],
            measured=y,
            displacement=y,
            loop_error=error,
            voltage=volts,
            feedforward=feedforward,
            feedback=feedback,
            repetitive=repetitive,
            saturated=saturated > 0.5,
            fine_t=t,
            fine_displacement=y,
            fine_voltage=volts,
            note=note,
            latency=latency,
            lateness=self.lateness[:n].copy(),
        )


def track_on(
    driver: Device,
    controller: Controller,
    reference: Reference,
    *,
    safe: float | None = None,
    shift: float = 0.0,
    beyond_reach: bool = False,
    unstable: bool = False,
    injected: Array | None = None,
) -> DeviceTracking:
    """Close the loop of a controller on a device; `pt.track` calls it for a device.

    Parameters
    ----------
    driver : Device
        One with `exchange`.
    controller, reference, beyond_reach, unstable
        As of `pt.track`; reach and stability are checked on the model of the feedforward, with the
        latency measured.
    safe : float, optional
        Voltage before and after [V]; default 0 V, or the limit nearest to it.
    shift : float, optional
        What is subtracted from every reading [m].
    injected : ndarray, shape (n,), optional
        Voltage that is added to the feedforward at the samples [V].

    Returns
    -------
    DeviceTracking
        The motion and its metrics, with the lateness of each tick.

    Raises
    ------
    ParameterError
        A number is out of its range, or the device is too slow for the interval.
    DeviceError
        The device or the clock failed; the output is at `safe`, or the message says where it may
        be. Its `partial` is the run up to then.
    Interrupted
        Ctrl-C or SIGTERM came; the output is at `safe`. Its `partial` is the run up to then.
    """
    device = check_exchanging(driver)
    check_limits(device, controller)
    if controller.drive_unit != "V":
        raise ParameterError(
            "controller",
            f"in {controller.drive_unit}",
            "V, which a device puts out",
            verb="commands",
        )
    home = rest_of(device, safe)
    check_period(controller, reference)
    planned = Run(controller, reference, injected)
    volts, note = planned.feedforward
    log = _Log(planned)
    with terminated(), _safe_after(device, home, log):
        latency = measure_latency(device, controller.dt, rest=home)
        refuse_slow(latency, controller.dt)
        _check_model(planned, latency, beyond_reach=beyond_reach, unstable=unstable)
        notes = f"{note}; the loop closed on {device.channels[0]}{shift_words(shift)}"
        try:
            _run(device, volts, home, shift, log)
        except DeviceError as error:
            error.partial = log.tracking(latency, notes)
            raise
        except KeyboardInterrupt as error:
            part = log.tracking(latency, notes)
            raise Interrupted(str(error) or "the loop was interrupted", part) from None
    run = log.tracking(latency, notes)
    assert run is not None
    return run


def _check_model(run: Run, latency: Latency, *, beyond_reach: bool, unstable: bool) -> None:
    """Check what can be checked before: with the model of the feedforward, where there is one."""
    inverse = run.controller.feedforward
    if inverse is not None:
        plant = plant_of_inverse(inverse)
        run.check(plant, latency.p99, unstable=unstable, beyond_reach=beyond_reach)


def _run(device: Exchanging, feedforward: Array, home: float, shift: float, log: _Log) -> None:
    """Go from tick to tick by the absolute time; a tick that is over is left out."""
    controller = log.run.controller
    session, dt = controller.start(present=home), controller.dt
    low, high = controller.limits
    guard = Guard(session, dt, high - low)
    x, held = log.run.samples.x, home
    start = time.perf_counter() + dt
    for k in range(x.size):
        tick = start + k * dt
        late = time.perf_counter() - tick
        log.done = k + 1
        guard.tick(late, k * dt)
        if late > dt:
            continue
        wait_until(tick)
        y = _number(device.exchange(held)) - shift
        held = session.step(x[k], y, feedforward=feedforward[k])
        device.hold(held)
        log.lateness[k] = time.perf_counter() - tick
        last = session.last
        parts = (last.feedforward, last.feedback, last.repetitive, last.error, last.saturated)
        log.rows[k] = (y, held, *parts)
        guard.reading(y, held, k * dt)


def _number(reading: object) -> float:
    """Return a reading as a float; what is no number is no measurement."""
    return float(reading) if isinstance(reading, (int, float, np.floating)) else math.nan


@contextmanager
def _safe_after(device: Exchanging, home: float, log: _Log) -> Iterator[None]:
    """Lead the output to a voltage [V] at the end, however it comes to it."""
    try:
        yield
    except BaseException as error:
        _to_safe(device, home, log, error)
        raise
    _to_safe(device, home, log, None)


def _to_safe(device: Exchanging, home: float, log: _Log, error: BaseException | None) -> None:
    done = np.flatnonzero(np.isfinite(log.lateness))
    held = float(log.rows[done[-1], 1]) if done.size else home
    problem: Exception | None = None
    # Slowly, so that nothing is excited; at once where that does not work, or is interrupted.
    try:
        lead(device, held, home)
        return
    except KeyboardInterrupt:
        pass
    except Exception as failed:
        problem = failed
    try:
        device.hold(home)
        return
    except Exception as failed:
        problem = failed
    with suppress(Exception):
        device.close()
    first = f"{error}; " if error is not None else ""
    lost = DeviceError(
        f"{first}the output could not be led to {home:g} V ({problem}): it may still be at "
        f"{held:.4g} V"
    )
    lost.partial = getattr(error, "partial", None)
    raise lost from error
