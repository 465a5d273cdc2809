"""Block diagrams of the report: they can be read."""

from __future__ import annotations

from typing import Any

import matplotlib.pyplot as plt
import pytest
from matplotlib.patches import Patch

from piezotrack.xu_li_2010.views.block_diagrams import plot_block_diagrams


@pytest.mark.parametrize("width", [None, "85mm", "170mm"])
@pytest.mark.parametrize("style", ["screen", "paper"])
def test_no_label_of_a_diagram_lies_on_a_line_or_a_box(style: str, width: str | None) -> None:
    chosen: dict[str, Any] = {"style": style, "width": width}
    figure = plot_block_diagrams(**chosen)
    figure.canvas.draw()
    for ax in figure.axes:
        boxes = [one.get_window_extent() for one in ax.patches if isinstance(one, Patch)]
        paths = [line.get_path().transformed(line.get_transform()) for line in ax.lines]
        visible = ax.get_window_extent()
        for text in ax.texts:
            if not text.get_text():
                continue
            assert float(text.get_fontsize()) >= 6.0
            extent = text.get_window_extent()
            assert visible.x0 <= extent.x0 <= extent.x1 <= visible.x1, text
            inside = [box for box in boxes if box.overlaps(extent)]
            if inside:
                # What stands in a block lies in it whole.
                (box,) = inside
                assert box.x0 < extent.x0 < extent.x1 < box.x1, text
                assert box.y0 < extent.y0 < extent.y1 < box.y1, text
                continue
            assert not any(path.intersects_bbox(extent, filled=False) for path in paths), text
        for path in paths:
            assert path.get_extents().y0 >= visible.y0
            assert path.get_extents().y1 <= visible.y1
    plt.close(figure)
