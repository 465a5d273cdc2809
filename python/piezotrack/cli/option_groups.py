"""Groups of options that several commands have: a dataclass each, as one argument of a command."""

from __future__ import annotations

from dataclasses import dataclass, fields, is_dataclass
from functools import wraps
from inspect import Parameter, Signature, signature
from typing import TYPE_CHECKING, Any, get_type_hints

from .options import (
    Decimate,
    DisplacementColumn,
    DriveColumn,
    HoldOption,
    Interval,
    MissingOption,
    Resample,
    TimeColumn,
    Units,
    Zero,
    column,
    of_file,
    pairs,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from ..data.dataset import Dataset, Hold
    from ..data.missing import Missing

__all__ = ["Columns", "HeldLogOptions", "LogOptions", "with_groups"]


def with_groups(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command the options of its groups, in the place of the argument that takes them."""
    arguments = signature(command, eval_str=True).parameters.values()
    groups: dict[str, Any] = {
        argument.name: argument.annotation
        for argument in arguments
        if is_dataclass(argument.annotation)
    }

    @wraps(command)
    def run(**options: Any) -> None:
        for name, group in groups.items():
            options[name] = group(**{of.name: options.pop(of.name) for of in fields(group)})
        command(**options)

    expanded = [option for argument in arguments for option in _options_of(argument)]
    vars(run)["__signature__"] = Signature(expanded)
    run.__annotations__ = {option.name: option.annotation for option in expanded}
    return run


def _options_of(argument: Parameter) -> Iterator[Parameter]:
    group = argument.annotation
    if not is_dataclass(group):
        yield argument.replace(kind=Parameter.KEYWORD_ONLY)
        return
    hints = get_type_hints(group, include_extras=True)
    for of in fields(group):
        default, hint = of.default, hints[of.name]
        yield Parameter(of.name, Parameter.KEYWORD_ONLY, default=default, annotation=hint)


@dataclass(frozen=True, kw_only=True)
class Columns:
    """Columns of a log by the options that name them; a number counts from 0."""

    time: TimeColumn = None
    drive: DriveColumn = None
    displacement: DisplacementColumn = None
    unit: Units = None
    dt: Interval = None

    @property
    def arguments(self) -> dict[str, Any]:
        """Arguments of the functions that read a log, those that are given."""
        units = {column(name) or name: text for name, text in pairs("--unit", self.unit)}
        names = ("time", "drive", "displacement")
        columns = {name: column(getattr(self, name)) for name in names}
        given = {**columns, "units": units, "dt": self.dt}
        return {name: value for name, value in given.items() if value is not None}

    def read(
        self,
        file: Path,
        hold: Hold,
        resample: float | None = None,
        missing: Missing = None,
        decimate: int | None = None,
    ) -> Dataset:
        """Read a log with these columns."""
        from ..data.reader import read

        log = read(file, **self.arguments, resample=resample, hold=hold, missing=missing)
        if decimate in (None, 1):
            return log
        with of_file(file):
            return log.decimate(decimate)


@dataclass(frozen=True, kw_only=True)
class LogOptions(Columns):
    """Columns of a log, and what is done to its samples."""

    resample: Resample = None
    decimate: Decimate = None
    zero: Zero = False
    missing: MissingOption = None

    def log(self, file: Path, hold: Hold = "foh") -> Dataset:
        """Read a log."""
        log = self.read(file, hold, self.resample, self.missing, self.decimate)
        return log.zeroed() if self.zero else log


@dataclass(frozen=True, kw_only=True)
class HeldLogOptions(LogOptions):
    """Columns of a log, what is done to its samples, and the drive between them."""

    hold: HoldOption = "foh"
