"""Tables that end early: the output goes to a safe voltage, whatever ended them."""

from __future__ import annotations

import math
import signal
import threading
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING

from ..errors import DeviceError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import FrameType

    from .device import Device

__all__ = ["lead", "led_back", "terminated", "to_rest"]

# Time that the way to a safe voltage takes [s], and between two of its steps.
RAMP, PAUSE = 0.5, 0.002


@contextmanager
def terminated() -> Iterator[None]:
    """Turn SIGTERM into KeyboardInterrupt meanwhile, where nobody else answers it."""
    main = threading.current_thread() is threading.main_thread()
    if not main or signal.getsignal(signal.SIGTERM) is not signal.SIG_DFL:
        yield
        return

    def stop(number: int, frame: FrameType | None) -> None:
        del number, frame
        raise KeyboardInterrupt

    signal.signal(signal.SIGTERM, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


@contextmanager
def led_back(device: Device, home: float) -> Iterator[None]:
    """Lead the output to a voltage [V] where what is played fails or is interrupted.

    In half a second where the device has `voltage`, that which is there [V]; in one step otherwise.
    """
    with terminated():
        try:
            yield
        except BaseException as error:
            _lead_back(device, home, error)
            raise


def _lead_back(device: Device, home: float, error: BaseException) -> None:
    try:
        to_rest(device, home)
        return
    # Where that does not work, or Ctrl-C comes again: at once.
    except (Exception, KeyboardInterrupt) as failed:
        problem: BaseException = failed
    # Twice: a connection may have to be made anew first.
    for _ in range(2):
        try:
            device.hold(home)
            return
        except (Exception, KeyboardInterrupt) as failed:
            problem = failed
    raise DeviceError(
        f"{_words(error)}; the output could not be led to {home:g} V ({_words(problem)}): it may "
        "be anywhere in the table"
    ) from error


def to_rest(device: Device, home: float) -> None:
    """Lead the output to a voltage [V] slowly, from that which the device says is there.

    In one step where it says none.
    """
    present = getattr(device, "voltage", math.nan)
    if isinstance(present, float) and math.isfinite(present):
        lead(device, present, home)
    else:
        device.hold(home)


def lead(device: Device, present: float, home: float) -> None:
    """Lead the output from one voltage to another [V] in half a second, as fast as it answers."""
    low, high = device.limits
    begin, begun = min(max(present, low), high), time.perf_counter()
    while (share := (time.perf_counter() - begun) / RAMP) < 1.0:
        # Between two voltages within the limits, whatever the rounding.
        device.hold(min(max(begin + (home - begin) * share, low), high))
        time.sleep(PAUSE)
    device.hold(home)


def _words(error: BaseException | None) -> str:
    return str(error) or "interrupted"
