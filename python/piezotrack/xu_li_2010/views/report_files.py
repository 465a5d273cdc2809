"""Writing the report as HTML, PDF and JSON files."""

from __future__ import annotations

from itertools import pairwise
from textwrap import fill
from typing import TYPE_CHECKING

from ..._support.display.look import without_glyph_warnings
from ..._support.files.writing import make_folder, replacing, result_set, write_document
from ..reproduction import REPORT
from .figures import Drawn, drawn
from .report_html import html_text
from .report_text import summary_text

if TYPE_CHECKING:
    import os
    from collections.abc import Sequence
    from pathlib import Path

    from ..reproduction import Reproduction

__all__ = ["pages", "save_report"]

# Lines on a page, and their size in points.
LINES, TYPE = 66, 7.0


def save_report(reproduction: Reproduction, folder: str | os.PathLike[str]) -> list[Path]:
    """Write the three files; arguments, result and errors as of `Reproduction.save`."""
    import matplotlib.pyplot as plt

    figures = drawn(reproduction.experiments, reproduction.drives)
    try:
        with result_set(make_folder(folder)) as path, without_glyph_warnings():
            page = html_text(reproduction, figures)
            written = [path / name for name in REPORT]
            with replacing(written[0]) as temporary:
                temporary.write_text(page, encoding="utf-8")
            with replacing(written[1]) as temporary:
                _write_pdf(reproduction, figures, temporary)
            write_document(written[2], reproduction.document())
            return written
    finally:
        for one in figures:
            plt.close(one.figure)


def _write_pdf(reproduction: Reproduction, figures: Sequence[Drawn], file: Path) -> None:
    import matplotlib.pyplot as plt
    from matplotlib.backends.backend_pdf import PdfPages

    lines = ["Xu and Li 2010, doi 10.1115/1.4001712, published beside obtained", ""]
    lines += summary_text(reproduction).splitlines()
    # Without a date the same result gives the same file.
    with PdfPages(file, metadata={"CreationDate": None}) as pdf:
        for part in pages(lines):
            page = plt.figure(figsize=(11.7, 8.3))
            page.text(0.04, 0.96, "\n".join(part), family="monospace", fontsize=TYPE, va="top")
            pdf.savefig(page)
            plt.close(page)
        for drawing in figures:
            words = f"{drawing.title}\n{drawing.caption}"
            drawing.figure.text(
                0.01, 1.02, "\n".join(fill(line, 150) for line in words.splitlines())
            )
            pdf.savefig(drawing.figure, bbox_inches="tight", pad_inches=0.3)


def pages(lines: Sequence[str]) -> list[list[str]]:
    """Put lines on as few pages as possible, filled alike, with paragraphs and tables whole."""
    blocks: list[list[str]] = [[]]
    for line in lines:
        if not line or len(blocks[-1]) == LINES:
            blocks.append([])
        if line:
            blocks[-1].append(line)
    blocks = [block for block in blocks if block]
    # The best way to place the blocks from each one on: pages, unevenness, pages' beginnings.
    best: list[tuple[int, int, list[int]]] = [(0, 0, [])]
    for first in reversed(range(len(blocks))):
        ways, height = [], -1
        for last in range(first, len(blocks)):
            height += len(blocks[last]) + 1
            if height > LINES:
                break
            count, uneven, begun = best[last - first]
            ways.append((count + 1, uneven + (LINES - height) ** 2, [first, *begun]))
        best.insert(0, min(ways))
    begins = [*best[0][2], len(blocks)]
    return [
        [line for block in blocks[first:last] for line in [*block, ""]][:-1]
        for first, last in pairwise(begins)
    ]
