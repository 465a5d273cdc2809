"""Figs. 3 to 15, redrawn from one run."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from . import (
    block_diagrams,
    fig_03_sensor_at_rest,
    fig_04_step_test,
    fig_06_identification,
    fig_07_model_comparison,
    fig_15_circles,
)
from .references import RULES

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from .fig_12_14_tracking import Runs
    from .measured_log import Drives
    from .run import Experiments

__all__ = ["Drawn", "drawn"]


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
                drives.plot(),
            )
        ]
    return [
        Drawn(
            "fig_03",
            "Fig. 3: the sensor at rest",
            "Left the first 80 ms, in steps of the sensor; right the spectrum: not white.",
            fig_03_sensor_at_rest.draw(experiments.noise),
        ),
        Drawn(
            "fig_04",
            "Fig. 4: step of 75 V",
            "The readings of equations (4) to (13).",
            fig_04_step_test.draw(experiments.step),
        ),
        Drawn(
            "fig_05",
            "Figs. 5 and 8 to 11: block diagrams",
            "As implemented here.",
            block_diagrams.draw(),
        ),
        Drawn(
            "fig_06",
            "Fig. 6: convergence of the swarm",
            "Four parameters between the paper's bounds, on the first 4 s of Fig. 7.",
            fig_06_identification.draw(experiments.fit),
        ),
        Drawn(
            "fig_07",
            "Fig. 7: the identified models",
            "0.25 Hz, 0 to 75 V; the part to the right of the dotted line was not fitted.",
            fig_07_model_comparison.draw(experiments.judged),
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
            fig_15_circles.draw(experiments.table),
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


def _grid(runs: Runs, names: dict[str, str], columns: tuple[str, ...]) -> Figure:
    """Draw each run in a row."""
    from .._support.plot_style import legend_inside, whole
    from .._support.plot_style import panels as sheet

    figure = sheet(None, (12.0, 3.3 * len(names)))
    rows = figure.subfigures(len(names), 1, squeeze=False)[:, 0]
    for (key, title), row in zip(names.items(), rows, strict=True):
        run = runs[key]
        row.suptitle(f"{title}: {run.metrics}", fontsize="medium")
        for panel, ax in zip(columns, row.subplots(1, len(columns)), strict=True):
            getattr(run, f"plot_{panel}")(ax=ax)
            if panel == "error":
                # Scaled to the settled error; the smooth start is cropped.
                reach = 1.25e6 * run.metrics.max_error
                ax.set_ylim(-reach, reach)
                legend_inside(ax, ncols=2)
    return whole(figure)
