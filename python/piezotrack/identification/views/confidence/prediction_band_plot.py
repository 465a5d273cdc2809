"""Picture of a prediction with its band: loop, displacement over time, parts of the band."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...._support.display.plot_style import (
    BAND,
    BLUE,
    ERROR,
    GREEN,
    GREY,
    GUIDE,
    MEASURED,
    ORANGE,
    PURPLE,
    SIMULATED,
    drawing,
    heading,
    legend_inside,
    literal,
    sheet,
    stack,
    thinned,
    whole,
)
from ...._support.units import best_length_unit, drive_word, shown_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

    from ...fitted.certainty.prediction_band import PredictionBand

__all__ = ["plot_band"]


@drawing
def plot_band(band: PredictionBand, fig: Figure | SubFigure | None = None) -> Figure:
    """Draw a prediction with its band."""
    rows = (("loop", "time"), ("loop", "parts"))
    figure, axes = sheet(fig, (11.0, 5.6), rows, widths=(1.0, 1.35))
    _loop(band, axes["loop"])
    _time(band, axes["time"])
    _parts(band, axes["parts"])
    stack((axes["time"], axes["parts"]), numbers=True)
    return whole(figure)


def _loop(band: PredictionBand, ax: Axes) -> None:
    unit, scale = best_length_unit(float(np.ptp(band.x)))
    drive, times = shown_unit(band.drive_unit)
    kept = thinned(band.x, band.u)
    u, x = times * band.u[kept], scale * band.x[kept]
    if band.measured is not None:
        ax.plot(u, scale * band.measured[kept], **MEASURED)
    ax.plot(u, x, **{**SIMULATED, "label": "predicted"})
    for end in (band.lower, band.upper):
        ax.plot(u, scale * end[kept], color=BLUE, alpha=0.4, linewidth=0.5)
    ax.set(
        xlabel=f"{drive_word(band.drive_unit)} [{literal(drive)}]",
        ylabel=f"displacement [{unit}]",
    )
    heading(ax, f"Loop with the {100.0 * band.level:g} % band")
    ax.legend(loc="upper left", frameon=False, fontsize="small")


def _time(band: PredictionBand, ax: Axes) -> None:
    unit, scale = best_length_unit(float(np.ptp(band.x)))
    kept = thinned(band.x)
    t, named = band.t[kept], {**BAND, "label": f"{100.0 * band.level:g} % expected"}
    if band.measured is not None:
        ax.plot(t, scale * band.measured[kept], **MEASURED)
    ax.fill_between(t, scale * band.lower[kept], scale * band.upper[kept], **named)
    ax.plot(t, scale * band.x[kept], **{**SIMULATED, "label": "predicted"})
    ax.set(xlabel="time [s]", ylabel=f"displacement [{unit}]")
    heading(ax, "Displacement over time")
    ax.margins(x=0.0)
    legend_inside(ax)


def _parts(band: PredictionBand, ax: Axes) -> None:
    """Draw the errors in the band, and the half widths that its parts give alone."""
    unit, scale = best_length_unit(float(band.half.max()))
    kept = thinned(band.half)
    t, half = band.t[kept], scale * band.half[kept]
    ax.fill_between(t, -half, half, **{**BAND, "label": f"{100.0 * band.level:g} % expected"})
    if band.measured is not None:
        error = band.measured - band.x
        few = thinned(np.nan_to_num(error))
        ax.plot(band.t[few], scale * error[few], **{**ERROR, "linewidth": 0.7, "label": "error"})
    rows = ((band.noise, GREY, "noise"), (band.parameters, GREEN, "parameters"),
            (band.model_error, ORANGE, "model error"))  # fmt: skip
    for size, colour, name in rows:
        ax.plot(t, scale * size[kept], color=colour, linewidth=1.1, label=name)
    if band.unlike.any():
        ax.fill_between(
            t, -half, half, where=band.unlike[kept], color=PURPLE, alpha=0.25, linewidth=0.0,
            label="no such amplitude or rate measured",
        )  # fmt: skip
    ax.axhline(0.0, **GUIDE)
    ax.set(xlabel="time [s]", ylabel=f"error [{unit}]")
    heading(ax, "Parts of the band: half width of each alone")
    ax.margins(x=0.0)
    legend_inside(ax, ncols=3)
