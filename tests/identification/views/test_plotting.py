"""Pictures: on the axes given, labelled with units, the same file for the same result."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Any, cast

import matplotlib.pyplot as plt
import numpy as np
import pytest
from scipy.signal import lfilter

import piezotrack as pt
from piezotrack._support.files.writing import save_figures
from piezotrack.identification.views.files import save_identification
from piezotrack.identification.views.plot import (
    plot_convergence,
    plot_loop,
    plot_response,
    plot_time,
)
from records import quick, quick_fit, search_of

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@cache
def fitted() -> pt.identification.Identification:
    return quick_fit()


@cache
def response() -> pt.stages.Response:
    return fitted().simulate(quick())


def scaled(factor: float) -> tuple[pt.Dataset, pt.stages.Response]:
    """The same record with another stroke."""
    log, run = quick(), response()
    return pt.Dataset(u=log.u, y=factor * log.y, dt=log.dt), replace(run, x=factor * run.x)


@pytest.fixture(autouse=True)
def _no_figure_is_left() -> Iterator[None]:
    plt.close("all")
    yield
    plt.close("all")


def labels(ax: Axes) -> tuple[str, str]:
    return ax.get_xlabel(), ax.get_ylabel()


def points(ax: Axes, line: int) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    drawn = ax.get_lines()[line]
    return np.asarray(drawn.get_xdata()), np.asarray(drawn.get_ydata())


def test_the_axes_given_are_drawn_on_and_returned() -> None:
    figure, axes = plt.subplots(4, 1)
    loop, above, below, convergence = axes
    assert plot_loop(quick(), response(), ax=loop) is loop
    assert plot_time(quick(), response(), axes=(above, below)) == (above, below)
    assert plot_convergence(fitted(), ax=convergence) is convergence
    assert plt.get_fignums() == [figure.number]
    assert all(ax.lines for ax in axes)


def test_without_axes_a_figure_is_made() -> None:
    assert plot_loop(quick(), response()).figure is not None
    above, below = plot_time(quick(), response())
    assert above.figure is below.figure
    assert plot_convergence(fitted()).figure is not None
    assert len(plt.get_fignums()) == 3


def test_the_sheet_has_four_labelled_panels() -> None:
    figure = fitted().plot()
    loop, above, convergence, below = figure.axes
    assert labels(loop) == ("drive [V]", "displacement [\N{MICRO SIGN}m]")
    assert labels(convergence) == ("iteration", "best cost, rms [\N{MICRO SIGN}m]")
    assert above.get_ylabel() == "displacement [\N{MICRO SIGN}m]"
    # One time axis for both.
    assert labels(below) == ("time [s]", "error [nm]")
    assert above.get_shared_x_axes().joined(above, below)
    assert all(ax.get_title() for ax in figure.axes)
    legend = loop.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == ["measured", "simulated"]


def test_what_is_drawn_is_what_was_measured_and_simulated() -> None:
    log = quick()
    run = fitted().simulate(log, offset=fitted().offset)
    loop, above, convergence, below = fitted().plot().axes
    for ax, x in ((loop, log.u), (above, log.t)):
        for line, y in ((0, log.y), (1, run.x)):
            drawn_x, drawn_y = points(ax, line)
            assert np.allclose(drawn_x, x, rtol=1e-12)
            assert np.allclose(drawn_y, 1e6 * y, rtol=1e-12)
    assert np.allclose(points(below, 0)[1], 1e9 * (log.y - run.x), rtol=1e-9, atol=1e-9)
    assert np.allclose(points(convergence, 0)[1], 1e6 * search_of(fitted()).history, rtol=1e-12)
    assert f"rms {1e9 * fitted().fitted.rms:.3g} nm" in below.get_title()
    # What ran: model, record, window, error.
    title = fitted().plot().get_suptitle()
    assert title.startswith(fitted().model.info.title)
    assert title.endswith(f"{fitted().cost_percent:.3g} % of stroke rms")
    assert f"{log.t[0]:g} to {log.t[-1] + log.dt:g} s" in title
    assert "% of stroke" in below.get_title()


def test_another_record_can_be_shown() -> None:
    other = quick(5)[1.0:3.0]
    figure = fitted().plot(other)
    t, y = points(figure.axes[1], 0)
    assert np.allclose(t, other.t)
    assert np.allclose(y, 1e6 * other.y)
    score = fitted().score(other)
    assert f"({score.rms_percent:.3g} % of stroke)" in figure.axes[3].get_title()


def test_a_model_from_a_file_is_drawn_on_a_record(tmp_path: Path) -> None:
    log = quick()
    model = pt.load(fitted().save(tmp_path / "model.json"))
    run = model.simulate(log)
    for ax, x in ((model.plot_loop(log), log.u), (model.plot_time(log)[0], log.t)):
        drawn_x, drawn_y = points(ax, 1)
        assert np.allclose(drawn_x, x, rtol=1e-12)
        assert np.allclose(drawn_y, 1e6 * run.x, rtol=1e-12)
    # Without a search there is no convergence; and this record is the one that was fitted.
    figure = model.plot(log)
    assert len(figure.axes) == 3
    assert "not fitted" not in figure.get_suptitle()
    assert "not fitted" in model.plot(quick(5)[1.0:3.0]).get_suptitle()
    # Without one the loops in the range of the drive that was fitted.
    drawn = points(model.plot().axes[1], 0)[0]
    assert (drawn.min(), drawn.max()) == pytest.approx((log.u.min(), log.u.max()), abs=1e-3)
    for draw in (model.plot_loop, model.plot_time):
        with pytest.raises(pt.ParameterError, match="a model from a file has none"):
            draw()
    assert f"{model.model.mass:.6g}" in model.summary()


def test_panels_of_a_fit_show_its_record() -> None:
    run = fitted().simulate(quick(), offset=fitted().offset)
    assert np.allclose(points(fitted().plot_loop(), 1)[1], 1e6 * run.x, rtol=1e-12)
    assert np.allclose(points(fitted().plot_time()[0], 1)[1], 1e6 * run.x, rtol=1e-12)
    drawn = points(fitted().plot_convergence(), 0)[1]
    assert np.allclose(drawn, 1e6 * search_of(fitted()).history, rtol=1e-12)


def test_a_fit_by_least_squares_has_no_convergence() -> None:
    fit = pt.identify(quick(), "prandtl-ishlinskii", progress=False)
    with pytest.raises(pt.ParameterError, match="least squares"):
        fit.plot_convergence()


@pytest.mark.parametrize(
    ("factor", "unit", "scale"),
    [(1.0, "\N{MICRO SIGN}m", 1e6), (1e-3, "nm", 1e9), (100.0, "mm", 1e3)],
)
def test_the_unit_follows_the_stroke(factor: float, unit: str, scale: float) -> None:
    log, run = scaled(factor)
    loop = plot_loop(log, run)
    above, _ = plot_time(log, run)
    for ax in (loop, above):
        assert ax.get_ylabel() == f"displacement [{unit}]"
        assert np.allclose(points(ax, 0)[1], scale * log.y)
    assert plot_response(log.t, log.u, run.x).axes[0].get_ylabel() == f"displacement [{unit}]"


def test_the_unit_of_the_drive_is_the_records() -> None:
    log = pt.Dataset(u=quick().u, y=quick().y, dt=quick().dt, drive_unit="mA")
    assert plot_loop(log, response()).get_xlabel() == "drive [mA]"


def test_a_response_is_drawn_over_time_and_over_the_drive() -> None:
    log, run = quick(), response()
    left, right = plot_response(log.t, log.u, run.x).axes
    assert labels(left) == ("time [s]", "displacement [\N{MICRO SIGN}m]")
    assert labels(right) == ("drive [V]", "displacement [\N{MICRO SIGN}m]")
    assert np.allclose(points(left, 0)[1], 1e6 * run.x)
    assert np.allclose(points(right, 0)[0], log.u)


def test_the_end_of_the_fit_is_marked() -> None:
    above, below = plot_time(quick(), response(), fitted_until=2.0)
    for ax in (above, below):
        assert any(np.allclose(line.get_xdata(), 2.0) for line in ax.get_lines())
    legend = above.get_legend()
    assert legend is not None
    assert "fitted before, predicted after" in [text.get_text() for text in legend.get_texts()]


def test_a_long_record_is_thinned_but_keeps_its_ends_and_shape() -> None:
    t = np.arange(200_001) / 5000.0
    u = 37.5 - 37.5 * np.cos(0.5 * np.pi * t)
    log = pt.Dataset(u=u, y=1.6e-6 * u, dt=1 / 5000.0)
    run = replace(response(), t=t, u=u, x=1.6e-6 * u)
    x, y = points(plot_loop(log, run), 0)
    assert 5_000 < x.size <= 20_000
    assert (x.min(), x.max()) == pytest.approx((0.0, 75.0), abs=1e-3)
    assert (y.min(), y.max()) == pytest.approx((0.0, 120.0), abs=1e-3)


def test_the_loop_of_a_long_record_of_steps_has_its_corners() -> None:
    # The drive jumps where the stage has not moved yet, which moves while the drive is held.
    u = np.repeat(np.random.default_rng(1).uniform(0.0, 75.0, 40), 1507)
    x = 1.6e-6 * lfilter([0.05], [1.0, -0.95], np.concatenate((u[:1], u[:-1])))
    log = pt.Dataset(u=u, y=x, dt=1e-3, hold="zoh")
    volts, um = points(plot_loop(log, replace(response(), t=log.t, u=u, x=x)), 1)
    both = np.minimum(np.abs(np.diff(volts)) / 75.0, np.abs(np.diff(um)) / 120.0)
    assert volts.size < 20_000
    assert both.max() < 0.05


def test_a_spike_in_a_long_record_is_not_thinned_away() -> None:
    # A glitch of one sample is just what one looks for in the picture of the error.
    t = np.arange(60_001) / 5000.0
    u = 37.5 - 37.5 * np.cos(0.5 * np.pi * t)
    y = 1.6e-6 * u
    y[31_415] += 50e-6
    log = pt.Dataset(u=u, y=y, dt=1 / 5000.0)
    _, below = plot_time(log, replace(response(), t=t, u=u, x=1.6e-6 * u))
    assert points(below, 0)[1].max() == pytest.approx(50.0)


@pytest.mark.parametrize("stop", [0, 1])
def test_a_search_that_was_stopped_early_can_be_drawn(stop: int) -> None:
    with pytest.raises(pt.Interrupted) as caught:
        quick_fit(callback=lambda progress: progress.nit == stop)
    assert len(caught.value.partial.plot().axes) == 4


def test_an_exact_fit_can_be_drawn() -> None:
    log = pt.Dataset(u=quick().u, y=response().x, dt=quick().dt)
    above, below = plot_time(log, response())
    assert below.get_title().startswith("error = measured - simulated: rms 0 ")
    above.figure.canvas.draw()
    search = replace(search_of(fitted()), history=np.zeros(31))
    flat = replace(fitted(), search=search, cost=0.0)
    plot_convergence(flat).figure.canvas.draw()


def saved(folder: Path) -> dict[str, bytes]:
    written = save_identification(fitted(), folder, name="stage", shown=None)
    assert [path.parent for path in written] == [folder] * len(written)
    assert sorted(folder.iterdir()) == sorted(written)
    return {path.name: path.read_bytes() for path in written}


def test_the_same_result_gives_the_same_files(tmp_path: Path) -> None:
    first = saved(tmp_path / "first")
    assert set(first) == {"stage.json"} | {
        f"stage_{panel}.{ending}"
        for panel in ("loop", "time", "convergence")
        for ending in ("png", "svg")
    }
    plt.figure()  # The numbers of figures must not show.
    assert saved(tmp_path / "second") == first
    for name, content in first.items():
        if name.endswith(".png"):
            assert content.startswith(b"\x89PNG\r\n\x1a\n")
        elif name.endswith(".svg"):
            assert ET.fromstring(content).tag == "{http://www.w3.org/2000/svg}svg"
            assert b"dc:date" not in content


def test_figures_are_closed_when_saved(tmp_path: Path) -> None:
    saved(tmp_path)
    assert plt.get_fignums() == []


def test_where_nothing_can_be_written_it_is_said_and_figures_are_closed(tmp_path: Path) -> None:
    figures = {"a": cast("Figure", plot_loop(quick(), response()).figure), "b": plt.figure()}
    with pytest.raises(pt.DataError, match=r"a\.png cannot be written: no such file"):
        save_figures(figures, tmp_path / "gone")
    assert plt.get_fignums() == []
