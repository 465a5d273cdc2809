"""Table of a suggested drive: what a record of it would tell."""

from __future__ import annotations

import math
from itertools import groupby
from typing import TYPE_CHECKING

from ...._support.arguments import plain
from ...._support.display.table import Column, Table
from ...._support.units import length_text, shown_unit

if TYPE_CHECKING:
    from ...confidence.suggestion.suggested_drive import ExpectedDeviation, SuggestedDrive

__all__ = ["suggested_text"]


def suggested_text(drive: SuggestedDrive) -> str:
    """Write a suggested drive and the expected deviations as a table.

    Parameters
    ----------
    drive : SuggestedDrive
        The drive.

    Returns
    -------
    str
        Several lines.
    """
    unit, scale = shown_unit(drive.drive_unit)
    low, high = (scale * end for end in drive.limits)
    known = any(one.of_record is not None for one in drive.parameters.values())
    columns = [
        Column("parameter", left=True),
        Column("value", format=".5g"),
        Column("unit", left=True),
        Column("suggested", "%"),
        Column("plain sine", "%"),
        *([Column("record fitted", "%")] if known else []),
    ]
    rows = [
        (name, one.value, one.unit, *_percents(one, known=known))
        for name, one in drive.parameters.items()
    ]
    blocks = [
        f"  {count} x {text}" if count > 1 else f"  {text}"
        for text, count in ((text, len(list(same))) for text, same in groupby(drive.blocks))
    ]
    rate = plain(1.0 / drive.dt)
    return "\n".join(
        [
            f"drive   {plain(low)} to {plain(high)} {unit}, up to {plain(scale * drive.slew)} "
            f"{unit}/s, {plain(drive.u.size * drive.dt)} s at {rate} Hz",
            *(f"note  {note}" for note in drive.notes),
            f"blocks of {plain(drive.u.size * drive.dt / len(drive.blocks))} s",
            *blocks,
            "",
            f"standard deviations to expect, white noise of {length_text(drive.noise, 3)} rms",
            *Table(columns, rows).lines(),
        ]
    )


def _percents(one: ExpectedDeviation, *, known: bool) -> list[str]:
    """Write the deviations of a parameter in per cent of its value."""
    several = [one.deviation, one.of_sine, *([one.of_record] if known else [])]
    return ["-" if each is None else _percent(each, one.value) for each in several]


def _percent(deviation: float, value: float) -> str:
    """Write a deviation in per cent of a value."""
    if not math.isfinite(deviation):
        return "> 500"
    return plain(float(f"{100.0 * deviation / abs(value):.2g}"))
