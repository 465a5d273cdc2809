"""Reading text logs of any usual delimiter, encoding and units, in seconds, volts and metres.

A log is never guessed at: a missing unit, two columns that could both be the drive, or a sample
that is not a number is an error that names the file, the line and the entry.
"""

from __future__ import annotations

import codecs
import math
import re
from collections import Counter
from contextlib import contextmanager
from functools import partial
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from .._support.arrays import backward, check_dt, time_fault
from .._support.messages import quoted
from .._support.units import lookup, require
from ..errors import DataError, ParameterError, ShapeError
from .columns import Column, Columns
from .dataset import Dataset
from .resampling import even_times, evened
from .text_fields import are_titles, delimiter_of, field_fault, number_of, split_fields

if TYPE_CHECKING:
    import os
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from .dataset import Hold

    Array = NDArray[np.float64]

__all__ = ["DriveRecord", "drive_dataset", "read", "read_displacement", "read_drive"]

NOT_TEXT = {".mat", ".h5", ".hdf5", ".tdms", ".npy", ".npz", ".xls", ".xlsx", ".parquet"}

# A line and a header beyond these are none of a log: a million letters, ten thousand columns.
MOST_LETTERS, MOST_COLUMNS = 1_000_000, 10_000

USE_RESAMPLE = "resample= puts it on even times at that interval [s]"

_CONTROL = re.compile(r"[\x00-\x08\x0e-\x1f]")
_SWAP = str.maketrans(",.", ".,")


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
) -> Dataset:
    r"""Read the log of one axis from a text file.

    Parameters
    ----------
    path : path-like
        A text file with a header line and one line for each sample, divided by commas,
        semicolons, tabs or blanks; outside of comma files the decimal mark may be a comma. Lines
        before the header that begin with ``#`` or ``%`` are skipped, and so are blank lines. Up to
        ten thousand columns, and a million characters in a line.
    time, drive, displacement : str or int, optional
        The columns to use: the title in the header, with or without its unit, or the number of
        the column counted from 0. Needed only where the header does not use a usual name (such
        as ``time_s``, ``Voltage [V]``, ``x (um)``) or where several columns would do.
    units : mapping of str or int to str, optional
        Units for columns whose titles have none, or have the wrong one. A key is ``"time"``,
        ``"drive"`` or ``"displacement"`` for the column in that role, or else a column as above.
    dt : float, optional
        Sampling interval [s]. The time column is then ignored and the first sample is at 0 s.
    resample : float, optional
        Sampling interval [s] of even times on which the record is put, for a log with gaps,
        several rates or jitter: on straight lines between its samples, the drive with ``"zoh"``
        as the last one before. No longer than most intervals of the log, as what is faster than
        half the new rate would be misread; `Dataset.decimate` then lowers the rate without that.
    hold : {"foh", "zoh"}, optional
        Drive between two samples; see `Dataset`.

    Returns
    -------
    Dataset
        The record in seconds, volts and metres, its ``drive_unit`` ``"m"`` where the drive is a
        position, as the height (piezo) of an AFM. Further columns are in its ``columns``, in SI
        where their unit is known, and NaN where an entry is not a number.

    Raises
    ------
    DataError
        The file cannot be read or used. The message begins with the file's name and the line.
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
    log = _TextLog(path)
    roles = log.roles({"time": time, "drive": drive, "displacement": displacement}, units, dt)
    if resample is not None:
        if dt is not None:
            raise ParameterError("dt and resample: expected one of them at most, both are given")
        check_dt(resample, "resample")
    return log.dataset(roles, dt, hold, resample)


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
) -> DriveRecord:
    r"""Read a drive from a text file that need not have a displacement.

    Parameters
    ----------
    path, time, drive, units, dt
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
    record = drive_dataset(path, time=time, drive=drive, units=units, dt=dt)
    return DriveRecord(record.t, record.u)


def drive_dataset(
    path: str | os.PathLike[str],
    *,
    time: str | int | None = None,
    drive: str | int | None = None,
    units: Mapping[str | int, str] | None = None,
    dt: float | None = None,
) -> Dataset:
    """Read a drive as `read_drive`, with its unit; the displacement of the record is 0."""
    log = _TextLog(path)
    return log.dataset(log.roles({"time": time, "drive": drive}, units, dt), dt, "foh")


def read_displacement(
    path: str | os.PathLike[str],
    *,
    time: str | int | None = None,
    displacement: str | int | None = None,
    units: Mapping[str | int, str] | None = None,
    dt: float | None = None,
) -> Dataset:
    r"""Read a displacement from a text file that need not have a drive.

    Parameters
    ----------
    path, time, units, dt
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
    log = _TextLog(path)
    column = log.columns.to_follow() if displacement is None else displacement
    return log.dataset(log.roles({"time": time, "displacement": column}, units, dt), dt, "foh")


class _TextLog:
    """The lines of one text log, how they are divided, and its columns."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        try:
            file = Path(path)
        except TypeError:
            raise ParameterError(f"path is {quoted(path)}: expected the name of a file") from None
        self.name = file.name or str(file)
        self.lines = self._decode(self._load(file)).split("\n")
        self._check_lines()
        header = self._first_line()
        self.delimiter = delimiter_of(self.lines[header])
        titles = split_fields(self.lines[header], self.delimiter, is_header=True)
        if len(titles) > MOST_COLUMNS:
            found = f"this line has {len(titles)} fields, the first {quoted(titles[0])}"
            raise self.error(f"{found}: expected {MOST_COLUMNS} columns at most", header + 1)
        has_header = are_titles(titles)
        self.header = header + 1
        self.first = header + has_header
        if not has_header and (commented := self._commented_titles(header, len(titles))):
            self.header, titles = commented
            has_header = True
        self.columns = Columns(titles, has_titles=has_header)
        if not any(True for _ in self._rows()):
            raise self.error("holds a header and no samples", self.header)

    def error(self, sentence: str, line: int | None = None) -> DataError:
        """Make an error about the content of the file."""
        return DataError(f"{self.name}:{line}: {sentence}" if line else f"{self.name}: {sentence}")

    @contextmanager
    def named(self, line: int | None = None) -> Iterator[None]:
        """Put the name of the file, and the line of a fault, before a message."""
        try:
            yield
        except DataError as error:
            raise self.error(str(error), line) from None
        except (ParameterError, ShapeError) as error:
            raise type(error)(f"{self.name}: {error}") from None

    def _load(self, file: Path) -> bytes:
        data, is_directory, is_text = b"", False, file.suffix.lower() not in NOT_TEXT
        try:
            is_directory = file.is_dir()
            if not is_directory:
                with file.open("rb") as opened:
                    data = opened.read() if is_text else b""
        except FileNotFoundError:
            raise self.error(f"there is no such file in {quoted(str(file.parent))}") from None
        except PermissionError:
            raise self.error("no permission to read this file") from None
        except (OSError, ValueError) as error:
            raise self.error(f"cannot be read: {error}") from None
        if is_directory:
            raise self.error("is a directory: expected a text log")
        if not is_text:
            only = "only text logs are read so far, export it as CSV"
            raise self.error(f"is not a text log ({file.suffix}): {only}")
        return data

    def _decode(self, data: bytes) -> str:
        is_utf16 = data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
        try:
            text = data.decode("utf-16" if is_utf16 else "utf-8-sig")
        except UnicodeDecodeError:
            if is_utf16:
                raise self.error("is not a text log: it is cut off or not UTF-16") from None
            # Older instruments write the micro sign in Latin-1.
            text = data.decode("latin-1")
        if "\r" in text:
            text = text.replace("\r\n", "\n").replace("\r", "\n")
        if found := _CONTROL.search(text):
            line = text.count("\n", 0, found.start()) + 1
            raise self.error(f"is not a text log: it holds the byte {ord(found[0])}", line)
        return text

    def _check_lines(self) -> None:
        """Refuse a line so long that it is none of a log, before it is divided."""
        longest = max(map(len, self.lines))
        if longest > MOST_LETTERS:
            line = next(k for k, text in enumerate(self.lines) if len(text) == longest)
            found = f"this line has {longest} characters and begins with {quoted(self.lines[line])}"
            raise self.error(f"{found}: expected {MOST_LETTERS} at most", line + 1)

    def _first_line(self) -> int:
        for number, line in enumerate(self.lines):
            if line.strip() and not line.lstrip().startswith(("#", "%")):
                return number
        raise self.error("is empty: expected a header and samples")

    def _commented_titles(self, first: int, count: int) -> tuple[int, list[str]] | None:
        """Find titles in the comment right above the first sample, as numpy.savetxt writes them.

        Returns the line's number and the titles, or None.
        """
        above = [k for k in range(first) if self.lines[k].strip()]
        if not above:
            return None
        titles = split_fields(
            self.lines[above[-1]].strip().lstrip("#% "), self.delimiter, is_header=True
        )
        return (above[-1] + 1, titles) if len(titles) == count and are_titles(titles) else None

    def _rows(self) -> Iterator[tuple[int, str]]:
        """Yield the lines with samples, each with its number as an editor counts."""
        for k in range(self.first, len(self.lines)):
            if self.lines[k].strip():
                yield k + 1, self.lines[k]

    def roles(
        self,
        wanted: Mapping[str, str | int | None],
        units: Mapping[str | int, str] | None,
        dt: float | None,
    ) -> dict[str, Column]:
        """Find the column in each role; with `dt`, the time may be missing and have no unit."""
        with self.named(self.header):
            if dt is not None:
                check_dt(dt)
            return self.columns.roles(wanted, units, needs_time=dt is None)

    def dataset(
        self,
        roles: Mapping[str, Column],
        dt: float | None,
        hold: Hold,
        resample: float | None = None,
    ) -> Dataset:
        """Read the samples."""
        main = {role: c for role, c in roles.items() if role != "time" or dt is None}
        table = self._table(list(main.values()))
        signals = {role: require(c.unit).to_si(table[:, c.index]) for role, c in main.items()}
        t = signals.get("time")
        check = partial(time_fault, resampling=USE_RESAMPLE) if resample is None else backward
        if t is not None and (fault := check(t)) is not None:
            line = next(islice(self._rows(), fault[0], None))[0]
            raise self.error(f"{roles['time']}: {fault[1]}", line)
        if t is not None and resample is not None:
            with self.named():
                times = even_times(t, resample)
            steps = {main["drive"].index} if hold == "zoh" and "drive" in main else set()
            table = evened(t, table, times, constant=steps)
            signals = {role: require(c.unit).to_si(table[:, c.index]) for role, c in main.items()}
            signals["time"] = times
        columns, units = self._further(table, {column.index for column in roles.values()})
        # A drive alone is a record with an unused displacement, and vice versa.
        nothing = np.zeros(len(table))
        with self.named():
            return Dataset(
                u=signals.get("drive", nothing),
                y=signals.get("displacement", nothing),
                t=signals.get("time"),
                dt=dt,
                hold=hold,
                drive_unit=require(main["drive"].unit).si if "drive" in main else "V",
                columns=columns,
                column_units=units,
                source=self.name,
            )

    def _further(self, table: Array, taken: set[int]) -> tuple[dict[str, Array], dict[str, str]]:
        """Name and convert the columns that have no role."""
        columns: dict[str, Array] = {}
        units: dict[str, str] = {}
        rest = [column for column in self.columns if column.index not in taken]
        shared = Counter(column.name for column in rest)
        for column in rest:
            name = column.name if shared[column.name] == 1 else column.title
            if not name or name in columns:
                name = f"column {column.index}"
            unit = lookup(column.unit)
            values = table[:, column.index]
            columns[name] = values if unit is None else unit.to_si(values)
            units[name] = column.unit if unit is None else unit.si
        return columns, units

    def _table(self, main: Sequence[Column]) -> Array:
        """Return all samples, shape (samples, columns); those of `main` are finite."""
        shape = sum(1 for _ in self._rows()), len(self.columns)
        swap = self._has_decimal_commas(main)
        body = islice(self.lines, self.first, None)
        rows = (line.translate(_SWAP) for line in body) if swap else body
        try:
            table = np.loadtxt(
                rows, delimiter=self.delimiter, comments=None, quotechar='"', ndmin=2, encoding=None
            )
        except ValueError:
            return self._table_by_line(main, shape, swap)
        if table.shape != shape or not np.isfinite(table[:, [c.index for c in main]]).all():
            return self._table_by_line(main, shape, swap)
        return table

    def _table_by_line(self, main: Sequence[Column], shape: tuple[int, int], swap: bool) -> Array:
        """Do the same line by line, to name a fault, or for further columns with text."""
        table = np.empty(shape)
        for row, (line, text) in enumerate(self._rows()):
            fields = self._fields(text)
            if len(fields) != shape[1]:
                last = "; the log may have been cut off in this last line"
                raise self.error(
                    f"this line has {len(fields)} fields, expected {shape[1]} as in line "
                    f"{self.header}{last if row == shape[0] - 1 else ''}",
                    line,
                )
            values = [number_of(field.translate(_SWAP) if swap else field) for field in fields]
            for column in main:
                if not math.isfinite(values[column.index]):
                    raise self.error(field_fault(fields[column.index], column, swap), line)
            table[row] = values
        return table

    def _fields(self, line: str) -> list[str]:
        fields = split_fields(line, self.delimiter)
        # Some loggers end each line with a delimiter.
        return fields[:-1] if len(fields) > len(self.columns) and not fields[-1] else fields

    def _has_decimal_commas(self, main: Sequence[Column]) -> bool:
        """Find the decimal mark in the first sample of `main` that has one."""
        if self.delimiter == "," or not any("," in line for _, line in self._rows()):
            return False
        for _, line in self._rows():
            fields = self._fields(line)
            numbers = "".join(fields[c.index] for c in main if c.index < len(fields))
            if "," in numbers or "." in numbers:
                return "." not in numbers
        return False
