"""``piezotrack measure``: a log, recorded with a device."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ...errors import ParameterError
from ..connection import DeviceAddress, Rest, connected
from ..error_messages import report_errors
from ..options import Duration, Overwrite, Quiet, list_files

__all__ = ["measure_command"]


@report_errors
def measure_command(
    device: DeviceAddress,
    drive: Annotated[
        str,
        typer.Option(
            metavar="TEXT|FILE",
            help="Voltage: decaying:1Hz,0..75V, sine:, triangle:, chirp:, staircase:, multisine:, "
            "or a log with time and voltage.",
        ),
    ],
    rate: Annotated[float, typer.Option(help="Sampling rate in Hz.")],
    out: Annotated[
        Path,
        typer.Option(
            "--out", "-o", metavar="LOG", help="File for the log: CSV, NPZ, MAT or Parquet."
        ),
    ] = Path("measured.csv"),
    overwrite: Overwrite = False,
    duration: Duration = None,
    rest: Rest = None,
    ramp: Annotated[float, typer.Option(help="Length of the way from rest and back in s.")] = 0.5,
    clip: Annotated[
        bool, typer.Option("--clip", help="Clip a drive beyond the limits of the device to them.")
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Record a log with a device.

    A drive goes out, the displacement comes back. The log has the way from rest and back too, so
    that its hysteresis is known from the start.
    """
    from ...data.log_file import format_to_write
    from ...hardware.excitations import parse_drive
    from ...hardware.measuring import measure
    from ..output import print_words

    format_to_write(out)
    if out.exists() and not overwrite:
        raise ParameterError(f"{out} exists: expected --overwrite, or another name")
    volts = parse_drive(drive, duration=duration)
    with connected(device) as used:
        log = measure(used, volts, rate, rest=rest, ramp=ramp, clip=clip)
    first, last = log.t[0], log.t[-1]
    written = log.full.save(out)
    if quiet:
        return
    print(f"{log.full!r}")
    print(f"{volts!r}, held between samples, from {first:.4g} s to {last:.4g} s")
    print(f"  piezotrack identify {out} --hold zoh --window {first:.4g}:{last:.4g}")
    for note in log.notes:
        print_words(f"note  {note}")
    list_files([written])
