"""Options and arguments that several commands have, and the parsing of their values."""

from __future__ import annotations

import shlex
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import click

from ..errors import ParameterError, PiezotrackError
from .command import Argument, Option
from .values import DRIVE, FREQUENCY, LENGTH, LOOP_TIME, TIME, VOLTAGE, Ranged, named

if TYPE_CHECKING:
    from collections.abc import Iterator
    from typing import TypeAlias

    from ..data.dataset import Dataset

    Span: TypeAlias = tuple[float | None, float | None]

__all__ = [
    "WINDOW",
    "Bandwidth",
    "Delay",
    "DeviceAddress",
    "Duration",
    "Limits",
    "LogFile",
    "ModelFile",
    "Noise",
    "OnDevice",
    "Overwrite",
    "Period",
    "Reference",
    "Rest",
    "Seed",
    "Sensitivity",
    "TestLog",
    "TestWindow",
    "Threads",
    "Window",
    "Windows",
    "Zero",
    "column",
    "command_line",
    "cut",
    "driven_alike",
    "in_order",
    "number",
    "of_file",
    "of_voltage",
    "pairs",
]

WINDOW = Ranged(TIME, "A:B", open=True)

LogFile = Annotated[Path, Argument("Log: CSV, MAT, HDF5, TDMS, NPZ and others", "FILE")]
ModelFile = Annotated[Path, Argument("Model file in JSON, as `identify` writes it", "MODEL")]
Reference = Annotated[
    str,
    Argument(
        "Motion: sine:0.2Hz,0..110um, triangle:, staircase:, chirp:, multisine:, s-curve:, zv:, "
        "zvd:, ei:, or a CSV file with time and displacement",
        "REFERENCE",
    ),
]
Window = Annotated[
    tuple[float | None, float | None] | None,
    Option("Part of the log that is used, as 3s:15s; default all", WINDOW),
]
Windows = Annotated[
    list[tuple[float | None, float | None]] | None,
    Option(
        "Part of the log that is used, as 3s:15s; default all. Several of one log, or one each",
        WINDOW,
    ),
]
TestLog = Annotated[Path | None, Option("Log for the test only; default FILE", metavar="FILE")]
TestWindow = Annotated[
    tuple[float | None, float | None] | None,
    Option("Part of the log for the test, which is not fitted", WINDOW),
]
Zero = Annotated[
    bool,
    Option(
        "Count displacements from the first reading of the record that was identified; of a device "
        "or another stage, from its rest"
    ),
]
Limits = Annotated[
    tuple[float, float] | None,
    Option(
        "Lowest and highest drive, as 0:75V; default those of the record identified",
        Ranged(DRIVE, "LOW:HIGH"),
    ),
]
Duration = Annotated[
    float | None, Option("Length of the motion; default that of its text or file", TIME)
]
Period = Annotated[
    float | None, Option("Time after which a motion from a file repeats; default never", TIME)
]
Noise = Annotated[float, Option("Noise of the simulated sensor, rms, as 20nm", LENGTH)]
Bandwidth = Annotated[float, Option("Bandwidth of the simulated amplifier", FREQUENCY)]
Delay = Annotated[float, Option("Delay of the loop in addition to the hold", LOOP_TIME)]
Overwrite = Annotated[bool, Option("Replace results that exist")]
Seed = Annotated[int, Option("Seed of the random numbers")]
Sensitivity = Annotated[float, Option("Largest sensitivity Ms")]
Threads = Annotated[int | None, Option("Threads, up to 256; default all cores")]
DeviceAddress = Annotated[
    str,
    Option(
        "Device over TCP: gcs://HOST, scpi://HOST:PORT?unit=um&limits=0..75V; a card: "
        "ni:Dev1/ao0,Dev1/ai0?scale=10um/V&limits=0..7.5V; simulated: virtual: or "
        "virtual:MODEL.json",
        metavar="ADDRESS",
    ),
]
OnDevice = Annotated[
    str | None, Option("Device in place of the simulated stage, as of `measure`", metavar="ADDRESS")
]
Rest = Annotated[
    float | None, Option("Drive before and after; default 0 V, or the limit nearest to it", VOLTAGE)
]


def column(text: str | None) -> str | int | None:
    """Parse a column: a number is an index, anything else a name."""
    return int(text) if text is not None and text.isdecimal() else text


def command_line() -> str:
    """Write the command with the arguments and options that were given, for a shell."""
    context = click.get_current_context()
    words = [context.command_path]
    for parameter in context.command.params:
        source = context.get_parameter_source(parameter.name or "")
        if source is None or source.name != "COMMANDLINE":
            continue
        value = context.params[parameter.name or ""]
        many = parameter.multiple or parameter.nargs == -1
        for one in value if many else [value]:
            if parameter.param_type_name == "argument":
                words.append(shlex.quote(str(one)))
            elif isinstance(one, bool):
                words.append((parameter.opts if one else parameter.secondary_opts)[0])
            else:
                words += [parameter.opts[0], shlex.quote(_typed(one))]
    return " ".join(words)


def _typed(value: object) -> str:
    """Write a value as it can be typed again."""
    if isinstance(value, tuple):
        return ":".join("" if one is None else f"{one:.12g}" for one in value)
    return f"{value:.12g}" if isinstance(value, float) else str(value)


@contextmanager
def of_file(file: Path, *, options: tuple[str, ...] = ()) -> Iterator[None]:
    """Put the name of the file before the message of an error, once.

    Errors of arguments that are `options`, and of no file, stay as they are.
    """
    try:
        yield
    except PiezotrackError as error:
        if getattr(error, "argument", None) in options or str(error).startswith(f"{file.name}:"):
            raise
        raise error.of(file.name) from None


def in_order(model: Path, other: str | Path) -> None:
    """Refuse a model file behind the log or the motion that belongs behind it."""
    behind = Path(other)
    if behind.suffix == ".json" != model.suffix and behind.is_file():
        context = click.get_current_context()
        names = [named(one) for one in context.command.params if isinstance(one, click.Argument)]
        raise ParameterError(
            f"{model} and {behind.name} are the wrong way round: expected {' '.join(names)}, "
            "the model file first"
        )


def cut(
    log: Dataset,
    file: Path,
    window: Span | None,
    option: str = "--window",
) -> Dataset:
    """Cut a log to the window of an option; without one the whole log is used."""
    if window is None:
        return log
    try:
        return log[slice(*window)]
    except ParameterError as error:
        raise error.of(f"{file.name}: {option} {_typed(window)}") from None


def driven_alike(file: Path, log: Dataset, other: Path, unit: str) -> None:
    """Refuse a log whose drive is in another unit than that of another file."""
    from .._support.units import shown_unit

    if log.drive_unit != unit:
        raise ParameterError(
            f"{file.name}: the drive is in {shown_unit(log.drive_unit)[0]}: expected "
            f"{shown_unit(unit)[0]}, as that of {other.name}"
        )


def of_voltage(option: str, limits: tuple[float, float]) -> tuple[float, float]:
    """Return the limits of a drive in V; those in another unit are refused."""
    for one in limits:
        unit = getattr(one, "unit", "")
        if unit not in ("", "V", "mV", "kV"):
            raise ParameterError(option, f"in {unit}", "voltages, as 0:75V")
    return limits


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
    """Parse a number without a unit; `expected` says what else the option takes."""
    try:
        return float(text)
    except ValueError:
        raise ParameterError(option, f"'{text}'", expected, verb="has") from None
