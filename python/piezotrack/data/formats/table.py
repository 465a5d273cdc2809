"""Table that every format gives: named columns with the file's units and interval."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ..._support.arrays import MOST_SAMPLES, unmasked
from ..._support.units import lookup, split_unit, symbol_of
from ...errors import DataError
from ..columns import Column, Columns
from ..missing import USE_MISSING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from .source import Source

    Array = NDArray[np.float64]

__all__ = [
    "Channel",
    "ChannelTable",
    "Format",
    "Table",
    "WrittenColumn",
    "names_interval",
    "numbers",
    "split_matrix",
    "stated_interval",
]

# Most columns of a file, and bytes of a sample in memory.
MOST_COLUMNS = 10_000
ITEM = 8
# Names of a constant that is the sampling interval, or its inverse, and the units of the latter.
INTERVALS = ("dt", "ts", "interval", "sample time", "sampling interval", "sample interval")
RATES = ("fs", "rate", "sample rate", "sampling rate", "sampling frequency", "sample frequency")
HERTZ = {"hz": 1.0, "khz": 1e3, "mhz": 1e6}


@dataclass(frozen=True)
class WrittenColumn:
    """A column to write.

    Attributes
    ----------
    name : str
        Its name without a unit.
    unit : str
        Its unit; may be empty.
    values : ndarray, shape (n,)
        In that unit.
    title : str
        Name and unit as a reader finds them again.
    """

    name: str
    unit: str
    values: Array
    title: str


@dataclass(frozen=True)
class Format:
    """One format of logs.

    Attributes
    ----------
    name : str
        What messages call it.
    endings : tuple of str
        Endings of the names of its files, in small letters.
    opens : callable
        Reads what columns a file has, and no samples yet where the format allows it.
    begins : callable
        Whether the first bytes of a file are those of this format.
    writes : callable, optional
        Writes columns to a file that exists.
    """

    name: str
    endings: tuple[str, ...]
    opens: Callable[[Source], Table]
    begins: Callable[[bytes], bool]
    writes: Callable[[Path, Sequence[WrittenColumn]], None] | None = None

    def write(self, path: Path, columns: Sequence[WrittenColumn]) -> None:
        """Write columns, where the format is one that is written."""
        if self.writes is not None:
            self.writes(path, columns)


class Table(ABC):
    """The columns of a file.

    Attributes
    ----------
    source : Source
        The file.
    columns : Columns
        Its columns.
    header : int or None
        The line of a text that names the columns.
    dt : float or None
        Sampling interval that the file states for all columns [s].
    signals : frozenset of int
        Columns whose missing readings can be left out or filled; a fault of theirs says so.
    takes_missing : bool
        Whether they are, as NaN.
    """

    source: Source
    columns: Columns
    header: int | None = None
    dt: float | None = None
    signals: frozenset[int] = frozenset()
    takes_missing: bool = False

    @abstractmethod
    def values(self, main: Sequence[Column]) -> Mapping[int, Array]:
        """Read the samples of columns, and of those that go with them.

        Parameters
        ----------
        main : sequence of Column
            The columns that are needed; their samples are finite, or NaN where missing ones are
            taken.

        Returns
        -------
        mapping of int to ndarray, each of shape (n,)
            By the number of the column, in the units of the columns.
        """

    @abstractmethod
    def column(self, column: Column) -> Array:
        """Read one column as it is, also where entries are no numbers: those are NaN."""

    @abstractmethod
    def count(self, column: Column) -> int:
        """Return the number of samples of a column."""

    def is_empty(self, column: Column) -> bool:
        """Whether a column has no reading at all."""
        try:
            return bool(np.isnan(self.column(column)).all())
        except DataError:
            # One that cannot be read is not known to be empty.
            return False

    def above(self) -> int | None:
        """Return how many lines seem to be above the titles, where those found seem to be none."""
        return None

    def interval(self, main: Sequence[Column]) -> float | None:
        """Return the sampling interval that the file states for columns [s], or None."""
        del main
        return self.dt

    def line(self, sample: int) -> int | None:
        """Return the line of a text that a sample is in."""
        del sample
        return None


@dataclass
class Channel:
    """One column of a file whose samples are not read yet.

    Attributes
    ----------
    name : str
        Its name without that of its group; where the file does not state a unit, the name may
        have it, as ``voltage_V``.
    count : int
        Its number of samples.
    read : callable
        Reads them: numbers or times, shape (n,).
    group : str
        What it is in: a group, a table, a structure; several separated by slashes.
    unit : str or None
        As the file states it; None where it does not.
    dt : float or None
        Sampling interval as the file states it [s].
    """

    name: str
    count: int
    read: Callable[[], Any]
    group: str = ""
    unit: str | None = None
    dt: float | None = field(default=None)

    @property
    def path(self) -> str:
        """Group and name."""
        return f"{self.group}/{self.name}" if self.group else self.name


class ChannelTable(Table):
    """Channels of one length or several.

    Parameters
    ----------
    source : Source
        The file.
    channels : iterable of Channel
        What it holds. Those with one value are constants; one of them may be the interval, as
        ``dt_s`` or ``fs_Hz``.
    dt : float, optional
        Sampling interval that the file states [s].
    titled : bool, optional
        Whether the names are titles of the file.
    notes : sequence of str, optional
        What a person should know of the file.
    """

    def __init__(
        self,
        source: Source,
        channels: Iterable[Channel],
        *,
        dt: float | None = None,
        titled: bool = True,
        notes: Sequence[str] = (),
    ) -> None:
        columns = list(channels)
        self.source = source
        self.channels = [channel for channel in columns if channel.count > 1]
        if not self.channels:
            raise source.error(
                "holds no column of numbers with two samples or more: expected those of the drive "
                "and of the displacement"
            )
        if len(self.channels) > MOST_COLUMNS:
            raise source.error(f"has {len(self.channels)} columns: expected {MOST_COLUMNS} at most")
        self.columns = Columns.of(
            [column_of(k, channel) for k, channel in enumerate(self.channels)]
            if titled
            else [Column(k, "", "", "") for k in range(len(self.channels))],
            has_titles=titled,
        )
        self.columns.notes += notes
        self.dt = dt if dt is not None else stated_interval(c for c in columns if c.count == 1)

    def count(self, column: Column) -> int:
        """Return the number of samples of a column."""
        return self.channels[column.index].count

    def interval(self, main: Sequence[Column]) -> float | None:
        """Return the interval that the file states for columns; several are an error."""
        stated = {}
        for column in main:
            channel = self.channels[column.index]
            if (dt := channel.dt if channel.dt is not None else self.dt) is not None:
                stated[str(column)] = dt
        if not stated:
            return None
        (first, dt), *others = stated.items()
        for other, interval in others:
            if abs(interval - dt) > 1e-6 * dt:
                raise self.source.error(
                    f"the file states an interval of {dt:.10g} s for {first} and {interval:.10g} s "
                    f"for {other}: expected the same, or dt="
                )
        return dt if len(stated) == len(main) or self.dt is not None else None

    def values(self, main: Sequence[Column]) -> Mapping[int, Array]:
        """Read the main columns, and those of the same groups that are as long."""
        lengths = {column: self.channels[column.index].count for column in main}
        (first, count), *others = lengths.items()
        for other, length in others:
            if length != count:
                raise self.source.error(
                    f"{first} has {count} samples and {other} has {length}: expected equally many"
                )
        if count > MOST_SAMPLES:
            raise self.source.error(f"{first} has {count} samples: expected {MOST_SAMPLES} at most")
        self.source.check_size("the sum of the columns", ITEM * count * len(main))
        table = {}
        for column in main:
            values = self.column(column)
            missing = np.isnan(values) & (column.index in self.signals)
            fits = np.isfinite(values) | (missing & self.takes_missing)
            if (bad := _first(~fits)) is not None:
                remedy = USE_MISSING if missing[bad] else ""
                raise self.source.error(
                    f"{column} is {values[bad]} at sample {bad}: expected finite numbers{remedy}"
                )
            table[column.index] = values
        groups = {column.group for column in main}
        beside = [
            column
            for column in self.columns
            if column.index not in table
            and self.channels[column.index].count == count
            and column.group in groups
        ]
        most = max(0, self.source.most // (ITEM * max(count, 1)) - len(table))
        for column in beside[:most]:
            further = self._further(column, self.channels[column.index])
            if further is not None and further.shape == (count,):
                table[column.index] = further
        if len(beside) > most:
            self.columns.notes.append(
                f"{len(beside) - most} further columns are left out: all of them would have "
                f"{ITEM * count * (len(main) + len(beside))} bytes, expected {self.source.most} at "
                f"most, as measured samples in a file of {self.source.size} bytes"
            )
        return table

    def _further(self, column: Column, channel: Channel) -> Array | None:
        """Read a column that is not needed; one that cannot be read is left out, with a note."""
        try:
            return numbers(channel.read())
        except DataError as error:
            reason = str(error).removeprefix(f"{self.source.name}: ")
            self.columns.notes.append(f"{column} is left out: it {reason}")
            return None

    def column(self, column: Column) -> Array:
        """Read one column; what is not a number is NaN."""
        channel = self.channels[column.index]
        raw = channel.read()
        values = numbers(raw)
        if values is None:
            raise self.source.error(
                f"{column} holds values of type {np.asarray(raw).dtype}: expected real numbers"
            )
        if values.shape != (channel.count,):
            raise self.source.error(
                f"{column} has the shape {values.shape}, said to be ({channel.count},)"
            )
        return values


def numbers(raw: Any) -> Array | None:
    """Convert numbers and times to float64, dates to seconds from the first one."""
    values = np.asarray(unmasked(raw))
    if values.dtype.kind == "M":
        # The first sample is at 0 s: float64 does not hold nanoseconds since 1970.
        values = values - values[:1]
    if values.dtype.kind == "m":
        lost = np.isnat(values)
        values = values.astype("timedelta64[ns]").astype(np.int64) / 1e9
        values[lost] = np.nan
    if values.dtype.kind not in "biuf":
        return None
    # NaN in float32 may be one that signals.
    with np.errstate(over="ignore", invalid="ignore"):
        return values.astype(np.float64, copy=False)


def column_of(index: int, channel: Channel) -> Column:
    """Make the column of a channel; a stated unit counts as one in a title."""
    name, unit = _split(channel.name)
    if channel.unit is not None:
        stated = symbol_of(channel.unit)
        if not stated or (lookup(unit) is None and unit != stated):
            # What looks like a unit is part of the name.
            name, unit = (channel.name.strip() if unit else name), ""
        # No unit has this name: where two are stated, the caller has to say which one it is.
        agree = not unit or lookup(unit) == lookup(stated)
        unit = stated if agree else f"{unit} in its title, {stated} beside it"
    return Column(
        index, channel.path, name, unit, group=channel.group, count=channel.count, last=channel.name
    )


def split_matrix(name: str, shape: Sequence[int]) -> list[tuple[str, tuple[Any, ...], int]]:
    """Divide an array into columns: the samples go along its longest dimension.

    Parameters
    ----------
    name : str
        Name of the array.
    shape : sequence of int
        Its shape.

    Returns
    -------
    list of (str, tuple, int)
        Name, index into the array and number of samples of each column; none for arrays of more
        than two dimensions besides those of length 1.

    Examples
    --------
    >>> split_matrix("u", (1, 500))
    [('u', (0, slice(None, None, None)), 500)]
    >>> [name for name, _, _ in split_matrix("data", (500, 3))]
    ['data[0]', 'data[1]', 'data[2]']
    """
    every = slice(None)
    long = [k for k, length in enumerate(shape) if length != 1]
    if len(long) <= 1:
        along = long[0] if long else 0
        place = tuple(every if k == along else 0 for k in range(len(shape)))
        return [(name, place, shape[along] if shape else 1)]
    if len(long) > 2 or len(shape) > 8:
        return []
    across, along = sorted(long, key=lambda k: (shape[k], -k))
    columns = []
    for number in range(min(shape[across], MOST_COLUMNS + 1)):
        place = tuple(
            every if k == along else number if k == across else 0 for k in range(len(shape))
        )
        columns.append((f"{name}[{number}]", place, shape[along]))
    return columns


def _split(name: str) -> tuple[str, str]:
    """Split a name into name and unit; the number of a column of a matrix is no unit."""
    return (name, "") if re.search(r"\[\d+\]$", name) else split_unit(name)


def stated_interval(constants: Iterable[Channel]) -> float | None:
    """Find the sampling interval among the constants of a file [s]."""
    for channel in constants:
        if (scale := _interval_scale(channel)) is None:
            continue
        values = np.asarray(channel.read()).ravel()
        if values.size != 1 or values.dtype.kind not in "iuf" or not float(values[0]) > 0.0:
            continue
        per_second, is_rate = scale
        value = float(values[0])
        return 1.0 / (value * per_second) if is_rate else value / per_second
    return None


def names_interval(name: str) -> bool:
    """Whether a name is that of a sampling interval or of its inverse, with a unit.

    Examples
    --------
    >>> names_interval("sample_rate_Hz"), names_interval("dt")
    (True, False)
    """
    return _interval_scale(Channel(name, 1, list)) is not None


def _interval_scale(channel: Channel) -> tuple[float, bool] | None:
    """Return how many units there are in SI, and whether it is a rate; None where it is neither."""
    column = column_of(0, channel)
    name = re.sub(r"[\s_-]+", " ", column.name).lower()
    unit = column.unit.lower()
    seconds = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}.get(unit)
    if name.endswith((" hz", " khz")):
        name, _, unit = name.rpartition(" ")
    if name in INTERVALS and seconds:
        return seconds, False
    return (HERTZ[unit], True) if name in RATES and unit in HERTZ else None


def _first(mask: NDArray[np.bool_]) -> int | None:
    return int(np.argmax(mask)) if mask.any() else None
