"""``piezotrack watch``: whether a stage is still that of its model."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import click

from ...errors import ParameterError
from ..command import Option, command
from ..option_groups import LogOptions
from ..options import LogFile, ModelFile, Overwrite, Window, cut, in_order, of_file
from ..output import Printing, can_be_folder

__all__ = ["CHANGED", "watch_command"]

# Exit code; 1 and 2 are those of errors.
CHANGED = 3


@command()
def watch_command(
    model: ModelFile,
    file: LogFile,
    window: Window = None,
    refit: Annotated[
        Path | None,
        Option(
            "Identify the model again and write it here, if it is better on the last third of the "
            "log, which is not fitted first; default not",
            metavar="FILE",
        ),
    ] = None,
    *,
    reading: LogOptions,
    overwrite: Overwrite = False,
    printing: Printing,
) -> None:
    """Test with a new log whether a stage has changed.

    The exit code is 0 if the log shows no change, 3 if it does, and 2 if the log cannot be judged.
    """
    from ...identification.fitted.model_file import load
    from ...identification.watching.watch import watch

    in_order(model, file)
    known = load(model)
    if refit is not None:
        can_be_folder(refit.parent)
        if refit.exists() and not overwrite:
            raise ParameterError(f"{refit} exists: expected --overwrite, or another --refit")
    log = cut(reading.log(file), file, window)
    with of_file(file):
        health = watch(known, log, refit=refit is not None)
    written = []
    if refit is not None and health.refit is not None and health.refit.model is not None:
        refit.parent.mkdir(parents=True, exist_ok=True)
        written = [health.refit.model.save(refit)]
    printing.show(health.summary(), health.document(), written)
    if not health.healthy:
        raise click.exceptions.Exit(CHANGED)
