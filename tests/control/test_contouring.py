"""Two axes: paths, contour errors, cross-talk, and the circles of Table 2."""

from __future__ import annotations

import dataclasses
import math
from functools import cache
from typing import TYPE_CHECKING, Any

import matplotlib.pyplot as plt
import numpy as np
import pytest

import piezotrack as pt
from loops import DT, PID, fitted, loop
from piezotrack.xu_li_2010.experiments.table_2 import PUBLISHED
from virtual import changed

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

UM = 1e-6
ALONG_X = pt.VirtualStage.xu_li_2010(seed=1)
STAGE = pt.XYStage.xu_li_2010(seed=1)
QUIET: dict[str, Any] = {"noise": 0.0, "resolution": 0.0}
TABLE_1 = pt.DahlStage.xu_li_2010()


def both(**parts: Any) -> tuple[pt.Controller, pt.Controller]:
    one = loop(**parts)
    return one, one


def led() -> tuple[pt.Controller, pt.Controller]:
    """Feedforward by the model of x, and PID, on both axes."""
    return both(feedforward=fitted().inverse(), feedback=PID)


@cache
def table() -> pt.xu_li_2010.Table2:
    return pt.xu_li_2010.run_table_2(STAGE, led())


# Paths.

PATHS: dict[str, Callable[[], pt.XYReference]] = {
    "circle": lambda: pt.circle(frequency=0.5, radius=20 * UM, phase=1.0),
    "lissajous": lambda: pt.lissajous(frequencies=(0.4, 0.6), sizes=(20 * UM, 10 * UM)),
    "raster": lambda: pt.raster(line_rate=1.0, sizes=(30 * UM, 20 * UM), lines=5),
    "spiral": lambda: pt.spiral(frequency=0.5, radius=20 * UM, pitch=4 * UM),
}


@pytest.mark.parametrize("name", PATHS)
def test_velocity_and_acceleration_are_those_of_the_path(name: str) -> None:
    path, h = PATHS[name](), 1e-5
    t = np.linspace(2 * h, path.duration - 2 * h, 4001)
    for axis in path.axes:
        (before, v0, _), (_, v, a), (after, v1, _) = (axis.at(t + s) for s in (-h, 0.0, h))
        assert np.allclose((after - before) / (2 * h), v, rtol=0, atol=1e-5 * np.abs(v).max())
        assert np.allclose((v1 - v0) / (2 * h), a, rtol=0, atol=1e-3 * np.abs(a).max())


@pytest.mark.parametrize("name", PATHS)
def test_a_path_leaves_home_from_rest_and_stays_in_its_range(name: str) -> None:
    path = PATHS[name]()
    for axis in path.axes:
        x, v, a = axis.at(0.0)
        assert x == 0.0
        assert v == 0.0
        assert abs(a) < 1e-12
        x = axis.at(np.linspace(axis.ramp, path.duration, 5001))[0]
        assert axis.low - 1e-12 <= x.min()
        assert x.max() <= axis.high + 1e-12
        assert np.ptp(x) > 0.99 * (axis.high - axis.low)
        if path.period is not None:
            late = axis.at([axis.ramp, axis.ramp + path.period])[0]
            assert late[0] == pytest.approx(late[1], abs=1e-15)


def test_a_raster_traces_its_lines_at_one_speed() -> None:
    scan = pt.raster(line_rate=2.0, sizes=(30 * UM, 20 * UM), lines=5, centre=(50 * UM, 40 * UM),
                     flyback=0.4, duration=9.0)  # fmt: skip
    assert scan.period == pytest.approx(3.0)
    for line in range(5):
        # The second frame, without the start.
        t = 3.0 + 0.5 * line + np.linspace(0.0, 0.3, 50)
        (x, v, a), (y, vy, _) = scan.x.at(t), scan.y.at(t)
        assert np.allclose(x, 35 * UM + 100 * UM * (t - t[0]), atol=1e-15)
        assert np.allclose(v, 100 * UM)
        assert np.allclose(a, 0.0)
        assert np.allclose(y, 30 * UM + 5 * UM * line, atol=1e-15)
        assert np.allclose(vy, 0.0)


def test_a_spiral_winds_by_its_pitch() -> None:
    path = pt.spiral(frequency=0.5, radius=20 * UM, pitch=4 * UM, centre=(30 * UM, 40 * UM))
    (x, _, _), (y, _, _) = path.x.at([4.0, 6.0, 10.0]), path.y.at([4.0, 6.0, 10.0])
    assert np.allclose(np.hypot(x - 30 * UM, y - 40 * UM), [8 * UM, 12 * UM, 20 * UM])


def test_a_path_is_read_from_two_columns(tmp_path: Path) -> None:
    file = tmp_path / "eight.csv"
    t = np.arange(500) / 100.0
    x, y = 50 + 10 * np.sin(0.4 * np.pi * t), 40 + 5 * np.sin(0.8 * np.pi * t)
    rows = "\n".join(f"{a:.9f},{b:.9f},{c:.9f}" for a, b, c in zip(t, x, 1e3 * y, strict=True))
    file.write_text("time_s,x_um,y_nm\n" + rows + "\n", encoding="utf-8")
    path = pt.references.read_path(file, period=5.0, duration=15.0, ramp=1.0, origin=(0.0, 0.0))
    assert path.period == 5.0
    assert path.x.at(6.25)[0] == pytest.approx(60 * UM, abs=1e-12)
    assert path.y.at(0.625 + 5.0)[0] == pytest.approx(45 * UM, abs=1e-12)
    assert path.x.at(0.0)[0] == 0.0
    with pytest.raises(pt.ParameterError, match="'z' is not a column"):
        pt.references.read_path(file, y="z")
    assert pt.references.parse_path(str(file)).duration == pytest.approx(5.0)
    # One that repeats begins at home, one that does not where it begins.
    starts = [pt.references.read_path(file, period=period).x.at(0.0)[0] for period in (5.0, None)]
    assert starts == pytest.approx([0.0, 50 * UM])


def test_texts_make_the_paths_that_python_makes() -> None:
    for text, made in (
        ("circle:0.5Hz,20um,phase=1rad", PATHS["circle"]()),
        ("lissajous:0.4/0.6Hz,20/10um", PATHS["lissajous"]()),
        ("raster:1Hz,30/20um,lines=5", PATHS["raster"]()),
        ("spiral:500mHz,20um,pitch=4um", PATHS["spiral"]()),
    ):
        found, t = pt.references.parse_path(text), np.linspace(0.0, made.duration, 300)
        assert repr(found) == repr(made)
        for one, other in zip(found.axes, made.axes, strict=True):
            assert np.allclose(one.at(t)[0], other.at(t)[0], rtol=0, atol=1e-15)


# Contour errors.


def test_the_contour_error_of_a_general_path_is_the_distance_from_it() -> None:
    # SciPy's nearest point on the curve itself, and not on chords of it.
    from scipy.optimize import minimize_scalar

    path = PATHS["lissajous"]()
    random = np.random.default_rng(1)
    t = random.uniform(0.0, 5.0, 40)
    x, y = (axis.motion(t)[0] + random.normal(0.0, 0.3 * UM, 40) for axis in path.axes)
    errors = path.errors(x, y)
    assert path.radius is None

    def distance(s: float, k: int) -> float:
        here = [axis.motion(np.array([s]))[0][0] for axis in path.axes]
        return math.hypot(x[k] - here[0], y[k] - here[1])

    for k in range(40):
        grid = np.linspace(0.0, 5.0, 4001)
        coarse = np.hypot(path.x.motion(grid)[0] - x[k], path.y.motion(grid)[0] - y[k])
        near = grid[coarse.argmin()]
        best = minimize_scalar(
            distance,
            bounds=(near - 2e-3, near + 2e-3),
            args=(k,),
            method="bounded",
            options={"xatol": 1e-12},
        )
        assert abs(errors[k]) == pytest.approx(best.fun, abs=2e-10)


def test_left_of_the_direction_is_positive() -> None:
    path = pt.spiral(frequency=1.0, radius=20 * UM, pitch=5 * UM, centre=(0.0, 0.0))
    (x, vx, _), (y, vy, _) = (axis.motion(np.linspace(1.0, 3.0, 30)) for axis in path.axes)
    speed = np.hypot(vx, vy)
    for off in (0.5 * UM, -0.5 * UM):
        found = path.errors(x - off * vy / speed, y + off * vx / speed)
        assert np.allclose(found, off, atol=1e-9)


# The stage.


def test_axes_alone_have_the_bits_of_track() -> None:
    stage = pt.XYStage(x=STAGE.x, y=TABLE_1)
    path = pt.circle(frequency=0.5, radius=10 * UM, duration=4.0)
    run = pt.contour(stage, led(), path)
    for axis, alone in zip((run.x, run.y), (stage.x, stage.y), strict=True):
        other = pt.track(alone, led()[0], axis.reference)
        for name in ("measured", "displacement", "voltage", "fine_voltage", "feedback"):
            assert np.array_equal(getattr(axis, name), getattr(other, name)), name


def test_the_same_seed_gives_the_same_bits() -> None:
    path = pt.circle(frequency=0.5, radius=10 * UM)
    first, other = (pt.contour(pt.XYStage.xu_li_2010(seed=4), led(), path) for _ in range(2))
    assert np.array_equal(first.y.measured, other.y.measured)
    third = pt.contour(pt.XYStage.xu_li_2010(seed=5), led(), path)
    assert not np.array_equal(first.y.measured, third.y.measured)


def test_the_lag_moves_y_and_leaves_x() -> None:
    """A lag of whole intervals: y makes the same motion, so much later."""
    path = pt.circle(frequency=0.5, radius=10 * UM)
    stage = pt.XYStage(x=TABLE_1, y=TABLE_1)
    late = dataclasses.replace(stage, lag=3 * DT)
    even, other = (pt.contour(each, led(), path) for each in (stage, late))
    assert np.array_equal(even.x.measured, other.x.measured)
    assert np.allclose(even.y.measured[:-3], other.y.measured[3:], rtol=0, atol=1e-13)
    # Its controller saw nothing of that.
    assert np.allclose(even.y.loop_error[:-3], other.y.loop_error[3:], rtol=0, atol=1e-13)
    assert not np.allclose(even.y.error[:-3], other.y.error[3:], rtol=0, atol=1e-7)
    # R sin(b) / sqrt 8 on top of what the two had before.
    angle = math.tau * 0.5 * 3 * DT
    assert other.metrics.sd_error == pytest.approx(10 * UM * math.sin(angle) / 8**0.5, rel=0.1)


def test_missed_ticks_move_y_by_whole_samples_and_leave_x() -> None:
    path = pt.circle(frequency=0.5, radius=10 * UM, duration=12.0)
    stage = pt.XYStage(x=TABLE_1, y=TABLE_1)
    late = dataclasses.replace(stage, missed_ticks=0.2, most_behind=3)
    even, other = (pt.contour(each, led(), path) for each in (stage, late))
    assert np.array_equal(even.x.measured, other.x.measured)
    # What its controller followed is the path, 0 to 3 samples before.
    followed = other.y.loop_error + other.y.measured
    whole = np.arange(followed.size)
    off = [np.abs(followed - other.y.desired[np.maximum(whole - n, 0)]) for n in range(4)]
    assert np.min(off, axis=0).max() < 1e-13
    behind = np.argmin(off, axis=0)[100:]
    assert set(behind) == {0, 1, 2, 3}
    assert other.metrics.sd_error > 2 * even.metrics.sd_error
    # No chance, or no sample to fall behind by: the same bits.
    for chance, most in ((0.0, 3), (0.2, 0)):
        same = dataclasses.replace(stage, missed_ticks=chance, most_behind=most)
        assert np.array_equal(pt.contour(same, led(), path).y.measured, even.y.measured)


def test_the_mean_error_of_a_viscous_stage_under_pid_is_as_computed() -> None:
    """With an integrator on a lag D/K, |T| = 1 + w^2 tau (D/K - tau/2), tau = Ti / (Kp G).

    K is that for small motions: the hysteresis adds to the spring.
    """
    stage = pt.XYStage(x=TABLE_1, y=TABLE_1)
    for frequency in (0.2, 0.5):
        run = pt.contour(stage, both(feedback=PID), pt.circle(frequency=frequency, radius=10 * UM))
        w = math.tau * frequency
        # Gain for small motions about the middle of the stroke.
        gain = float(np.ptp(run.x.displacement[-100:]) / np.ptp(run.x.voltage[-100:]))
        tau = 0.009 / (0.120 / UM * gain)
        stiffness = TABLE_1.piezo_coefficient / gain
        expected = -10 * UM * w**2 * tau * (TABLE_1.damping / stiffness - 0.5 * tau)
        assert run.metrics.mean_error == pytest.approx(expected, rel=0.15)


def test_record_gives_a_dataset_for_each_axis() -> None:
    u = np.linspace(0.0, 75.0, 200)
    stage = dataclasses.replace(STAGE, x=changed(ALONG_X, **QUIET))
    x, y = stage.record(u, np.zeros(200), 1e-3)
    assert isinstance(x, pt.Dataset)
    assert np.array_equal(x.u, u)
    # The published bound on the cross-talk, and the chosen share.
    assert y.y[-1] == pytest.approx(0.010 * x.y[-1], abs=0.5 * UM)
    motion, _ = stage.simulate(u, np.zeros(200), 1e-3)
    assert np.allclose(motion.x, motion.y, rtol=0, atol=1e-15)
    assert stage.matrix.tolist() == [[1.0, 0.015], [0.010, 1.0]]


# Cross-talk.


def logs(stage: pt.XYStage) -> tuple[Any, Any]:
    t = np.arange(8000) / 1000.0
    u, held = 37.5 * (1.0 - np.cos(2.0 * np.pi * 0.25 * t)), np.zeros(t.size)
    return stage.record(u, held, 1e-3), stage.record(held, u, 1e-3)


def test_cross_talk_is_found_and_decoupled() -> None:
    true = (0.10, -0.08)
    stage = dataclasses.replace(STAGE, cross_talk=true, lag=0.0)
    cross_talk = pt.identification.identify_cross_talk(*logs(stage))
    assert np.diag(cross_talk.matrix).tolist() == [1.0, 1.0]
    for place, share in (((0, 1), true[0]), ((1, 0), true[1])):
        assert 0.0 < cross_talk.sd[place] < 1e-3
        assert abs(cross_talk.matrix[place] - share) < max(4.0 * cross_talk.sd[place], 2e-4)
    assert "of y in x" in str(cross_talk)
    # With an inverse that is exact there is nothing left but what decoupling removes.
    exact = pt.XYStage(x=TABLE_1, y=TABLE_1, cross_talk=true)
    forward = both(feedforward=TABLE_1.inverse(), limits=(-50.0, 150.0))
    path = pt.circle(frequency=0.1, radius=40 * UM)
    as_is, decoupled = (
        pt.contour(exact, forward, path, decoupling=matrix).score(true=True)
        for matrix in (None, cross_talk.matrix)
    )
    assert as_is.peak_to_peak > 3 * UM
    assert decoupled.peak_to_peak < 0.3 * as_is.peak_to_peak
    # On the virtual stage, whose inverse is not exact, feedforward alone gains as well.
    alone = both(feedforward=fitted().inverse())
    as_is, decoupled = (
        pt.contour(stage, alone, path, decoupling=matrix).metrics
        for matrix in (None, cross_talk.matrix)
    )
    assert decoupled.mean_error**2 < as_is.mean_error**2 or decoupled.rms_error < as_is.rms_error


# Table 2.


def test_the_numbers_are_those_of_the_paper() -> None:
    assert len(PUBLISHED) == 9
    assert [round(1e6 * case.sd, 3) for case in PUBLISHED] == [
        0.184, 0.311, 0.485, 0.300, 0.480, 0.831, 0.472, 0.853, 1.518
    ]  # fmt: skip


def test_the_nine_circles_are_near_the_published_ones() -> None:
    """No circle is worse than published by half, and the order is the paper's.

    What the paper's stage adds at higher frequencies is not on this stage: docs/evidence.md.
    """
    for case, run in zip(PUBLISHED, table().runs, strict=True):
        assert run.path.period == pytest.approx(1.0 / case.frequency)
        assert 0.3 * case.peak_to_peak < run.metrics.peak_to_peak < 1.5 * case.peak_to_peak
        assert 0.3 * case.sd < run.metrics.sd_error < 1.5 * case.sd
        assert not run.x.saturated.any()
    # Fig. 15: 10 um at 0.1 Hz, 0.96 um peak to peak and 0.44 um at most on each axis.
    slow = table().runs[0]
    assert slow.metrics.peak_to_peak == pytest.approx(0.96 * UM, rel=0.25)
    assert slow.metrics.sd_error == pytest.approx(0.184 * UM, rel=0.25)
    for axis in (slow.x, slow.y):
        assert axis.metrics.max_error < 0.66 * UM
    for row in range(3):
        assert table().runs[3 * row].metrics.sd_error < table().runs[3 * row + 2].metrics.sd_error


def test_a_lag_of_40_ms_gives_the_published_deviations() -> None:
    late = dataclasses.replace(STAGE, lag=0.040)
    for case, run in zip(PUBLISHED, pt.xu_li_2010.run_table_2(late, led()).runs, strict=True):
        assert run.metrics.sd_error == pytest.approx(case.sd, rel=0.3)


# Words and pictures.


@pytest.mark.parametrize("name", PATHS)
def test_every_path_has_figures_words_and_a_picture(name: str) -> None:
    run = pt.contour(STAGE, led(), PATHS[name]())
    assert repr(run).startswith("<Contour of XYReference(")
    assert "true, between the samples too" in run.summary()
    figure = run.plot()
    figure.canvas.draw()
    assert len(figure.axes) == 5
    for ax in figure.axes:
        assert ax.get_ylabel().endswith("[\N{MICRO SIGN}m]")
        low, high = ax.get_ylim()
        y = np.concatenate([np.asarray(line.get_ydata(), dtype=float) for line in ax.lines])
        assert np.isfinite(y).all()
        assert np.ptp(y[(y >= low) & (y <= high)]) > 0.2 * (high - low)
    plt.close(figure)


def test_the_table_has_words_and_a_picture() -> None:
    rows = str(table()).splitlines()
    assert len(rows) == 11
    assert rows[2].split()[:2] == ["10", "0.1"]
    assert "0.957 /" in rows[2]
    figure = table().plot()
    figure.canvas.draw()
    assert [ax.get_ylabel() for ax in figure.axes[2:]] == [
        "peak to peak [\N{MICRO SIGN}m]",
        "mean [\N{MICRO SIGN}m]",
        "SD [\N{MICRO SIGN}m]",
    ]
    plt.close(figure)


# Refusals.

PATH = pt.circle(frequency=0.5, radius=10 * UM)
# Errors about the content of a record; all others are about an argument.
KINDS = {"driven": pt.DataError, "still": pt.DataError, "short": pt.ShapeError}
BAD: dict[str, tuple[Callable[[], object], str]] = {
    "stage": (lambda: pt.contour(STAGE.x, led(), PATH), "stage"),
    "path": (lambda: pt.contour(STAGE, led(), PATH.x), "path"),  # type: ignore[arg-type]
    "one": (lambda: pt.contour(STAGE, led()[:1], PATH), "controllers"),
    "bare": (lambda: pt.contour(STAGE, led()[0], PATH), "controllers"),  # type: ignore[arg-type]
    "dt": (lambda: pt.contour(STAGE, (loop(), loop(dt=0.01)), PATH), "dt of y"),
    "matrix": (lambda: pt.contour(STAGE, led(), PATH, decoupling=[1, 2]), "decoupling"),
    "singular": (
        lambda: pt.contour(STAGE, led(), PATH, decoupling=np.ones((2, 2))),
        "decoupling",
    ),
    "unstable": (
        lambda: pt.contour(STAGE, both(feedback=pt.Pid.from_um(kp=0.5, ti=0.009, td=0.044)), PATH),
        "x: the loop",
    ),
    "axis": (lambda: pt.XYStage(x=STAGE.x, y=3), "y"),
    "shares": (lambda: pt.XYStage(x=TABLE_1, y=TABLE_1, cross_talk=(0.1,)), "cross_talk"),  # type: ignore[arg-type]
    "diagonal": (
        lambda: pt.XYStage(x=TABLE_1, y=TABLE_1, cross_talk=[[2, 0], [0, 1]]),  # type: ignore[arg-type]
        "cross_talk",
    ),
    "same": (lambda: pt.XYStage(x=TABLE_1, y=TABLE_1, cross_talk=(1.0, 1.0)), "cross_talk"),
    "lag": (lambda: pt.XYStage(x=TABLE_1, y=TABLE_1, lag=-1.0), "lag"),
    "ticks": (lambda: pt.XYStage(x=TABLE_1, y=TABLE_1, missed_ticks=1.5), "missed_ticks"),
    "behind": (lambda: pt.XYStage(x=TABLE_1, y=TABLE_1, most_behind=-1), "most_behind"),
    "radius": (lambda: pt.circle(frequency=0.1, radius=10.0), "radius"),
    "pair": (lambda: pt.circle(frequency=0.1, radius=UM, centre=3.0), "centre"),  # type: ignore[arg-type]
    "lines": (lambda: pt.raster(line_rate=1.0, sizes=(UM, UM), lines=1), "lines"),
    "flyback": (
        lambda: pt.raster(line_rate=1.0, sizes=(UM, UM), lines=3, flyback=0.0),
        "flyback",
    ),
    "pitch": (lambda: pt.spiral(frequency=1.0, radius=UM, pitch=2 * UM), "pitch"),
    "turns": (lambda: pt.spiral(frequency=0.5, radius=20 * UM, pitch=1e-12), "pitch"),
    "common": (
        lambda: pt.lissajous(frequencies=(1.0, 2**0.5), sizes=(UM, UM)),
        "frequencies",
    ),
    "text": (
        lambda: pt.references.parse_path("circle:0.1Hz"),
        "path 'circle:0.1Hz'",
    ),
    "long": (
        lambda: pt.references.parse_path("spiral:1Hz,20um,pitch=2um", duration=5.0),
        "duration",
    ),
    "kind": (lambda: pt.references.parse_path("square:1Hz"), "path 'square:1Hz'"),
    "halves": (
        lambda: pt.XYReference(name="two", x=PATH.x, y=pt.circle(frequency=0.1, radius=UM).y),
        "duration of y",
    ),
    "driven": (
        lambda: pt.identification.identify_cross_talk(*logs(STAGE)[::-1]),
        "x_driven",
    ),
    "log": (lambda: pt.identification.identify_cross_talk(STAGE, STAGE), "x_driven"),  # type: ignore[arg-type]
    "still": (
        lambda: pt.identification.identify_noise(
            pt.Dataset(u=np.zeros(200), y=np.zeros(200), dt=1e-3)
        ),
        "all 200 samples",
    ),
    "short": (
        lambda: pt.identification.identify_noise(
            pt.Dataset(u=np.zeros(9), y=np.arange(9.0), dt=1e-3)
        ),
        "record",
    ),
    "noise": (lambda: pt.identification.identify_noise(np.zeros(9)), "log"),  # type: ignore[arg-type]
}


@pytest.mark.parametrize("name", BAD)
def test_refuses(name: str) -> None:
    call, message = BAD[name]
    kind = KINDS.get(name, pt.ParameterError)
    with pytest.raises(kind, match=rf"^{message}(?!\w)"):
        call()


def test_a_refusal_of_one_axis_names_it() -> None:
    far = pt.circle(frequency=0.1, radius=70 * UM)
    with pytest.raises(pt.ParameterError, match=r"^x: reference is .* beyond_reach=True$"):
        pt.contour(STAGE, led(), far)


def test_the_way_home_is_not_scored() -> None:
    """On a repeated path of one period only what comes after the smooth start counts."""
    circle = pt.circle(frequency=0.2, radius=20e-6, duration=3.5)
    stage = pt.XYStage.xu_li_2010(seed=1)
    loop = pt.Controller(dt=0.02, limits=(0.0, 75.0), feedback=pt.Pid.xu_li_2010())
    run = pt.contour(stage, (loop, loop), circle)
    assert run.settled == pytest.approx(2.0)
    assert run.metrics.peak_to_peak < 5e-6
