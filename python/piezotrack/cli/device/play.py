"""``piezotrack play``: a reference followed with a table that a device plays."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..connection import DeviceAddress, Rest, connected
from ..control.loop_options import known_model
from ..error_messages import report_errors
from ..options import (
    Duration,
    Json,
    Out,
    Overwrite,
    Period,
    Quiet,
    Zero,
)
from ..output import Output

if TYPE_CHECKING:
    from ...control.controller.controller import Controller
    from ...stages.inverse import Inverse

__all__ = ["play_command"]


@report_errors
def play_command(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="CONTROLLER",
            help="Controller file in JSON with feedforward alone; with --rate a model file, whose "
            "inverse is played.",
        ),
    ],
    device: DeviceAddress,
    reference: Annotated[str, typer.Option(metavar="TEXT|FILE", help="Reference, as of `track`.")],
    out: Out = Path("results"),
    overwrite: Overwrite = False,
    rate: Annotated[
        float | None,
        typer.Option(help="Sampling rate of the inverse of a model in Hz.", show_default=False),
    ] = None,
    zero: Zero = False,
    duration: Duration = None,
    period: Period = None,
    rest: Rest = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Play a feedforward as a table on a device."""
    from ..._support.files.writing import picture_files
    from ...control.controller.load import load_controller
    from ...control.on_device.playing import play
    from ...control.running.zero import zero as read_zero
    from ...references.parse import reference_of

    if rate is None:
        forward: Controller | Inverse = load_controller(file)
    else:
        forward = known_model(file, zero=zero).inverse()
    desired = reference_of(reference, duration=duration, period=period)
    result = Output(out, overwrite=overwrite, json=json, quiet=quiet)
    result.will_write(["tracking.csv", "tracking.json", *picture_files("tracking")])
    with connected(device) as used:
        begun = read_zero(used, rest=rest) if zero else None
        run = play(used, forward, desired, rate=rate, rest=rest, offset=begun)
    result.show(run.summary(), run.document(), run.save(out))
