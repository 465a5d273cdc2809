"""Options that several commands share, and the parsing of their values."""

from __future__ import annotations

import os
import shlex
from contextlib import contextmanager
from pathlib import Path
from string import ascii_letters
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from ..errors import ParameterError, PiezotrackError
from .terminal import one_line

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from ..data.dataset import Dataset

__all__ = [
    "ControlInterval",
    "Decimate",
    "DisplacementColumn",
    "DriveColumn",
    "Duration",
    "HoldOption",
    "Interval",
    "Jitter",
    "Json",
    "LogFile",
    "MissingOption",
    "ModelFile",
    "Out",
    "OutFile",
    "Overwrite",
    "Period",
    "Quiet",
    "Resample",
    "Seconds",
    "TimeColumn",
    "Units",
    "Zero",
    "can_be_folder",
    "can_be_written",
    "column",
    "command_line",
    "list_files",
    "number",
    "number_range",
    "of_file",
    "pairs",
    "refuse_without_effect",
    "seconds",
    "windowed",
]

Seconds = Annotated[
    str | None,
    typer.Option(
        metavar="A:B",
        help="Seconds to use, default all; the drive before A is simulated as warm-up.",
    ),
]
TimeColumn = Annotated[
    str | None, typer.Option(metavar="COLUMN", help="Column of the time; default by its title.")
]
DriveColumn = Annotated[
    str | None, typer.Option(metavar="COLUMN", help="Column of the drive; default by its title.")
]
DisplacementColumn = Annotated[
    str | None,
    typer.Option(metavar="COLUMN", help="Column of the displacement; default by its title."),
]
Units = Annotated[
    list[str] | None,
    typer.Option(
        "--unit",
        metavar="NAME=UNIT",
        help="Unit of a column, or of time, drive, displacement; default as in its title. "
        "Repeatable.",
    ),
]
Interval = Annotated[
    float | None, typer.Option(help="Sampling interval in s; default from the column of the time.")
]
Resample = Annotated[
    float | None,
    typer.Option(
        help="Put a log with gaps or jitter on even times, at this interval in s; default not."
    ),
]
Decimate = Annotated[
    int | None,
    typer.Option(
        metavar="N",
        help="Every Nth sample of the log, after a low-pass filter without lag over all signals; "
        "for one sampled far above what moves (see `info`), not for steps. Default all.",
    ),
]
MissingOption = Annotated[
    Literal["drop", "fill"] | None,
    typer.Option(
        help="Missing readings (NaN): left out of what is fitted and judged (drop) or on straight "
        "lines (fill); default refused."
    ),
]
HoldOption = Annotated[
    Literal["foh", "zoh"],
    typer.Option(help="Drive between samples: linear (foh) or constant (zoh)."),
]
ControlInterval = Annotated[float, typer.Option(help="Sampling interval of the controller in s.")]
Jitter = Annotated[float, typer.Option(help="Mean sampling jitter in s (truncated exponential).")]
Duration = Annotated[
    float | None, typer.Option(help="Length of the reference in s; default as the reference says.")
]
Period = Annotated[
    float | None,
    typer.Option(help="Time in s after which a reference from a file repeats; default never."),
]
Zero = Annotated[
    bool,
    typer.Option(
        "--zero",
        help="Displacements from the beginning of the record on: less what its sensor reads there, "
        "before the drive moves. Of a device or another stage, from where it is at rest. Default "
        "as recorded.",
    ),
]
Out = Annotated[Path, typer.Option(metavar="FOLDER", help="Folder for the results.")]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace results that exist.")]
Json = Annotated[bool, typer.Option("--json", help="Print the figures as one JSON document.")]
Quiet = Annotated[bool, typer.Option("--quiet", help="Print nothing but errors.")]
LogFile = Annotated[
    Path,
    typer.Argument(
        metavar="FILE", help="Log: CSV, MAT, HDF5, TDMS, NPZ and others, with its units."
    ),
]
OutFile = Annotated[
    Path, typer.Argument(metavar="OUT", help="File to write: .csv, .npz, .mat or .parquet.")
]
ModelFile = Annotated[Path, typer.Argument(metavar="MODEL", help="Model file in JSON.")]


def column(text: str | None) -> str | int | None:
    """Parse a column: a number is an index, anything else a name."""
    return int(text) if text is not None and text.isdecimal() else text


def command_line(context: typer.Context) -> str:
    """Write the command with the arguments and options that were given, for a shell."""
    words = [context.command_path]
    for parameter in context.command.params:
        source = context.get_parameter_source(parameter.name or "")
        if source is None or source.name != "COMMANDLINE":
            continue
        value = context.params[parameter.name or ""]
        values = value if isinstance(value, (list, tuple)) else [value]
        for one in values:
            if parameter.param_type_name == "argument":
                words.append(shlex.quote(str(one)))
            elif isinstance(one, bool):
                words.append((parameter.opts if one else parameter.secondary_opts)[0])
            else:
                words += [parameter.opts[0], shlex.quote(str(one))]
    return " ".join(words)


def refuse_without_effect(context: typer.Context, options: Iterable[str], reason: str) -> None:
    """Refuse options that were given although they have no effect; `reason` says beside what."""
    for name in options:
        source = context.get_parameter_source(name)
        if source is not None and source.name != "DEFAULT":
            option = f"--{name.replace('_', '-')}"
            raise ParameterError(option, f"no effect {reason}", "it left out", verb="has")


@contextmanager
def of_file(file: Path) -> Iterator[None]:
    """Put the name of the file before the message of an error."""
    try:
        yield
    except PiezotrackError as error:
        raise error.of(file.name) from None


def can_be_folder(out: Path) -> None:
    """Refuse a folder that cannot be written to before the computation begins."""
    there = out
    try:
        while not there.exists() and there != there.parent:
            there = there.parent
        is_folder = there.is_dir()
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise ParameterError(f"--out: {out} cannot be made a folder: {reason}") from None
    if not is_folder:
        raise ParameterError(f"--out: {out} cannot be made a folder: {there} is a file")
    if not os.access(there, os.W_OK | os.X_OK):
        raise ParameterError(f"--out: {there} cannot be written to: permission denied")


def can_be_written(out: Path, names: Iterable[str], *, overwrite: bool) -> None:
    """Refuse a folder that cannot be written to, or that has a result, before the computation."""
    can_be_folder(out)
    for path in [] if overwrite else [out / name for name in names]:
        if path.exists():
            raise ParameterError(f"{path} exists: expected --overwrite, or another --out")


def list_files(written: Iterable[Path]) -> None:
    """Print which files were written, if any were."""
    files = list(written)
    if files:
        print("\nwritten")
    for path in files:
        print(f"  {one_line(str(path))}")


def seconds(option: str, text: str) -> tuple[float | None, float | None]:
    """Parse A:B in seconds; either end may be left out."""
    start, colon, stop = text.partition(":")
    if not colon:
        raise ParameterError(option, f"'{text}'", "A:B in seconds, as 3:23")
    first, last = (_in_seconds(option, end) if end else None for end in (start, stop))
    return first, last


def _in_seconds(option: str, text: str) -> float:
    """Parse a time with or without its unit [s]."""
    from .._support.units import lookup

    plain = text.rstrip(ascii_letters)
    unit = lookup(text[len(plain) :]) if plain != text else None
    if unit is None or unit.quantity != "time":
        return number(option, text)
    return number(option, plain) * unit.factor / unit.divisor


def windowed(log: Dataset, file: Path, option: str, window: str | None) -> Dataset:
    """Cut a log to the window of an option; without one the whole log is used."""
    if window is None:
        return log
    start, stop = seconds(option, window)
    try:
        return log[start:stop]
    except ParameterError as error:
        raise error.of(f"{file.name}: {option} {window}") from None


def pairs(option: str, given: list[str] | None) -> list[tuple[str, str]]:
    """Parse options of the form NAME=VALUE."""
    pairs: list[tuple[str, str]] = []
    for text in given or []:
        name, equals, value = text.partition("=")
        if not equals or not name or not value:
            raise ParameterError(option, f"'{text}'", "NAME=VALUE")
        if name.strip() in dict(pairs):
            raise ParameterError(option, f"{name.strip()} twice", "it once", verb="names")
        pairs.append((name.strip(), value.strip()))
    return pairs


def number(option: str, text: str, expected: str = "a number") -> float:
    """Parse a number; `expected` says what else the option takes."""
    try:
        return float(text)
    except ValueError:
        raise ParameterError(option, f"'{text}'", expected, verb="has") from None


def number_range(option: str, text: str) -> tuple[float, float]:
    """Parse LOW:HIGH."""
    low, colon, high = text.partition(":")
    if not colon:
        raise ParameterError(option, f"'{text}'", "LOW:HIGH", verb="has")
    return number(option, low), number(option, high)
