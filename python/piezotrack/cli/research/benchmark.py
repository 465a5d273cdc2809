"""``piezotrack benchmark``: models times records, each fitted by its default call."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from ...errors import DataError, ParameterError
from ..command import Argument, Option, command, refuse_without_effect
from ..option_groups import LogOptions
from ..options import WINDOW, Overwrite, TestWindow, Window, cut, of_file
from ..output import OUT, Printing, can_be_folder

if TYPE_CHECKING:
    from ...benchmarking.record import BenchmarkRecord
    from ...data.dataset import Dataset

    Part = tuple[float | None, float | None] | None

__all__ = ["benchmark_command"]

# What a line of a list may say of its log.
ENTRIES = ("window", "test-window", "other", "other-window")


@command()
def benchmark_command(
    files: Annotated[
        list[Path] | None, Argument("Logs, in place of the records of the package", "FILE")
    ] = None,
    listed: Annotated[
        Path | None,
        Option(
            "List of logs, one a line, as `log.csv window=3:23 other=second.csv`",
            metavar="FILE",
            names=("--list",),
        ),
    ] = None,
    record: Annotated[
        list[str] | None, Option("Record of the package; default all. Repeatable", metavar="NAME")
    ] = None,
    model: Annotated[
        list[str] | None,
        Option("Name of a model; default all that suit the drive. Repeatable", metavar="NAME"),
    ] = None,
    window: Window = None,
    test_window: TestWindow = None,
    *,
    reading: LogOptions,
    out: Annotated[
        Path,
        Option(
            "Folder for the results; those that it has are not computed again",
            metavar="PATH",
            names=OUT,
        ),
    ] = Path("benchmark"),
    overwrite: Overwrite = False,
    printing: Printing,
) -> None:
    """Compare all models on many records.

    The part fitted is --window, by default the first half; the test is on --test-window, by default
    the rest.
    """
    from ...benchmarking.board import benchmark

    if not files:
        refuse_without_effect(("window", "test_window"), "without a FILE")
    if not files and listed is None:
        refuse_without_effect(vars(reading), "without a FILE or --list")
    can_be_folder(out)
    records: list[str | BenchmarkRecord] = list(record or [])
    records += [_record(file, reading.log(file), window, test_window, None) for file in files or []]
    if listed is not None:
        for file, keys in _lines(listed):
            other = None
            if "other" in keys:
                path = listed.parent / keys["other"]
                other = cut(reading.log(path), path, _part(keys, "other-window"), "other-window")
            parts = _part(keys, "window"), _part(keys, "test-window")
            records.append(_record(file, reading.log(file), *parts, other))
    board = benchmark(
        records or None, model or None, folder=out, overwrite=overwrite, progress=printing.progress
    )
    written = board.save(out)
    if all(one.error for one in board.results):
        first = board.results[0]
        raise DataError(f"no model was found of any record; {first.record}: {first.error}")
    printing.show(board.summary(), board.document(), written)


def _part(keys: dict[str, str], name: str) -> Part:
    """Parse a window of a line of a list."""
    return WINDOW.parse(name, keys[name]) if name in keys else None


def _record(
    file: Path, log: Dataset, window: Part, test: Part, other: Dataset | None
) -> BenchmarkRecord:
    """Make the record of a log."""
    from ...benchmarking.record import BenchmarkRecord

    with of_file(file):
        return BenchmarkRecord.of_log(log, train=window, test=test, other=other)


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
        if len(keys) < len(words) - 1 or not keys.keys() <= set(ENTRIES) or not all(keys.values()):
            raise DataError(
                f"{where}: '{' '.join(words[1:])}': expected NAME=VALUE with the names "
                f"{', '.join(ENTRIES)}, each once at most"
            )
        if "other-window" in keys and "other" not in keys:
            raise DataError(f"{where}: other-window has no effect without other=")
        entries.append((listed.parent / words[0], keys))
    if not entries:
        raise DataError(f"{listed}: no log is listed: expected one a line")
    return entries
