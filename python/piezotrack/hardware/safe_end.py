"""Tables that end early: the output goes to a safe voltage, whatever ended them."""

from __future__ import annotations

import signal
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING

from ..errors import DeviceError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import FrameType

    from .device import Device

__all__ = ["led_back", "terminated"]


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
    """Put the output to a voltage [V] where what is played fails or is interrupted."""
    with terminated():
        try:
            yield
        except BaseException as error:
            _lead_back(device, home, error)
            raise


def _lead_back(device: Device, home: float, error: BaseException) -> None:
    problem: BaseException | None = None
    # Twice: a connection may have to be made anew first, and Ctrl-C may come again.
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


def _words(error: BaseException | None) -> str:
    return str(error) or "interrupted"
