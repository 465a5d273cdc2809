"""GCS arrays, the text files of controllers by Physik Instrumente.

A header of comments (``# SEPARATOR = 32``, ``# SAMPLE_TIME = 0.0001``, ``# NDATA = 1024``,
``# NAME0 = ...``, ``# END_HEADER``), then one line for each sample. Units are not in it.
"""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING

from ...columns import Columns
from ...text_fields import number_of, split_fields
from ..table import MOST_COLUMNS, Format
from .delimited import Layout, TextTable, lines_of

if TYPE_CHECKING:
    from ..source import Source

__all__ = ["FORMAT"]

_ENTRY = re.compile(r"#\s*([A-Z_]+?)\s*(\d*)\s*=\s*(.*?)\s*")
_BEGINS = re.compile(rb"\s*#\s*(TYPE|VERSION|SEPARATOR|DIM)\s*=")


def _opens(source: Source) -> TextTable:
    lines = lines_of(source)
    end = next((k for k, line in enumerate(lines) if re.match(r"#\s*END_HEADER", line)), None)
    if end is None:
        raise source.error("has no line '# END_HEADER': expected a GCS array, as PI writes it")
    entries: dict[str, tuple[int, str]] = {}
    for k in range(end):
        if found := _ENTRY.fullmatch(lines[k]):
            entries[found[1] + found[2]] = (k + 1, found[3])
    separator = chr(_whole(source, entries, "SEPARATOR", 32, 255))
    count = _columns(source, entries, lines, end, separator)
    names = [entries.get(f"NAME{k}", (0, ""))[1] for k in range(count)]
    columns = Columns(names, has_titles=any(names))
    layout = Layout(
        lines,
        columns,
        first=end + 1,
        delimiter=None if separator == " " else separator,
        header=end + 1,
    )
    table = TextTable(source, layout, dt=_sample_time(source, entries))
    if "NDATA" in entries:
        stated, there = _whole(source, entries, "NDATA", 0, 2**63), table.count(columns[0])
        if stated != there:
            cut = "; the log may have been cut off" if there < stated else ""
            raise source.error(
                f"says NDATA = {stated} and has {there} samples: expected equally many{cut}",
                entries["NDATA"][0],
            )
    return table


def _columns(
    source: Source,
    entries: dict[str, tuple[int, str]],
    lines: list[str],
    end: int,
    separator: str,
) -> int:
    """Return the number of columns, which the first sample confirms."""
    first = next((line for line in lines[end + 1 :] if line.strip()), "")
    fields = split_fields(first, None if separator == " " else separator)
    there = sum(1 for field in fields if field)
    if "DIM" not in entries:
        return there
    stated = _whole(source, entries, "DIM", 1, MOST_COLUMNS)
    if first and stated != there:
        raise source.error(
            f"says DIM = {stated} and has {there} columns: expected equally many", entries["DIM"][0]
        )
    return stated


def _whole(
    source: Source, entries: dict[str, tuple[int, str]], name: str, default: int, most: int
) -> int:
    """Read a whole number of the header."""
    line, text = entries.get(name, (None, str(default)))
    if not text.isascii() or not text.isdecimal() or len(text) > 19 or int(text) > most:
        raise source.error(
            f"{name} is {text[:40]!r}: expected a whole number, {most} at most", line
        )
    return int(text)


def _sample_time(source: Source, entries: dict[str, tuple[int, str]]) -> float | None:
    """Read the sampling interval [s]."""
    if "SAMPLE_TIME" not in entries:
        return None
    line, text = entries["SAMPLE_TIME"]
    dt = number_of(text)
    if not 0.0 < dt < math.inf:
        raise source.error(f"SAMPLE_TIME is {text[:40]!r}: expected seconds above 0", line)
    return dt


FORMAT = Format(
    name="GCS array",
    endings=(".gcs",),
    opens=_opens,
    begins=lambda head: _BEGINS.match(head) is not None and b"END_HEADER" in head,
)
