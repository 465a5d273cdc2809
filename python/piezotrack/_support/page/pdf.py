"""A page as a PDF file of sheets in A4."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING, Any

from .html import TYPE, WIDTH
from .layout import lay_out
from .parts import Listing, Picture, Sentences

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator
    from pathlib import Path

    from matplotlib.figure import Figure

    from ..display.table import Table
    from .parts import Page, Part

__all__ = ["write_pdf"]

# A4, and the margins at the top and at the bottom [inch].
SHEET = (8.27, 11.69)
TOP, BOTTOM = 0.7, 0.8
LEFT = (SHEET[0] - WIDTH) / 2.0
POINT = 1.0 / 72.0
# Sizes of letters in points, height of a line in sizes, and space between columns and parts [inch].
BODY, SMALL, MONO = 9.0, 8.0, 7.5
LINE = 1.38
GAP, SPACE = 0.16, 0.12
DARK, LIGHT = "0.25", "0.75"


@dataclass(frozen=True)
class Strip:
    """A strip of a sheet, which is not divided.

    Attributes
    ----------
    height : float
        Height [inch].
    write : callable or None
        Writes on a figure below a height above the lower edge [inch].
    picture : Picture or None
        The picture that it is.
    joined : bool
        Whether it stays on the sheet of the next one.
    """

    height: float
    write: Callable[[Figure, float], object] | None = None
    picture: Picture | None = None
    joined: bool = False


def write_pdf(page: Page, file: Path) -> None:
    """Write a page; the same content gives the same bytes.

    Parameters
    ----------
    page : Page
        Title and sections.
    file : pathlib.Path
        The file.
    """
    import matplotlib as mpl
    from matplotlib.backends.backend_pdf import PdfPages

    settings: Any = {"font.size": TYPE, "text.usetex": False, "pdf.fonttype": 42}
    # Without a date the same content gives the same file.
    stamp = {"CreationDate": None, "Title": page.title}
    with mpl.rc_context(settings), PdfPages(file, metadata=stamp) as pdf:
        sheets = list(_sheets(list(_strips(page))))
        for i, strips in enumerate(sheets):
            pdf.savefig(_drawn(strips, f"{i + 1} of {len(sheets)}"))


def _drawn(strips: list[Strip], number: str) -> Figure:
    """Draw a sheet: pictures in the rows of a grid, words at their places."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=SHEET, dpi=72, layout="constrained")
    heights = [TOP, *(one.height for one in strips)]
    heights.append(SHEET[1] - math.fsum(heights))
    grid = figure.add_gridspec(
        len(heights),
        3,
        height_ratios=heights,
        width_ratios=[LEFT, WIDTH, LEFT],
        wspace=0.0,
        hspace=0.0,
    )
    top = SHEET[1] - TOP
    for i, strip in enumerate(strips):
        if strip.picture is not None:
            strip.picture.draw(figure.add_subfigure(grid[i + 1, 1]))
        if strip.write is not None:
            strip.write(figure, top)
        top -= strip.height
    if any(one.picture for one in strips):
        lay_out(figure)
    _write(figure, SHEET[0] - LEFT, 0.5, number, size=SMALL, color=DARK, ha="right")
    return figure


def _sheets(strips: list[Strip]) -> Iterator[list[Strip]]:
    """Put strips on sheets, a title with what it stands above."""
    room = SHEET[1] - TOP - BOTTOM
    sheet: list[Strip] = []
    used, i = 0.0, 0
    while i < len(strips):
        last = i
        while strips[last].joined and last + 1 < len(strips):
            last += 1
        block = strips[i : last + 1]
        height = math.fsum(one.height for one in block)
        if sheet and used + height > room:
            yield sheet
            sheet, used = [], 0.0
        sheet += block
        used, i = used + height, last + 1
    if sheet:
        yield sheet


def _strips(page: Page) -> Iterator[Strip]:
    yield from _lines(page.title, 15.0, weight="bold")
    yield from _lines(page.line, BODY, color=DARK)
    yield Strip(SPACE)
    for section in page.sections:
        if section.title:
            yield Strip(SPACE)
            strips = _lines(section.title, 11.0, weight="bold")
            yield from (replace(one, joined=True) for one in strips)
            yield Strip(0.04, joined=True)
        for part in section.parts:
            yield from _part(part)
            yield Strip(SPACE)


def _part(part: Part) -> Iterator[Strip]:
    if isinstance(part, Sentences):
        for line in part.lines:
            strips = _lines(line, BODY, mark="•" if part.listed else "")
            yield from (replace(one, joined=True) for one in strips)
            yield Strip(0.04)
    elif isinstance(part, Listing):
        columns = int(WIDTH / (MONO * 0.605 * POINT))
        for line in part.text.splitlines():
            rows = [line[i : i + columns] for i in range(0, len(line), columns)] or [""]
            yield from (_row([(LEFT, one)], MONO, family="monospace") for one in rows)
    elif isinstance(part, Picture):
        yield Strip(part.height, picture=part)
    else:
        yield from _table(part)


def _lines(text: str, size: float, mark: str = "", **style: Any) -> Iterator[Strip]:
    indent = 0.15 if mark else 0.0
    for i, line in enumerate(_wrapped(text, WIDTH - indent, size, style.get("weight", "normal"))):
        begun = [(LEFT, mark)] if mark and not i else []
        yield _row([*begun, (LEFT + indent, line)], size, **style)


def _table(table: Table) -> Iterator[Strip]:
    if table.title:
        strips = _lines(table.title, SMALL, color=DARK)
        yield from (replace(one, joined=True) for one in strips)
    rows = table.cells
    columns = list(zip(*([table.heads, *rows]), strict=True))
    natural = [
        max(_width(cell, SMALL, "normal" if i and j else "bold") for j, cell in enumerate(cells))
        for i, cells in enumerate(columns)
    ]
    widths = _fitted(natural, WIDTH - GAP * (len(columns) - 1))
    if any(table.heads):
        yield _cells(table.heads, widths, bold=len(widths), rule="0.2")
    for row in rows:
        yield _cells(row, widths, bold=1, rule=LIGHT)


def _cells(cells: Iterable[str], widths: list[float], *, bold: int, rule: str) -> Strip:
    """Write a row of a table, with a line below it."""
    weights = ["bold" if i < bold else "normal" for i in range(len(widths))]
    blocks = [
        _wrapped(cell, width, SMALL, weight)
        for cell, width, weight in zip(cells, widths, weights, strict=True)
    ]
    line = LINE * SMALL * POINT
    height = line * max(map(len, blocks)) + 0.05

    def write(figure: Figure, top: float) -> None:
        from matplotlib.lines import Line2D

        x = LEFT
        for block, width, weight in zip(blocks, widths, weights, strict=True):
            for i, text in enumerate(block):
                _write(figure, x, top - 0.03 - i * line, text, size=SMALL, weight=weight)
            x += width + GAP
        y = (top - height) / SHEET[1]
        ends = [LEFT / SHEET[0], (x - GAP) / SHEET[0]]
        figure.add_artist(Line2D(ends, [y, y], color=rule, linewidth=0.6))

    return Strip(height, write, joined=bold > 1)


def _row(places: list[tuple[float, str]], size: float, **style: Any) -> Strip:
    def write(figure: Figure, top: float) -> None:
        for x, text in places:
            _write(figure, x, top, text, size=size, **style)

    return Strip(LINE * size * POINT, write)


def _write(figure: Figure, x: float, y: float, text: str, **style: Any) -> None:
    """Write a line below a height [inch], without formulas."""
    shown = "".join(one if one.isprintable() else ascii(one)[1:-1] for one in text)
    placed = {"va": "top", "parse_math": False, **style}
    figure.text(x / SHEET[0], y / SHEET[1], shown, **placed).set_in_layout(False)


def _fitted(natural: list[float], room: float) -> list[float]:
    """Narrow the widest columns alike until all fit the room."""
    if math.fsum(natural) <= room:
        return natural
    left, most = room, 0.0
    for i, width in enumerate(sorted(natural)):
        most = left / (len(natural) - i)
        if width > most:
            break
        left -= width
    return [min(width, most) for width in natural]


def _wrapped(text: str, width: float, size: float, weight: str) -> list[str]:
    """Break a text into lines of a width [inch]; words that are longer are divided."""
    lines = [""]
    for word in text.split():
        joined = f"{lines[-1]} {word}".lstrip()
        if _width(joined, size, weight) <= width:
            lines[-1] = joined
            continue
        rest = word
        while _width(rest, size, weight) > width and len(rest) > 1:
            count = max(1, int(len(rest) * width / _width(rest, size, weight)))
            while count > 1 and _width(rest[:count], size, weight) > width:
                count -= 1
            lines.append(rest[:count])
            rest = rest[count:]
        lines.append(rest)
    return lines[1:] if len(lines) > 1 and not lines[0] else lines


@cache
def _font(weight: str) -> Any:
    from matplotlib.font_manager import FontProperties

    return FontProperties(weight=weight)


def _width(text: str, size: float, weight: str) -> float:
    """Width of a line [inch]."""
    from matplotlib.textpath import text_to_path

    font = _font(weight).copy()
    font.set_size(size)
    width, _, _ = text_to_path.get_text_width_height_descent(text, font, ismath=False)
    return float(width) * POINT
