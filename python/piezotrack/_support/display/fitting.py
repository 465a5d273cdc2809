"""Fit of what is drawn to the size of its figure: titles, labels, legends and numbers on axes."""

from __future__ import annotations

import re
from itertools import pairwise
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure, FigureBase, SubFigure
from matplotlib.lines import Line2D
from matplotlib.text import Text
from matplotlib.ticker import LogLocator, MaxNLocator

from ..arguments import has_entries
from .wrapping import folded

if TYPE_CHECKING:
    from collections.abc import Iterable

    from matplotlib.axis import Axis
    from matplotlib.legend import Legend

__all__ = ["ROOMS", "fit_in", "parts_of", "place_legend", "whole"]

# Lines and marks in a paper over those on a screen.
THIN = 0.7
# Layouts until all is in its place, and points between numbers on an axis.
ROUNDS, APART = 6, 3.0
# Axes whose legend has room made above the data: the limits without it, and columns at most.
ROOMS: WeakKeyDictionary[Axes, tuple[float, float, int]] = WeakKeyDictionary()
_MICRO = re.compile(r"(?<![A-Za-z_])u(m|s|V)(?![A-Za-z_])")


def whole(drawn: FigureBase) -> Figure:
    """Return the figure that a panel of figures belongs to."""
    # A figure is its own parent.
    while (parent := drawn.figure) is not drawn:
        drawn = parent
    return drawn  # type: ignore[return-value]


def parts_of(values: Iterable[object]) -> set[int]:
    """Return the identities of all that is drawn in the figures and axes among values."""
    several = [one for value in values for one in (value if has_entries(value) else [value])]
    drawn = [one for one in several if isinstance(one, (Axes, FigureBase))]
    return {id(part) for one in drawn for part in one.findobj()}


def fit_in(drawn: Any, before: set[int], *, thin: bool = False) -> None:
    """Fold titles and labels, arrange legends, and thin numbers out until nothing touches.

    Parameters
    ----------
    drawn : Figure, Axes, or sequence of Axes
        What a view returns.
    before : set of int
        Identities of what was drawn before, which is left as it is, but for the axes given.
    thin : bool, optional
        Whether lines and marks are those of a paper.
    """
    several = list(drawn) if isinstance(drawn, (tuple, list)) else [drawn]
    given = [one for one in several if isinstance(one, Axes)]
    figure = whole(several[0] if not given else given[0].figure)
    axes = given or [ax for ax in figure.axes if id(ax) not in before or not ax.has_data()]
    axes += [one for ax in axes for one in ax.child_axes if isinstance(one, Axes)]
    parts = [part for one in (axes if given else [figure]) for part in one.findobj()]
    new = [part for part in parts if id(part) not in before]
    if thin:
        _thin(new)
        for ax in axes:
            # Numbers on an axis that are made later have the settings of then.
            ax.tick_params(which="both", labelsize="medium", length=2.5, width=0.6, pad=2.0)
            sizes = {axis.get_offset_text() for axis in (ax.xaxis, ax.yaxis)}
            for offset in sizes:
                offset.set_fontsize("small")
    for _ in range(ROUNDS):
        for text in (text for one in (axes if given else [figure]) for text in one.findobj(Text)):
            _write_micro(text)
        figure.draw_without_rendering()
        if not any([_fit_titles(figure, before), *(_fit_axes(ax) for ax in axes)]):
            break


def _write_micro(text: Text) -> None:
    text.set_text(_MICRO.sub("\N{MICRO SIGN}\\1", text.get_text()))


def _thin(parts: Iterable[object]) -> None:
    for part in parts:
        if isinstance(part, Line2D):
            part.set_linewidth(THIN * part.get_linewidth())
            part.set_markersize(THIN * part.get_markersize())
            part.set_markeredgewidth(THIN * part.get_markeredgewidth())
        elif isinstance(part, LineCollection):
            part.set_linewidth(THIN * np.asarray(part.get_linewidth()))  # type: ignore[arg-type]


def _fit_titles(figure: Figure, before: set[int]) -> bool:
    """Fold the titles of a figure and of its parts."""
    changed = False
    for part in figure.findobj(lambda one: isinstance(one, (Figure, SubFigure))):
        title: Text | None = part._suptitle  # type: ignore[attr-defined]
        if title is not None and id(title) not in before:
            changed |= _fold(title, 0.97 * part.bbox.width)  # type: ignore[attr-defined]
    return changed


def _fit_axes(ax: Axes) -> bool:
    box = ax.get_window_extent()
    titles = (ax.title, ax._left_title)  # type: ignore[attr-defined]
    wide = [*((title, 1.02 * box.width) for title in titles), (ax.xaxis.label, 1.05 * box.width)]
    changed = [_fold(text, most) for text, most in wide]
    changed += [_fold(ax.yaxis.label, 1.05 * box.height, along=1)]
    changed += [_fewer(ax, "x", ax.xaxis), _fewer(ax, "y", ax.yaxis)]
    if ax in ROOMS:
        changed.append(_fit_legend(ax))
    return any(changed)


def _fold(text: Text, most: float, along: int = 0) -> bool:
    """Break lines that are longer than so many pixels; say whether there were any."""
    words = text.get_text()
    if not words or not text.get_visible():
        return False
    box = text.get_window_extent()
    length = box.height if along else box.width
    if length <= most:
        return False
    letters = max(map(len, words.splitlines()))
    narrower = folded(words, max(8, min(letters - 1, int(letters * most / length))))
    text.set_text(narrower)
    return narrower != words


def _fewer(ax: Axes, name: str, axis: Axis) -> bool:
    """Set fewer numbers on an axis where they touch."""
    low, high = sorted(axis.get_view_interval())
    along = 0 if name == "x" else 1
    boxes = sorted(
        (
            tick.label1.get_window_extent()
            for tick in axis.get_major_ticks()
            if low <= tick.get_loc() <= high
            and tick.label1.get_visible()
            and tick.label1.get_text()
        ),
        key=lambda box: float(box.min[along]),
    )
    apart = APART if name == "x" else 0.0
    if all(a.max[along] + apart <= b.min[along] for a, b in pairwise(boxes)):
        return False
    locator = axis.get_major_locator()
    fewer = len(boxes) - 1
    if fewer < 2:
        return False
    if isinstance(locator, MaxNLocator):
        ax.locator_params(axis=name, nbins=max(1, fewer - 1))  # type: ignore[arg-type]
    elif isinstance(locator, LogLocator):
        # Decades alone, then fewer of them.
        subs = getattr(locator, "_subs", None)
        several = subs is not None and len(subs) > 1
        locator.set_params(**({"subs": (1.0,)} if several else {"numticks": fewer}))
    else:
        return False
    return True


def place_legend(ax: Axes, columns: int, part: float) -> Legend:
    """Put a legend at the top of axes, in room made above the data of `part` of the height."""
    low, high, _ = ROOMS[ax]
    part = min(part, 0.7)
    if ax.get_yscale() == "log":
        top = high * (high / low) ** (part / (1.0 - part))
    else:
        top = high + (high - low) * part / (1.0 - part)
    ax.set_ylim(low, top)
    legend = ax.legend(
        loc="upper left",
        ncols=columns,
        fontsize="small",
        framealpha=0.8,
        edgecolor="none",
        borderaxespad=0.25,
        borderpad=0.1,
        columnspacing=1.2,
    )
    # It is inside: how wide it is has no effect on the axes.
    legend.set_in_layout(False)
    for text in legend.get_texts():
        _write_micro(text)
    return legend


def _fit_legend(ax: Axes) -> bool:
    """Give a legend so many columns as fit, and the room it needs, or one beside it needs."""
    legend = ax.get_legend()
    if legend is None:
        return False
    frame, box = ax.get_window_extent(), legend.get_window_extent()
    columns = legend._ncols  # type: ignore[attr-defined]
    if columns > 1 and box.width > frame.width:
        place_legend(ax, max(1, int(columns * frame.width / box.width)), 0.2)
        return True
    beside = [one for one in ax.get_shared_y_axes().get_siblings(ax) if one in ROOMS]
    heights = [one.get_legend().get_window_extent().height for one in beside]
    part = (max([box.height, *heights]) + 4.0) / frame.height
    low, high, _ = ROOMS[ax]
    top = ax.get_ylim()[1]
    place_legend(ax, columns, part)
    return abs(ax.get_ylim()[1] - top) > 0.01 * abs(high - low)
