"""``piezotrack compare``: several models fitted to one log and validated on another part."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .error_messages import in_words
from .options import (
    Columns,
    DisplacementColumn,
    DriveColumn,
    HoldOption,
    Interval,
    Out,
    TimeColumn,
    Units,
    can_be_folder,
    list_files,
    of_file,
    refuse_without_effect,
    seconds,
    windowed,
)

__all__ = ["compare_command"]


@in_words
def compare_command(
    context: typer.Context,
    file: Annotated[Path, typer.Argument(help="Log in CSV, with units in its header.")],
    model: Annotated[
        list[str] | None,
        typer.Option(
            metavar="MODEL|FILE",
            help="Stage model, as dahl, or a model file in JSON; default all models. Repeatable.",
        ),
    ] = None,
    train: Annotated[
        str | None, typer.Option(metavar="A:B", help="Seconds to fit; default the first half.")
    ] = None,
    test: Annotated[
        str | None,
        typer.Option(metavar="A:B", help="Seconds for validation; default the rest after --train."),
    ] = None,
    test_log: Annotated[
        Path | None, typer.Option(help="Another log for validation, in place of this one.")
    ] = None,
    out: Out = Path("results"),
    time: TimeColumn = None,
    drive: DriveColumn = None,
    displacement: DisplacementColumn = None,
    unit: Units = None,
    dt: Interval = None,
    hold: HoldOption = "foh",
    seed: Annotated[int, typer.Option(help="Seed of the random numbers.")] = 0,
    runs: Annotated[int, typer.Option(help="Number of independent restarts.")] = 4,
    threads: Annotated[
        int | None, typer.Option(help="Number of threads, up to 256; default all cores.")
    ] = None,
) -> None:
    """Fit several models to a part of a log and validate them on the rest: a table, a picture."""
    from ..identification.comparison import compare
    from ..stages.registry import MODELS

    searched = {one.name for one in MODELS if one.searched}
    if model and searched.isdisjoint(model):
        refuse_without_effect(
            context, ("seed", "runs", "threads"), f"with {', '.join(model)}: none is searched"
        )

    columns = Columns(time, drive, displacement, unit, dt)
    log = columns.read(file, hold)
    fitted = None if train is None else seconds("--train", train)
    judged = None if test is None else seconds("--test", test)
    second = None
    if test_log is not None:
        second = windowed(columns.read(test_log, hold), test_log, "--test", test)
    can_be_folder(out)
    with of_file(file):
        found = compare(
            log,
            model or None,
            train=fitted,
            test=judged if second is None else second,
            seed=seed,
            runs=runs,
            threads=threads,
        )
    written = found.save(out)
    print(found.summary())
    list_files(written)
