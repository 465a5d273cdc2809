"""CSV of Digilent WaveForms: comments, among them the sampling rate, and a usual header."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from ..table import Format
from .delimited import Layout, TextTable, lines_of

if TYPE_CHECKING:
    from ..source import Source

__all__ = ["FORMAT"]

_SAMPLES = re.compile(r"#\s*Samples:\s*(\d{1,18})\s*", re.IGNORECASE)
_RATE = re.compile(r"#\s*Sample rate:\s*([0-9.eE+-]+)\s*([kM]?)Hz\s*", re.IGNORECASE)
FACTORS = {"": 1.0, "k": 1e3, "m": 1e6}


def _opens(source: Source) -> TextTable:
    lines = lines_of(source)
    dt, stated = None, None
    for number, line in enumerate(lines):
        if line.strip() and not line.startswith("#"):
            break
        if match := _SAMPLES.fullmatch(line):
            stated = int(match[1]), number + 1
        if match := _RATE.fullmatch(line):
            try:
                dt = 1.0 / (float(match[1]) * FACTORS[match[2].lower()])
            except (ValueError, ZeroDivisionError):
                raise source.error(
                    f"the sample rate is {match[1][:40]!r}: expected hertz above 0", number + 1
                ) from None
    table = TextTable(source, Layout.of(source, lines), dt=dt)
    if stated is not None and (there := table.count(table.columns[0])) < stated[0]:
        raise source.error(
            f"says {stated[0]} samples and has {there}: expected equally many; the log may have "
            "been cut off",
            stated[1],
        )
    return table


FORMAT = Format(
    name="WaveForms",
    endings=(),
    opens=_opens,
    begins=lambda head: head.removeprefix(b"\xef\xbb\xbf").startswith(b"#Digilent WaveForms"),
)
