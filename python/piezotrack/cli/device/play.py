"""``piezotrack play``: a reference followed with a table that a device plays."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from ..command import Argument, command
from ..connection import connected
from ..control.controller_files import only_controller
from ..control.loop_options import known_model
from ..option_groups import Motion, Sampling
from ..options import DeviceAddress, Reference, Rest, Zero
from ..output import Output

if TYPE_CHECKING:
    from ...control.controller.controller import Controller
    from ...stages.inverse import Inverse

__all__ = ["play_command"]


@command()
def play_command(
    file: Annotated[
        Path,
        Argument(
            "Controller file with feedforward alone; with --rate a model file, whose inverse is "
            "played",
            "MODEL|CONTROLLER",
        ),
    ],
    reference: Reference,
    device: DeviceAddress,
    *,
    sampling: Sampling,
    zero: Zero = False,
    rest: Rest = None,
    motion: Motion,
    output: Output,
) -> None:
    """Play a feedforward as a table on a device."""
    from ..._support.files.writing import picture_files
    from ...control.on_device.playing import play
    from ...control.running.zero import zero as read_zero

    rate = sampling.rate or (sampling.dt and 1.0 / sampling.dt)
    forward: Controller | Inverse
    if sampling.interval is None:
        forward = only_controller(file, "to play the inverse of a model, give --rate, as 1kHz")
    else:
        forward = known_model(file, zero=zero).inverse()
    desired = motion.of(reference)
    output.will_write(["tracking.csv", "tracking.json", *picture_files("tracking")])
    with connected(device) as used:
        begun = read_zero(used, rest=rest) if zero else None
        run = play(used, forward, desired, rate=rate, rest=rest, offset=begun)
    output.show(run.summary(), run.document(), output.write(run.save))
