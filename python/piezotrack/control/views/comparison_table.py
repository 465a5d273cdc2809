"""The tables of a comparison of controllers, for a terminal and for a notebook."""

from __future__ import annotations

import math
import re
from textwrap import wrap
from typing import TYPE_CHECKING, NamedTuple

from ..._support.display.table import words
from ..._support.units import decibels

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..comparing.comparison import ControllerComparison, Row

__all__ = ["Grid", "comparison_html", "comparison_text", "grids", "short", "with_spread"]

# Columns of a terminal; where headings are broken, and where they are else it is too narrow.
WIDTH = 100
HEADINGS = (10, 6)
# A number and its unit stay together.
UNIT = re.compile(r"(?<=\d) (?=Hz|ms|%)")
FIGURES = ("effort mV", "chatter mV", "clipped %", "settled ms", "Ms", "gain margin dB", "step ns")


class Grid(NamedTuple):
    """A table: title, headings without that of the names, and names with their cells."""

    title: str
    heads: list[str]
    rows: list[tuple[str, list[str]]]


def grids(comparison: ControllerComparison, *, spreads: bool = True) -> list[Grid]:
    """Make the tables: errors along each reference, other figures, errors on each stage.

    With standard deviations beside the means, of several draws, where `spreads`.
    """
    rows, several = comparison.rows, comparison.seeds > 1
    searched = comparison.searches > 1
    many = f"mean of {comparison.seeds} draws of the noise" if several else "one draw of the noise"
    names = [short(one) for one in comparison.references]

    def mean(value: float, spread: float) -> str:
        return with_spread(value, spread if spreads else math.nan)

    return [
        Grid(
            f"true error in nm rms at {1.0 / comparison.dt:.6g} Hz, {many}",
            names,
            [
                (row.name, [(one and mean(one.rms, one.spread)) or "-" for one in row.cells[0]])
                for row in rows
            ],
        ),
        Grid(
            "largest true error in nm, with any of the draws",
            names,
            [
                (row.name, [(one and mean(one.largest, math.nan)) or "-" for one in row.cells[0]])
                for row in rows
            ],
        ),
        Grid(
            "on the stage that they were tuned for, errors relative to those of the inverse alone",
            ["error %", *(["of searches %"] if searched else []), *FIGURES],
            [(row.name, _figures(row, searched=searched)) for row in rows],
        ),
        Grid(
            "on each stage, errors in % of those of the inverse alone on the first",
            list(comparison.variants),
            [
                (row.name, [_percent(row.relative(i)) for i in range(len(row.cells))])
                for row in rows
            ],
        ),
    ]


def short(reference: str) -> str:
    """Name a reference without its numbers of steps and lines."""
    return reference.partition(" of ")[0]


def with_spread(value: float, spread: float) -> str:
    """Write a length [m] in nm, with its standard deviation [m] where there is one.

    Parameters
    ----------
    value, spread : float
        Mean, infinite where a loop diverged; standard deviation, NaN for none.

    Returns
    -------
    str
        As "57.4 ± 0.1".

    Examples
    --------
    >>> with_spread(57.42e-9, 0.13e-9), with_spread(18.921e-6, 43.6e-9)
    ('57.4 ± 0.1', '18920 ± 44')
    >>> with_spread(1e-9, float("nan"))
    '1.00'
    """
    if not math.isfinite(value):
        return "unstable" if value > 0.0 else "-"
    shown = 1e9 * value
    decimals = min(3, max(0, 2 - math.floor(math.log10(shown)))) if shown > 0.0 else 0
    words = f"{_significant(shown, 4):.{decimals}f}"
    if math.isnan(spread):
        return words
    digits = 2 if spread > 10e-9 else 1
    # One decimal beyond those of the mean says that there is less.
    return f"{words} ± {round(_significant(1e9 * spread, digits), decimals + 1):.4g}"


def _significant(value: float, digits: int) -> float:
    return float(f"{value:.{digits}g}")


def _figures(row: Row, *, searched: bool) -> list[str]:
    clipped = max(one.clipped for one in row.cells[0] if one is not None)
    ends = [_percent(one) for one in (row.searches[0], row.searches[-1])]
    return [
        _percent(row.relative()),
        *([" to ".join(ends) if len(row.searches) > 1 else "-"] if searched else []),
        _plain(1e3 * row.effort, "{:.3g}"),
        "-" if row.chatter is None else _plain(1e3 * row.chatter, "{:.3g}"),
        f"{100.0 * clipped:.3g}",
        "-" if row.settled is None else _plain(1e3 * row.settled, "{:.3g}"),
        _plain(row.sensitivity, "{:.2f}"),
        _plain(None if row.gain_margin is None else decibels(row.gain_margin), "{:.1f}"),
        f"{1e9 * row.step_time:.0f}",
    ]


def _percent(share: float) -> str:
    """Write a share in %, of three digits."""
    if not math.isfinite(share):
        return "unstable" if share > 0.0 else "-"
    return f"{100.0 * share:.3g}" if share < 10.0 else f"{100.0 * share:.0f}"


def _plain(value: float | None, form: str) -> str:
    if value is None:
        return "-"
    if not math.isfinite(value):
        return "inf"
    return f"{value:.0f}" if value >= 1000.0 else form.format(value)


def comparison_text(comparison: ControllerComparison) -> str:
    """Write the tables for a terminal of 100 columns."""
    lines: list[str] = []
    for wide, narrow in zip(grids(comparison), grids(comparison, spreads=False), strict=True):
        tried = [_lines(grid, width) for grid in (wide, narrow) for width in HEADINGS]
        lines += [*next((one for one in tried if max(map(len, one)) <= WIDTH), tried[-1]), ""]
    for name, why in comparison.refused.items():
        lines += wrap(f"not made: {name}: {why}", WIDTH, subsequent_indent="  ")
    return "\n".join(lines).rstrip("\n")


def _lines(grid: Grid, width: int) -> list[str]:
    """Write one table; its headings are broken into lines."""
    joined = (UNIT.sub("\N{NO-BREAK SPACE}", one) for one in grid.heads)
    heads = [wrap(one, width, break_long_words=False) for one in joined]
    deep = max(map(len, heads))
    heads = [[""] * (deep - len(one)) + one for one in heads]
    columns = list(zip(*(cells for _, cells in grid.rows), strict=True))
    widths = [
        2 + max(len(one) for one in (*head, *column))
        for head, column in zip(heads, columns, strict=True)
    ]
    first = max(len(name) for name, _ in grid.rows)
    table = [("", [head[i] for head in heads]) for i in range(deep)] + grid.rows
    return [grid.title, *(_line(name, cells, first, widths) for name, cells in table)]


def _line(name: str, cells: Sequence[str], first: int, widths: Sequence[int]) -> str:
    padded = (f"{cell:>{width}}" for cell, width in zip(cells, widths, strict=True))
    line = f"{name:{first}}{''.join(padded)}".rstrip()
    return line.replace("\N{NO-BREAK SPACE}", " ")


def comparison_html(comparison: ControllerComparison) -> str:
    """Write the tables for a notebook."""
    return "".join(
        words(grid.title, [(name, *cells) for name, cells in grid.rows], ["", *grid.heads]).html()
        for grid in grids(comparison)
    )
