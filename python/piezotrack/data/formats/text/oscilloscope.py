"""Text of instruments with lines above the titles: oscilloscopes, and curves of AFM Workshop.

The lines above become blank and the titles get their units, so that what is left is a usual log
whose lines have the numbers that an editor shows.
"""

from __future__ import annotations

import math
import re
from itertools import chain
from typing import TYPE_CHECKING, NamedTuple

from ...._support.units import symbol_of
from ...columns import Columns
from ...text_fields import delimiter_of, number_of, split_fields
from ..table import Format
from .delimited import Layout, TextTable, lines_of

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from ..source import Source

__all__ = ["FORMAT"]

# Lines of settings at most.
ABOVE = 200


class Plain(NamedTuple):
    """A usual log: its lines, and the interval that the instrument states [s]."""

    lines: list[str]
    dt: float | None = None


def _opens(source: Source) -> TextTable:
    lines = lines_of(source)
    for begins, plain in LAYOUTS:
        if begins.match(lines[0].encode()):
            found = plain(lines)
            break
    else:
        found = None
    if found is None:
        return TextTable(source, Layout.of(source, lines))
    if isinstance(found, Layout):
        return TextTable(source, found)
    return TextTable(source, Layout.of(source, found.lines), dt=found.dt)


def _titled(lines: list[str], at: int, titles: Sequence[str], units: Sequence[str]) -> list[str]:
    """Write titles with their units in a line, below blank ones."""
    mark = delimiter_of(lines[at]) or ","
    named = [f"{_name(title)} ({symbol_of(unit)})" if unit else _name(title)
             for title, unit in zip(titles, units, strict=False)]  # fmt: skip
    return [*("" for _ in range(at)), mark.join(named), *lines[at + 1 :]]


def _name(title: str) -> str:
    """Name a channel as the others do: "1" and "X(CH1)" are CH1."""
    if title.isdigit():
        return f"CH{title}"
    if inner := re.fullmatch(r"X\((\w+)\)", title):
        return inner[1]
    return "time" if title.lower() == "x-axis" else title


def _two_lines(lines: list[str]) -> Plain | None:
    """Read titles with their units in the line below, as of Keysight, Rigol and PicoScope."""
    if len(lines) < 3:
        return None
    mark = delimiter_of(lines[0])
    titles = split_fields(lines[0], mark, is_header=True)
    units = [unit.strip("()[] ") for unit in split_fields(lines[1], mark)]
    if units[0].lower() == "sequence":
        # Rigol numbers the samples, and has begin and interval behind the units of the channels.
        channels = [title for title in titles[1:] if title.lower() not in ("start", "increment")]
        count = len(channels)
        dt = number_of(units[count + 2]) if len(units) > count + 2 else 0.0
        named = _titled(lines, 1, ["sequence", *channels], ["", *units[1 : count + 1]])
        return Plain(named, dt) if dt > 0.0 else None
    if not all(unit and math.isnan(number_of(unit)) for unit in units[: len(titles)]):
        return None
    return Plain(_titled(lines, 1, titles, units))


def _settings(lines: list[str]) -> Plain | None:
    """Read settings above a line with TIME and the channels, as of Tektronix."""
    start = next(
        (k for k, line in enumerate(lines[:ABOVE]) if line.lower().startswith(("time,", "time;"))),
        None,
    )
    if start is None:
        return None
    mark = delimiter_of(lines[start])
    titles = split_fields(lines[start], mark, is_header=True)
    above = [fields for line in lines[:start] if (fields := split_fields(line, mark))]
    named = {name: [one for one in rest if one] for name, *rest in above}
    across, up = named.get("Horizontal Units", ["s"]), named.get("Vertical Units", [])
    units = chain(across[:1], up, [""] * (len(titles) - 1 - len(up)))
    plain = _titled(lines, start, titles, [unit.replace("S", "s") for unit in units])
    return Plain(plain)


def _beside(lines: list[str]) -> Layout | None:
    """Read settings to the left of the samples of one channel, as of Tektronix TDS."""
    rows = [split_fields(line, ",") for line in lines]
    settings = {row[0]: row[1] for row in rows[:ABOVE] if len(row) > 4 and row[0]}
    if any(len(row) < 5 for row, line in zip(rows, lines, strict=True) if line.strip()):
        return None
    units = (settings.get("Horizontal Units", "s"), settings.get("Vertical Units", ""))
    titles = [f"time ({units[0]})", f"{settings.get('Source', 'CH1')} ({units[1]})"]
    plain = [",".join(row[3:5]) if len(row) > 4 else "" for row in rows]
    return Layout(plain, Columns(titles, has_titles=True), first=0, delimiter=",", header=None)


def _curve(lines: list[str]) -> Plain | None:
    """Read a curve of AFM Workshop: settings above titles with units."""
    start = next((k for k, line in enumerate(lines[:ABOVE]) if line.count(",") >= 3), None)
    above = [""] * (start or 0)
    return None if start is None else Plain([*above, *lines[start:]])


LAYOUTS: tuple[tuple[re.Pattern[bytes], Callable[[list[str]], Plain | Layout | None]], ...] = (
    (re.compile(rb'"?(x-axis"?[,;]|X[,;]CH\d|Time[,;]X\(CH|Time[,;]Channel )'), _two_lines),
    (re.compile(rb'"?Model"?[,;]'), _settings),
    (re.compile(rb'"?Record Length"?,'), _beside),
    (re.compile(rb"Force-Distance Curve"), _curve),
)


def _begins(head: bytes) -> bool:
    first = head.removeprefix(b"\xef\xbb\xbf")
    return any(begins.match(first) for begins, _ in LAYOUTS)


FORMAT = Format(name="oscilloscope", endings=(), opens=_opens, begins=_begins)
