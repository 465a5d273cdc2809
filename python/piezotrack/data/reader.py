"""Reading logs of any format of `formats/` and any units, in seconds, volts and metres.

A log is never guessed at: a missing unit, two columns that could both be the drive, or a sample
that is not a number is an error that names the file, the line and the entry.
"""

from __future__ import annotations

from collections import Counter
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from .._support.arrays import LARGEST, UNEVEN, backward, check_dt, time_fault
from .._support.units import lookup, require
from ..errors import DataError, ParameterError
from .dataset import Dataset
from .dataset_arguments import MIN_SAMPLES
from .formats import open_log
from .missing import checked_missing
from .resampling import even_times, evened

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping
    from collections.abc import Set as AbstractSet

    from numpy.typing import NDArray

    from .columns import Column
    from .dataset import Hold
    from .missing import Missing

    Array = NDArray[np.float64]

__all__ = ["DriveRecord", "Log", "drive_dataset", "read", "read_displacement", "read_drive"]

USE_RESAMPLE = "resample= puts it on even times at that interval [s]"


def read(
    path: str | os.PathLike[str],
    *,
    time: str | int | None = None,
    drive: str | int | None = None,
    displacement: str | int | None = None,
    units: Mapping[str | int, str] | None = None,
    dt: float | None = None,
    resample: float | None = None,
    hold: Hold = "foh",
    missing: Missing = None,
    skip: int = 0,
) -> Dataset:
    r"""Read the log of one axis from a file.

    Parameters
    ----------
    path : path-like
        A text file with a header line and one line for each sample, divided by commas,
        semicolons, tabs or blanks; outside of comma files the decimal mark may be a comma. Lines
        before the header that begin with ``#`` or ``%`` are skipped, and so are blank lines. Up to
        ten thousand columns, and a million characters in a line. Or a file in MAT, HDF5, TDMS,
        NPZ, NPY, Parquet, MDF, XLSX, a GCS array, LabVIEW's .lvm, an AFM curve, or the CSV of
        Digilent WaveForms, Keysight, Tektronix, Rigol, PicoScope and AFM Workshop, known by its
        first bytes or its ending.
    time, drive, displacement : str or int, optional
        The columns to use: the title in the header, with or without its unit, or the number of
        the column counted from 0. In a file with groups a title is a path, as
        ``"run 1/voltage"``; its last part is enough where only one column has it. Needed only
        where the title is not a usual name (such as ``time_s``, ``Voltage [V]``, ``x (um)``) or
        where several columns would do.
    units : mapping of str or int to str, optional
        Units for columns that have none in the file, or have the wrong one, which `Dataset.notes`
        then says. A key is ``"time"``, ``"drive"`` or ``"displacement"`` for the column in that
        role, or else a column as above.
    dt : float, optional
        Sampling interval [s]. The time column, or the interval that the file states, is then
        ignored and the first sample is at 0 s.
    resample : float, optional
        Sampling interval [s] of even times on which the record is put, for a log with gaps,
        several rates or jitter: on straight lines between its samples, the drive with ``"zoh"``
        as the last one before. No longer than most intervals of the log, as what is faster than
        half the new rate would be misread; `Dataset.decimate` then lowers the rate without that.
    hold : {"foh", "zoh"}, optional
        Drive between two samples; see `Dataset`.
    missing : {"drop", "fill"}, optional
        What becomes of readings of drive and displacement that are NaN, or empty in a text:
        ``"drop"`` leaves them out of what is fitted and judged, ``"fill"`` puts straight lines
        there; see `Dataset`. A log with missing readings is refused where it is not given.
    skip : int, optional
        Lines of a text, or rows of a spreadsheet, above the titles that are left out.

    Returns
    -------
    Dataset
        The record in seconds, volts and metres, its ``drive_unit`` ``"m"`` where the drive is a
        position, as the height (piezo) of an AFM. Further columns of the same length, and of the
        same group, are in its ``columns``, in SI where their unit is known, and NaN where an
        entry is not a number.

    Raises
    ------
    DataError
        The file cannot be read or used, or the library that reads it is not installed. The
        message begins with the file's name, and the line of a text.
    ParameterError
        An argument names a column that is not there or has a value that cannot be used.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import piezotrack as pt
    >>> folder = tempfile.TemporaryDirectory()
    >>> path = pathlib.Path(folder.name, "stage.csv")
    >>> _ = path.write_text("time_ms,voltage_V,x (um)\n0,0,0.0\n5,10,1.5\n10,20,3.5\n")
    >>> pt.read(path)
    Dataset(3 samples, 0.015 s at 200 Hz, stroke 3.5 um)
    >>> folder.cleanup()
    """
    log = Log(path, skip)
    roles = log.roles({"time": time, "drive": drive, "displacement": displacement}, units, dt)
    log.takes(checked_missing(missing), roles)
    if resample is not None:
        if dt is not None:
            raise ParameterError(
                "dt and resample: expected one of them at most, both are given", argument="dt"
            )
        check_dt(resample, "resample")
    return log.dataset(roles, dt, hold, resample, missing)


class DriveRecord(NamedTuple):
    """A drive read from a file.

    Attributes
    ----------
    t : ndarray, shape (n,)
        Times [s].
    u : ndarray, shape (n,)
        Drive [V], or [m] where it is a position.
    """

    t: Array
    u: Array


def read_drive(
    path: str | os.PathLike[str],
    *,
    time: str | int | None = None,
    drive: str | int | None = None,
    units: Mapping[str | int, str] | None = None,
    dt: float | None = None,
    skip: int = 0,
) -> DriveRecord:
    r"""Read a drive from a file that need not have a displacement.

    Parameters
    ----------
    path, time, drive, units, dt, skip
        As in `read`.

    Returns
    -------
    DriveRecord
        Times `t` [s], increasing and even, and drive `u` [V]; read-only.

    Raises
    ------
    DataError, ParameterError
        As in `read`.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import piezotrack as pt
    >>> folder = tempfile.TemporaryDirectory()
    >>> path = pathlib.Path(folder.name, "drive.csv")
    >>> _ = path.write_text("t (s);u (V)\n0,0;1,5\n0,1;2,5\n0,2;3,5\n")
    >>> t, u = pt.data.read_drive(path)
    >>> u
    array([1.5, 2.5, 3.5])
    >>> folder.cleanup()
    """
    record = drive_dataset(path, time=time, drive=drive, units=units, dt=dt, skip=skip)
    return DriveRecord(record.t, record.u)


def drive_dataset(
    path: str | os.PathLike[str],
    *,
    time: str | int | None = None,
    drive: str | int | None = None,
    units: Mapping[str | int, str] | None = None,
    dt: float | None = None,
    skip: int = 0,
) -> Dataset:
    """Read a drive as `read_drive`, with its unit; the displacement of the record is 0."""
    log = Log(path, skip)
    return log.dataset(log.roles({"time": time, "drive": drive}, units, dt), dt, "foh")


def read_displacement(
    path: str | os.PathLike[str],
    *,
    time: str | int | None = None,
    displacement: str | int | None = None,
    units: Mapping[str | int, str] | None = None,
    dt: float | None = None,
    skip: int = 0,
) -> Dataset:
    r"""Read a displacement from a file that need not have a drive.

    Parameters
    ----------
    path, time, units, dt, skip
        As in `read`.
    displacement : str or int, optional
        As in `read`; a column called reference, desired, target or setpoint has priority.

    Returns
    -------
    Dataset
        A record whose drive is 0 V.

    Raises
    ------
    DataError, ParameterError
        As in `read`.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> folder = tempfile.TemporaryDirectory()
    >>> path = pathlib.Path(folder.name, "target.csv")
    >>> _ = path.write_text("t_s,x_um,target_um\n0,0,2\n1,1,3\n2,2,4\n")
    >>> read_displacement(path).y
    array([2.e-06, 3.e-06, 4.e-06])
    >>> folder.cleanup()
    """
    log = Log(path, skip)
    column = log.columns.to_follow() if displacement is None else displacement
    return log.dataset(log.roles({"time": time, "displacement": column}, units, dt), dt, "foh")


class Log:
    """A file of any format, and how its columns become a record."""

    def __init__(self, path: str | os.PathLike[str], skip: int = 0) -> None:
        self.table = open_log(path, skip)
        self.source, self.columns = self.table.source, self.table.columns

    def roles(
        self,
        wanted: Mapping[str, str | int | None],
        units: Mapping[str | int, str] | None,
        dt: float | None,
    ) -> dict[str, Column]:
        """Find the column in each role; with an interval, the time may be missing.

        With `dt` a column of the time is not used, and need not have a unit. Where the file
        states the interval it may be missing. Columns without any reading have no role that is
        not given.
        """
        try:
            return self._roles(wanted, units, dt)
        except DataError as error:
            if (above := self.table.above()) is not None:
                hint = (
                    f"; the titles seem to be in line {above + 1}: skip={above} leaves out the rest"
                )
                raise DataError(f"{error}{hint}") from None
            empty = {column.index for column in self.columns if self.table.is_empty(column)}
            if not empty or empty == self.columns.empty:
                raise
            self.columns.empty = empty
        return self._roles(wanted, units, dt)

    def _roles(
        self,
        wanted: Mapping[str, str | int | None],
        units: Mapping[str | int, str] | None,
        dt: float | None,
    ) -> dict[str, Column]:
        with self.source.named(self.table.header):
            if dt is not None:
                check_dt(dt)
            needs_time = dt is None and not self._may_state()
            columns = self.columns.roles(
                wanted, units, needs_time=needs_time, checks_time=needs_time
            )
        others = [column for role, column in columns.items() if role != "time"]
        if dt is not None or needs_time:
            return columns
        stated = self.table.interval(others)
        time = columns.get("time")
        usable = time is not None and lookup(time.unit) is not None
        if wanted.get("time") is None and stated is not None and not usable:
            return {role: column for role, column in columns.items() if role != "time"}
        with self.source.named(self.table.header):
            return self.columns.roles(wanted, units, needs_time=True)

    def _may_state(self) -> bool:
        """Whether the file states the interval of some column."""
        return any(self.table.interval([column]) is not None for column in self.columns)

    def dataset(
        self,
        roles: Mapping[str, Column],
        dt: float | None,
        hold: Hold,
        resample: float | None = None,
        missing: Missing = None,
    ) -> Dataset:
        """Read the samples."""
        main = {role: c for role, c in roles.items() if role != "time" or dt is None}
        table = dict(self.table.values(list(main.values())))
        for role, column in main.items():
            if role != "time" and (count := table[column.index].size) < MIN_SAMPLES:
                raise self.source.error(
                    f"{column} has {count} samples: expected at least {MIN_SAMPLES}"
                )
        t = self._times(main["time"], table, resample) if "time" in main else None
        if dt is None and t is None:
            dt = self.table.interval(list(main.values()))
        if t is not None and resample is not None:
            with self.source.named():
                times = even_times(t, resample)
            steps = {main["drive"].index} if hold == "zoh" and "drive" in main else set()
            table, t = _resampled(t, table, times, steps), times
        signals = {role: self.in_si(c, table[c.index]) for role, c in main.items()}
        columns, units = self._further(table, {column.index for column in roles.values()})
        # A drive alone is a record with an unused displacement, and vice versa.
        nothing = np.zeros(len(next(iter(table.values()))))
        with self.source.named():
            return Dataset(
                u=signals.get("drive", nothing),
                y=signals.get("displacement", nothing),
                t=t,
                dt=dt if t is None else None,
                hold=hold,
                drive_unit=require(main["drive"].unit).si if "drive" in main else "V",
                columns=columns,
                column_units=units,
                source=self.source.name,
                notes=self.columns.notes,
                missing=missing,
            )

    def takes(self, missing: Missing, roles: Mapping[str, Column]) -> None:
        """Say what becomes of missing readings, which are refused where it is None."""
        signals = {column.index for role, column in roles.items() if role != "time"}
        self.table.signals = frozenset(signals)
        self.table.takes_missing = missing is not None

    def _times(self, column: Column, table: Mapping[int, Array], resample: float | None) -> Array:
        """Convert the times [s], and refuse those that are not increasing or not even."""
        t = self.in_si(column, table[column.index])
        check = partial(time_fault, resampling=USE_RESAMPLE) if resample is None else backward
        if (fault := check(t)) is not None:
            raise self.source.error(f"{column}: {fault[1]}", self.table.line(fault[0]))
        self._note_interval(column, t)
        return t

    def in_si(self, column: Column, values: Array) -> Array:
        """Convert samples to SI, and refuse those that cannot be any.

        Parameters
        ----------
        column : Column
            Where they are; its unit is known.
        values : ndarray, shape (n,)
            In its unit.

        Returns
        -------
        ndarray, shape (n,)
            In seconds, volts or metres.
        """
        with np.errstate(over="ignore"):
            converted = require(column.unit).to_si(values)
        beyond = np.abs(converted) >= LARGEST
        if beyond.any():
            sample = int(np.argmax(beyond))
            raise self.source.error(
                f"{column} is {values[sample]:g} at sample {sample}: expected numbers below "
                f"{LARGEST:g}",
                self.table.line(sample),
            )
        return converted

    def _note_interval(self, column: Column, t: Array) -> None:
        """Say that a file states another interval than its times have."""
        stated, usual = self.table.interval([column]), float(np.median(np.diff(t)))
        stated = self.table.dt if stated is None else stated
        if stated is not None and abs(stated - usual) > UNEVEN * usual:
            self.columns.notes.append(
                f"the file states an interval of {stated:.6g} s, and the times of {column} are "
                f"{usual:.6g} s apart: the times are used"
            )

    def _further(
        self, table: Mapping[int, Array], taken: set[int]
    ) -> tuple[dict[str, Array], dict[str, str]]:
        """Name and convert the columns that have no role."""
        columns: dict[str, Array] = {}
        units: dict[str, str] = {}
        rest = [c for c in self.columns if c.index in table and c.index not in taken]
        shared = Counter(column.name for column in rest)
        for column in rest:
            name = column.name if shared[column.name] == 1 else column.title
            if not name or name in columns:
                name = f"column {column.index}"
            unit = lookup(column.unit)
            values = table[column.index]
            columns[name] = values if unit is None else unit.to_si(values)
            units[name] = column.unit if unit is None else unit.si
        return columns, units


def _resampled(
    t: Array, table: Mapping[int, Array], times: Array, constant: AbstractSet[int]
) -> dict[int, Array]:
    """Put all columns on other times."""
    places = {place for place, index in enumerate(table) if index in constant}
    values = evened(t, np.column_stack(list(table.values())), times, constant=places)
    return dict(zip(table, values.T, strict=True))
