"""Common style of pictures: colours, figures, axes, legends, and thinning of long signals.

A colour means one thing in all pictures; it is distinct from the others in black and white too, by
its width or its line style.
"""

from __future__ import annotations

import warnings
from contextlib import contextmanager
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import ParameterError
from ..arguments import expect, has_entries
from ..messages import quoted

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, FigureBase, SubFigure
    from numpy.typing import NDArray

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
    "few_ticks",
    "folded",
    "heading",
    "legend_inside",
    "literal",
    "panels",
    "plain_log_ticks",
    "thinned",
    "whole",
    "without_glyph_warnings",
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
# Height of a row of a legend, as a part of the axes.
ROW = 0.085


def _new_figure(size: tuple[float, float]) -> Figure:
    """Make a figure that pyplot knows, so that ``plt.show()`` shows it, and notebooks once."""
    import matplotlib.pyplot as plt

    from .notebook import Picture

    return plt.figure(FigureClass=Picture, figsize=size, layout="constrained")


def panels(given: Figure | SubFigure | None, size: tuple[float, float]) -> FigureBase:
    """Return the figure to draw in: the one given, or a new one of a size in inches."""
    from matplotlib.figure import FigureBase

    if given is None:
        return _new_figure(size)
    expect("fig", given, FigureBase, "a figure of Matplotlib, or a part of one")
    return given


def whole(drawn: FigureBase) -> Figure:
    """Return the figure that a panel of figures belongs to."""
    # A figure is its own parent.
    while (parent := drawn.figure) is not drawn:
        drawn = parent
    return drawn  # type: ignore[return-value]


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


def thinned(values: Array) -> NDArray[np.intp]:
    """Choose the samples to draw: of a long signal, the extrema of each part.

    So a glitch of one sample stays visible.
    """
    stretch = max(1, values.size // (MOST_POINTS // 2))
    if stretch < 3:
        return np.arange(values.size)
    whole = values.size // stretch * stretch
    rows = values[:whole].reshape(-1, stretch)
    first = np.arange(0, whole, stretch)
    extremes = np.stack([first + rows.argmin(axis=1), first + rows.argmax(axis=1)])
    ends = [0, values.size - 1]
    tail = np.arange(whole, values.size)
    return np.unique(np.concatenate([extremes.ravel(), tail, ends]))


def plain_log_ticks(ax: Axes) -> None:
    """Label a short logarithmic axis with plain numbers."""
    from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

    low, high = ax.get_ylim()
    decades = np.log10(high / low)
    plain = FuncFormatter(lambda value, _: f"{value:.12g}")
    # So many labels that there are two at least, and few that they do not touch.
    subs = (1.0, 2.0, 5.0) if decades < 2.5 else (1.0,)
    several = MaxNLocator(5) if decades < 0.7 else LogLocator(subs=subs, numticks=12)
    ax.yaxis.set_major_locator(several)
    ax.yaxis.set_major_formatter(plain)
    ax.yaxis.set_minor_formatter(NullFormatter())


def few_ticks(ax: Axes, axis: str = "x") -> None:
    """Set so few numbers that long ones, as -107.5, do not touch."""
    ax.locator_params(axis=axis, nbins=5)  # type: ignore[arg-type]


def heading(ax: Axes, words: str, width: int = 68) -> None:
    """Write a title in lines that fit the axes; `words` may hold line breaks."""
    ax.set_title(folded(words, width), fontsize="medium")


def folded(words: str, width: int) -> str:
    """Break lines that are too long, into parts of about one length."""
    return "\n".join(part for line in words.splitlines() for part in _evenly(line, width))


def _evenly(line: str, width: int) -> list[str]:
    def parts(most: int) -> list[str]:
        return wrap(line, most, break_long_words=False, break_on_hyphens=False)

    # The shortest lines of which there are as few; no single word on the last one.
    needed = len(parts(width))
    return next((parts(most) for most in range(20, width) if len(parts(most)) == needed), [line])


def literal(words: str) -> str:
    """Write words from outside, as names and units, so that matplotlib shows them as they are.

    A dollar sign would begin a formula; a control character has no glyph and is shown as Python
    writes it.
    """
    shown = "".join(one if one.isprintable() else ascii(one)[1:-1] for one in words)
    return shown.replace("$", r"\$")


@contextmanager
def without_glyph_warnings() -> Iterator[None]:
    """Draw a box for a letter that the font does not have, without a warning for each."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", r"Glyph \d+ .*missing from", UserWarning)
        yield


def legend_inside(ax: Axes, ncols: int = 4) -> None:
    """Put the legend at the top of the axes, in room that is made for it above the data."""
    count = len(ax.get_legend_handles_labels()[1])
    if not count:
        return
    low, high = ax.get_ylim()
    part = ROW * -(-count // ncols) + 0.02
    if ax.get_yscale() == "log":
        top = high * (high / low) ** (part / (1.0 - part))
    else:
        top = high + (high - low) * part / (1.0 - part)
    ax.set_ylim(low, top)
    ax.legend(
        loc="upper left",
        ncols=ncols,
        fontsize="small",
        framealpha=0.8,
        edgecolor="none",
        borderaxespad=0.25,
        borderpad=0.1,
        columnspacing=1.2,
        handlelength=2.2,
    )
