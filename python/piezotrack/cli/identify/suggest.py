"""``piezotrack suggest``: the drive to measure next."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated

from ...errors import ParameterError
from ..command import Option, command
from ..option_groups import Sampling
from ..options import ModelFile, Seed, of_file, of_voltage
from ..output import Output
from ..values import DRIVE, LENGTH, SLEW, TIME, Ranged

if TYPE_CHECKING:
    from pathlib import Path

__all__ = ["suggest_command"]


@command()
def suggest_command(
    model: ModelFile,
    limits: Annotated[
        tuple[float, float],
        Option("Lowest and highest drive, as 0:75V", Ranged(DRIVE, "LOW:HIGH")),
    ],
    slew: Annotated[float, Option("Largest rate of the drive, as 2000V/s", SLEW)],
    duration: Annotated[float, Option("Length of the drive, as 4s", TIME)],
    *,
    sampling: Sampling,
    noise: Annotated[
        float | None, Option("Noise of the sensor, rms, as 20nm; default rms of the fit", LENGTH)
    ] = None,
    seed: Seed = 0,
    output: Output,
) -> None:
    """Suggest the drive that would determine a model best.

    Written as a table that `piezotrack measure` plays, with the standard deviations of the
    parameters to expect. One of --dt and --rate is required.
    """
    from ..._support.files.writing import (
        picture_files,
        result_set,
        save_figures,
        write_document,
    )
    from ...identification.confidence.suggestion.suggested_drive import suggest_drive
    from ...identification.fitted.model_file import load

    if noise is not None and not 0.0 < noise < math.inf:
        raise ParameterError("--noise", f"{1e9 * noise:g} nm", "an rms value above 0 nm")
    if (dt := sampling.interval) is None:
        raise ParameterError("--dt", "missing", "a sampling interval, or a rate by --rate")
    known = load(model)
    volts = of_voltage("--limits", limits)
    output.will_write(["suggested.csv", "suggested.json", *picture_files("suggested")])
    with of_file(model, options=("limits", "slew", "seconds", "dt", "seed")):
        drive = suggest_drive(
            known,
            limits=volts,
            slew=slew,
            seconds=duration,
            dt=dt,
            noise=noise,
            seed=seed,
        )

    def save(place: Path) -> list[Path]:
        with result_set(place) as folder:
            return [
                drive.save(folder / "suggested.csv"),
                write_document(folder / "suggested.json", drive.document()),
                *save_figures({"suggested": drive.plot()}, folder),
            ]

    written = output.write(save)
    table = written[0] if output.is_file else output.out / "suggested.csv"
    line = f"  piezotrack measure {table} --device ADDRESS --rate {1.0 / dt:.9g}Hz"
    output.show("\n".join([drive.summary(), "", line]), drive.document(), written)
