"""``piezotrack measure``: a log, recorded with a device."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from ...errors import ParameterError
from ..command import Argument, Option, command
from ..connection import connected
from ..option_groups import Sampling
from ..options import DeviceAddress, Duration, Rest
from ..output import Output
from ..values import LOOP_TIME

__all__ = ["measure_command"]


@command(out=Path("measured.csv"))
def measure_command(
    drive: Annotated[
        str,
        Argument(
            "Voltage: decaying:1Hz,0..75V, sine:, triangle:, chirp:, staircase:, multisine:, or a "
            "log with time and voltage",
            "DRIVE",
        ),
    ],
    device: DeviceAddress,
    *,
    sampling: Sampling,
    duration: Duration = None,
    rest: Rest = None,
    ramp: Annotated[float, Option("Time of the ramp from rest and back", LOOP_TIME)] = 0.5,
    clip: Annotated[bool, Option("Clip a drive beyond the limits of the device")] = False,
    output: Output,
) -> None:
    """Record a log with a device.

    The log has the ramps from rest and back as well, so that its hysteresis is known from the
    beginning. --out is a file: .csv, .npz, .mat or .parquet.
    """
    from ...data.log_file import format_to_write
    from ...hardware.excitations import parse_drive
    from ...hardware.measuring import measure

    out = output.out if output.out.suffix else output.out / "measured.csv"
    format_to_write(out)
    if out.exists() and not output.overwrite:
        raise ParameterError(f"{out} exists: expected --overwrite, or another name")
    if (dt := sampling.interval) is None:
        raise ParameterError("--rate", "missing", "a sampling rate, as 1kHz, or --dt")
    volts = parse_drive(drive, duration=duration)
    rate = sampling.rate or 1.0 / dt
    with connected(device) as used:
        log = measure(used, volts, rate, rest=rest, ramp=ramp, clip=clip)
    first, last = log.t[0], log.t[-1]
    out.parent.mkdir(parents=True, exist_ok=True)
    written = log.full.save(out)
    words = [
        f"{log.full!r}",
        f"{volts!r}, held between samples, from {first:.4g} s to {last:.4g} s",
        f"  piezotrack identify {out} --hold zoh --window {first:.4g}:{last:.4g}",
        *(f"note  {note}" for note in log.notes),
    ]
    document = {
        "samples": len(log.full),
        "dt": {"value": log.dt, "unit": "s"},
        "window_s": [float(first), float(last)],
        "notes": log.notes,
    }
    output.show("\n".join(words), document, [written])
