"""Text and picture of a verification."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ..._support.display.plot_style import (
    ACTUAL,
    BAND,
    DESIRED,
    GUIDE,
    LIMITS,
    axes_or_new,
    caption,
    drawing,
    legend_inside,
    sheet,
    whole,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

    from ..verifying.verification import Verification

__all__ = ["plot_open_loop", "plot_sensitivity", "plot_verification", "verification_text"]

VERDICTS = {
    "holds": "the margins hold on the stage",
    "fails": "the margins do NOT hold on the stage",
    "undecided": "the bands are too wide to decide",
}
# Frequencies that are listed.
LISTED = 5
REGION = {**BAND, "label": "band of 95 %"}


def verification_text(found: Verification) -> str:
    """Write the verdict, and what was measured beside what was predicted.

    Parameters
    ----------
    found : Verification
        The verification.

    Returns
    -------
    str
        Several lines.
    """
    sensitivity = found.sensitivity
    worst = int(np.argmax(sensitivity.magnitude))
    band = sensitivity.band()[worst]
    lines = [
        f"{found.controller.title}, {sensitivity.excitation}",
        f"{VERDICTS[found.verdict]}{_where(found)}",
        f"largest sensitivity {sensitivity.magnitude[worst]:.3g} +- {band:.2g} (at most "
        f"{found.bound:.3g}), at {sensitivity.frequency[worst]:.4g} Hz",
    ]
    if found.predicted is not None:
        sizes = np.abs(found.predicted)
        k = int(np.argmax(sizes.max(axis=0)))
        lines.append(
            f"predicted {sizes.max():.3g}, at {sensitivity.frequency[k]:.4g} Hz; measured within "
            f"the band of it at {100.0 * _agreeing(found):.0f} % of the lines"
        )
    if (margin := found.phase_margin) is not None:
        lines.append(f"phase margin {math.degrees(margin):.3g} deg, between the lines")
    return "\n".join(lines)


def _where(found: Verification) -> str:
    """Write the distance of the lines, or those at which the bound is or may be exceeded."""
    if found.verdict == "holds":
        apart = float(np.median(np.diff(found.sensitivity.frequency)))
        return f", at lines {apart:.3g} Hz apart"
    listed = ", ".join(f"{f:.4g}" for f in found.beyond[:LISTED])
    more = f" and {found.beyond.size - LISTED} more" if found.beyond.size > LISTED else ""
    remedy = ": more periods, realisations or amplitude narrow them"
    return f", at {listed} Hz{more}{remedy if found.verdict == 'undecided' else ''}"


def _agreeing(found: Verification) -> float:
    """Return the share of lines at which a predicted sensitivity lies within the band."""
    assert found.predicted is not None
    low, high = (getattr(np.abs(found.predicted), end)(axis=0) for end in ("min", "max"))
    size, band = found.sensitivity.magnitude, found.sensitivity.band()
    return float(np.mean((size + band >= low) & (size - band <= high)))


@drawing
def plot_sensitivity(found: Verification, ax: Axes | None = None) -> Axes:
    """Draw the sensitivity measured with its band, predicted, and its bound."""
    (ax,) = axes_or_new(ax, 1)
    f, size = found.sensitivity.frequency, found.sensitivity.magnitude
    band = found.sensitivity.band()
    ax.fill_between(f, np.maximum(size - band, 1e-3 * size), size + band, **REGION)
    ax.loglog(f, size, **{**ACTUAL, "label": "measured |S|", "linewidth": 1.2})
    if found.predicted is not None:
        low, middle, high = np.abs(found.predicted)
        ax.loglog(f, middle, **{**DESIRED, "label": "predicted"})
        ends = {**DESIRED, "linewidth": 0.5, "label": None}
        for one in (low, high):
            ax.loglog(f, one, **ends)
    ax.axhline(found.bound, **{**LIMITS, "label": f"bound {found.bound:.3g}"})
    ax.set(xlabel="frequency [Hz]", ylabel="sensitivity |S|")
    ax.margins(x=0)
    legend_inside(ax)
    return ax


@drawing
def plot_open_loop(found: Verification, ax: Axes | None = None) -> Axes:
    """Draw the open loop about -1, with the circle that it must not enter."""
    (ax,) = axes_or_new(ax, 1)
    loop = found.loop
    turn = np.exp(2j * np.pi * np.arange(181) / 180)
    circle = -1.0 + turn / found.bound
    ax.plot(loop.value.real, loop.value.imag, ".-", color=ACTUAL["color"], markersize=3.0)
    if found.predicted is not None:
        middle = 1.0 / found.predicted[1] - 1.0
        ax.plot(middle.real, middle.imag, **{**DESIRED, "label": "predicted"})
    ax.plot(circle.real, circle.imag, **{**LIMITS, "label": f"|S| = {found.bound:.3g}"})
    ax.plot(-1.0, 0.0, "k+")
    ax.axhline(0.0, **GUIDE)
    ax.axvline(0.0, **GUIDE)
    ax.set(xlim=(-2.6, 1.4), ylim=(-2.0, 2.0), aspect="equal")
    ax.set(xlabel="real part of L", ylabel="imaginary part of L")
    legend_inside(ax)
    return ax


@drawing
def plot_verification(found: Verification, fig: Figure | SubFigure | None = None) -> Figure:
    """Plot the sensitivity measured beside predicted, and the open loop about -1."""
    figure, axes = sheet(fig, (10.0, 4.6), (("sensitivity", "loop"),), widths=(3.0, 2.0))
    plot_sensitivity(found, axes["sensitivity"])
    plot_open_loop(found, axes["loop"])
    caption(figure, f"{VERDICTS[found.verdict]}{_where(found)}", "medium")
    return whole(figure)
