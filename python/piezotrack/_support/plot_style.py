"""Common style of pictures: axes, lines, legends, and thinning of long signals."""

from __future__ import annotations

import warnings
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = [
    "ACTUAL",
    "DESIRED",
    "MEASURED",
    "above",
    "axes_or_new",
    "literal",
    "plain_log_ticks",
    "thinned",
    "without_glyph_warnings",
]

# Distinct in black and white too, also where many cycles overlap.
MEASURED: dict[str, Any] = {"color": "0.68", "linewidth": 3.2, "label": "measured"}
DESIRED: dict[str, Any] = {"color": "0.35", "linewidth": 1.6, "label": "desired"}
ACTUAL: dict[str, Any] = {"color": "C0", "linewidth": 1.1, "label": "actual"}
# More points than columns of pixels, yet few enough for a small SVG.
MOST_POINTS = 6000


def axes_or_new(given: Axes | Sequence[Axes] | None, count: int) -> list[Axes]:
    """Return the axes given, or make a figure with new ones."""
    if given is None:
        import matplotlib.pyplot as plt

        size = (6.4, 4.2) if count == 1 else (7.6, 5.4)
        _, made = plt.subplots(
            count, 1, figsize=size, sharex=True, squeeze=False, layout="constrained"
        )
        return [ax for row in made for ax in row]
    return list(given) if isinstance(given, (list, tuple, np.ndarray)) else [given]  # type: ignore[list-item]


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
    from matplotlib.ticker import FuncFormatter, LogFormatter, LogLocator

    low, high = ax.get_ylim()
    plain = FuncFormatter(lambda value, _: f"{value:g}")
    ax.yaxis.set_major_formatter(plain)
    if np.log10(high / low) < 2.0:
        ax.yaxis.set_minor_locator(LogLocator(subs=(2.0, 5.0)))
        ax.yaxis.set_minor_formatter(plain)
    else:
        ax.yaxis.set_minor_formatter(LogFormatter(labelOnlyBase=True))


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


def above(ax: Axes) -> None:
    """Put the legend above the axes, where it covers no data."""
    ax.legend(
        loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=4, frameon=False, borderaxespad=0.2
    )
