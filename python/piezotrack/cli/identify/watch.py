"""``piezotrack watch``: whether a stage is still that of its model."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..error_messages import report_errors
from ..option_groups import HeldLogOptions, with_groups
from ..options import Json, LogFile, ModelFile, Overwrite, Quiet, Seconds, of_file, windowed
from ..output import Output

__all__ = ["CHANGED", "watch_command"]

# Exit code; 1 and 2 are those of errors.
CHANGED = 3


@report_errors
@with_groups
def watch_command(
    model: ModelFile,
    file: LogFile,
    window: Seconds = None,
    refit: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Identify the model again and write it here in JSON, if it is better on the last "
            "third of the log, which is not fitted first; default not.",
        ),
    ] = None,
    overwrite: Overwrite = False,
    *,
    reading: HeldLogOptions,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Judge from a new log whether a stage has changed.

    The exit code is 0 if nothing has changed as far as the log shows, 3 if something has, and 2 if
    the log cannot be judged.
    """
    from ...identification.fitted.model_file import load
    from ...identification.watching.watch import watch

    known = load(model)
    folder = Path() if refit is None else refit.parent
    result = Output(folder, overwrite=overwrite, json=json, quiet=quiet)
    if refit is not None:
        result.will_write([refit.name])
    log = windowed(reading.log(file, reading.hold), file, "--window", window)
    with of_file(file):
        health = watch(known, log, refit=refit is not None)
    written = []
    if refit is not None and health.refit is not None and health.refit.model is not None:
        refit.parent.mkdir(parents=True, exist_ok=True)
        written = [health.refit.model.save(refit)]
    result.show(health.summary(), health.document(), written)
    if not health.healthy:
        raise typer.Exit(CHANGED)
