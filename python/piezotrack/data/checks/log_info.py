"""Contents of a log, and the models it can determine."""

from __future__ import annotations

import math
import re
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..._support.arrays import check_dt, time_fault
from ..._support.display.table import Column as Cells
from ..._support.display.table import Table, words
from ..._support.messages import quoted
from ..._support.units import drive_text, drive_word, length_text, lookup
from ...errors import DataError, ParameterError, PiezotrackError
from ..far_readings import are_few, bridged, far_notes, far_readings
from ..formats import format_of
from ..missing import checked_missing, complete
from ..reader import USE_RESAMPLE, Log
from .connections import unusual_connection
from .drive_features import (
    Determination,
    DriveFeatures,
    TimeFeatures,
    determinations,
    drive_features,
    reversals_text,
    time_features,
)
from .sampling_rate import sampling_notes

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from ..columns import Column
    from ..missing import Missing

    Array = NDArray[np.float64]

__all__ = ["ColumnInfo", "LogInfo", "info"]

# How an error begins where nothing in a log may be a drive.
NO_DRIVE = "no column is known to be the drive"
# Gaps and rests that a summary lists.
LISTED = 5
# Jitter below which times are even but for rounding [% of an interval].
EVEN = 0.01


@dataclass(frozen=True)
class ColumnInfo:
    """One column of a log.

    Attributes
    ----------
    title : str
        As in the file; of a column in a group its path.
    unit : str
        As in the file, or as given; empty where there is none.
    samples : int
        Number of samples.
    low, high : float
        Range of the numbers in it [unit]; NaN where there are none.
    missing : int
        Number of entries that are no finite numbers.
    """

    title: str
    unit: str
    samples: int
    low: float
    high: float
    missing: int


@dataclass(frozen=True, repr=False)
class LogInfo:
    """Contents of a log.

    Attributes
    ----------
    source : str
        Name of the file.
    format : str
        Name of its format.
    columns : tuple of ColumnInfo
        Its columns.
    roles : dict of str to str
        Titles of the columns of time, drive and displacement, as far as they are known.
    problem : str
        Why `piezotrack.read` refuses it as it is; empty where it does not.
    time : TimeFeatures or None
        Its sampling; None where neither times nor an interval are known.
    drive : DriveFeatures or None
        What its drive does; None where the drive is not known.
    stroke : float or None
        Range of the displacement [m]; None where it is not known.
    determines : tuple of Determination
        Properties of the stage that it can determine, or not.
    notes : tuple of str
        What a person should know of the file.
    """

    source: str
    format: str
    columns: tuple[ColumnInfo, ...]
    roles: dict[str, str]
    problem: str
    time: TimeFeatures | None
    drive: DriveFeatures | None
    stroke: float | None
    determines: tuple[Determination, ...]
    notes: tuple[str, ...]

    def __repr__(self) -> str:
        rate = "" if self.time is None else f", {1.0 / self.time.interval:.6g} Hz"
        fault = "; not read as it is" if self.problem else ""
        samples = max(column.samples for column in self.columns)
        what = f"{self.format}, {len(self.columns)} columns, {samples} samples{rate}{fault}"
        return f"<LogInfo, {self.source}: {what}; see summary()>"

    def _repr_html_(self) -> str:
        rows = [
            *((f"column of the {role}", title) for role, title in self.roles.items()),
            *(line.split("  ", 1) for line in [*self._of_time(), *self._of_drive()]),
            *(("can determine", one.text) for one in self.determines),
            *(("note", note) for note in self.notes),
            *([("not read as it is", self.problem)] if self.problem else []),
        ]
        told = [(name.strip(), text.strip()) for name, text in rows]
        return (
            replace(self._table, title=f"{self.source}, {self.format}").html()
            + words("", told).html()
        )

    def __str__(self) -> str:
        return self.summary()

    def summary(self) -> str:
        """Write all of it for a person.

        Returns
        -------
        str
            Several lines.
        """
        lines = [
            f"{self.source}  {self.format}, {len(self.columns)} columns",
            "",
            *self._table.lines(),
        ]
        lines += ["", *self._of_time(), *self._of_drive()]
        if self.determines:
            lines += ["", "can determine", *(f"  {one}" for one in self.determines)]
            if self.drive is not None and self.drive.turns and self.stroke:
                lines.append(
                    "  for the drive to record next, with a first model: piezotrack suggest"
                )
        lines += [f"note  {note}" for note in self.notes]
        if self.problem:
            lines += ["", f"is not read as it is: {self.problem}"]
        return "\n".join(lines)

    @property
    def _table(self) -> Table:
        """The columns."""
        width = min(60, max(len(_shown(column.title)) for column in self.columns))
        return Table(
            (
                Cells("column", width=width, before=0, left=True),
                Cells("unit", width=5, left=True),
                Cells("samples", width=8),
                Cells("lowest", format=".6g", width=11),
                Cells("highest", format=".6g", width=11),
                Cells(left=True),
            ),
            [
                (
                    _shown(column.title),
                    _shown(column.unit) or "-",
                    column.samples,
                    column.low,
                    column.high,
                    f"{column.missing} not finite" if column.missing else "",
                )
                for column in self.columns
            ],
        )

    def document(self) -> dict[str, Any]:
        """Return the same as numbers, texts, lists and dicts, in SI but for the columns.

        Returns
        -------
        dict
            For a JSON file.
        """
        return {
            "format": "piezotrack-info",
            "schema_version": 1,
            "source": self.source,
            "file_format": self.format,
            "columns": [asdict(column) for column in self.columns],
            "roles": self.roles,
            "problem": self.problem or None,
            "time": None if self.time is None else asdict(self.time),
            "drive": None if self.drive is None else asdict(self.drive),
            "stroke": {"value": self.stroke, "unit": "m"},
            "determines": [one.text for one in self.determines],
            "notes": list(self.notes),
        }

    def _of_time(self) -> list[str]:
        if self.time is None:
            return ["rate      not known"]
        time = self.time
        rate = 1.0 / time.interval if time.interval > 0.0 else math.nan
        share = 100.0 * time.jitter / time.interval if time.interval > 0.0 else math.nan
        jitter = f"jitter {1e6 * time.jitter:.3g} us rms, {share:.2g} % of an interval"
        lines = [
            f"time      {time.begin:.6g} to {time.end:.6g} s",
            f"rate      {rate:.6g} Hz, {'even' if share < EVEN else jitter}",
        ]
        lost = sum(count for _, _, count in time.gaps)
        gaps = [f"{first:.6g} to {last:.6g} s" for first, last, _ in time.gaps]
        lines.append(
            f"gaps      {len(time.gaps)}, {lost} samples missing: {_listed(gaps)}"
            if gaps
            else "gaps      none"
        )
        return lines

    def _of_drive(self) -> list[str]:
        lines = []
        if self.drive is not None:
            unit = self.drive.unit
            low, high = drive_text(self.drive.low, unit), drive_text(self.drive.high, unit)
            rests = [
                f"{first:.4g} to {last:.4g} s at {drive_text(level, unit)}"
                for first, last, level in self.drive.rests
            ]
            lines = [
                f"{drive_word(unit):<8}  {low} to {high}",
                f"reverses  {reversals_text(self.drive)}",
                f"rests     {_listed(rests) if rests else 'none'}",
            ]
        if self.stroke is not None:
            lines.append(f"stroke    {length_text(self.stroke)}")
        return lines


def info(
    path: str | os.PathLike[str],
    *,
    time: str | int | None = None,
    drive: str | int | None = None,
    displacement: str | int | None = None,
    units: Mapping[str | int, str] | None = None,
    dt: float | None = None,
    missing: Missing = None,
    skip: int = 0,
) -> LogInfo:
    """Look into a log: columns, sampling, what the drive does, and what it can determine.

    A log that `piezotrack.read` refuses is described as far as it goes; `LogInfo.problem` says
    what is missing.

    Parameters
    ----------
    path, time, drive, displacement, units, dt, missing, skip
        As in `piezotrack.read`.

    Returns
    -------
    LogInfo
        Print its `summary()`.

    Raises
    ------
    DataError
        The file is not there, damaged, or the library for its format is not installed.
    ParameterError
        An argument names a column that is not there or has a value that cannot be used.

    Examples
    --------
    >>> import numpy as np
    >>> import piezotrack as pt
    >>> t = np.arange(1000) / 100.0
    >>> u = 30.0 - 30.0 * np.cos(2.0 * np.pi * t)
    >>> path = pt.Dataset(u=u, y=1e-6 * u, t=t).save("stage.csv")
    >>> found = pt.data.info(path)
    >>> found.drive.turns, round(1.0 / found.time.interval)
    (19, 100)
    >>> print(found.determines[1])
    one amplitude, 60 V: minor loops are extrapolated from it
    """
    log = Log(path, skip)
    given = {"time": time, "drive": drive, "displacement": displacement}
    roles: dict[str, Column] = {}
    problems: list[str] = []
    for wanted in _attempts(given):
        try:
            roles = log.roles(wanted, units, dt)
            break
        except DataError as error:
            problems.append(_without_name(error, log.source.name))
    log.takes(checked_missing(missing), roles)
    signals, fault = _signals(log, roles, dt)
    problems += fault
    t, u, y = (signals.get(role) for role in ("time", "drive", "displacement"))
    if t is not None and not problems and (uneven := time_fault(t, USE_RESAMPLE)) is not None:
        problems.append(f"{roles['time']}: {uneven[1]}")
    if t is None and (u is not None or y is not None):
        count = (u if u is not None else y if y is not None else np.zeros(0)).size
        if (interval := dt or log.table.interval(list(roles.values()))) is not None:
            try:
                t = check_dt(interval) * np.arange(count, dtype=np.float64)
            except ParameterError as error:
                problems.append(str(error))
    lost: list[str] = []
    if u is not None and y is not None:
        try:
            u, y, _, lost = complete(u, y, missing, constant=False)
        except DataError as error:
            problems.append(str(error))
            u = y = None
    far = _far(u, y)
    # What is said of the displacement leaves out what a fit does.
    plain = y if y is None or far is None or not are_few(far) else bridged(y, far)
    connection = None
    if u is not None and plain is not None and far is not None:
        connection = unusual_connection(u, plain)
    times = time_features(t) if t is not None and t.size > 1 else None
    features, stroke = None, None if plain is None else float(np.ptp(plain))
    if t is not None and u is not None:
        features = drive_features(t, u, plain, _si(roles["drive"]))
    # Of a log that is read as it is: another has no even rate, or not yet.
    spare: list[str] = []
    if times is not None and u is not None and y is not None and not problems:
        spare = sampling_notes(u, times.interval, 0.0 if features is None else features.mode_limit)
    determined: list[Determination] = []
    if connection is not None and not connection.follows:
        words = "no model: drive and displacement are not correlated, see the note"
        determined = [Determination("record", "no", words)]
    elif times is not None and features is not None:
        determined = determinations(times, features, stroke)
    elif stroke is not None and problems and problems[0].startswith(NO_DRIVE):
        words = "no drive: the noise of a sensor at rest (piezotrack noise), or a reference"
        determined = [Determination("record", "no", words)]
    notes = far_notes(t, y, far) if t is not None and y is not None and far is not None else []
    notes += [] if connection is None else [connection.note]
    return LogInfo(
        source=log.source.name,
        format=format_of(log.source).name,
        columns=tuple(_column(log, column) for column in log.columns),
        roles={role: column.title for role, column in roles.items()},
        problem=problems[0] if problems else "",
        time=times,
        drive=features,
        stroke=stroke,
        determines=tuple(determined),
        notes=(*log.columns.notes, *lost, *notes, *spare),
    )


def _far(u: Array | None, y: Array | None) -> NDArray[np.bool_] | None:
    """Find the readings that are far off; None without both signals."""
    return None if u is None or y is None or u.size != y.size else far_readings(u, y)


def _attempts(given: Mapping[str, str | int | None]) -> list[dict[str, str | int | None]]:
    """Return the roles to look for: all, two of them, the time; those with what was named first."""
    fewer = ("time", "drive"), ("time", "displacement"), ("drive", "displacement"), ("time",)
    named = {role for role, key in given.items() if key is not None}
    ordered = sorted(fewer, key=lambda roles: not named <= set(roles))
    return [dict(given)] + [{role: given[role] for role in roles} for roles in ordered]


def _signals(
    log: Log, roles: Mapping[str, Column], dt: float | None
) -> tuple[dict[str, Array], list[str]]:
    """Read the columns of the roles in SI, and say why that fails."""
    main = {role: c for role, c in roles.items() if role != "time" or dt is None}
    if not main:
        return {}, []
    try:
        table = log.table.values(list(main.values()))
        known = {role: c for role, c in main.items() if lookup(c.unit) is not None}
        return {role: log.in_si(c, table[c.index]) for role, c in known.items()}, []
    except PiezotrackError as error:
        return {}, [_without_name(error, log.source.name)]


def _column(log: Log, column: Column) -> ColumnInfo:
    values: Array = np.zeros(0)
    with suppress(PiezotrackError):
        values = log.table.column(column)
    known = values[np.isfinite(values)]
    low, high = (float(known.min()), float(known.max())) if known.size else (math.nan, math.nan)
    count = log.table.count(column)
    title = column.title or f"column {column.index}"
    return ColumnInfo(title, column.unit, count, low, high, count - known.size)


def _si(column: Column) -> str:
    unit = lookup(column.unit)
    return "V" if unit is None else unit.si


def _shown(text: str) -> str:
    """Shorten a text of the file for a table."""
    return text if len(text) <= 60 else quoted(text[:50])


def _listed(found: list[str]) -> str:
    more = len(found) - LISTED
    return "; ".join(found[:LISTED]) + (f"; and {more} more" if more > 0 else "")


def _without_name(error: Exception, name: str) -> str:
    """Return a message without the name of the file before it."""
    return re.sub(rf"^{re.escape(name)}(:\d+)?: ", "", str(error))
