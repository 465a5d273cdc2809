"""Options of the commands that use a device, and its connection."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from collections.abc import Iterator

    from ..hardware.device import Device

__all__ = ["DeviceAddress", "Rest", "connected"]

DeviceAddress = Annotated[
    str,
    typer.Option(
        metavar="ADDRESS",
        help="Device: gcs://HOST, scpi://HOST:PORT?unit=um&limits=0..75V, "
        "ni:Dev1/ao0,Dev1/ai0?scale=10um/V&limits=0..7.5V, virtual: or virtual:MODEL.json.",
    ),
]
Rest = Annotated[
    float | None,
    typer.Option(
        help="Voltage before and after in V; default 0, or the limit nearest to it.",
        show_default=False,
    ),
]


@contextmanager
def connected(address: str) -> Iterator[Device]:
    """Connect to a device, and give the connection back at the end."""
    from ..hardware.addresses import connect

    device = connect(address)
    try:
        yield device
    finally:
        device.close()
