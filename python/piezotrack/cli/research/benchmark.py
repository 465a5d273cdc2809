"""``piezotrack benchmark``: models times records, each fitted by its default call."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ...errors import DataError, ParameterError
from ..error_messages import report_errors
from ..option_groups import Columns, with_groups
from ..options import (
    Decimate,
    HoldOption,
    Json,
    Quiet,
    Resample,
    can_be_folder,
    of_file,
    refuse_without_effect,
    seconds,
    windowed,
)
from ..output import Output

if TYPE_CHECKING:
    from ...benchmarking.record import BenchmarkRecord
    from ...data.dataset import Dataset

__all__ = ["benchmark_command"]

# What a line of a list may say of its log.
SAID = ("train", "test", "other", "other-test")


@report_errors
@with_groups
def benchmark_command(
    context: typer.Context,
    files: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[FILE]", help="Your own logs, in place of the package's records."),
    ] = None,
    listed: Annotated[
        Path | None,
        typer.Option(
            "--list",
            metavar="FILE",
            help="List of your own logs: a line each, as `log.csv train=3:23 other=second.csv`.",
        ),
    ] = None,
    record: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="Record of the package; default all. Repeatable."),
    ] = None,
    model: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME", help="Model; default all that suit a record's drive. Repeatable."
        ),
    ] = None,
    train: Annotated[
        str | None,
        typer.Option(metavar="A:B", help="Seconds of each FILE to fit; default the first half."),
    ] = None,
    test: Annotated[
        str | None,
        typer.Option(metavar="A:B", help="Seconds of each FILE to judge on; default the rest."),
    ] = None,
    out: Annotated[
        Path,
        typer.Option(
            metavar="FOLDER", help="Folder for the results; what it has is not computed again."
        ),
    ] = Path("benchmark"),
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Compute again what the folder has.")
    ] = False,
    *,
    columns: Columns,
    resample: Resample = None,
    decimate: Decimate = None,
    hold: HoldOption = "foh",
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Compare all models on many records."""
    from ...benchmarking.board import benchmark

    if not files:
        refuse_without_effect(context, ("train", "test"), "without a FILE")
    if not files and listed is None:
        names = ("time", "drive", "displacement", "unit", "dt", "resample", "decimate", "hold")
        refuse_without_effect(context, names, "without a FILE or --list")
    result = Output(out, overwrite=True, json=json, quiet=quiet)
    can_be_folder(out)

    def read(file: Path) -> Dataset:
        return columns.read(file, hold, resample, decimate=decimate)

    records: list[str | BenchmarkRecord] = list(record or [])
    records += [_record(file, read(file), train, test, None) for file in files or []]
    if listed is not None:
        for file, keys in _lines(listed):
            other = None
            if "other" in keys:
                path = listed.parent / keys["other"]
                other = windowed(read(path), path, "other-test", keys.get("other-test"))
            records.append(_record(file, read(file), keys.get("train"), keys.get("test"), other))
    board = benchmark(
        records or None, model or None, folder=out, overwrite=overwrite, progress=result.progress
    )
    written = board.save(out)
    if all(one.error for one in board.results):
        first = board.results[0]
        raise DataError(f"no model was found of any record; {first.record}: {first.error}")
    result.show(board.summary(), board.document(), written)


def _record(
    file: Path, log: Dataset, train: str | None, test: str | None, other: Dataset | None
) -> BenchmarkRecord:
    """Make the record of a log."""
    from ...benchmarking.record import BenchmarkRecord

    with of_file(file):
        return BenchmarkRecord.of_log(
            log,
            train=None if train is None else seconds("--train", train),
            test=None if test is None else seconds("--test", test),
            other=other,
        )


def _lines(listed: Path) -> list[tuple[Path, dict[str, str]]]:
    """Read a list of logs: each with what is fitted, what is judged, and another log."""
    try:
        text = listed.read_text(encoding="utf-8")
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise ParameterError(f"--list: {listed} cannot be read: {reason}") from None
    except UnicodeDecodeError:
        raise ParameterError(f"--list: {listed} is not a text file") from None
    entries = []
    for number, line in enumerate(text.splitlines(), 1):
        where = f"{listed}:{number}"
        try:
            words = shlex.split(line, comments=True)
        except ValueError as error:
            raise DataError(f"{where}: {str(error).lower()}") from None
        if not words:
            continue
        keys = dict(word.partition("=")[::2] for word in words[1:])
        if len(keys) < len(words) - 1 or not keys.keys() <= set(SAID) or not all(keys.values()):
            raise DataError(
                f"{where}: '{' '.join(words[1:])}': expected NAME=VALUE with the names "
                f"{', '.join(SAID)}, each once at most"
            )
        if "other-test" in keys and "other" not in keys:
            raise DataError(f"{where}: other-test has no effect without other=")
        entries.append((listed.parent / words[0], keys))
    if not entries:
        raise DataError(f"{listed}: no log is listed: expected one a line")
    return entries
