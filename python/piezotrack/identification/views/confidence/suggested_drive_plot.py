"""Picture of a suggested drive: the drive, and the deviations that it leaves."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ...._support.display.plot_style import (
    GREY,
    MODELS,
    RECORDED,
    drawing,
    heading,
    legend_inside,
    names_beside,
    sheet,
    trace,
    whole,
)
from ...._support.units import drive_word, length_text, shown_unit

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.figure import Figure, SubFigure

    from ...confidence.suggestion.suggested_drive import ExpectedDeviation, SuggestedDrive

__all__ = ["plot_suggested"]

# Most parameters with a row of their own; the table has all.
ROWS = 12


@drawing
def plot_suggested(drive: SuggestedDrive, fig: Figure | SubFigure | None = None) -> Figure:
    """Plot a suggested drive, and the expected deviations of the best determined parameters."""
    shown = _best(drive.parameters)
    names = list(shown)
    size = (11.0, max(4.4, 1.4 + 0.28 * len(names)))
    figure, axes = sheet(
        fig, size, (("drive", "deviations"),), widths=(1.5, 1.0), least=1.0 + 0.14 * len(names)
    )
    left, right = axes["drive"], axes["deviations"]
    unit, scale = shown_unit(drive.drive_unit)
    t, line = drive.dt * np.arange(float(drive.u.size)), {**RECORDED, "linewidth": 0.8}
    trace(
        left,
        t,
        scale * drive.u,
        line,
        xlabel="time [s]",
        ylabel=f"{drive_word(drive.drive_unit)} [{unit}]",
    )
    heading(left, "Suggested drive")
    each = list(shown.values())
    series: list[tuple[str, str, str, list[float | None]]] = [
        ("suggested drive", "o", MODELS[0]["color"], [one.deviation for one in each]),
        ("plain sine", "s", MODELS[1]["color"], [one.of_sine for one in each]),
        ("record fitted", "D", "0.4", [one.of_record for one in each]),
    ]
    rows, sizes = np.arange(float(len(names))), np.array([abs(one.value) for one in each])
    for label, marker, colour, deviations in series:
        known = np.array([math.nan if one is None else one for one in deviations])
        shares = np.where(np.isfinite(known), 100.0 * known / sizes, math.nan)
        if np.isfinite(shares).any():
            right.plot(shares, rows, marker, color=colour, label=label, markersize=6, alpha=0.9)
    right.set(xscale="log", xlabel="standard deviation [% of the value]")
    names_beside(right, rows, names)
    right.invert_yaxis()
    right.grid(axis="y", color=GREY, linewidth=0.4)
    legend_inside(right, ncols=3)
    total = len(drive.parameters)
    what = "Expected" if len(names) == total else f"Best determined {len(names)} of {total},"
    heading(right, f"{what} under a noise of {length_text(drive.noise, 3)} rms")
    return whole(figure)


def _best(parameters: Mapping[str, ExpectedDeviation]) -> dict[str, ExpectedDeviation]:
    """Return the parameters that the drive determines best, in their order."""

    def share(name: str) -> float:
        one = parameters[name]
        return one.deviation / abs(one.value) if one.value else math.inf

    best = set(sorted(parameters, key=share)[:ROWS])
    return {name: one for name, one in parameters.items() if name in best}
