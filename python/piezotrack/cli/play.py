"""``piezotrack play``: a reference followed with a table that a device plays."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .devices import DeviceAddress, Rest, connected
from .error_messages import in_words
from .options import Duration, Json, Out, Overwrite, Period, Quiet  # noqa: TC001, typer reads it
from .output import Output
from .track import ControllerFile, parsed_reference, tracking_document, write_tracking

__all__ = ["play_command"]


@in_words
def play_command(
    controller: ControllerFile,
    device: DeviceAddress,
    reference: Annotated[str, typer.Option(metavar="TEXT|FILE", help="Reference, as of `track`.")],
    out: Out = Path("results"),
    overwrite: Overwrite = False,
    duration: Duration = None,
    period: Period = None,
    rest: Rest = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Follow a reference on a device with the feedforward of a controller, played as a table."""
    from .._support.files import picture_files
    from ..control.controller_file import load_controller
    from ..control.on_device.playing import play

    loop = load_controller(controller)
    desired = parsed_reference(reference, duration, period)
    result = Output(out, overwrite=overwrite, json=json, quiet=quiet)
    result.will_write(["tracking.csv", "tracking.json", *picture_files("tracking")])
    with connected(device) as used:
        run = play(used, loop, desired, rest=rest)
    document = tracking_document(run, None, loop, [])
    result.show(run.summary(), document, write_tracking(run, document, out))
