"""``piezotrack serve``: a stage behind a protocol, behind converters, or as records of EPICS."""

from __future__ import annotations

import math
import threading
import time
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from ...errors import ParameterError
from ..command import Argument, Option, command, refuse_without_effect
from ..connection import connected
from ..options import Limits as LimitsOption
from ..options import OnDevice, of_voltage
from ..values import PLAIN

if TYPE_CHECKING:
    from collections.abc import Iterator
    from typing import TypeAlias

    from ...hardware.device import Device
    from ...hardware.virtual import VirtualDevice
    from ...stages.virtual import VirtualStage

    Limits: TypeAlias = tuple[float, float]
    # The address, and the limits [V].
    Served: TypeAlias = Iterator[tuple[str, Limits]]

__all__ = ["serve_command"]

PORTS = {"gcs": 50000, "scpi": 5025, "converters": 5556}
# Options of the other protocols.
OTHERS = {
    "gcs": (("prefix", "device"), "with gcs"),
    "scpi": (("prefix", "device", "abandoned"), "with scpi"),
    "converters": (("prefix", "device", "abandoned"), "with converters"),
    "epics": (
        ("host", "port", "abandoned"),
        "with epics, which listens where EPICS_CAS_INTF_ADDR_LIST and EPICS_CA_SERVER_PORT say",
    ),
}


@command()
def serve_command(
    protocol: Annotated[
        Literal["gcs", "scpi", "converters", "epics"],
        Argument(
            "gcs: PI's command set, over TCP; scpi: an instrument with messages as VOLT and MEAS?; "
            "converters: those of a firmware of `export`; epics: records over Channel Access",
            "PROTOCOL",
        ),
    ],
    model: Annotated[
        Path | None, Argument("Model file in JSON; default the stage of Xu and Li 2010", "MODEL")
    ] = None,
    limits: LimitsOption = None,
    host: Annotated[
        str, Option("Address to listen at; default 127.0.0.1, this computer alone", metavar="HOST")
    ] = "127.0.0.1",
    port: Annotated[
        int | None,
        Option("TCP port, 0 for any free one; default 50000, of scpi 5025, of converters 5556"),
    ] = None,
    speed: Annotated[
        float,
        Option("Speed relative to real time; inf: as fast as converters are answered", PLAIN),
    ] = 1.0,
    abandoned: Annotated[
        Literal["runs", "stops", "rests"],
        Option(
            "What a wave of gcs does whose client has gone: it runs on, as with a real controller, "
            "stops, or goes to rest at 0 V; default runs"
        ),
    ] = "runs",
    prefix: Annotated[
        str | None, Option("First part of the names of epics records, as LAB:STAGE", metavar="NAME")
    ] = None,
    device: OnDevice = None,
) -> None:
    """Simulate a controller over the network, or publish a device.

    Software that controls a stage can be tested against it. With epics --device a real device is
    published. It runs until Ctrl-C or SIGTERM.
    """
    refuse_without_effect(*OTHERS[protocol])
    if device is not None:
        refuse_without_effect(("model", "limits", "speed"), "with --device")
    if protocol == "epics":
        if prefix is None:
            raise ParameterError("--prefix", "missing", "the start of names, as LAB:STAGE")
        with _published(device, model, limits, speed) as one:
            _epics(one, prefix)
        return
    stage, within = _stage(model, limits)
    place = PORTS[protocol] if port is None else port
    servers = {"scpi": _scpi, "converters": _converters}
    serving = servers.get(protocol, partial(_gcs, abandoned=abandoned))
    with serving(stage, within, host, place, speed) as (address, (low, high)):
        print(f"listening from {low:g} to {high:g} V at {address}", flush=True)
        threading.Event().wait()


def _stage(
    model: Path | None, limits: tuple[float, float] | None
) -> tuple[VirtualStage, Limits | None]:
    """Return the virtual stage of the options, with its limits [V]; None for the amplifier's."""
    from ...hardware.virtual import virtual_stage

    stage, known = virtual_stage(model)
    within = known if limits is None else of_voltage("--limits", limits)
    if within is None and not all(map(math.isfinite, stage.amplifier.limits)):
        raise ParameterError(
            "--limits",
            f"not given, and {model} does not say with which voltages it was identified",
            "--limits LOW:HIGH",
        )
    return stage, within


def _timed(stage: VirtualStage, limits: Limits | None, speed: float) -> VirtualDevice:
    """Return a stage as a device whose time goes faster."""
    from ..._support.arguments import positive
    from ...hardware.virtual import VirtualDevice

    speed = positive("speed", speed, "times real time")
    return VirtualDevice(stage, limits=limits, clock=lambda: speed * time.monotonic())


@contextmanager
def _gcs(
    stage: VirtualStage,
    limits: Limits | None,
    host: str,
    port: int,
    speed: float,
    abandoned: Literal["runs", "stops", "rests"],
) -> Served:
    from ...adapters.simulators.gcs.server import GcsServer

    options: dict[str, Any] = {"host": host, "port": port, "speed": speed, "abandoned": abandoned}
    with GcsServer(stage, limits=limits, **options) as server:
        yield server.address, server.limits


@contextmanager
def _scpi(stage: VirtualStage, limits: Limits | None, host: str, port: int, speed: float) -> Served:
    from ...adapters.simulators.virtual_scpi import VirtualScpi

    device = _timed(stage, limits, speed)
    with VirtualScpi(device, host=host, port=port) as server:
        name, number = server.address
        low, high = device.limits
        yield f"scpi://{name}:{number}?unit=um&limits={low:g}..{high:g}V", device.limits


@contextmanager
def _converters(
    stage: VirtualStage, limits: Limits | None, host: str, port: int, speed: float
) -> Served:
    from ...adapters.simulators.converters import Converters

    with Converters(stage, host=host, port=port, speed=speed) as converters:
        name, number = converters.address
        yield f"converters://{name}:{number}", stage.amplifier.limits if limits is None else limits


@contextmanager
def _published(
    address: str | None, model: Path | None, limits: tuple[float, float] | None, speed: float
) -> Iterator[Device]:
    """Connect to the device of an address; without one make a virtual one of the options."""
    if address is None:
        yield _timed(*_stage(model, limits), speed)
        return
    with connected(address) as device:
        yield device


def _epics(device: Device, prefix: str) -> None:
    from ...adapters.epics import RECORDS, serve_epics

    low, high = device.limits
    records = ", ".join(f"{prefix}:{name}" for name in RECORDS)
    words = f"serving {records} of {device.channels[0]}, {low:g} to {high:g} V"
    serve_epics(device, prefix, ready=lambda: print(words, flush=True))
