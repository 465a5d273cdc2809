"""Common style of pictures: colours, figures, axes, legends, and thinning of long signals.

A colour means one thing in all pictures; it is distinct from the others in black and white too, by
its width or its line style.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import ParameterError
from ..arguments import expect, has_entries
from ..messages import quoted
from .fitting import ROOMS, place_legend, whole
from .look import CHOSEN, drawing, look
from .thinning import extremes, path_cells
from .wrapping import folded

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, FigureBase, SubFigure
    from numpy.typing import NDArray

    from .look import Chosen

    Array = NDArray[np.float64]

__all__ = [
    "ACTUAL",
    "BAND",
    "CLIPPED",
    "COMMAND",
    "DESIRED",
    "ERROR",
    "FEEDBACK",
    "FEEDFORWARD",
    "GUIDE",
    "LEVEL",
    "LIMITS",
    "MARKS",
    "MEASURED",
    "MODELS",
    "QUIET",
    "RECORDED",
    "REPETITIVE",
    "SIMULATED",
    "axes_or_new",
    "caption",
    "columns",
    "drawing",
    "folded",
    "heading",
    "in_rows",
    "is_narrow",
    "leftmost",
    "legend_below",
    "legend_inside",
    "literal",
    "names_beside",
    "panels",
    "path",
    "plain_log_ticks",
    "share",
    "sheet",
    "stack",
    "thinned",
    "trace",
    "whole",
]

GREY, BLUE, RED, ORANGE, GREEN, PURPLE = (
    "0.68",
    "#1b6ca8",
    "#c0341d",
    "#d98200",
    "#1d7a3a",
    "#7a3b8f",
)
MEASURED: dict[str, Any] = {"color": GREY, "linewidth": 3.2, "label": "measured"}
# The same where nothing is drawn over it.
RECORDED: dict[str, Any] = {**MEASURED, "color": "0.4", "linewidth": 1.1}
SIMULATED: dict[str, Any] = {"color": BLUE, "linewidth": 1.0, "label": "simulated"}
ACTUAL: dict[str, Any] = {"color": BLUE, "linewidth": 1.7, "label": "actual"}
# Thin dashes over the actual line: both are seen where they agree.
DESIRED: dict[str, Any] = {
    "color": "black",
    "linewidth": 0.9,
    "linestyle": (0, (4.0, 3.0)),
    "zorder": 3,
    "label": "desired",
}
ERROR: dict[str, Any] = {"color": RED, "linewidth": 0.9}
COMMAND: dict[str, Any] = {"color": GREY, "linewidth": 2.6, "label": "command"}
FEEDFORWARD: dict[str, Any] = {"color": PURPLE, "linewidth": 1.0, "label": "feedforward"}
FEEDBACK: dict[str, Any] = {"color": ORANGE, "linewidth": 1.0, "label": "feedback"}
REPETITIVE: dict[str, Any] = {"color": GREEN, "linewidth": 1.0, "label": "repetitive"}
BAND: dict[str, Any] = {
    "color": BLUE,
    "alpha": 0.2,
    "linewidth": 0.0,
    "label": "95 % on cycles like those fitted",
}
LIMITS: dict[str, Any] = {"color": "0.3", "linewidth": 0.9, "linestyle": "-.", "label": "limits"}
CLIPPED: dict[str, Any] = {"color": "#f3dfa8", "zorder": 0, "linewidth": 1.0, "label": "clipped"}
# A line through zero, a level that is read off, and numbers that were read off.
GUIDE: dict[str, Any] = {"color": "0.7", "linewidth": 0.8, "zorder": 0}
LEVEL: dict[str, Any] = {"color": "0.3", "linewidth": 0.9, "linestyle": "--"}
QUIET: dict[str, Any] = {"color": "0.35", "linewidth": 0.9, "linestyle": ":"}
MARKS: dict[str, Any] = {
    "color": "black",
    "linestyle": "none",
    "marker": "o",
    "markersize": 5.0,
    "markerfacecolor": "none",
}
# Models beside each other, sixteen of them; distinct in black and white as well.
HUES = (BLUE, ORANGE, GREEN, PURPLE, "#7a5b00", "#000000", "#c2478f", "#0a8f8f")
DASHES: tuple[Any, ...] = (
    "-",
    "--",
    "-.",
    ":",
    (0, (6, 1.5, 1, 1.5, 1, 1.5)),
    (0, (8, 3)),
    (0, (2, 1)),
    (0, (10, 2, 3, 2)),
)
MODELS: tuple[dict[str, Any], ...] = tuple(
    {"color": hue, "linestyle": DASHES[(i + shift) % len(DASHES)]}
    for shift in (0, 4)
    for i, hue in enumerate(HUES)
)
# More points than columns of pixels, yet few enough for a small SVG.
MOST_POINTS = 6000
# Cells of a path across the axes, and ways between them from which it is a cloud.
CELLS, CLOUD = 400, 2000
# Height of a row of a legend, as a part of the axes.
ROW = 0.085
# Width [inch] below which panels are not beside each other.
NARROW = 4.9
# Height of a panel at least [inch].
LEAST = 1.3
# Letters of a name in a line, where it is narrow and where it is wide.
LETTERS = (15, 30)


def _new_figure(size: tuple[float, float]) -> Figure:
    """Make a figure that pyplot knows, so that ``plt.show()`` shows it, and notebooks once."""
    import matplotlib.pyplot as plt

    from .notebook import Picture

    figsize = look().size(*size)
    return plt.figure(FigureClass=Picture, figsize=figsize, layout="constrained")


def panels(given: Figure | SubFigure | None, size: tuple[float, float]) -> FigureBase:
    """Return the figure to draw in: the one given, or a new one of a size in inches."""
    from matplotlib.figure import FigureBase

    if given is None:
        return _new_figure(size)
    expect("fig", given, FigureBase, "a figure of Matplotlib, or a part of one")
    figure = whole(given)
    if not figure.axes and figure.get_layout_engine() is None:
        figure.set_layout_engine("constrained")
    return given


def is_narrow(given: Figure | SubFigure | None, size: tuple[float, float]) -> bool:
    """Whether a figure, a new one of a size where None, has no room for panels side by side."""
    width = look().size(*size)[0] if given is None else given.bbox.width / whole(given).dpi
    return width < NARROW


def sheet(
    given: Figure | SubFigure | None,
    size: tuple[float, float],
    rows: Sequence[Sequence[str]],
    *,
    heights: Sequence[float] | None = None,
    widths: Sequence[float] | None = None,
    least: float = LEAST,
    down: bool = False,
) -> tuple[FigureBase, dict[str, Axes]]:
    """Make the panels of a picture: beside each other, or below each other where it is narrow.

    Parameters
    ----------
    given : Figure or SubFigure or None
        The figure to draw in; a new one where None.
    size : tuple of float
        Width and height of a new figure as wide as a screen [inch].
    rows : sequence of sequences of str
        Names of the panels, as of ``Figure.subplot_mosaic``; "." is none.
    heights, widths : sequence of float, optional
        Parts of rows and columns; the same for all where not given.
    least : float, optional
        Height of the lowest panel of a new figure at least [inch].
    down : bool, optional
        Whether panels of a narrow picture are in the order of the columns, not of the rows.

    Returns
    -------
    figure, axes
        The figure, and the axes by their names.
    """
    if (chosen := CHOSEN.get()) is not None:
        return _alone(chosen, rows)
    parts, across = heights or [1.0] * len(rows), widths or [1.0] * len(rows[0])
    if len(across) > 1 and is_narrow(given, size):
        cell = size[1] / sum(parts), size[0] / sum(across)
        read = zip(*rows, strict=True) if down else rows
        names = dict.fromkeys(name for row in read for name in row if name != ".")
        parts = [_proportion(name, rows, parts, across, cell) for name in names]
        rows, across = [[name] for name in names], [1.0]
        size = size[0], size[0] * sum(parts)
    width, height = look().size(*size)
    height = max(height, least * sum(parts) / min(parts))
    figure = panels(given, (size[0], size[0] * height / width))
    axes = figure.subplot_mosaic(
        [list(row) for row in rows], height_ratios=parts, width_ratios=across
    )
    return figure, axes


def columns(
    given: Figure | SubFigure | None,
    width: float,
    parts: Sequence[Mapping[str, float]],
    widths: Sequence[float],
) -> tuple[FigureBase, dict[str, Axes]]:
    """Make panels in columns of heights of their own, below each other where it is narrow.

    `parts` has the panels of each column with their heights [inch] in a figure of `width` [inch]
    on a screen, `widths` the parts of the columns.
    """
    if (chosen := CHOSEN.get()) is not None:
        return _alone(chosen, [[name for part in parts for name in part]])
    if is_narrow(given, (width, width)):
        # Each keeps its shape.
        pairs, all_wide = zip(parts, widths, strict=True), sum(widths)
        parts = [{k: all_wide / wide * v for part, wide in pairs for k, v in part.items()}]
        widths = [1.0]
    figure = panels(given, (width, max(sum(part.values()) for part in parts)))
    grid = figure.add_gridspec(1, len(parts), width_ratios=widths)
    axes: dict[str, Axes] = {}
    for i, part in enumerate(parts):
        places = grid[i].subgridspec(len(part), 1, height_ratios=list(part.values()))
        axes |= {name: figure.add_subplot(places[k]) for k, name in enumerate(part)}
    return figure, axes


def _alone(chosen: Chosen, rows: Sequence[Sequence[str]]) -> tuple[FigureBase, dict[str, Axes]]:
    """Make the axes of one panel, and a figure that nobody sees for the others."""
    from matplotlib.figure import Figure

    unseen = Figure()
    axes = unseen.subplot_mosaic([list(row) for row in rows])
    if chosen.name not in axes:
        raise ParameterError("panel", quoted(chosen.name), "one of " + ", ".join(axes))
    (chosen.ax,) = axes_or_new(chosen.ax, 1)
    return unseen, {**axes, chosen.name: chosen.ax}


def share(ax: Axes, other: Axes, axis: str = "x") -> None:
    """Give two panels one axis, where both are in the picture."""
    if CHOSEN.get() is None:
        getattr(ax, f"share{axis}")(other)


def stack(axes: Sequence[Axes], *, numbers: bool = False) -> None:
    """Give panels below each other one axis of x, and one label of y, where all are drawn.

    The lowest is labelled and numbered; with `numbers` the others have numbers too.
    """
    if CHOSEN.get() is not None:
        return
    for ax in axes[:-1]:
        ax.sharex(axes[-1])
        ax.tick_params(labelbottom=numbers)
        ax.set_xlabel("")
    middle = axes[len(axes) // 2]
    for ax in axes:
        if ax is not middle and ax.get_ylabel() == middle.get_ylabel():
            ax.set_ylabel("")


def leftmost(axes: Iterable[Axes], *, numbers: bool = False) -> None:
    """Leave what is written beside panels to those at the left, where all are drawn.

    With `numbers` the others have numbers, or names of their rows, too.
    """
    for ax in axes:
        place = ax.get_subplotspec()
        if CHOSEN.get() is None and place is not None and not place.is_first_col():
            ax.tick_params(labelleft=numbers)
            ax.set_ylabel("")


def in_rows(names: Iterable[str], across: int) -> list[list[str]]:
    """Put panels in rows of so many, as for `sheet`."""
    each = list(names)
    each += ["."] * (-len(each) % across)
    return [each[i : i + across] for i in range(0, len(each), across)]


def _proportion(
    name: str,
    rows: Sequence[Sequence[str]],
    heights: Sequence[float],
    widths: Sequence[float],
    cell: tuple[float, float],
) -> float:
    """Return height over width of a panel, within what is seen well."""
    high = sum(part for part, row in zip(heights, rows, strict=True) if name in row)
    columns = zip(*rows, strict=True)
    wide = sum(part for part, column in zip(widths, columns, strict=True) if name in column)
    return min(0.75, max(0.5, high * cell[0] / (wide * cell[1])))


def names_beside(ax: Axes, places: Sequence[float] | Array, names: Sequence[str]) -> None:
    """Write names beside rows, in lines that leave room for what is drawn."""
    wide = int(whole(ax.figure).get_figwidth() > NARROW)
    ax.set_yticks(list(places), [folded(literal(name), LETTERS[wide]) for name in names])


def axes_or_new(given: Axes | Sequence[Axes] | None, count: int) -> list[Axes]:
    """Return the axes given, or make a figure with new ones below each other."""
    from matplotlib.axes import Axes

    if given is None:
        figure = _new_figure((6.4, 4.2) if count == 1 else (7.6, 5.4))
        made = figure.subplots(count, 1, sharex=True, squeeze=False)
        return [ax for row in made for ax in row]
    several = given if has_entries(given) else [given]
    axes = [ax for ax in several if isinstance(ax, Axes)]
    if len(axes) != count:
        name, words = ("ax", "the axes") if count == 1 else ("axes", f"{count} axes")
        raise ParameterError(name, quoted(given), f"{words} of Matplotlib")
    return axes


def thinned(*signals: Array) -> NDArray[np.intp]:
    """Choose the samples to draw of signals of the same instants, as `extremes` does of each."""
    return np.unique(np.concatenate([extremes(values, MOST_POINTS) for values in signals]))


def trace(
    ax: Axes,
    t: Array,
    values: Array,
    style: Mapping[str, Any],
    *,
    steps: bool = False,
    zero: bool = False,
    xlabel: str = "",
    ylabel: str = "",
) -> None:
    """Draw a signal over time, thinned, from the first to the last instant.

    With `steps` each value holds until the next; with `zero` a line is drawn through 0.
    """
    kept = thinned(values)
    ax.plot(t[kept], values[kept], drawstyle="steps-post" if steps else "default", **style)
    if zero:
        ax.axhline(0.0, **GUIDE)
    ax.set(xlabel=xlabel or ax.get_xlabel(), ylabel=ylabel or ax.get_ylabel())
    ax.margins(x=0.0)


def path(ax: Axes, x: Array, y: Array, style: Mapping[str, Any]) -> None:
    """Draw a path in the plane, a long one each way once; dense noise in thin pale lines."""
    if x.size > CLOUD:
        kept = path_cells(x, y, CELLS, CELLS)
        x, y = (np.where(kept < 0, np.nan, one[kept]) for one in (x, y))
    thin = {"linewidth": 0.7, "alpha": 0.5} if x.size > CLOUD else {}
    ax.plot(x, y, **{**style, **thin})


def plain_log_ticks(ax: Axes, axis: str = "y") -> None:
    """Label a short logarithmic axis with plain numbers."""
    from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

    low, high = ax.get_ylim() if axis == "y" else ax.get_xlim()
    decades = np.log10(high / low)
    plain = FuncFormatter(lambda value, _: f"{value:.12g}")
    # So many labels that there are two at least, and few that they do not touch.
    subs = (1.0, 2.0, 5.0) if decades < 2.5 else (1.0,)
    several = MaxNLocator(5) if decades < 0.7 else LogLocator(subs=subs, numticks=12)
    which = ax.yaxis if axis == "y" else ax.xaxis
    which.set_major_locator(several)
    which.set_major_formatter(plain)
    which.set_minor_formatter(NullFormatter())


def heading(ax: Axes, words: str) -> None:
    """Write a title above axes, which a paper leaves to the caption."""
    if not look().paper:
        ax.set_title(words, fontsize="medium")


def caption(figure: FigureBase, words: str, size: str = "large") -> None:
    """Write a title above all panels, which a paper leaves to the caption."""
    if not look().paper:
        figure.suptitle(words, fontsize=size)


def literal(words: str) -> str:
    """Write words from outside, as names and units, so that matplotlib shows them as they are.

    A dollar sign would begin a formula; a control character has no glyph and is shown as Python
    writes it.
    """
    shown = "".join(one if one.isprintable() else ascii(one)[1:-1] for one in words)
    return shown.replace("$", r"\$")


def legend_inside(ax: Axes, ncols: int = 4) -> None:
    """Put the legend at the top of the axes, in room that is made for it above the data."""
    count = len(ax.get_legend_handles_labels()[1])
    if not count:
        return
    low, high = ax.get_ylim()
    if ax in ROOMS and ROOMS[ax][0] == low:
        # It has room already.
        high = ROOMS[ax][1]
    ROOMS[ax] = (low, high, ncols)
    place_legend(ax, min(ncols, count), ROW * -(-count // ncols) + 0.02)


def legend_below(ax: Axes) -> None:
    """Put a legend of long names below axes that have no label there, inside those drawn alone."""
    if CHOSEN.get() is not None:
        legend_inside(ax)
        return
    look = {"frameon": False, "fontsize": "small", "handlelength": 4.0}
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.02), **look)
