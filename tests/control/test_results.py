"""Results of control as files: samples, JSON and picture, which say what the result has."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from matplotlib.figure import Figure

import piezotrack as pt

if TYPE_CHECKING:
    from pathlib import Path

PLAYS = pt.PrandtlIshlinskiiStage(linear=1e-6, thresholds=(5.0,), weights=(5e-7,))
LOOP = pt.Controller(dt=0.01, limits=(0.0, 75.0), feedforward=PLAYS.inverse())
SINE = pt.sine(frequency=1.0, low=10e-6, high=60e-6, duration=2.0)


def tracked() -> pt.control.Tracking:
    return pt.track(PLAYS, LOOP, SINE)


def traced() -> pt.control.Contour:
    path = pt.circle(frequency=1.0, radius=10e-6, centre=(35e-6, 35e-6), duration=2.0)
    return pt.contour(pt.XYStage(x=PLAYS, y=PLAYS), (LOOP, LOOP), path)


def plain(document: Any) -> Any:
    """Content of a document as a file has it."""
    return json.loads(json.dumps(document, allow_nan=False))


@pytest.mark.parametrize("kind", [tracked, traced])
def test_a_run_is_written_as_samples_metrics_and_picture(kind: Any, tmp_path: Path) -> None:
    run = kind()
    files = run.save(tmp_path / "new", entries={"notes": ["a note"]})
    assert [file.suffix for file in files] == [".csv", ".json", ".png", ".svg"]
    assert len({file.stem for file in files}) == 1
    assert json.loads(files[1].read_text()) == plain({**run.document(), "notes": ["a note"]})
    written = np.genfromtxt(files[0], delimiter=",", names=True)
    assert written.dtype.names == tuple(run.table)
    for name, column in run.table.items():
        np.testing.assert_allclose(written[name], column, rtol=1e-9, atol=1e-12)


def test_the_metrics_of_a_document_are_those_of_the_run() -> None:
    run = tracked()
    document = plain(run.document())
    assert document["metrics"]["rms_error"] == run.metrics.rms_error
    assert [period["max_error"] for period in document["periods"]] == [
        period.max_error for period in run.periods
    ]
    contour = traced()
    document = plain(contour.document())
    assert document["contour"]["sd_error"] == contour.metrics.sd_error
    assert document["contour_true"]["sd_error"] == contour.score(true=True).sd_error


def test_a_learning_is_a_document_of_its_trials() -> None:
    reference = pt.triangle(frequency=10.0, low=10e-6, high=50e-6, duration=0.5)
    loop = pt.Controller(dt=1e-3, limits=(0.0, 75.0), feedforward=PLAYS.inverse())
    stage = pt.VirtualStage.of(PLAYS, noise=5e-9, mode=(160.0, 0.065))
    learning = pt.learn(stage, reference, loop, model=stage, mode_scales=1.0, trials=3)
    document = plain(learning.document())
    assert [trial["rms_error"] for trial in document["trials"]] == list(learning.errors)
    assert document["best"] == learning.best == int(np.argmin(learning.errors))
    assert document["convergence"]["factor"] == learning.convergence.factor < 1.0


def test_a_report_has_its_margins_as_numbers_for_the_file_of_its_controller() -> None:
    loop = pt.Controller(dt=0.02, limits=(0.0, 75.0), feedback=pt.Pid.xu_li_2010())
    report = pt.check_loop(pt.VirtualStage.xu_li_2010(), loop)
    design = plain(report.design())
    assert 10.0 ** (design["middle"]["gain_margin_dB"] / 20.0) == pytest.approx(
        report.middle.gain_margin
    )
    assert plain(loop.document(report=report))["provenance"]["design"] == design
    assert plain(loop.document())["provenance"]["design"] is None


QUICK = pt.TuningSearch(particles=12, iterations=6)


def test_tuned_controllers_are_written_with_their_margins(tmp_path: Path) -> None:
    path = pt.circle(frequency=0.5, radius=10e-6)
    xy = pt.XYStage.xu_li_2010(seed=1)
    of_loop: Any = {"dt": 0.02, "limits": (0.0, 75.0)}
    tuned = pt.tune(xy, path, parts="pid", search=QUICK, feedforward=(None, None), **of_loop)
    names = [file.name for file in tuned.save(tmp_path)]
    assert names[:3] == ["tuning.json", "controller_x.json", "controller_y.json"]
    assert names[3:] == ["tuned.png", "tuned.svg"]
    for name, axis in zip(names[1:3], tuned.controllers, strict=True):
        again = pt.load_controller(tmp_path / name)
        assert again == axis
        assert again.provenance is not None
        assert again.provenance["design"] == plain(tuned.design())
    document = plain(tuned.document())
    assert [one["feedback"]["kp"] for one in document["axes"]] == [
        one.feedback._pid.kp for one in tuned.controllers if one.feedback
    ]
    other = replace(tuned.controller, dt=0.01)
    with pytest.raises(pt.ParameterError, match="of another controller"):
        other.document(report=tuned)
    (ax,) = tuned.plot(fig=Figure()).axes
    (line,) = ax.lines
    figures = np.asarray(line.get_ydata(), float)
    assert figures[-1] == 1e6 * tuned.history[-1] < figures[0]


def test_a_tuning_without_references_is_drawn_in_the_unit_of_its_value() -> None:
    tuned = pt.tune(PLAYS, dt=1e-3, limits=(0.0, 75.0), parts="pid", search=QUICK)
    (ax,) = tuned.plot(fig=Figure()).axes
    assert "m s/V" in ax.get_ylabel()
    assert np.asarray(ax.lines[0].get_ydata(), float)[-1] == pytest.approx(tuned.value, rel=1e-12)


def test_a_schedule_is_its_grid(tmp_path: Path) -> None:
    grid: tuple[Any, Any] = ([5e-6, 20e-6], [0.5, 1.0, 2.0])
    options: Any = {"dt": 0.01, "limits": (0.0, 75.0), "parts": "pid", "search": QUICK}
    schedule = pt.schedule(PLAYS, *grid, centre=40e-6, **options)
    table = schedule.table
    law: Any = schedule.controller.feedback
    assert table["kp_V_per_m"].tolist() == [one.kp for one in law.gains]
    places = zip(table["amplitude_m"], table["rate_Hz"], strict=True)
    assert list(places) == [(amplitude, rate) for amplitude in grid[0] for rate in grid[1]]
    assert schedule.errors[1, 2, 1] == table["scheduled_rms_m"][5]
    assert schedule.to_frame()["ti_s"].tolist() == [one.ti for one in law.gains]
    files = {file.name: file for file in schedule.save(tmp_path)}
    assert set(files) == {"schedule.csv", "schedule.json", "schedule.png", "schedule.svg"}
    assert json.loads(files["schedule.json"].read_text()) == plain(schedule.document())
    (ax,) = schedule.plot(fig=Figure()).axes
    drawn = np.array([line.get_ydata() for line in ax.lines], float)
    np.testing.assert_allclose(drawn, 1e6 * np.moveaxis(schedule.errors, 2, 1).reshape(4, 3))


def test_panels_are_drawn_in_the_axes_given() -> None:
    figure = Figure()
    for run, names in (
        (tracked(), ("motion", "error", "following", "effort")),
        (traced(), ("path", "magnified", "contour_error")),
    ):
        for name, ax in zip(names, np.ravel(figure.subplots(2, 2)), strict=False):
            assert getattr(run, f"plot_{name}")(ax=ax) is ax
            assert ax.lines
