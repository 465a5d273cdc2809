"""The tables of a benchmark: for a terminal, and for a page."""

from __future__ import annotations

import math
from textwrap import wrap
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..board import Benchmark, BenchmarkResult

__all__ = ["board_markdown", "board_text"]

NOTES = """\
default: pt.identify(log), and what it chose. Errors are rms in per cent of the stroke fitted; um:
largest error on the last part. K: values fitted. s: time of the fit, on this computer, beside
whatever else it did. inverse: its drive for the measured displacement of a part not fitted, less
the recorded drive, rms in per cent of the drive's range."""
# Of a line in a terminal.
WIDTH = 100
HEADS = ("K", "s", "um", "inverse")


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
        heads, cells = _heads(rows), [_cells(row) for row in rows]
        width = max(len(_title(row)) for row in rows)
        wide = [
            max(len(head), *(len(cell[i]) for cell in cells if cell)) if any(cells) else len(head)
            for i, head in enumerate(heads)
        ]
        lines += [_about(rows), f"  {'model':<{width}}{_line(heads, wide)}"]
        for row, cell in zip(rows, cells, strict=True):
            if cell:
                lines.append(f"  {_title(row):<{width}}{_line(cell, wide)}")
        for row in rows:
            if row.error:
                said = f"no fit: {_title(row)}: {row.error}"
                lines += wrap(said, WIDTH, initial_indent="  ", subsequent_indent="    ")
        lines.append("")
    return "\n".join([*lines, NOTES])


def _line(cells: list[str], wide: list[int]) -> str:
    return "".join(f"  {cell:>{width}}" for cell, width in zip(cells, wide, strict=True))


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
        heads = ["model", *_heads(rows)]
        lines += [f"**{_about(rows)}**", "", _row(heads), _row(["---"] * len(heads))]
        lines += [_row([_title(row), *_cells(row)]) for row in rows if row.parts]
        failed = [f"No fit: {_title(row)}: {row.error}." for row in rows if not row.parts]
        lines += ["", *failed, *([""] if failed else [])]
    return "\n".join([*lines, NOTES])


def _row(cells: list[str]) -> str:
    plain = (cell.replace("|", "\\|").replace("\n", " ") for cell in cells)
    return f"| {' | '.join(plain)} |"


def _about(rows: list[BenchmarkResult]) -> str:
    first = rows[0]
    noise = "" if math.isnan(first.noise) else f", noise {_percent(first.noise, first)} %"
    return f"{first.record_title} (stroke {1e6 * first.stroke:.4g} um{noise})"


def _heads(rows: list[BenchmarkResult]) -> list[str]:
    parts = next((row.parts for row in rows if row.parts), ())
    return [*(part.part for part in parts), *HEADS]


def _cells(row: BenchmarkResult) -> list[str]:
    if not row.parts or row.judged is None:
        return []
    inverse = row.inverse
    return [
        *(f"{part.rms_percent:.3g}" for part in row.parts),
        "-" if row.values is None else str(row.values),
        f"{row.seconds:.2g}" if row.seconds < 10.0 else f"{row.seconds:.0f}",
        f"{1e6 * row.judged.max_error:.3g}",
        "-" if inverse is None or inverse.error else f"{inverse.drive_percent:.3g}",
    ]


def _title(row: BenchmarkResult) -> str:
    return f"{row.title}: {row.chosen}" if row.chosen else row.title


def _percent(value: float, row: BenchmarkResult) -> str:
    return f"{100.0 * value / row.stroke:.2g}"
