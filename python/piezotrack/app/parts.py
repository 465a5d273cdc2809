"""Parts of a page as JSON has them: charts, controls, tables, messages and buttons.

The browser draws each kind of part in one way and knows nothing of the steps.
"""

from __future__ import annotations

import base64
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from .._support.display.thinning import extremes, path_cells

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]

__all__ = [
    "Box",
    "Light",
    "Part",
    "Plotter",
    "action",
    "band",
    "buttons",
    "cards",
    "chart",
    "check",
    "code",
    "controls",
    "entry",
    "file",
    "lights",
    "message",
    "messages",
    "needs",
    "number",
    "points",
    "region",
    "select",
    "slider",
    "table",
    "text",
    "unpacked",
]

Part = dict[str, Any]
# Range of x and of y that a chart shows.
Box = tuple[float, float, float, float]
Light = Literal["green", "amber", "red", "grey"]
# Pixels of a chart, at least and at most, and its height as a share of its width.
NARROWEST, WIDEST = 200, 4000
# Width of a loop's chart as a share of that of the page.
LOOP = 0.5


def packed(values: ArrayLike) -> str:
    """Pack numbers as 8 bytes each, lowest first, in base64."""
    return base64.b64encode(np.asarray(values, dtype="<f8").tobytes()).decode()


def unpacked(text: str) -> Array:
    """Return the numbers in a text of `packed`."""
    return np.frombuffer(base64.b64decode(text), dtype="<f8")


class Plotter:
    """Lines of charts, thinned to the pixels that there are.

    Parameters
    ----------
    width : int
        Pixels from side to side of a chart.
    zoom : mapping of str to Box
        Ranges of the charts that are not shown as a whole.
    """

    def __init__(self, width: int, zoom: Mapping[str, Box]) -> None:
        self.width = min(max(width, NARROWEST), WIDEST)
        self.zoom = zoom

    def over_time(
        self, chart: str, t: Array, values: Array, name: str, role: str, **style: Any
    ) -> Part:
        """Draw a signal over time, with two points for each pixel.

        Parameters
        ----------
        chart : str
            The chart that it belongs to.
        t, values : ndarray, shape (n,)
            Times, increasing, and the signal in the unit of the axis.
        name, role : str
            Its name in the legend, and its colour in all charts.
        **style : object
            As ``dash``, ``marks`` or ``steps``.

        Returns
        -------
        Part
            A line.
        """
        kept = self.kept(chart, t, values)
        return _line(t[kept], values[kept], name, role, style)

    def kept(self, chart: str, t: Array, values: Array) -> NDArray[np.intp]:
        """Return the samples of a signal that `over_time` draws."""
        first, last = 0, t.size
        if (box := self.zoom.get(chart)) is not None:
            inside = np.searchsorted(t, box[:2])
            first, last = max(int(inside[0]) - 1, 0), min(int(inside[1]) + 1, t.size)
        return first + extremes(values[first:last], 2 * self.width)

    def in_plane(self, chart: str, x: Array, y: Array, name: str, role: str, **style: Any) -> Part:
        """Draw a path in the plane, each way from pixel to pixel once; as `over_time`."""
        x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
        if (box := self.zoom.get(chart)) is not None:
            near = (x >= box[0]) & (x <= box[1]) & (y >= box[2]) & (y <= box[3])
            # One sample more at each end of a part that is inside.
            near[1:] |= near[:-1].copy()
            near[:-1] |= near[1:].copy()
            x, y = np.where(near, x, np.nan), np.where(near, y, np.nan)
        size = max(int(LOOP * self.width), NARROWEST)
        kept = path_cells(x, y, size, size)
        whole = kept >= 0
        return _line(
            np.where(whole, x[kept], np.nan), np.where(whole, y[kept], np.nan), name, role, style
        )


def _line(x: Array, y: Array, name: str, role: str, style: Mapping[str, Any]) -> Part:
    return {"name": name, "role": role, "x": packed(x), "y": packed(y), **style}


def points(x: ArrayLike, y: ArrayLike, name: str, role: str, **style: Any) -> Part:
    """Draw a few points or a short line as they are."""
    return _line(np.asarray(x, float), np.asarray(y, float), name, role, style)


def band(x: ArrayLike, low: ArrayLike, high: ArrayLike, name: str, role: str) -> Part:
    """Fill between two lines."""
    return {"name": name, "role": role, "x": packed(x), "y": packed(low), "to": packed(high)}


def region(
    first: float, last: float, label: str, role: str, axis: str = "x", *, hatched: bool = False
) -> Part:
    """Mark a range of an axis, over the whole of the other one."""
    return {
        "from": first,
        "to": last,
        "label": label,
        "role": role,
        "axis": axis,
        "hatched": hatched,
    }


def chart(
    key: str,
    title: str,
    sentence: str,
    x: tuple[str, str],
    y: tuple[str, str],
    lines: Sequence[Part],
    **more: Any,
) -> Part:
    """Make a chart.

    Parameters
    ----------
    key : str
        Its key in the page.
    title, sentence : str
        What it shows, and that in one sentence with numbers, for those who do not see it.
    x, y : (str, str)
        Name and unit of the axes.
    lines : sequence of Part
        As of a `Plotter`.
    **more : object
        ``regions``, ``levels``, ``brush``, ``log`` (axes), ``equal``, ``wide``, ``height``.

    Returns
    -------
    Part
        The chart.
    """
    return {
        "kind": "chart",
        "id": key,
        "title": title,
        "sentence": sentence,
        "x": {"label": x[0], "unit": x[1]},
        "y": {"label": y[0], "unit": y[1]},
        "lines": list(lines),
        **more,
    }


def action(label: str, do: str, values: Mapping[str, Any] | None = None, **more: Any) -> Part:
    """Make what a button does: ``do`` is the action, ``values`` its arguments."""
    return {"label": label, "do": do, "values": dict(values or {}), **more}


def buttons(key: str, *items: Part) -> Part:
    """Make a row of buttons."""
    return {"kind": "buttons", "id": key, "items": list(items)}


def needs(step: str, words: str) -> Part:
    """Make the button that leads to the step that has to come before."""
    return buttons("needs", action(words, "go", to=step, primary=True))


def message(level: Light, sentence: str, *fixes: Part) -> Part:
    """Make a sentence of the library with the buttons that mend its cause."""
    return {"level": level, "text": sentence, "fixes": list(fixes)}


def messages(key: str, *items: Part) -> Part:
    """Make a list of messages."""
    return {"kind": "messages", "id": key, "items": list(items)}


def lights(key: str, title: str, *items: tuple[Light, str, str]) -> Part:
    """Make lights, each with a colour, a name and a sentence."""
    found = [{"light": one[0], "name": one[1], "text": one[2]} for one in items]
    return {"kind": "lights", "id": key, "title": title, "items": found}


def table(key: str, title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> Part:
    """Make a table of texts."""
    return {
        "kind": "table",
        "id": key,
        "title": title,
        "columns": list(columns),
        "rows": [list(row) for row in rows],
    }


def cards(key: str, title: str, *items: Part, step: str) -> Part:
    """Make cards to choose from.

    Each has ``title``, ``light``, ``value``, ``text``; ``share`` and ``mark`` of its bar, and the
    settings of the step that it chooses, ``choose``.
    """
    return {"kind": "cards", "id": key, "title": title, "items": list(items), "step": step}


def code(key: str, title: str, lines: str, *, open: bool = False) -> Part:
    """Make lines of code to copy, folded or open."""
    return {"kind": "code", "id": key, "title": title, "text": lines, "open": open}


def text(key: str, title: str, *sentences: str) -> Part:
    """Make paragraphs."""
    return {"kind": "text", "id": key, "title": title, "items": list(sentences)}


def controls(key: str, title: str, *items: Part, step: str = "log", folded: bool = False) -> Part:
    """Make a group of controls for the settings of a step, folded into a drawer or not."""
    return {
        "kind": "controls",
        "id": key,
        "title": title,
        "items": list(items),
        "step": step,
        "folded": folded,
    }


def slider(
    name: str,
    label: str,
    value: float,
    bounds: tuple[float, float],
    unit: str = "",
    **more: Any,
) -> Part:
    """Make a slider for a setting: ``scale`` is SI over the unit shown, ``log`` its spacing."""
    return {
        "type": "slider",
        "name": name,
        "label": label,
        "value": value,
        "low": bounds[0],
        "high": bounds[1],
        "unit": unit,
        **more,
    }


def number(name: str, label: str, value: float | None, unit: str = "", **more: Any) -> Part:
    """Make a field for a number; None is an empty one."""
    return {"type": "number", "name": name, "label": label, "value": value, "unit": unit, **more}


def select(
    name: str, label: str, value: Any, options: Sequence[tuple[Any, str]], **more: Any
) -> Part:
    """Make a list to choose from: values of the setting, each with its text."""
    known = [{"value": one, "text": shown} for one, shown in options]
    return {
        "type": "select",
        "name": name,
        "label": label,
        "value": value,
        "options": known,
        **more,
    }


def check(name: str, label: str, value: bool, **more: Any) -> Part:
    """Make a box to tick."""
    return {"type": "check", "name": name, "label": label, "value": value, **more}


def entry(name: str, label: str, value: str, **more: Any) -> Part:
    """Make a field for a text."""
    return {"type": "entry", "name": name, "label": label, "value": value, **more}


def file(name: str, label: str, **more: Any) -> Part:
    """Make a place to drop a file; ``name`` is what the content is for."""
    return {"type": "file", "name": name, "label": label, **more}
