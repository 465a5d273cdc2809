"""LabVIEW measurement files (.lvm): text with a header for the file and one for each segment."""

from __future__ import annotations

import math
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...._support.arrays import UNEVEN
from ...columns import Column, Columns
from ...text_fields import number_of
from ..table import Channel, ChannelTable, Format
from .delimited import Layout, TextTable, lines_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from ..source import Source

__all__ = ["FORMAT"]

END = "***End_of_Header***"
SPECIAL = "***Start_Special***", "***End_Special***"
X = "X_Value"
# Intervals off their place from which a time says that samples are missing.
LOST = 0.5


class Segment(NamedTuple):
    """A segment: its header, by name, and where its lines are, from 0."""

    entries: dict[str, list[str]]
    titles: int
    last: int


def _opens(source: Source) -> ChannelTable:
    lines = _without_special(lines_of(source))
    ends = [k for k, line in enumerate(lines) if line.startswith(END)]
    if len(ends) < 2:
        raise source.error(f"has {len(ends)} lines {END!r}: expected one behind each header")
    entries = _entries(lines[: ends[0]], None)
    separator = "," if entries.get("Separator", ["Tab"])[0].lower().startswith("comma") else "\t"
    segments = list(_segments(lines, ends, separator))
    channels: list[Channel] = []
    notes: list[str] = []
    for number, segment in enumerate(segments, start=1):
        group = f"segment {number}" if len(segments) > 1 else ""
        table = _samples(source, lines, segment, separator)
        if (note := _check_count(source, segment, table)) is not None:
            notes.append(note)
        channels += _channels(segment, table, group)
    return ChannelTable(source, channels, notes=notes)


def _without_special(lines: list[str]) -> list[str]:
    """Blank the blocks that other programs may have put in."""
    kept, special = [], False
    for line in lines:
        special = special or line.startswith(SPECIAL[0])
        kept.append("" if special else line)
        special = special and not line.startswith(SPECIAL[1])
    return kept


def _entries(lines: list[str], separator: str | None) -> dict[str, list[str]]:
    """Read the lines of a header: a name, then values."""
    entries = {}
    for line in lines:
        name, *values = [field.strip() for field in line.split(separator or _separator(line))]
        if name:
            entries[name] = values or [""]
    return entries


def _separator(line: str) -> str:
    return "\t" if "\t" in line else ","


def _segments(lines: list[str], ends: list[int], separator: str) -> Iterator[Segment]:
    """Find the segments: a header begins behind a blank line, or with the line ``Channels``."""
    begins = []
    for before, end in pairwise(ends):
        first = end
        while first > before + 1 and not lines[first].startswith(f"Channels{separator}"):
            first -= 1
        begins.append(first)
    for k, (first, end) in enumerate(zip(begins, ends[1:], strict=True)):
        last = begins[k + 1] if k + 1 < len(begins) else len(lines)
        yield Segment(_entries(lines[first:end], separator), end + 1, last)


def _check_count(source: Source, segment: Segment, table: TextTable) -> str | None:
    """Refuse fewer samples than the header says; return a note on more of them.

    LabVIEW writes one header before several blocks of samples, where it is told to.
    """
    stated = number_of(segment.entries.get("Samples", [""])[0])
    there = table.count(table.columns[0])
    if there < stated:
        raise source.error(
            f"says {stated:.0f} samples and has {there}: expected equally many; the log may have "
            "been cut off",
            segment.titles,
        )
    if there > stated:
        return (
            f"the header before line {segment.titles + 1} says {stated:.0f} samples, and there are "
            f"{there}: all are read"
        )
    return None


def _channels(segment: Segment, table: TextTable, group: str) -> Iterator[Channel]:
    """Divide a segment into channels with their units and intervals."""
    number = 0
    time: np.ndarray | None = None
    for column in table.columns:
        is_x = column.title == X
        delta = number_of(_entry(segment, "Delta_X", number).replace(",", "."))
        interval = delta if 0.0 < delta < math.inf else None
        seconds = _entry(segment, "X_Dimension", number) in ("Time", "")
        if is_x:
            values = table.column(column)
            before, time = time, values if np.isfinite(values).all() and seconds else None
            # Each channel may have a column of its own with the same times.
            if time is not None and (before is None or not np.array_equal(time, before)):
                name = X if _agree(time, interval) else "time"
                yield _channel(table, column, name, group, "s", None)
            continue
        if not seconds or (time is not None and not _agree(time, interval)):
            interval = None
        unit = _entry(segment, "Y_Unit_Label", number) or None
        yield _channel(table, column, column.title, group, unit, interval)
        number += 1


def _samples(source: Source, lines: list[str], segment: Segment, separator: str) -> TextTable:
    """Read the lines of a segment without their comments; blank X columns are NaN."""
    if segment.titles >= len(lines):
        raise source.error("ends behind a header: expected samples", segment.titles)
    titles = [title.strip() for title in lines[segment.titles].split(separator)]
    # Behind the last channel there may be comments.
    used = titles.index("Comment") if "Comment" in titles else len(titles)
    titles = titles[:used]
    while titles and not titles[-1]:
        titles.pop()
    rows = list(lines)
    for k in range(segment.titles + 1, segment.last):
        if lines[k].strip():
            fields = [field.strip() for field in lines[k].split(separator)][: len(titles)]
            pairs = zip(fields, titles, strict=False)
            fields = [field or ("nan" if title == X else "") for field, title in pairs]
            rows[k] = separator.join(fields)
    columns = Columns.of([Column(k, title, title, "") for k, title in enumerate(titles)])
    layout = Layout(
        rows,
        columns,
        first=segment.titles + 1,
        last=segment.last,
        delimiter=separator,
        header=segment.titles + 1,
    )
    return TextTable(source, layout)


def _channel(
    table: TextTable, column: Column, name: str, group: str, unit: str | None, dt: float | None
) -> Channel:
    read = partial(table.column, column)
    return Channel(name, table.count(column), read, group, unit, dt)


def _entry(segment: Segment, name: str, number: int) -> str:
    """Return the value of a channel in a header, or that of all channels."""
    values = segment.entries.get(name, [""])
    return values[number] if number < len(values) else values[0]


def _agree(times: np.ndarray, interval: float | None) -> bool:
    """Whether times are those of an interval, but for their last digits: none is lost between."""
    if interval is None or times.size < 2:
        return False
    mean = float(times[-1] - times[0]) / (times.size - 1)
    if abs(mean - interval) > UNEVEN * interval:
        return False
    even = times[0] + interval * np.arange(times.size)
    return bool(np.abs(times - even).max() < LOST * interval)


FORMAT = Format(
    name="LabVIEW measurement",
    endings=(".lvm",),
    opens=_opens,
    begins=lambda head: head.removeprefix(b"\xef\xbb\xbf").startswith(b"LabVIEW Measurement"),
)
