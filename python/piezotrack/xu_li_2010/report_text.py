"""The report as a table of text, for the terminal and the PDF."""

from __future__ import annotations

from textwrap import wrap
from typing import TYPE_CHECKING

from .published import SI

if TYPE_CHECKING:
    from .published import Obtained
    from .reproduction import Reproduction
    from .section import Section

__all__ = ["number", "reading", "seen", "summary_text", "tally"]

SIGNS = {"value": "", "about": "about ", "bound": "within "}


def summary_text(found: Reproduction) -> str:
    """Write table and conclusions, as of `Reproduction.summary`."""
    lines = [
        f"{'figure':<9}{'':<50}{'published':>14}  {'obtained':>9}  {'quartiles':<17}"
        f"{'true':>8}  {'ratio':>5}"
    ]
    for one in found.obtained:
        low, high = (number(one, value) for value in one.quartiles)
        true = found.true_median(one.observable.key)
        mark = " " if one.reached else "*"
        use = "" if one.observable.calibrated else "left out"
        lines.append(
            f"{one.observable.figure:<9}{_name(one):<50}{reading(one):>14}  "
            f"{number(one, one.median):>8}{mark}  {low + ' to ' + high:<17}"
            f"{'' if true is None else number(one, true):>8}  {one.ratio:>5.2f}  {use}".rstrip()
        )
    lines += ["", tally(found), "", "Conclusions of the paper"]
    for conclusion in found.conclusions:
        lines += [
            f"  {'confirmed    ' if conclusion.holds else 'NOT CONFIRMED'}  {conclusion.text}",
            f"                 {conclusion.words} ({conclusion.seen} of {conclusion.seeds} runs)",
        ]
    for part in found.sections:
        lines += ["", part.title, *wrap(part.text, 118), *_columns(part)]
    return "\n".join(lines)


def _columns(part: Section) -> list[str]:
    """Write a table in columns, the first left-aligned."""
    table = [part.heads, *part.rows]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    lines = []
    for row in table:
        first, *others = zip(row, widths, strict=True)
        cells = [first[0].ljust(first[1]), *(cell.rjust(width) for cell, width in others)]
        lines.append(("  " + "  ".join(cells)).rstrip())
    return lines


def tally(found: Reproduction) -> str:
    """Count the numbers within their tolerances."""
    parts = []
    for name, used in (("calibrated", True), ("left out", False)):
        rows = [one for one in found.obtained if one.observable.calibrated == used]
        goal = "15 % or 0.04 um" if used else "30 % or 0.08 um"
        parts.append(f"{sum(one.reached for one in rows)} of {len(rows)} {name} within {goal}")
    return f"{'; '.join(parts)}. * marks the others. Medians over {len(found.seeds)} seeds."


def number(one: Obtained, value: float) -> str:
    """Write the number of a value in the unit of its observable."""
    shown = value / SI[one.observable.unit]
    if one.observable.unit in ("rad", ""):
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
