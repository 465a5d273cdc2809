"""Devices by their addresses, as the command line takes them."""

from __future__ import annotations

from importlib.metadata import entry_points
from typing import TYPE_CHECKING
from urllib.parse import parse_qsl, urlsplit

from .._support.messages import quoted
from ..errors import ParameterError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoints

    from .device import Device

__all__ = ["connect", "schemes"]

# Entry points, of this package and of others: name is the scheme of an address, value a function
# `from_address(host, port, path, options)` that returns a device.
GROUP = "piezotrack.devices"
OWN = "piezotrack"


def schemes() -> list[str]:
    """List the schemes of the addresses that can be connected to, those of the package first."""
    names = sorted((entry.module.partition(".")[0] != OWN, entry.name) for entry in _entries())
    return list(dict.fromkeys(name for _, name in names))


def connect(address: str) -> Device:
    """Connect to a device by its address.

    Parameters
    ----------
    address : str
        ``SCHEME:REST``; other packages add schemes by the entry point ``piezotrack.devices``.
        ``virtual:`` is the stage of Xu and Li 2010, ``virtual:MODEL.json`` an
        identified one in the displacements of its record, ``virtual:MODEL.json?zero`` in those that
        begin at 0; ``gcs://HOST[:PORT][/AXIS]``: a controller that speaks GCS, port 50000 and
        axis 1 where they are not given; ``?limits=0..100V``, ``factor=1V`` and ``timeout=5s`` as
        of `GcsDevice`; ``ni:Dev1/ao0,Dev1/ai0?scale=10um/V&limits=0..7.5V`` as
        `NiDevice`; ``scpi://HOST:PORT?unit=um&limits=0..75V`` as `ScpiDevice`;
        ``firmware://HOST[:PORT]``, port 5555 where it is not given, or
        ``firmware:///dev/PORT[?baud=115200]``, as `FirmwareDevice`.

    Returns
    -------
    Device
        The device; ``close`` it at the end.

    Raises
    ------
    ParameterError
        The address cannot be parsed.
    DeviceError
        Nobody answers.

    Examples
    --------
    >>> import piezotrack as pt
    >>> pt.hardware.connect("virtual:").limits
    (0.0, 75.0)
    """
    known = ", ".join(f"{name}:..." for name in schemes())
    if not isinstance(address, str):
        raise ParameterError("device", quoted(address), f"an address, one of {known}")
    try:
        parts = urlsplit(address)
        host, port = parts.hostname, parts.port
    except ValueError as error:
        raise ParameterError("device", quoted(address), f"an address ({error})") from None
    named = [entry for entry in _entries() if entry.name == parts.scheme]
    if not named:
        # A controller at a serial port or USB has no scheme of its own.
        port_of = "; serial ports and USB are not supported" if _is_port(address) else ""
        raise ParameterError("device", quoted(address), f"an address, one of {known}{port_of}")
    options = dict(parse_qsl(parts.query, keep_blank_values=True))
    # No other package replaces a scheme of this one.
    entry = min(named, key=lambda entry: (entry.module.partition(".")[0] != OWN, entry.value))
    device: Device = entry.load()(host, port, parts.path, options)
    return device


def _is_port(address: str) -> bool:
    """Whether an address is the name of a serial port or of a USB device."""
    return address.startswith("/dev/") or address.lower().startswith(("com", "usb", "asrl"))


def _entries() -> EntryPoints:
    return entry_points(group=GROUP)
