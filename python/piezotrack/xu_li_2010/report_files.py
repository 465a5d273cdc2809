"""Writing the report as HTML, PDF and JSON files."""

from __future__ import annotations

from textwrap import fill
from typing import TYPE_CHECKING

from .._support.files import make_folder, replacing, together, write_document
from .._support.plot_style import without_glyph_warnings
from .figures import Drawn, drawn
from .report_html import html_text
from .report_text import summary_text

if TYPE_CHECKING:
    import os
    from collections.abc import Sequence
    from pathlib import Path

    from .reproduction import Reproduction

__all__ = ["REPORT", "save_report"]

# The files.
REPORT = ("report.html", "report.pdf", "report.json")

# Lines of small type on a page.
LINES = 58


def save_report(found: Reproduction, folder: str | os.PathLike[str]) -> list[Path]:
    """Write the three files; arguments, result and errors as of `Reproduction.save`."""
    import matplotlib.pyplot as plt

    figures = drawn(found.experiments, found.drives)
    try:
        with together(make_folder(folder)) as path, without_glyph_warnings():
            page = html_text(found, figures)
            written = [path / name for name in REPORT]
            with replacing(written[0]) as temporary:
                temporary.write_text(page, encoding="utf-8")
            with replacing(written[1]) as temporary:
                _write_pdf(found, figures, temporary)
            write_document(written[2], found.document())
            return written
    finally:
        for one in figures:
            plt.close(one.figure)


def _write_pdf(found: Reproduction, figures: Sequence[Drawn], file: Path) -> None:
    import matplotlib.pyplot as plt
    from matplotlib.backends.backend_pdf import PdfPages

    lines = ["Xu and Li 2010, doi 10.1115/1.4001712, published beside obtained", ""]
    lines += summary_text(found).splitlines()
    # Without a date the same result gives the same file.
    with PdfPages(file, metadata={"CreationDate": None}) as pdf:
        for first in range(0, len(lines), LINES):
            page = plt.figure(figsize=(11.7, 8.3))
            text = "\n".join(lines[first : first + LINES])
            page.text(0.04, 0.96, text, family="monospace", fontsize=8, va="top")
            pdf.savefig(page)
            plt.close(page)
        for one in figures:
            words = f"{one.title}\n{one.caption}"
            one.figure.text(0.01, 1.02, "\n".join(fill(line, 150) for line in words.splitlines()))
            pdf.savefig(one.figure, bbox_inches="tight", pad_inches=0.3)
