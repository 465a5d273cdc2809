"""``piezotrack compare``: several models fitted to one log and tested on another part."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from ...errors import Interrupted
from ..command import Option, command, refuse_without_effect
from ..connection import with_what_is_kept
from ..option_groups import LogOptions
from ..options import (
    LogFile,
    Seed,
    TestLog,
    TestWindow,
    Threads,
    Window,
    cut,
    driven_alike,
    of_file,
)
from ..output import Output
from ..values import Names
from .fit_options import listed

if TYPE_CHECKING:
    from collections.abc import Iterable

    from ...identification.comparison.compare import Comparison

__all__ = ["compare_command"]


@command(out=Path("comparison"))
def compare_command(
    file: LogFile,
    model: Annotated[
        list[str] | None,
        Option(
            "Name of a model, or a model file; default all models. Repeatable",
            Names(listed, "NAME", strict=False),
        ),
    ] = None,
    window: Window = None,
    test: TestLog = None,
    test_window: TestWindow = None,
    *,
    reading: LogOptions,
    runs: Annotated[int, Option("Independent searches")] = 1,
    seed: Seed = 0,
    threads: Threads = None,
    output: Output,
) -> None:
    """Fit several models to a part of a log and test them on the rest.

    The part fitted is --window, by default the first half; the test is on --test-window, by default
    all after it, or on another log.
    """
    from ...identification.comparison.compare import compare, comparison_files
    from ...stages.registry import MODELS

    searched = {one.name for one in MODELS if one.searched}
    if model and searched.isdisjoint(model):
        refuse_without_effect(("seed", "runs"), f"with {', '.join(model)}: none is searched")
    log = reading.log(file)
    second = None if test is None else cut(reading.log(test), test, test_window, "--test-window")
    if test is not None and second is not None:
        driven_alike(test, second, file, log.drive_unit)
    # A model file that is given is written as it is.
    given = {Path(name).resolve() for name in model or []}
    with of_file(file):
        names = comparison_files(model or None, log.drive_unit)
    output.will_write(name for name in names if (output.folder / name).resolve() not in given)
    with of_file(file):
        try:
            comparison = compare(
                log,
                model or None,
                train=window,
                test=test_window if second is None else second,
                seed=seed,
                runs=runs,
                threads=threads,
                progress=output.progress,
            )
        except Interrupted as error:
            shown = partial(_show, output, notes=[str(error)])
            raise with_what_is_kept(error, "compared", shown) from None
    _show(output, comparison)


def _show(output: Output, comparison: Comparison, notes: Iterable[str] = ()) -> str:
    """Print and write a comparison; say where it is."""
    document = {**comparison.document(), "notes": [*comparison.notes, *notes]}
    output.show(comparison.summary(), document, output.write(comparison.save))
    return f"what was done is in {output.out}"
