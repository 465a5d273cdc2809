"""The tables of a benchmark: for a terminal, and for a page."""

from __future__ import annotations

import math
from textwrap import wrap
from typing import TYPE_CHECKING

from ..._support.display.table import Column, Table

if TYPE_CHECKING:
    from ..board import Benchmark, BenchmarkResult, PartScore

__all__ = ["board_markdown", "board_text", "title_of"]

NOTES = """\
default: the model chosen by pt.identify(log). Errors are rms in per cent of the stroke fitted; um:
largest error on the last part. K: values fitted. s: time of the fit, on this computer, beside
whatever else it did. inverse: its drive for the measured displacement of a part not fitted, less
the recorded drive, rms in per cent of the drive's range."""
# Of a line in a terminal.
WIDTH = 100


def board_text(board: Benchmark) -> str:
    """Write the tables for a terminal.

    Parameters
    ----------
    board : Benchmark
        The results.

    Returns
    -------
    str
        Several lines.
    """
    lines: list[str] = []
    for name in board.records:
        rows = board.of(name)
        lines += [_about(rows), *_table(rows).lines()]
        for row in rows:
            if row.error:
                said = f"no fit: {title_of(row)}: {row.error}"
                lines += wrap(said, WIDTH, initial_indent="  ", subsequent_indent="    ")
        lines.append("")
    return "\n".join([*lines, NOTES])


def board_markdown(board: Benchmark) -> str:
    """Write the tables for a page.

    Parameters
    ----------
    board : Benchmark
        The results.

    Returns
    -------
    str
        Markdown.
    """
    lines: list[str] = []
    for name in board.records:
        rows = board.of(name)
        lines += [f"**{_about(rows)}**", "", _table(rows).markdown()]
        failed = [f"No fit: {title_of(row)}: {row.error}." for row in rows if not row.parts]
        lines += ["", *failed, *([""] if failed else [])]
    return "\n".join([*lines, NOTES])


def _about(rows: list[BenchmarkResult]) -> str:
    first = rows[0]
    noise = "" if math.isnan(first.noise) else f", noise {_percent(first.noise, first)} %"
    return f"{first.record_title} (stroke {1e6 * first.stroke:.4g} um{noise})"


def _table(rows: list[BenchmarkResult]) -> Table:
    """Make the table of the models that have a fit."""
    parts = next((row.parts for row in rows if row.parts), ())
    columns = [
        Column("model", width=max(len(title_of(row)) for row in rows), left=True),
        *(Column(part.part, format=".3g") for part in parts),
        Column("K"),
        Column("s"),
        Column("um", format=".3g"),
        Column("inverse"),
    ]
    return Table(columns, [_cells(row, row.judged) for row in rows if row.judged is not None])


def _cells(row: BenchmarkResult, judged: PartScore) -> list[object]:
    inverse = row.inverse
    return [
        title_of(row),
        *(part.rms_percent for part in row.parts),
        row.values,
        f"{row.seconds:.2g}" if row.seconds < 10.0 else f"{row.seconds:.0f}",
        1e6 * judged.max_error,
        None if inverse is None or inverse.error else f"{inverse.drive_percent:.3g}",
    ]


def title_of(row: BenchmarkResult) -> str:
    """Name a model, and the one that it chose."""
    return f"{row.title}: {row.chosen}" if row.chosen else row.title


def _percent(value: float, row: BenchmarkResult) -> str:
    return f"{100.0 * value / row.stroke:.2g}"
