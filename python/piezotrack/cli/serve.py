"""``piezotrack serve``: a virtual stage behind the protocol of a controller."""

from __future__ import annotations

import math
import threading
import time
from contextlib import contextmanager
from pathlib import Path  # noqa: TC003, which typer reads
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from ..errors import ParameterError
from .error_messages import in_words
from .options import number_range

if TYPE_CHECKING:
    from collections.abc import Iterator
    from typing import TypeAlias

    from ..stages.virtual import VirtualStage

    Limits: TypeAlias = tuple[float, float]
    # The address, and the limits [V].
    Served: TypeAlias = Iterator[tuple[str, Limits]]

__all__ = ["serve_command"]

PORTS = {"gcs": 50000, "scpi": 5025}


@in_words
def serve_command(
    protocol: Annotated[
        Literal["gcs", "scpi"],
        typer.Argument(
            metavar="PROTOCOL",
            help="gcs: PI's command set, over TCP; scpi: a small instrument with messages as VOLT "
            "and MEAS?.",
        ),
    ],
    model: Annotated[
        Path | None,
        typer.Option(
            metavar="MODEL", help="Model file in JSON; default the stage of Xu and Li 2010."
        ),
    ] = None,
    limits: Annotated[
        str | None,
        typer.Option(
            metavar="LOW:HIGH", help="Lowest and highest voltage in V; default those of the stage."
        ),
    ] = None,
    host: Annotated[
        str, typer.Option(help="Address to listen at; by default only this computer reaches it.")
    ] = "127.0.0.1",
    port: Annotated[
        int | None,
        typer.Option(help="TCP port; 0 for any free one; default 50000, of scpi 5025."),
    ] = None,
    speed: Annotated[float, typer.Option(help="How much faster than real time it goes.")] = 1.0,
) -> None:
    """Serve a virtual stage as a controller.

    Software that controls a stage can test against it.

    It prints its address, and goes on until Ctrl-C or SIGTERM.
    """
    from ..hardware.virtual import virtual_stage

    stage, known = virtual_stage(model)
    within = known if limits is None else number_range("--limits", limits)
    if within is None and not all(map(math.isfinite, stage.amplifier.limits)):
        raise ParameterError(
            f"--limits is not given, and {model} does not say with which voltages it was "
            "identified: expected --limits LOW:HIGH"
        )
    place = PORTS[protocol] if port is None else port
    serving = _scpi if protocol == "scpi" else _gcs
    with serving(stage, within, host, place, speed) as (address, (low, high)):
        print(f"listening at {address}, {low:g} to {high:g} V", flush=True)
        threading.Event().wait()


@contextmanager
def _gcs(stage: VirtualStage, limits: Limits | None, host: str, port: int, speed: float) -> Served:
    from ..hardware.gcs.server import GcsServer

    with GcsServer(stage, limits=limits, host=host, port=port, speed=speed) as server:
        yield server.address, server.limits


@contextmanager
def _scpi(stage: VirtualStage, limits: Limits | None, host: str, port: int, speed: float) -> Served:
    from .._support.arguments import positive
    from ..hardware.virtual import VirtualDevice
    from ..hardware.virtual_scpi import VirtualScpi

    speed = positive("speed", speed, "times real time")
    device = VirtualDevice(stage, limits=limits, clock=lambda: speed * time.monotonic())
    with VirtualScpi(device, host=host, port=port) as server:
        name, number = server.address
        low, high = device.limits
        yield f"scpi://{name}:{number}?unit=um&limits={low:g}..{high:g}V", device.limits
