"""Groups of options that several commands have: a dataclass each, as one argument of a command."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Literal

from ..errors import ParameterError
from .command import Option, group
from .options import Duration, Period, column, of_file, pairs
from .values import FREQUENCY, LOOP_TIME, TIME

if TYPE_CHECKING:
    from pathlib import Path

    from ..data.dataset import Dataset
    from ..references.reference import Reference

__all__ = [
    "Columns",
    "DisplacementColumns",
    "DriveColumns",
    "LogOptions",
    "Motion",
    "Rate",
    "Sampling",
    "interval",
]

Rate = Annotated[float | None, Option("Sampling rate", FREQUENCY)]


def interval(dt: float | None, rate: float | None) -> float | None:
    """Return the sampling interval that one of two options gives [s]."""
    if dt is not None and rate is not None:
        raise ParameterError("--dt and --rate: expected one of them at most, both are given")
    if rate is None:
        return dt
    if not rate > 0.0:
        raise ParameterError("--rate", f"{rate:g} Hz", "a rate above 0 Hz")
    return 1.0 / rate


@group
class Sampling:
    """Sampling."""

    dt: Annotated[float | None, Option("Sampling interval, or rate", LOOP_TIME)] = None
    rate: Rate = None

    @property
    def interval(self) -> float | None:
        """Sampling interval [s]."""
        return interval(self.dt, self.rate)


@group
class _Columns:
    time: Annotated[
        str | None, Option("Column of the time; default by title", metavar="COLUMN")
    ] = None
    unit: Annotated[
        list[str] | None,
        Option(
            "Unit of a column, or of time, drive, displacement. Repeatable", metavar="NAME=UNIT"
        ),
    ] = None
    dt: Annotated[float | None, Option("Sampling interval; default by times", LOOP_TIME)] = None
    rate: Rate = None
    skip: Annotated[int | None, Option("Lines above the titles; default recognised")] = None

    @property
    def arguments(self) -> dict[str, Any]:
        """Arguments of the functions that read a log, those that are given."""
        units = {column(name) or name: text for name, text in pairs("--unit", self.unit)}
        names = ("time", "drive", "displacement")
        columns = {name: column(getattr(self, name, None)) for name in names}
        given = {**columns, "units": units, "dt": interval(self.dt, self.rate), "skip": self.skip}
        return {name: value for name, value in given.items() if value not in (None, {})}


@group
class DriveColumns(_Columns):
    """Log."""

    drive: Annotated[
        str | None, Option("Column of the drive; default by title", metavar="COLUMN")
    ] = None


@group
class DisplacementColumns(_Columns):
    """Log."""

    displacement: Annotated[
        str | None, Option("Column of the displacement; default by title", metavar="COLUMN")
    ] = None


@group
class Columns(DriveColumns, DisplacementColumns):
    """Log."""

    missing: Annotated[
        Literal["drop", "fill"] | None,
        Option("Missing readings (NaN): left out, or interpolated; default refused"),
    ] = None


@group
class LogOptions(Columns):
    """Log."""

    hold: Annotated[Literal["foh", "zoh"], Option("Drive between samples: linear, constant")] = (
        "foh"
    )
    resample: Annotated[
        float | None, Option("Interpolate to this interval, over gaps; default not", TIME)
    ] = None
    decimate: Annotated[
        str | None,
        Option(
            "Every Nth sample, low-pass filtered; auto: as `info` advises; default all",
            metavar="N|auto",
        ),
    ] = None
    zero: Annotated[bool, Option("Displacements less the sensor's initial reading")] = False

    def log(self, file: Path) -> Dataset:
        """Read a log."""
        from ..data.reader import read

        log = read(
            file,
            **self.arguments,
            resample=self.resample,
            hold=self.hold,
            missing=self.missing,
        )
        if (factor := self._factor(log)) != 1:
            with of_file(file):
                log = log.decimate(factor)
        return log.zeroed() if self.zero else log

    def _factor(self, log: Dataset) -> int:
        from ..data.checks.sampling_rate import spare_factor

        if self.decimate in (None, "auto"):
            return 1 if self.decimate is None else spare_factor(log.u, log.dt)
        try:
            return int(self.decimate or 1)
        except ValueError:
            raise ParameterError(
                "--decimate", f"'{self.decimate}'", "a whole number, or auto", verb="has"
            ) from None


@group
class Motion:
    """Motion."""

    duration: Duration = None
    period: Period = None

    def of(self, text: str) -> Reference:
        """Read the motion from a file if the text names one, else parse the text."""
        from ..references.parse import reference_of

        return reference_of(text, duration=self.duration, period=self.period)
