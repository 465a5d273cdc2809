"""Gains of both axes of an XY stage by the contour error."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import piezotrack as pt
from piezotrack import _core
from piezotrack.control.tuning.model_set.motions import tasks_of
from piezotrack.control.tuning.problem import TuningProblem

LIMITS = (0.0, 75.0)
LOOP: dict[str, Any] = {"limits": LIMITS, "dt": 0.02}
QUICK = {**LOOP, "search": pt.TuningSearch(particles=24, iterations=25)}


def published(dt: float = 0.02) -> pt.Controller:
    return pt.Controller(dt=dt, limits=LIMITS, feedback=pt.Pid.xu_li_2010())


TIMING = pt.Timing(delay=1e-3)


def problem(stage: pt.XYStage, path: pt.XYReference) -> TuningProblem:
    options: dict[str, Any] = dict.fromkeys(("feedforward", "parts", "margins", "search"))
    return TuningProblem.checked(
        stage=stage, reference=path, law="pid", filters=(), threads=0, timing=TIMING,
        goal=pt.Goal(largest_saturation=1.0), spread=pt.Spread(offset=0.0), **LOOP, **options,
    )  # fmt: skip


@pytest.mark.parametrize("lag", [0.0, 0.013, 0.06])
@pytest.mark.parametrize("shape", ["circle", "lissajous"])
def test_the_contour_error_of_the_search_is_that_of_a_full_simulation(
    lag: float, shape: str
) -> None:
    stage = replace(pt.XYStage.xu_li_2010(seed=1), lag=lag)
    if shape == "circle":
        path = pt.circle(frequency=0.5, radius=20e-6)
    else:
        path = pt.references.lissajous(
            frequencies=(0.4, 0.2), sizes=(15e-6, 20e-6), centre=(50e-6, 50e-6)
        )
    loops = published(), replace(published(), feedback=pt.Pid(kp=0.08e6, ti=0.01, td=0.02))
    ((task,),) = tasks_of(problem(stage, path), loops, repeats=False)
    assert isinstance(task, _core.PathTask)
    ((rms, largest, *_),) = task.figures([(loops[0]._core, loops[1]._core)], 1)
    full = pt.contour(stage, loops, path, timing=TIMING).metrics
    # Noise is read at other instants where the lag is no whole number of intervals.
    assert rms == pytest.approx(full.rms_error, rel=0.03)
    assert largest == pytest.approx(full.max_error, rel=0.15)


def test_two_controllers_beat_the_published_gains_where_one_axis_comes_late() -> None:
    # 10 ms between the axes: no gains of one axis by itself mend that, those of both do.
    path = pt.circle(frequency=0.5, radius=20e-6)
    tuned = pt.tune(pt.XYStage.xu_li_2010(seed=1), path, parts="pid", **QUICK)
    x, y = tuned.controllers
    alone = tuple(
        pt.tune(axis, reference, parts="pid", **QUICK).controller
        for axis, reference in zip(
            (pt.VirtualStage.xu_li_2010(seed=1), pt.XYStage.xu_li_2010(seed=1).y),
            path.axes,
            strict=True,
        )
    )
    other = pt.XYStage.xu_li_2010(seed=5)
    before = pt.contour(other, (published(), published()), path).metrics
    apart = pt.contour(other, alone, path).metrics
    after = pt.contour(other, (x, y), path).metrics
    assert after.rms_error < 0.8 * before.rms_error
    assert after.rms_error < 0.95 * apart.rms_error
    assert tuned.minimised == "rms contour error"
    # The gains are the best for one draw of the noise; the full simulation reads another.
    assert tuned.value == pytest.approx(tuned.runs[0].metrics.rms_error, rel=0.15)
    for axis, loop in ((other.x, x), (other.y, y)):
        assert pt.check_loop(axis, loop).high.sensitivity <= 2.0 * 1.01
    assert any(name.startswith("y, ") for name in tuned.plants)
    assert "contour error" in str(tuned)


def test_each_axis_gets_the_feedforward_of_its_own() -> None:
    stage = pt.XYStage.xu_li_2010(seed=1)
    inverse = pt.DahlStage.xu_li_2010().inverse()
    path = pt.circle(frequency=0.5, radius=10e-6)
    x, y = pt.tune(stage, path, feedforward=(inverse, None), parts="pid", **QUICK).controllers
    assert x.feedforward is inverse
    assert y.feedforward is None


def test_a_path_is_needed_and_no_reference_of_one_axis() -> None:
    stage = pt.XYStage.xu_li_2010()
    sine: Any = pt.sine(frequency=0.2, low=0.0, high=50e-6, duration=5.0)
    with pytest.raises(
        pt.ParameterError, match=r"reference is Reference.*: expected pt\.XYReference"
    ):
        pt.tune(stage, sine, **QUICK)
    nothing: Any = None
    with pytest.raises(pt.ParameterError, match="reference is missing: expected a path"):
        pt.tune(stage, nothing, **QUICK)
    with pytest.raises(pt.ParameterError, match="feedforward has 3 entries: expected that of x"):
        pt.tune(stage, pt.circle(frequency=0.5, radius=1e-6), feedforward=(None,) * 3, **QUICK)


def test_a_path_beyond_reach_names_the_axis() -> None:
    path = pt.circle(frequency=0.5, radius=20e-6, centre=(50e-6, 150e-6))
    with pytest.raises(pt.ParameterError, match=r"y: .*largest_saturation=0.5 or more"):
        pt.tune(pt.XYStage.xu_li_2010(), path, **QUICK)


def test_the_same_bits_for_any_number_of_threads() -> None:
    path = pt.circle(frequency=0.5, radius=10e-6, duration=6.0)
    options: dict[str, Any] = {
        **LOOP,
        "parts": "pid",
        "search": pt.TuningSearch(particles=12, iterations=4),
    }
    single, three = (
        pt.tune(pt.XYStage.xu_li_2010(seed=1), path, threads=threads, **options)
        for threads in (1, 3)
    )
    assert single.controllers == three.controllers
    assert np.array_equal(single.history, three.history)


def test_scheduled_gains_of_both_axes_follow_the_contour() -> None:
    stage, grid = pt.XYStage.xu_li_2010(seed=1), ([10e-6, 40e-6], [0.5])
    schedule = pt.schedule(
        stage, *grid, **LOOP, search=pt.TuningSearch(particles=16, iterations=12)
    )
    assert len(schedule.controllers) == 2
    assert schedule.errors.shape == (2, 1, 2)
    assert (schedule.errors[..., 1] <= schedule.errors[..., 0]).all()
    for radius, (fixed, after) in zip(grid[0], schedule.errors[:, 0], strict=True):
        path = pt.circle(frequency=0.5, radius=radius)
        pair = tuple(
            replace(one, feedback=replace(one.feedback, first=(radius, 0.5)))  # type: ignore[type-var]
            for one in schedule.controllers
        )
        run = pt.contour(stage, pair, path)
        assert run.metrics.rms_error == pytest.approx(after, rel=0.02)
        assert run.metrics.rms_error < 1.02 * fixed
    assert str(schedule).count("rms um: fixed, scheduled") == 2


def test_filters_of_each_axis() -> None:
    path = pt.circle(frequency=0.5, radius=10e-6)
    filters: Any = ([pt.LowPass(10.0)], [pt.LowPass(4.0)])
    options = {**LOOP, "search": pt.TuningSearch(particles=10, iterations=4)}
    tuned = pt.tune(pt.XYStage.xu_li_2010(), path, parts="pid", filters=filters, **options)
    x, y = tuned.controllers
    assert x.filters == (pt.LowPass(10.0),)
    assert y.filters == (pt.LowPass(4.0),)


def test_the_runs_of_the_report_begin_after_the_voltages_before() -> None:
    stage = pt.XYStage(x=pt.DahlStage.xu_li_2010(), y=pt.DahlStage.xu_li_2010())
    path = pt.circle(frequency=0.5, radius=10e-6, duration=4.0)
    timing = pt.Timing(voltages_before=(75.0, 30.0))
    search = pt.TuningSearch(particles=10, iterations=2)
    tuned = pt.tune(stage, path, parts="pid", timing=timing, search=search, **LOOP)
    (run,) = tuned.runs
    assert run.x.displacement[0] == pytest.approx(
        pt.DahlStage.xu_li_2010().equilibrium([75.0, 30.0]).x, rel=1e-9
    )
