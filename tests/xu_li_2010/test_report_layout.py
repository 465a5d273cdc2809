"""The report on paper: tables whole, lines within the page, diagrams that can be read."""

from __future__ import annotations

import matplotlib.pyplot as plt
import pytest
from matplotlib.patches import Patch

from piezotrack.xu_li_2010.views.block_diagrams import draw
from piezotrack.xu_li_2010.views.report_files import LINES, TYPE, pages


def block(name: str, count: int) -> list[str]:
    return [f"{name} {i}" for i in range(count)] + [""]


@pytest.mark.parametrize(
    ("sizes", "expected"),
    [
        # As few pages as there can be, filled alike: not 66 and 20.
        ((30, 10, 10, 10, 20), 2),
        ((64, 8, 14, 14, 8, 9, 14, 6), 3),
        ((3,), 1),
        ((LINES,), 1),
        # A table that is longer than a page cannot stay whole.
        ((LINES + 5, 10), 2),
    ],
)
def test_a_table_is_not_split_and_pages_are_filled_alike(
    sizes: tuple[int, ...], expected: int
) -> None:
    lines = [line for i, size in enumerate(sizes) for line in block(f"{i}", size)]
    filled = pages(lines)
    assert len(filled) == expected
    # Nothing is lost, and the order is kept.
    kept = [line for page in filled for line in page if line]
    assert kept == [line for line in lines if line]
    assert all(len(page) <= LINES for page in filled)
    for i, size in enumerate(sizes):
        if size <= LINES:
            assert sum(any(line.startswith(f"{i} ") for line in page) for page in filled) == 1


def test_pages_are_filled_alike() -> None:
    lines = [line for i in range(6) for line in block(str(i), 15)]
    assert [len(page) for page in pages(lines)] == [47, 47]


def test_the_widest_line_of_the_table_fits_the_page() -> None:
    # Names of 50 characters, and what a number is for.
    line = "Table 2  " + 127 * "x"
    page = plt.figure(figsize=(11.7, 8.3))
    text = page.text(0.04, 0.96, line, family="monospace", fontsize=TYPE, va="top")
    page.canvas.draw()
    assert text.get_window_extent().x1 < 0.97 * page.bbox.x1
    # And as many lines as a page may have.
    text.set_text("\n".join(LINES * ["x"]))
    assert text.get_window_extent().y0 > 0.02 * page.bbox.y1
    plt.close(page)


def test_no_label_of_a_diagram_lies_on_a_line_or_a_box() -> None:
    figure = draw()
    figure.canvas.draw()
    for ax in figure.axes:
        boxes = [one.get_window_extent() for one in ax.patches if isinstance(one, Patch)]
        paths = [line.get_path().transformed(line.get_transform()) for line in ax.lines]
        visible = ax.get_window_extent()
        for text in ax.texts:
            if not text.get_text():
                continue
            extent = text.get_window_extent()
            assert visible.x0 <= extent.x0 <= extent.x1 <= visible.x1, text
            inside = [box for box in boxes if box.overlaps(extent)]
            if inside:
                # What stands in a block lies in it whole.
                (box,) = inside
                assert box.x0 < extent.x0 < extent.x1 < box.x1, text
                continue
            assert not any(path.intersects_bbox(extent, filled=False) for path in paths), text
        for path in paths:
            assert path.get_extents().y0 >= visible.y0
            assert path.get_extents().y1 <= visible.y1
    plt.close(figure)
