"""The layout of a figure, the same bits each time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from matplotlib.figure import Figure, FigureBase

__all__ = ["lay_out"]

# Digits of places in a figure: a thousandth of a point on a sheet, far above the solver's rounding.
DIGITS = 6


def lay_out(figure: Figure) -> None:
    """Place axes and titles by the layout of a figure, in round numbers.

    The last digits of a constrained layout depend on the order of its equations, which is one of
    addresses in memory.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        The figure, drawn; it keeps its layout from then on.
    """
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    _round_parts(figure)
    for ax in figure.axes:
        ax.set_position(tuple(np.round(ax.get_position(original=True).bounds, DIGITS)))


def _round_parts(part: FigureBase) -> None:
    title = part._suptitle  # type: ignore[attr-defined]
    if title is not None:
        title.set_position(np.round(title.get_position(), DIGITS))
    for sub in part.subfigs:
        box = sub.bbox_relative
        box.p0, box.p1 = np.round(box.p0, DIGITS), np.round(box.p1, DIGITS)
        _round_parts(sub)
