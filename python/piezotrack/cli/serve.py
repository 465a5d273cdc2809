"""``piezotrack serve``: a virtual stage behind the protocol of a controller."""

from __future__ import annotations

import math
import threading
from pathlib import Path  # noqa: TC003, which typer reads
from typing import Annotated, Literal

import typer

from ..errors import ParameterError
from .error_messages import in_words
from .options import number_range

__all__ = ["serve_command"]


@in_words
def serve_command(
    protocol: Annotated[
        Literal["gcs"], typer.Argument(metavar="PROTOCOL", help="gcs: PI's command set, over TCP.")
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
    port: Annotated[int, typer.Option(help="TCP port; 0 for any free one.")] = 50000,
    speed: Annotated[float, typer.Option(help="How much faster than real time it goes.")] = 1.0,
) -> None:
    """Serve a virtual stage, for software that controls a stage to test against.

    It prints its address, and goes on until Ctrl-C or SIGTERM.
    """
    from ..hardware.gcs.server import GcsServer
    from ..hardware.virtual import virtual_stage

    assert protocol == "gcs"
    stage, known = virtual_stage(model)
    within = known if limits is None else number_range("--limits", limits)
    if within is None and not all(map(math.isfinite, stage.amplifier.limits)):
        raise ParameterError(
            f"--limits is not given, and {model} does not say with which voltages it was "
            "identified: expected --limits LOW:HIGH"
        )
    with GcsServer(stage, limits=within, host=host, port=port, speed=speed) as server:
        low, high = server.limits
        print(f"listening at {server.address}, {low:g} to {high:g} V", flush=True)
        threading.Event().wait()
