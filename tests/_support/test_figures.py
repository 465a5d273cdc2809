"""Every picture of the package in the width of a column and of a page: nothing overlaps."""

from __future__ import annotations

import inspect
import pkgutil
from functools import cache
from importlib import import_module
from itertools import combinations
from typing import TYPE_CHECKING, Any

import matplotlib.pyplot as plt
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.text import Text

import piezotrack as pt
from pictures import FUNCTIONS, OBJECTS, SLOW
from piezotrack._support.display.result import Result, Viewed

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.transforms import Bbox

WIDTHS = ("85mm", "170mm")
# Points that boxes of letters may share: their edges are above and below the ink.
SHARED = 1.0
# Bases that have no objects of their own.
BASES = (Viewed, Result)


def modules() -> list[Any]:
    found = pkgutil.walk_packages(pt.__path__, "piezotrack.")
    return [import_module(one.name) for one in found if not one.name.endswith("__main__")]


MODULES = modules()


def classes() -> set[type[Viewed]]:
    known: set[type[Viewed]] = {Viewed}
    while more := {below for one in known for below in one.__subclasses__()} - known:
        known |= more
    return {one for one in known if one.__module__.startswith("piezotrack.")} - set(BASES)


def methods(kind: type) -> list[str]:
    return [name for name in dir(kind) if name.startswith("plot") and name != "plot_panel"]


@cache
def drawn(name: str) -> Any:
    return OBJECTS[name]()


CASES = [
    pytest.param(key, method, marks=[pytest.mark.slow] if key in SLOW else [])
    for key in OBJECTS
    for kind in classes()
    if kind.__name__ == key.partition(",")[0]
    for method in methods(kind)
]


PANELLED = [
    pytest.param(name, marks=[pytest.mark.slow] if name in SLOW else []) for name in OBJECTS
]


@pytest.fixture(autouse=True)
def _no_figure_is_left() -> Iterator[None]:
    yield
    plt.close("all")


def test_every_class_with_a_picture_is_here() -> None:
    assert {one.__name__ for one in classes()} == {key.partition(",")[0] for key in OBJECTS}


def test_every_function_that_draws_is_a_view_or_here() -> None:
    views = {view.partition(":")[2] for one in classes() for view in one.views.values()}
    drawing = {
        name
        for module in MODULES
        for name, function in vars(module).items()
        if inspect.isfunction(function)
        and function.__module__ == module.__name__
        and hasattr(function, "__wrapped__")
        and function.__code__.co_filename.endswith("look.py")
        and not name.startswith(("_", "figure_style", "looking", "without"))
    }
    assert len(drawing) > 20
    # The panels of a model, which those of a record draw.
    assert drawing - views - {"plot_loop", "plot_time"} == set(FUNCTIONS)


def parts(figure: Figure) -> list[tuple[str, Bbox]]:
    """Boxes of titles, labels, numbers on axes, legends and other words, with their texts."""
    figure.canvas.draw()
    found: list[tuple[str, Bbox]] = []
    legends = [one for one in figure.findobj(Legend) if one.get_visible()]
    for legend in legends:
        words = ", ".join(text.get_text() for text in legend.get_texts())
        found.append((f"legend {words}", legend.get_window_extent()))
    in_legends = {id(text) for legend in legends for text in legend.findobj(Text)}
    off = {
        id(text)
        for ax in figure.findobj(Axes)
        if not ax.axison
        for axis in (ax.xaxis, ax.yaxis)
        for text in axis.findobj(Text)
    }
    outside = set()
    for ax in figure.findobj(Axes):
        for axis in (ax.xaxis, ax.yaxis):
            low, high = sorted(axis.get_view_interval())
            slack = 1e-9 * (high - low)
            for tick in [*axis.get_major_ticks(), *axis.get_minor_ticks()]:
                if not low - slack <= tick.get_loc() <= high + slack:
                    outside |= {id(tick.label1), id(tick.label2)}
    for text in figure.findobj(Text):
        known = id(text) in in_legends | off | outside
        if text.get_visible() and text.get_text().strip() and not known:
            found.append((text.get_text(), text.get_window_extent()))
    return found


def faults(figure: Figure) -> list[str]:
    page, shared = figure.bbox, SHARED * figure.dpi / 72.0
    boxes = parts(figure)
    beyond = [
        f"{words!r} is beyond the canvas"
        for words, box in boxes
        if box.x0 < page.x0 - shared
        or box.x1 > page.x1 + shared
        or box.y0 < page.y0 - shared
        or box.y1 > page.y1 + shared
    ]
    over = [
        f"{one!r} overlaps {other!r}"
        for (one, a), (other, b) in combinations(boxes, 2)
        if min(a.x1, b.x1) - max(a.x0, b.x0) > shared and min(a.y1, b.y1) - max(a.y0, b.y0) > shared
    ]
    return beyond + over


def test_the_check_sees_what_overlaps() -> None:
    figure = Figure(figsize=(2.0, 2.0))
    ax = figure.subplots()
    ax.set_title("a title that is far too long for so small a figure as this one is")
    ax.text(0.5, 0.5, "one")
    ax.text(0.5, 0.5, "other")
    assert [one for one in faults(figure) if "canvas" in one]
    assert "'one' overlaps 'other'" in faults(figure)


def own_subplots() -> Figure:
    """Subplots of a user, with labels that need more room than the usual margins have."""
    figure, axes = plt.subplots(2, 2, figsize=(5.0, 4.5))
    for ax in axes.flat:
        ax.plot([0.0, 1.0], [-1.5e4, 2.5e4])
        ax.set(xlabel="time\n[s]", ylabel="displacement\n[µm]")
    drawn("Dataset").plot_panel("loop", ax=axes[0, 1])
    return figure


def test_subplots_of_ones_own_have_room_for_their_labels() -> None:
    with pt.figure_style("paper"):
        within = own_subplots()
    assert faults(within) == []
    # Without it they have not, and what Matplotlib was set to is so again.
    assert faults(own_subplots())


def drawn_figure(call: Any, **look: Any) -> Figure:
    result = call(**look)
    first = result[0] if isinstance(result, tuple) else result
    return first if isinstance(first, Figure) else first.figure


def call_of(name: str, method: str) -> Any:
    if not method:
        return FUNCTIONS[name]
    call = getattr(drawn(name), method)
    if name in ("IdentifiedModel", "ModelViews") and method != "plot":
        return lambda **look: call(drawn("Dataset"), **look)
    return call


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize(
    ("name", "method"), [*CASES, *(pytest.param(name, "") for name in FUNCTIONS)]
)
def test_nothing_overlaps(name: str, method: str, width: str) -> None:
    if method == "plot_convergence" and name != "Identification":
        pytest.skip("least squares have no iterations")
    figure = drawn_figure(call_of(name, method), style="paper", width=width)
    assert faults(figure) == []
    assert round(25.4 * figure.get_figwidth()) == int(width.removesuffix("mm"))
    words = [text.get_text() for text in figure.findobj(Text)]
    assert not [one for one in words if "um]" in one or " um" in one]
    # Letters of a paper, and no title above the panels.
    assert max(float(text.get_fontsize()) for text in figure.findobj(Text)) <= 10.0
    assert not figure.get_suptitle()


@pytest.mark.parametrize("name", PANELLED)
def test_every_panel_is_drawn_alone_in_axes_of_ones_own(name: str) -> None:
    with pytest.raises(pt.ParameterError, match="panel is 'none'") as refused:
        drawn(name).plot_panel("none")
    panels = str(refused.value).partition("one of ")[2].split(", ")
    whole = drawn_figure(drawn(name).plot)
    drawn_axes = [ax for ax in whole.axes if ax.has_data()]
    assert len(panels) == len(drawn_axes)
    plt.close("all")
    for panel, part in zip(panels, drawn_axes, strict=True):
        figure = Figure(figsize=(3.3, 2.5), layout="constrained")
        ax = figure.subplots()
        assert drawn(name).plot_panel(panel, ax=ax, style="paper") is ax
        # All that is in the picture.
        assert ax.has_data()
        assert len(ax.lines) == len(part.lines), panel
        assert len(ax.collections) == len(part.collections), panel
        assert faults(figure) == [], panel
        assert ax.get_xlabel(), panel
        for axis in (ax.xaxis, ax.yaxis):
            assert any(tick.label1.get_visible() for tick in axis.get_major_ticks()), panel
    assert plt.get_fignums() == []
