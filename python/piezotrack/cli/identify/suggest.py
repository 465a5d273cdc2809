"""``piezotrack suggest``: the drive to measure next."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from ...errors import ParameterError
from ..error_messages import report_errors
from ..options import Json, ModelFile, Out, Overwrite, Quiet, number_range, of_file
from ..output import Output

__all__ = ["suggest_command"]


@report_errors
def suggest_command(
    model: ModelFile,
    limits: Annotated[str, typer.Option(metavar="LOW:HIGH", help="Lowest and highest drive in V.")],
    slew: Annotated[float, typer.Option(help="Largest rate of the drive in V/s.")],
    seconds: Annotated[float, typer.Option(help="Length of the drive in s.")],
    dt: Annotated[float, typer.Option(help="Sampling interval in s.")],
    noise_nm: Annotated[
        float | None,
        typer.Option("--noise-nm", help="Noise of the sensor in nm rms; default the fit's rms."),
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of the random steps.")] = 0,
    out: Out = Path("results"),
    overwrite: Overwrite = False,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Suggest the drive that would determine a model best.

    It is written as a table that `piezotrack measure` plays, with the deviations of the parameters
    to expect.
    """
    from ..._support.files.writing import (
        make_folder,
        picture_files,
        result_set,
        save_figures,
        write_document,
    )
    from ...identification.confidence.suggestion.suggested_drive import suggest_drive
    from ...identification.fitted.model_file import load

    if noise_nm is not None and not 0.0 < noise_nm < math.inf:
        raise ParameterError("--noise-nm", f"{noise_nm:g}", "nm rms, finite, above 0")
    known = load(model)
    result = Output(out, overwrite=overwrite, json=json, quiet=quiet)
    result.will_write(["suggested.csv", "suggested.json", *picture_files("suggested")])
    with of_file(model):
        drive = suggest_drive(
            known,
            limits=number_range("--limits", limits),
            slew=slew,
            seconds=seconds,
            dt=dt,
            noise=None if noise_nm is None else 1e-9 * noise_nm,
            seed=seed,
        )
    with result_set(make_folder(out)) as folder:
        written = [
            drive.save(folder / "suggested.csv"),
            write_document(folder / "suggested.json", drive.document()),
            *save_figures({"suggested": drive.plot()}, folder),
        ]
    command = f"  piezotrack measure --device ADDRESS --drive {out / 'suggested.csv'} "
    words = "\n".join([drive.summary(), "", f"{command}--rate {1.0 / dt:.9g}"])
    result.show(words, drive.document(), written)
