"""Text logs of any usual delimiter and encoding, with dates."""

from __future__ import annotations

import codecs
import math
import re
from dataclasses import replace
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np

from ...._support.messages import quoted
from ...columns import Columns
from ...missing import USE_MISSING
from ...text_fields import (
    are_titles,
    delimiter_of,
    field_fault,
    is_missing,
    number_of,
    split_fields,
)
from ..kinds import kind_of
from ..table import MOST_COLUMNS, Format, Table
from .dates import instant_of, is_ambiguous

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from ...columns import Column
    from ..source import Source
    from ..table import WrittenColumn
    from .dates import Instant

    Array = NDArray[np.float64]

__all__ = ["FORMAT", "Layout", "TextTable", "lines_of"]

# A line beyond this is none of a log.
MOST_LETTERS = 1_000_000
# Lines above titles at most.
MOST_ABOVE = 200
CUT_OFF = "; the log may have been cut off in this last line"
# Samples before a last one without its line end that it is compared with: at least, and at most.
LEAST_BEFORE, MOST_BEFORE = 10, 1000

_CONTROL = re.compile(r"[\x00-\x08\x0e-\x1f]")
_SWAP = str.maketrans(",.", ".,")


def lines_of(source: Source) -> list[str]:
    """Decode a text file and divide it into its lines.

    Parameters
    ----------
    source : Source
        The file.

    Returns
    -------
    list of str
        The lines.

    Raises
    ------
    DataError
        It is no text, or has a line too long for a log.
    """
    if (kind := kind_of(source.head)) is not None:
        raise source.error(kind)
    lines = _decode(source, source.content()).split("\n")
    # They stay, as blank ones, so that messages name the lines that an editor shows.
    lines[: source.skip] = [""] * min(source.skip, len(lines))
    longest = max(map(len, lines))
    if longest > MOST_LETTERS:
        line = next(k for k, text in enumerate(lines) if len(text) == longest)
        found = f"this line has {longest} characters and begins with {quoted(lines[line])}"
        raise source.error(f"{found}: expected {MOST_LETTERS} at most", line + 1)
    return lines


def _decode(source: Source, data: bytes) -> str:
    is_utf16 = data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    try:
        text = data.decode("utf-16" if is_utf16 else "utf-8-sig")
    except UnicodeDecodeError:
        if is_utf16:
            raise source.error("is not a text log: it is cut off or not UTF-16") from None
        # Older instruments write the micro sign in Latin-1.
        text = data.decode("latin-1")
    if "\r" in text:
        text = text.replace("\r\n", "\n").replace("\r", "\n")
    if match := _CONTROL.search(text):
        line = text.count("\n", 0, match.start()) + 1
        raise source.error(
            f"is not a text log: it holds the byte {ord(match[0])}, expected text", line
        )
    return text


class Layout:
    """Where the samples of a text are, and the titles of their columns.

    Parameters
    ----------
    lines : list of str
        The file.
    first, last : int
        The first line with samples and that behind the last one, from 0.
    delimiter : str or None
        Between fields; None for blanks.
    columns : Columns
        The columns.
    header : int or None
        The line with the titles, from 1.
    """

    def __init__(
        self,
        lines: list[str],
        columns: Columns,
        *,
        first: int,
        last: int | None = None,
        delimiter: str | None,
        header: int | None,
    ) -> None:
        self.lines, self.columns, self.first, self.delimiter = lines, columns, first, delimiter
        self.last = len(lines) if last is None else last
        self.header = header

    @classmethod
    def of(cls, source: Source, lines: list[str]) -> Layout:
        """Find header and delimiter of a log that has no other description."""
        header = _first_line(source, lines)
        delimiter = delimiter_of(lines[header])
        titles = split_fields(lines[header], delimiter, is_header=True)
        if len(titles) > MOST_COLUMNS:
            found = f"this line has {len(titles)} fields, the first {quoted(titles[0])}"
            raise source.error(f"{found}: expected {MOST_COLUMNS} columns at most", header + 1)
        has_header = are_titles(titles)
        first, named_in = header + has_header, header + 1
        if not has_header and (
            commented := _commented_titles(lines, header, len(titles), delimiter)
        ):
            named_in, titles = commented
            has_header = True
        columns = Columns(titles, has_titles=has_header)
        return cls(lines, columns, first=first, delimiter=delimiter, header=named_in)

    def rows(self) -> Iterator[tuple[int, str]]:
        """Yield the lines with samples, each with its number as an editor counts."""
        for k in range(self.first, self.last):
            if self.lines[k].strip():
                yield k + 1, self.lines[k]


class TextTable(Table):
    """The samples in the lines of a text.

    Parameters
    ----------
    source : Source
        The file.
    layout : Layout
        Where they are.
    dt : float, optional
        Sampling interval that the file states [s].
    """

    def __init__(self, source: Source, layout: Layout, *, dt: float | None = None) -> None:
        self.source, self.layout, self.columns, self.dt = source, layout, layout.columns, dt
        self.header = layout.header
        first = next(layout.rows(), None)
        if first is None:
            raise source.error(
                "holds a header and no samples: expected one line for each", self.header
            )
        self._count = sum(1 for _ in layout.rows())
        self._check_last()
        self._dates: dict[int, Instant] = {}
        for column, text in zip(list(self.columns), self._fields(first[1]), strict=False):
            if not math.isnan(number_of(text)):
                continue
            if (instant := instant_of(text)) is not None:
                self._dates[column.index] = instant
            if instant is not None or (not column.unit and is_ambiguous(text)):
                self.columns[column.index] = replace(column, unit="s")

    def _check_last(self) -> None:
        """Refuse a log that was cut off within the last field of its last line.

        Many whole files do not end that line, so it is taken for a half one only where the field
        has fewer decimals than those of all samples before it; and not where it is 0, at rest, in
        numbers written with their shortest digits.
        """
        lines, last = self.layout.lines, self.layout.last
        if last != len(lines) or not lines[-1].strip() or self._count <= LEAST_BEFORE:
            return
        before = [line for line in lines[self.layout.first : last - 1] if line.strip()]
        rows = [self._fields(line) for line in before[-MOST_BEFORE:]]
        half = self._fields(lines[-1])
        if len(half) != len(rows[-1]):
            # Refused for the number of its fields.
            return
        decimals = [_decimals(row[-1]) for row in rows]
        is_fixed = min(decimals) == max(decimals)
        if _decimals(half[-1]) < min(decimals) and (is_fixed or half[-1].strip() != "0"):
            raise self.source.error(
                f"the file ends in this line, whose last field {quoted(half[-1])} has fewer "
                "decimals than in all lines before it: expected a whole line, or the end of one "
                "behind it; the log may have been cut off",
                last,
            )

    def count(self, column: Column) -> int:
        """Return the number of samples."""
        del column
        return self._count

    def line(self, sample: int) -> int | None:
        """Return the line of a sample."""
        return next(islice(self.layout.rows(), sample, None))[0]

    def values(self, main: Sequence[Column]) -> Mapping[int, Array]:
        """Read all columns."""
        table = self._table(main)
        return {column.index: table[:, column.index] for column in self.columns}

    def column(self, column: Column) -> Array:
        """Read one column; what is not a number is NaN."""
        return self.all_columns()[:, column.index]

    def above(self) -> int | None:
        """Return the number of lines above titles further down, with samples right below them."""
        lines = self.layout.lines[: MOST_ABOVE + 1]
        for k in range(self.layout.first, len(lines) - 1):
            delimiter = delimiter_of(lines[k])
            titles, below = (split_fields(line, delimiter) for line in lines[k : k + 2])
            if 1 < len(titles) == len(below) and are_titles(titles) and not are_titles(below):
                return k
        return None

    def is_empty(self, column: Column) -> bool:
        """Whether there is no reading in any line."""
        fields = (self._fields(line) for _, line in self.layout.rows())
        return all(is_missing(row[column.index]) for row in fields if column.index < len(row))

    def all_columns(self) -> Array:
        """Read all columns; what is not a number is NaN."""
        if self._read is None:
            self._read = self._table([])
        return self._read

    _read: Array | None = None

    def _table(self, main: Sequence[Column]) -> Array:
        """Return all samples, shape (samples, columns); those of `main` are finite."""
        shape = self._count, len(self.columns)
        swap = self._has_decimal_commas(main or self.columns)
        if self._dates:
            return self._table_by_line(main, shape, swap)
        body = islice(self.layout.lines, self.layout.first, self.layout.last)
        rows = (line.translate(_SWAP) for line in body) if swap else body
        try:
            table = np.loadtxt(
                rows,
                delimiter=self.layout.delimiter,
                comments=None,
                quotechar='"',
                ndmin=2,
                encoding=None,
            )
        except ValueError:
            return self._table_by_line(main, shape, swap)
        needed = [column.index for column in main]
        if table.shape != shape or not np.isfinite(table[:, needed]).all():
            return self._table_by_line(main, shape, swap)
        return table

    def _table_by_line(self, main: Sequence[Column], shape: tuple[int, int], swap: bool) -> Array:
        """Do the same line by line, to name a fault, or for dates and further columns with text."""
        table = np.empty(shape)
        for row, (line, text) in enumerate(self.layout.rows()):
            fields = self._fields(text)
            if len(fields) != shape[1]:
                raise self.source.error(
                    f"this line has {len(fields)} fields, expected {shape[1]} as in line "
                    f"{self.header}{CUT_OFF if row == shape[0] - 1 else ''}",
                    line,
                )
            values = [number_of(field.translate(_SWAP) if swap else field) for field in fields]
            for index, first in self._dates.items():
                values[index] = _seconds(fields[index], first)
            for column in main:
                if not math.isfinite(values[column.index]):
                    missing = column.index in self.signals and is_missing(fields[column.index])
                    if missing and self.takes_missing:
                        continue
                    fault = self._fault(fields[column.index], column, swap)
                    ends = not fields[-1] and row == shape[0] - 1
                    remedy = CUT_OFF if ends else USE_MISSING if missing else ""
                    raise self.source.error(f"{fault}{remedy}", line)
            table[row] = values
        return table

    def _fault(self, text: str, column: Column, swap: bool) -> str:
        if column.index in self._dates:
            return f"{quoted(text)} in {column} is not a date: expected one as in the first sample"
        if is_ambiguous(text):
            return (
                f"{quoted(text)} in {column} may be day or month first: expected a date as "
                "2024-03-12 10:00:00.5 or 12.03.2024 10:00:00,5"
            )
        return field_fault(text, column, swap)

    def _fields(self, line: str) -> list[str]:
        fields = split_fields(line, self.layout.delimiter)
        # Some loggers end each line with a delimiter.
        return fields[:-1] if len(fields) > len(self.columns) and not fields[-1] else fields

    def _has_decimal_commas(self, main: Sequence[Column]) -> bool:
        """Find the decimal mark in the first sample of `main` that has one."""
        rows = self.layout.rows
        if self.layout.delimiter == "," or not any("," in line for _, line in rows()):
            return False
        numbers = [column.index for column in main if column.index not in self._dates]
        for _, line in rows():
            fields = self._fields(line)
            text = "".join(fields[k] for k in numbers if k < len(fields))
            if "," in text or "." in text:
                return "." not in text
        return False


def _first_line(source: Source, lines: list[str]) -> int:
    for number, line in enumerate(lines):
        if line.strip() and not line.lstrip().startswith(("#", "%")):
            return number
    raise source.error("is empty: expected a header and samples")


def _commented_titles(
    lines: list[str], first: int, count: int, delimiter: str | None
) -> tuple[int, list[str]] | None:
    """Find titles in the comment right above the first sample, as numpy.savetxt writes them.

    Returns the line's number and the titles, or None.
    """
    above = [k for k in range(first) if lines[k].strip()]
    if not above:
        return None
    titles = split_fields(lines[above[-1]].strip().lstrip("#% "), delimiter, is_header=True)
    return (above[-1] + 1, titles) if len(titles) == count and are_titles(titles) else None


def _decimals(text: str) -> int:
    """Return the number of characters of a field behind its decimal mark."""
    mark = max(text.rfind("."), text.rfind(","))
    return len(text) - 1 - mark if mark >= 0 else 0


def _seconds(text: str, first: Instant) -> float:
    """Return the time since the first sample [s], NaN where there is no date."""
    instant = instant_of(text)
    if instant is None:
        return math.nan
    try:
        return instant.since(first)
    except TypeError:
        return math.nan


def _opens(source: Source) -> TextTable:
    return TextTable(source, Layout.of(source, lines_of(source)))


def _writes(path: Path, columns: Sequence[WrittenColumn]) -> None:
    """Write CSV; the shortest digits that give the same number again."""
    import csv

    with path.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerow([column.title for column in columns])
        rows = zip(*(column.values.tolist() for column in columns), strict=True)
        file.writelines(",".join(map(repr, row)) + "\n" for row in rows)


FORMAT = Format(
    name="CSV",
    endings=(".csv", ".txt", ".dat", ".tsv", ".asc"),
    opens=_opens,
    begins=lambda _: False,
    writes=_writes,
)
