"""What all pictures share: where they are drawn, their legends, and one picture in a notebook."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from functools import cache
from itertools import pairwise
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.figure import Figure

import piezotrack as pt
from campaigns import QUICK
from piezotrack._support.display import plot_style
from piezotrack._support.display.plot_style import folded, legend_inside, plain_log_ticks

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from matplotlib.axes import Axes

UM = 1e-6
PI = {"model": "prandtl-ishlinskii"}


@cache
def stage() -> pt.VirtualStage:
    return pt.VirtualStage.xu_li_2010(seed=1)


def test_letters_of_a_pdf_are_outlines_that_journals_take(tmp_path: Path) -> None:
    stage().record(np.linspace(0.0, 10.0, 50), 0.01).plot(style="paper", width="85mm").savefig(
        tmp_path / "log.pdf"
    )
    content = (tmp_path / "log.pdf").read_bytes()
    assert b"/Type3" not in content
    assert b"/CIDFontType2" in content


@cache
def loop(repetitive: bool = False) -> pt.Controller:
    return pt.Controller(
        dt=0.02,
        limits=(0.0, 75.0),
        feedforward=pt.DahlStage.xu_li_2010().inverse(),
        feedback=pt.Pid.xu_li_2010(),
        repetitive=pt.Repetitive.from_um(period=1.0, tq=0.2, kq=1.0) if repetitive else None,
    )


@cache
def log() -> pt.Dataset:
    u = 37.5 - 37.5 * np.cos(np.arange(600) / 50.0)
    return pt.Dataset(u=u, y=1.6e-6 * u, dt=0.005, source="log.csv")


@cache
def fit() -> pt.identification.Identification:
    return pt.identify(log(), "prandtl-ishlinskii", progress=False)


def stepped() -> pt.identification.StepResult:
    u = np.concatenate([np.zeros(100), np.full(1500, 75.0)])
    return pt.identify_step(stage().record(u, 2e-4, hold="zoh"))


def tracked() -> pt.control.Tracking:
    reference = pt.sine(frequency=1.0, low=0.0, high=110 * UM, duration=3.0)
    return pt.track(stage(), loop(repetitive=True), reference, unstable=True)


def traced() -> pt.control.Contour:
    path = pt.circle(frequency=1.0, radius=5 * UM, duration=2.0)
    return pt.contour(pt.XYStage.xu_li_2010(seed=1), (loop(), loop()), path)


def of_two_records(models: tuple[str, ...]) -> pt.identification.Campaign:
    """Three seeds of a search and one that finds nothing, or least squares alone."""
    given = {"flat": {**QUICK, "parameters": {"mass": (1.0, 0.5)}}, "quick": QUICK, "plays": PI}
    records = {"first": log(), "$second_name": log()[1.0:]}
    with TemporaryDirectory() as folder:
        return pt.campaign(records, {one: given[one] for one in models}, range(3), folder=folder)


PICTURES: dict[str, Callable[[], Any]] = {
    "record": log,
    "fit": fit,
    "comparison": lambda: pt.compare(log(), ["prandtl-ishlinskii"]),
    "campaign": lambda: of_two_records(("flat", "quick")),
    "campaign, one model": lambda: of_two_records(("plays",)),
    "noise": lambda: pt.identification.identify_noise(stage().record(np.zeros(5000), 2e-4)),
    "step": stepped,
    "tracking": tracked,
    "contour": traced,
    "stability": lambda: pt.check_loop(stage(), loop()),
    "stability, learning": lambda: pt.check_loop(stage(), loop(repetitive=True)),
}


@pytest.fixture(autouse=True)
def _no_figure_is_left() -> Iterator[None]:
    plt.close("all")
    yield
    plt.close("all")


@pytest.mark.parametrize("name", PICTURES)
def test_it_is_drawn_in_the_figure_given(name: str) -> None:
    drawn = PICTURES[name]()
    figure = Figure(figsize=(11.0, 14.0), layout="constrained")
    assert drawn.plot(fig=figure) is figure
    count = len(figure.axes)
    assert count
    # A part of a figure is as good, and what is returned can be saved.
    whole = Figure(figsize=(11.0, 14.0), layout="constrained")
    upper, lower = np.ravel(whole.subfigures(2, 1))  # type: ignore[arg-type]
    assert drawn.plot(fig=lower) is whole
    assert (len(upper.axes), len(lower.axes)) == (0, count)
    # None of these is a figure of pyplot.
    assert plt.get_fignums() == []
    own = drawn.plot()
    assert plt.get_fignums() == [own.number]
    assert len(own.axes) == count


@pytest.mark.parametrize("name", PICTURES)
def test_legends_and_titles_are_inside_and_every_broken_line_has_a_name(name: str) -> None:
    figure = PICTURES[name]().plot()
    figure.canvas.draw()
    page = figure.bbox
    renderer = figure.canvas.get_renderer()
    for ax in figure.axes:
        if legend := ax.get_legend():
            box = legend.get_window_extent(renderer)
            assert page.x0 <= box.x0
            assert box.x1 <= page.x1
            assert box.y1 <= page.y1
        for title in (ax.title, ax.xaxis.label, ax.yaxis.label):
            box = title.get_window_extent(renderer)
            assert not title.get_text() or page.x0 <= box.x0 <= box.x1 <= page.x1, title
        names = set() if legend is None else {text.get_text() for text in legend.get_texts()}
        styles = {
            line.get_color(): line
            for line in ax.lines
            if line.get_linestyle() not in ("-", "None") and not ax.texts
        }
        for line in styles.values():
            shown = [one for one in ax.lines if one.get_linestyle() == line.get_linestyle()]
            # In the panels of a comparison the legend is that of the first one.
            labels = {str(one.get_label()) for one in shown}
            assert labels & names or name == "comparison", (name, labels)
    assert figure.get_suptitle() or all(ax.get_title() for ax in figure.axes)


@pytest.mark.parametrize("name", PICTURES)
def test_numbers_on_an_axis_do_not_touch(name: str) -> None:
    figure = PICTURES[name]().plot()
    figure.canvas.draw()
    renderer = figure.canvas.get_renderer()
    for ax in figure.axes:
        low, high = sorted(ax.get_xlim())
        ticks = [tick for tick in ax.xaxis.get_major_ticks() if low <= tick.get_loc() <= high]
        labels = [tick.label1 for tick in ticks if tick.label1.get_visible()]
        boxes = [label.get_window_extent(renderer) for label in labels if label.get_text()]
        boxes.sort(key=lambda box: float(box.x0))
        assert all(a.x1 < b.x0 for a, b in pairwise(boxes))


def test_a_colour_means_one_thing() -> None:
    roles = ("MEASURED", "DESIRED", "ERROR", "FEEDFORWARD", "FEEDBACK", "REPETITIVE", "CLIPPED")
    colours = [getattr(plot_style, role)["color"] for role in (*roles, "SIMULATED")]
    assert len(set(colours)) == len(colours)
    # What a simulation of a record and what a simulated loop does is the same thing.
    assert plot_style.ACTUAL["color"] == plot_style.SIMULATED["color"]
    # No model of a comparison looks like an error.
    assert plot_style.ERROR["color"] not in [line["color"] for line in plot_style.MODELS]


def test_a_title_is_broken_evenly() -> None:
    words = "Dahl, second order, on dbo_training, 3 to 23 s: 0.486 % of stroke rms"
    assert folded(words, 80) == words
    first, second = folded(words, 68).splitlines()
    assert f"{first} {second}" == words
    assert abs(len(first) - len(second)) < 12
    # A word that is too long is not broken, and lines that are given are kept.
    assert folded("x" * 100, 68) == "x" * 100
    assert folded("one\ntwo", 68) == "one\ntwo"


def test_a_notebook_shows_a_picture_once(monkeypatch: pytest.MonkeyPatch) -> None:
    figure: Any = fit().plot()
    # Every figure is shown as matplotlib's are, and in a window it stays open.
    with pytest.raises(NotImplementedError):
        figure._ipython_display_()
    assert plt.get_fignums() == [figure.number]
    # The inline backend shows what is open at the end of a cell: what was shown is not open.
    monkeypatch.setattr(mpl, "get_backend", lambda: "module://matplotlib_inline.backend_inline")
    with pytest.raises(NotImplementedError):
        figure._ipython_display_()
    assert plt.get_fignums() == []


@pytest.mark.parametrize(
    ("low", "high"), [(0.2, 2.1), (0.018, 4.0), (3.0, 4.1), (1.0, 1.03), (1e-4, 1e3)]
)
def test_a_logarithmic_axis_has_plain_numbers_that_do_not_touch(low: float, high: float) -> None:
    ax = Figure(figsize=(4.0, 2.5)).subplots()
    ax.semilogy([0, 1], [low, high])
    plain_log_ticks(ax)
    ax.figure.canvas.draw()
    bottom, top = ax.get_ylim()
    shown = [
        label
        for tick, label in zip(ax.get_yticks(), ax.get_yticklabels(), strict=True)
        if bottom <= tick <= top and label.get_text()
    ]
    assert len(shown) >= 2
    assert not any("$" in label.get_text() for label in shown)
    boxes = sorted((label.get_window_extent() for label in shown), key=lambda box: float(box.y0))
    assert all(a.y1 < b.y0 + 2.0 for a, b in pairwise(boxes))


@pytest.mark.parametrize("scale", ["linear", "log"])
def test_a_legend_covers_no_data(scale: str) -> None:
    figure = Figure(figsize=(6.0, 4.0), layout="constrained")
    ax = figure.subplots()
    for i in range(5):
        ax.plot([0.0, 1.0], [1.0 + i, 10.0], label=f"line {i}")
    ax.set_yscale(scale)
    top = ax.get_ylim()[1]
    legend_inside(ax, ncols=3)
    figure.canvas.draw()
    legend = ax.get_legend()
    assert legend is not None
    lowest = ax.transData.inverted().transform((0.0, legend.get_window_extent().y0))[1]
    assert lowest > 0.99 * top


def test_sixteen_models_have_lines_of_their_own() -> None:
    lines = [(one["color"], str(one["linestyle"])) for one in plot_style.MODELS]
    assert len(set(lines)) == len(lines) == 16
    # A colour is there twice at most, with other dashes.
    assert max(Counter(color for color, _ in lines).values()) == 2


def test_names_of_many_models_leave_the_loop_its_panel() -> None:
    few = PICTURES["comparison"]()
    rows = (list(few.rows) * 16)[:16]
    many = replace(few, rows=tuple(replace(row, name=f"{i}") for i, row in enumerate(rows)))
    figure = many.plot()
    figure.canvas.draw()
    loop, errors = figure.axes[0], figure.axes[-1]
    assert loop.get_position().width > 0.3 * errors.get_position().width
    low, high = loop.get_ylim()
    drawn = np.concatenate([np.asarray(line.get_ydata()) for line in loop.lines])
    assert np.ptp(drawn) > 0.8 * (high - low)
    (names,) = [ax.get_legend() for ax in figure.axes if len(_names(ax)) > 10]
    box = names.get_window_extent(figure.canvas.get_renderer())
    assert box.x0 >= 0.0
    assert box.x1 <= errors.get_window_extent().x0


def test_a_path_of_dense_noise_is_pale_and_keeps_its_ends() -> None:
    x = np.tile(np.linspace(0.0, 1.0, 2000), 20)
    noise = 0.05 * np.random.default_rng(1).standard_normal(x.size)
    ax = Figure().subplots()
    plot_style.path(ax, x, x, plot_style.ACTUAL)
    plot_style.path(ax, x, x + noise, plot_style.ACTUAL)
    plain, dense = ax.lines
    assert np.asarray(plain.get_xdata()).size < 1000
    assert plain.get_alpha() is None
    assert dense.get_alpha() is not None
    assert dense.get_linewidth() < 0.5 * plain.get_linewidth()
    # As far as a cell of the grid, extremes stay.
    y = np.asarray(dense.get_ydata())
    assert np.nanmax(y) > np.max(x + noise) - 0.01
    assert np.nanmin(y) < np.min(x + noise) + 0.01


def _names(ax: Axes) -> list[str]:
    legend = ax.get_legend()
    return [] if legend is None else [text.get_text() for text in legend.get_texts()]
