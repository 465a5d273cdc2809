"""Figs. 3 to 15, redrawn from one run."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..._support.display.plot_style import (
    GUIDE,
    MARKS,
    MEASURED,
    MODELS,
    caption,
    drawing,
    heading,
    legend_inside,
    panels,
    sheet,
    whole,
)
from ..experiments.references import RULES
from .block_diagrams import plot_block_diagrams

if TYPE_CHECKING:
    from matplotlib.figure import Figure, SubFigure

    from ...identification.fitted.identification import Identification
    from ..experiments.fig_12_14_tracking import Runs
    from ..measured_log import Drives
    from ..reproduction import Reproduction
    from ..run import Experiments

__all__ = ["Drawn", "drawn", "plot_reproduction"]


class Drawn(NamedTuple):
    """A figure: name of its file, title, caption and picture."""

    name: str
    title: str
    caption: str
    figure: Figure


def drawn(experiments: Experiments, drives: Drives | None) -> list[Drawn]:
    """Draw all figures of the paper from 3 on, and the measured log where there is one."""
    measured = []
    if drives is not None:
        measured = [
            Drawn(
                "measured",
                "A measured log: drive of our inverse and of the authors' inverse",
                "Both less the straight line fitted to the latter, over two periods.",
                _drives(drives),
            )
        ]
    return [
        Drawn(
            "fig_03",
            "Fig. 3: the sensor at rest",
            "Left the first 80 ms, in steps of the sensor; right the spectrum: not white.",
            experiments.noise.plot(),
        ),
        Drawn(
            "fig_04",
            "Fig. 4: step of 75 V",
            "The readings of equations (4) to (13).",
            experiments.step.plot(),
        ),
        Drawn(
            "fig_05",
            "Figs. 5 and 8 to 11: block diagrams",
            "As implemented here.",
            plot_block_diagrams(),
        ),
        Drawn(
            "fig_06",
            "Fig. 6: convergence of the swarm",
            "Four parameters between the paper's bounds, on the first 4 s of Fig. 7.",
            _convergence(experiments.fit),
        ),
        Drawn(
            "fig_07",
            "Fig. 7: the identified models",
            "0.25 Hz, 0 to 75 V; the part to the right of the dotted line was not fitted.",
            experiments.judged.plot(),
        ),
        Drawn(
            "fig_12",
            "Fig. 12: feedforward, PID, both",
            "0.2 Hz, 0 to 110 um. Left the motion, in the middle the error, right measured over "
            "desired. The first period, with the smooth start, is excluded.",
            _grid(experiments.compensation, TWELVE, ("motion", "error", "following")),
        ),
        Drawn(
            "fig_13",
            "Fig. 13: saturation",
            f"The reference is a rule: {RULES['13']} Shaded where the voltage is clipped.",
            _grid(experiments.antiwindup, THIRTEEN, ("motion", "error", "effort")),
        ),
        Drawn(
            "fig_14",
            "Fig. 14: repetitive control at 0.5 Hz",
            f"The reference is a rule: {RULES['14']} Dashed the largest error of each period.",
            _grid(experiments.repetitive, FOURTEEN, ("motion", "error", "effort")),
        ),
        Drawn(
            "fig_15",
            "Fig. 15: a circle of 10 um at 0.1 Hz",
            "The last turn: path, contour error magnified along it, errors of the axes, contour "
            "error; all at the instants of x. The table above has the errors of each controller.",
            experiments.table.runs[0].plot(),
        ),
        Drawn(
            "table_2",
            "Fig. 15a and Table 2: circles of 10, 20 and 40 um",
            "Bars: published and obtained.",
            experiments.table.plot(),
        ),
        *measured,
    ]


TWELVE = {"forward": "feedforward alone", "back": "PID alone", "both": "both"}
THIRTEEN = {
    "free": "0 to 75 V",
    "without": "6 to 28 V, no antiwindup",
    "with": "6 to 28 V, antiwindup",
}
FOURTEEN = {"without": "feedforward and PID", "with": "with repetitive control"}


@drawing
def _grid(runs: Runs, names: dict[str, str], columns: tuple[str, ...]) -> Figure:
    """Draw each run in a row."""
    figure = panels(None, (12.0, 3.3 * len(names)))
    rows = figure.subfigures(len(names), 1, squeeze=False)[:, 0]
    for (key, title), row in zip(names.items(), rows, strict=True):
        run = runs[key]
        caption(row, f"{title}: {run.metrics}", "medium")
        for panel, ax in zip(columns, row.subplots(1, len(columns)), strict=True):
            getattr(run, f"plot_{panel}")(ax=ax)
            if panel == "error":
                # Scaled to the settled error; the smooth start is cropped.
                reach = 1.25e6 * run.metrics.max_error
                ax.set_ylim(-reach, reach)
                for inset in ax.child_axes:
                    inset.remove()
                legend_inside(ax, ncols=2)
    return whole(figure)


@drawing
def _convergence(fit: Identification) -> Figure:
    """Draw the convergence of the swarm."""
    figure = panels(None, (11.0, 4.2))
    fit.plot_convergence(ax=figure.add_subplot())
    return whole(figure)


@drawing
def _drives(drives: Drives) -> Figure:
    """Draw the drives over the reference and, less the line, over time."""
    figure, axes = sheet(None, (11.0, 4.6), (("reference", "time"),))
    # Two periods of 1 Hz.
    part = drives.t < drives.t[0] + 2.0
    um = 1e6 * (drives.desired - drives.desired.mean())
    for name, over, words in (("reference", um, "[um]"), ("time", drives.t, "[s]")):
        ax = axes[name]
        ax.plot(over[part], (drives.measured - drives.line)[part], **MEASURED)
        for (drive, voltage), line in zip(drives.computed.items(), MODELS, strict=False):
            added = (voltage - drives.line)[part]
            ax.plot(over[part], added, linewidth=1.1, label=drive, **line)
        ax.set(xlabel=f"{name} {words}", ylabel="drive - straight line [V]")
    axes["time"].margins(x=0.0)
    legend_inside(axes["time"], ncols=2)
    return whole(figure)


@drawing
def plot_reproduction(reproduction: Reproduction, fig: Figure | SubFigure | None = None) -> Figure:
    """Draw obtained over published of every number, with quartiles, in the order of the paper."""
    rows = reproduction.obtained
    figure, axes = sheet(fig, (11.0, 5.0), (("ratios",),))
    ax = axes["ratios"]
    ratios = np.array([row.ratio for row in rows])
    quartiles = np.array([row.quartiles for row in rows]).T
    published = np.array([row.observable.published for row in rows])
    reach = np.sort(quartiles / published, axis=0)
    places = np.arange(len(rows))
    ax.axhline(1.0, **GUIDE)
    ax.vlines(places, *reach, color=MEASURED["color"])
    reached = np.array([row.reached for row in rows])
    ax.plot(places[reached], ratios[reached], **{**MARKS, "markersize": 3.0, "label": "reached"})
    missed = {**MARKS, "markersize": 5.0, "marker": "x", "label": "not reached"}
    ax.plot(places[~reached], ratios[~reached], **missed)
    figures = [row.observable.figure for row in rows]
    # As many names as have room beside each other.
    apart, first = 0.14 * len(rows) / (whole(ax.figure).get_figwidth() - 0.8), [0]
    for i, name in enumerate(figures):
        if name != figures[i - 1] and i - first[-1] >= apart:
            first.append(i)
    ax.set_xticks(first, [figures[i] for i in first], rotation=90, fontsize="small")
    ax.set(xlabel="figure or table of the paper", ylabel="obtained / published")
    ax.margins(x=0.01)
    heading(ax, f"Median and quartiles of {len(reproduction.seeds)} seeds")
    legend_inside(ax)
    return whole(figure)
