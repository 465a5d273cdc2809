"""Connections to devices, and what is kept of a run that a fault ends."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from ..errors import Interrupted, PiezotrackError
from .process.interruption import acknowledge_interrupt

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from ..errors import DataError, DeviceError
    from ..hardware.device import Device

__all__ = ["connected", "with_what_is_kept"]


def with_what_is_kept(
    error: DeviceError | DataError | Interrupted, what: str, write: Callable[[Any], str]
) -> BaseException:
    """Write what an error has of a run, and return an error that says where it is.

    `write` writes what is `partial`, and returns the words that follow the error's own; `what` was
    done, for words where it cannot be written.
    """
    if isinstance(error, Interrupted):
        acknowledge_interrupt()
    if error.partial is None:
        return error
    try:
        kept = write(error.partial)
    except (PiezotrackError, OSError) as failed:
        # Where the output may be is said first.
        kept = f"what was {what} is lost: {failed}"
    words = f"{error}; {kept}"
    return KeyboardInterrupt(words) if isinstance(error, Interrupted) else type(error)(words)


@contextmanager
def connected(address: str) -> Iterator[Device]:
    """Connect to a device, and give the connection back at the end."""
    from ..hardware.addresses import connect

    device = connect(address)
    try:
        yield device
    finally:
        device.close()
