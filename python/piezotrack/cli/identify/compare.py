"""``piezotrack compare``: several models fitted to one log and validated on another part."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ...stages.model_info import LISTED
from ..error_messages import report_errors
from ..option_groups import HeldLogOptions, with_groups
from ..options import (
    Json,
    LogFile,
    Out,
    Overwrite,
    Quiet,
    of_file,
    refuse_without_effect,
    seconds,
    windowed,
)
from ..output import Output

__all__ = ["compare_command"]


@report_errors
@with_groups
def compare_command(
    context: typer.Context,
    file: LogFile,
    model: Annotated[
        list[str] | None,
        typer.Option(
            metavar="MODEL|FILE",
            autocompletion=lambda: list(LISTED),
            help=f"Kind of model to fit ({', '.join(LISTED)}), or a model file in JSON; default "
            "all kinds. Repeatable.",
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
        Path | None,
        typer.Option(metavar="FILE", help="Another log for validation; default this one."),
    ] = None,
    out: Out = Path("comparison"),
    overwrite: Overwrite = False,
    *,
    reading: HeldLogOptions,
    seed: Annotated[int, typer.Option(help="Seed of the random numbers.")] = 0,
    runs: Annotated[int, typer.Option(help="Number of independent searches.")] = 1,
    threads: Annotated[
        int | None, typer.Option(help="Number of threads, up to 256; default all cores.")
    ] = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Fit several models to a log and validate them."""
    from ...identification.comparison.compare import compare, comparison_files
    from ...stages.registry import MODELS

    searched = {one.name for one in MODELS if one.searched}
    if model and searched.isdisjoint(model):
        refuse_without_effect(
            context, ("seed", "runs"), f"with {', '.join(model)}: none is searched"
        )

    result = Output(out, overwrite=overwrite, json=json, quiet=quiet)
    log = reading.log(file, reading.hold)
    fitted = None if train is None else seconds("--train", train)
    judged = None if test is None else seconds("--test", test)
    second = None
    if test_log is not None:
        second = windowed(reading.log(test_log, reading.hold), test_log, "--test", test)
    # A model file that is given is written as it is.
    given = {Path(name).resolve() for name in model or []}
    with of_file(file):
        names = comparison_files(model or None, log.drive_unit)
    result.will_write(name for name in names if (out / name).resolve() not in given)
    with of_file(file):
        comparison = compare(
            log,
            model or None,
            train=fitted,
            test=judged if second is None else second,
            seed=seed,
            runs=runs,
            threads=threads,
            progress=result.progress,
        )
    result.show(
        comparison.summary(),
        {**comparison.document(), "notes": comparison.notes},
        comparison.save(out),
    )
