"""Devices by their addresses, as the command line takes them."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING
from urllib.parse import parse_qsl, urlsplit

from .._support.messages import quoted
from ..errors import ParameterError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from .device import Device

__all__ = ["SCHEMES", "connect"]

# Where each scheme is: a module with `from_address(host, port, path, options)`.
SCHEMES: Mapping[str, str] = {
    "ni": "ni",
    "scpi": "scpi",
    "virtual": "virtual",
    "gcs": "gcs.device",
}


def connect(address: str) -> Device:
    """Connect to a device by its address.

    Parameters
    ----------
    address : str
        ``SCHEME:REST``: ``virtual:`` is the stage of Xu and Li 2010, ``virtual:MODEL.json`` an
        identified one; ``gcs://HOST[:PORT][/AXIS]``: a controller that speaks GCS, port 50000 and
        axis 1 where they are not given; ``?limits=0..100V``, ``factor=1V`` and ``timeout=5s`` as
        of `GcsDevice`; ``ni:Dev1/ao0,Dev1/ai0?scale=10um/V&limits=0..7.5V`` as
        `NiDevice`; ``scpi://HOST:PORT?unit=um&limits=0..75V`` as `ScpiDevice`.

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
    known = ", ".join(f"{name}:..." for name in SCHEMES)
    if not isinstance(address, str):
        raise ParameterError(f"device is {quoted(address)}: expected an address, one of {known}")
    try:
        parts = urlsplit(address)
        host, port = parts.hostname, parts.port
    except ValueError as error:
        raise ParameterError(f"device is {quoted(address)}: {error}") from None
    if parts.scheme not in SCHEMES:
        raise ParameterError(f"device is {quoted(address)}: expected an address, one of {known}")
    options = dict(parse_qsl(parts.query, keep_blank_values=True))
    adapter = import_module(f".{SCHEMES[parts.scheme]}", __package__)
    device: Device = adapter.from_address(host, port, parts.path, options)
    return device
