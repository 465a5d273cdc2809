"""Charts of the page as figures, for papers and slides."""

from __future__ import annotations

import re
from importlib.resources import files
from typing import TYPE_CHECKING

from .._support.display.look import look, looking
from .._support.files.writing import save_figures
from .._support.messages import quoted
from ..errors import ParameterError
from .desk import Download, drawing
from .parts import Plotter, unpacked

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from .desk import Desk
    from .parts import Part

__all__ = ["picture"]

# Pixels from side to side to which lines are thinned: 170 mm at 300 dots per inch.
PIXELS = 2000

# Size on a screen [inch], and colours by role: those of the light page.
WIDE, HALF = (7.0, 3.0), (5.0, 3.6)
CSS = files(__package__).joinpath("static", "app.css").read_text(encoding="utf-8")
COLOURS = dict(re.findall(r"--(\w+): (#\w{6})", CSS.partition("}")[0]))


def _figure(chart: Part) -> Figure:
    """Draw a chart with its axes, units and legend; the sentence is left to the caption."""
    import matplotlib as mpl
    import matplotlib.pyplot as plt

    with mpl.rc_context(look().settings):
        size = look().size(*(WIDE if chart.get("wide") else HALF))
        fig = plt.figure(figsize=size, layout="constrained")
        ax = fig.add_subplot()
        log = chart.get("log", "")
        ax.set_xscale("log" if "x" in log else "linear")
        ax.set_yscale("log" if "y" in log else "linear")
        for line in chart["lines"]:
            _line(ax, line)
        for level in chart.get("levels", ()):
            on_y = level.get("axis", "y") == "y"
            at = 10.0 ** level["at"] if ("y" if on_y else "x") in log else level["at"]
            (ax.axhline if on_y else ax.axvline)(at, color=COLOURS["noise"], ls=":", lw=0.8)
        if view := chart.get("view"):
            ax.set(xlim=view[:2], ylim=view[2:])
        span = ax.get_xlim(), ax.get_ylim()
        for one in chart.get("regions", ()):
            over = ax.axhspan if one["axis"] == "y" else ax.axvspan
            hatch = "//" if one["hatched"] else None
            over(one["from"], one["to"], color=COLOURS[one["role"]], alpha=0.16, lw=0, hatch=hatch)
        ax.set(xlim=span[0], ylim=span[1], xlabel=_named(chart["x"]), ylabel=_named(chart["y"]))
        handles, names = ax.get_legend_handles_labels()
        known = dict(zip(names, handles, strict=True))
        if len(known) > 1:
            fig.legend(
                known.values(), known.keys(), loc="outside upper left", ncols=3, frameon=False
            )
    return fig


def _line(ax: Axes, line: Part) -> None:
    x, y, colour = unpacked(line["x"]), unpacked(line["y"]), COLOURS[line["role"]]
    if "to" in line:
        ax.fill_between(
            x, y, unpacked(line["to"]), color=colour, alpha=0.22, lw=0, label=line["name"]
        )
    elif line.get("marks") or line.get("dots"):
        size = 4.0 if line.get("marks") else 1.0
        ax.plot(x, y, ".", color=colour, ms=size, label=line["name"])
    else:
        style = "steps-post" if line.get("steps") else "default"
        dash = "--" if line.get("dash") else "-"
        width = 1.4 if line.get("wide") else 0.9
        ax.plot(x, y, dash, color=colour, lw=width, drawstyle=style, label=line["name"])


def _named(axis: Part) -> str:
    label: str = axis["label"]
    return f"{label} [{axis['unit']}]" if axis["unit"] else label


def picture(desk: Desk, page: Callable[[Desk], Iterable[Part]], name: str) -> Download:
    """Draw a chart of a page, as it is zoomed, at the width of a column or of a page of a journal.

    Parameters
    ----------
    desk : Desk
        The desk, whose state has width and format.
    page : callable
        Returns the parts of the page.
    name : str
        Key of the chart.

    Returns
    -------
    Download
        The file.

    Raises
    ------
    ParameterError
        There is no such chart.
    """
    use, zoom = desk.state.use, desk.plotter.zoom
    finer = desk.at(desk.state)
    finer.plotter = Plotter(PIXELS, zoom)
    charts = {part["id"]: part for part in page(finer) if part["kind"] == "chart"}
    if name not in charts:
        raise ParameterError("chart", quoted(name), f"one of {', '.join(charts) or 'none'}")
    chart = charts[name]
    if name in zoom:
        chart = {**chart, "view": zoom[name]}
    with drawing, looking("paper", f"{use.width}mm", [use.picture]):
        (path,) = save_figures({name: _figure(chart)}, desk.place("picture"))
    return Download(path.name, path.read_bytes())
