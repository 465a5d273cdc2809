"""Picture of a record: drive, displacement, loop."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..._support.display.plot_style import (
    COMMAND,
    RECORDED,
    caption,
    drawing,
    heading,
    literal,
    sheet,
    stack,
    thinned,
    trace,
    whole,
)
from ..._support.units import best_length_unit, shown_unit

if TYPE_CHECKING:
    from matplotlib.figure import Figure, SubFigure

    from ..dataset import Dataset

__all__ = ["plot_dataset"]


@drawing
def plot_dataset(data: Dataset, fig: Figure | SubFigure | None = None) -> Figure:
    """Draw drive and displacement over time, and displacement over drive."""
    rows = (("drive", "loop"), ("displacement", "loop"))
    figure, axes = sheet(fig, (11.0, 4.8), rows, widths=(1.35, 1.0), down=True)
    drive, displacement, loop = (axes[name] for name in ("drive", "displacement", "loop"))
    unit, scale = best_length_unit(data.stroke)
    name, times = shown_unit(data.drive_unit)
    u = times * data.u
    y = scale * data.y
    of_drive, in_metres = f"drive [{literal(name)}]", f"displacement [{unit}]"
    dark = {**COMMAND, "color": "0.2", "linewidth": 1.1}
    trace(drive, data.t, u, dark, steps=data.hold == "zoh", xlabel="time [s]", ylabel=of_drive)
    trace(displacement, data.t, y, RECORDED, xlabel="time [s]", ylabel=in_metres)
    stack((drive, displacement), numbers=True)
    kept = thinned(y, u)
    loop.plot(u[kept], y[kept], **RECORDED)
    loop.set(xlabel=of_drive, ylabel=in_metres)
    for ax, words in ((drive, "Drive"), (displacement, "Displacement"), (loop, "Hysteresis loop")):
        heading(ax, words)
    caption(
        figure,
        f"{literal(data.source or 'Record')}: {data.duration:.6g} s at {1.0 / data.dt:.6g} Hz, "
        f"stroke {scale * data.stroke:.3g} {unit}",
    )
    return whole(figure)
