"""The report as a table of text, for the terminal."""

from __future__ import annotations

import math
from textwrap import wrap
from typing import TYPE_CHECKING

from ..._support.display.table import Column, Table
from ..published import SI

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..experiments.table_2 import Table2
    from ..published import Obtained
    from ..reproduction import Reproduction
    from ..section import Section

__all__ = ["number", "place", "reading", "seen", "summary_text", "table_2_text", "tally"]

# A second harmonic has this peak to peak in units of its SD.
PURE_ANGLE = 2.0 * math.sqrt(2.0)
# Characters in a line of text.
WIDTH = 118
SIGNS = {"value": "", "about": "about ", "bound": "within "}


def summary_text(reproduction: Reproduction) -> str:
    """Write table and conclusions, as of `Reproduction.summary`."""
    lines = [
        f"{'figure':<9}{'':<50}{'published':>14}  {'obtained':>9}  {'quartiles':<17}"
        f"{'true':>8}  {'ratio':>5}"
    ]
    for row in reproduction.obtained:
        low, high = (number(row, value) for value in row.quartiles)
        true = reproduction.true_median(row.observable.key)
        mark = " " if row.reached else "*"
        use = "" if row.observable.use == "calibrated" else row.observable.label
        lines.append(
            f"{row.observable.figure:<9}{_name(row):<50}{reading(row):>14}  "
            f"{number(row, row.median):>8}{mark}  {low + ' to ' + high:<17}"
            f"{'' if true is None else number(row, true):>8}  {row.ratio:>5.2f}  {use}".rstrip()
        )
    lines += ["", *(line for part in tally(reproduction) for line in wrap(part, WIDTH))]
    lines += ["* marks numbers that are not reached.", "", "Conclusions of the paper"]
    for conclusion in reproduction.conclusions:
        lines += [
            f"  {'confirmed    ' if conclusion.holds else 'NOT CONFIRMED'}  {conclusion.text}",
            *(
                17 * " " + line
                for line in wrap(
                    f"{conclusion.words} ({conclusion.seen} of {conclusion.seeds} runs)", WIDTH - 17
                )
            ),
        ]
    for part in reproduction.sections:
        lines += ["", part.title, *wrap(part.text, WIDTH), *_columns(part)]
    return "\n".join(lines)


def table_2_text(table: Table2) -> str:
    """Write the contour errors of Table 2, published and obtained."""
    lines = [
        "contour error in um, published / obtained; max is peak to peak",
        "radius um  frequency Hz          max               mean                SD"
        "             max / SD",
    ]
    for case, run in table.cases:
        metrics = run.metrics
        pairs = (
            (case.peak_to_peak, metrics.peak_to_peak),
            (case.mean, metrics.mean_error),
            (case.sd, metrics.sd_error),
        )
        cells = "  ".join(f"{1e6 * one:>7.3f} /{1e6 * other:>7.3f}" for one, other in pairs)
        ratio = f"{case.ratio:>6.1f} /{metrics.peak_to_peak / metrics.sd_error:>5.1f}"
        lines.append(f"{1e6 * case.radius:>9g}  {case.frequency:>12g}  {cells}  {ratio}")
    return "\n".join(lines)


def _columns(part: Section) -> list[str]:
    """Write a table in columns, the first left-aligned."""
    first, *others = part.heads
    return Table([Column(first, left=True), *map(Column, others)], part.rows).lines()


def tally(reproduction: Reproduction) -> list[str]:
    """Count the numbers within their tolerances, by their use; a string for each paragraph."""
    rows = reproduction.obtained
    fitted = [one for one in rows if one.observable.calibrated]
    given = [one for one in fitted if one.observable.use == "put in"]
    left_out = [one for one in rows if one.observable.use == "left out"]
    circles = [one for one in left_out if one.observable.circle]
    others = [one for one in left_out if not one.observable.circle]
    missed = [one for one in others if not one.reached]
    return [
        f"{_reached(fitted)} calibrated numbers within 15 % or 0.04 um, medians over "
        f"{len(reproduction.seeds)} seeds; {len(given)} of them were put in: {_listed(given)}.",
        f"{_reached(left_out)} numbers left out of the calibration within 30 % or 0.08 um: "
        f"{_reached(circles)} of circles, which scale from the calibrated ones, and "
        f"{_reached(others)} others. Not reached of these: {_listed(missed)}.",
        _ratios([one for one in rows if one.observable.use == "derived"]),
    ]


def _reached(rows: Sequence[Obtained]) -> str:
    return f"{sum(one.reached for one in rows) or 'none'} of {len(rows)}"


def _listed(rows: Sequence[Obtained]) -> str:
    """Name numbers with their figures."""
    named = (f"{one.observable.name} ({place(one)})" for one in rows)
    return "; ".join(named) or "none"


def _ratios(rows: Sequence[Obtained]) -> str:
    """Compare peak to peak by SD of the circles, which no calibration aims at."""
    published = [one.observable.published for one in rows]
    seen = [one.median for one in rows]
    return (
        f"Contour errors of the {len(rows)} circles, peak to peak by SD: {min(published):.1f} to "
        f"{max(published):.1f} published, {min(seen):.1f} to {max(seen):.1f} obtained; a pure "
        f"angle between the axes gives {PURE_ANGLE:.2f}."
    )


def place(one: Obtained) -> str:
    """Write where in the paper a number is."""
    figure = one.observable.figure
    return figure if figure.startswith("Table") else f"Fig. {figure}"


def number(row: Obtained, value: float) -> str:
    """Write the number of a value in the unit of its observable."""
    shown = value / SI[row.observable.unit]
    if row.observable.unit in ("rad", ""):
        return f"{shown:.4f}"
    digits = 0 if abs(shown) >= 1000.0 else 1 if abs(shown) >= 100.0 else 3
    return f"{shown:.{digits}f}"


def reading(one: Obtained) -> str:
    """Write the published value with its kind."""
    return SIGNS[one.observable.kind] + number(one, one.observable.published)


def seen(holds: bool) -> str:
    """Write whether a conclusion is confirmed."""
    return "confirmed" if holds else "not confirmed"


def _name(one: Obtained) -> str:
    unit = one.observable.unit
    return f"{one.observable.name}, {unit}" if unit else one.observable.name
