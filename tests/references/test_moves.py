"""Moves: limits, the shortest time, and what is left of a mode's vibration."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.signal import lsim

import piezotrack as pt

WAY, INF = 20e-6, float("inf")
FREQUENCY, DAMPING = 160.0, 0.02


@pytest.mark.parametrize("way", [1e-6, 20e-6, -100e-6])
@pytest.mark.parametrize("speed", [INF, 1e-3, 20e-3])
@pytest.mark.parametrize("acceleration", [INF, 1.0, 30.0])
@pytest.mark.parametrize("jerk", [1e3, 1e5])
def test_limits_are_kept_and_the_derivatives_are_those_of_the_motion(
    way: float, speed: float, acceleration: float, jerk: float
) -> None:
    start = 50e-6
    move = pt.move(
        start=start, stop=start + way, dwell=0.01, speed=speed, acceleration=acceleration, jerk=jerk
    )
    t = np.linspace(0.0, move.duration, 40001)
    x, v, a = move.at(t)
    assert (x[0], x[-1]) == pytest.approx((start, start + way), abs=1e-15)
    step = t[1]
    assert np.abs(v).max() <= speed * (1.0 + 1e-9)
    assert np.abs(a).max() <= acceleration * (1.0 + 1e-9)
    assert np.abs(np.diff(a)).max() <= jerk * step * (1.0 + 1e-6)
    assert np.abs(np.diff(x) - 0.5 * step * (v[1:] + v[:-1])).max() < jerk * step**3
    assert np.abs(np.diff(v) - 0.5 * step * (a[1:] + a[:-1])).max() < 2.0 * jerk * step**2
    # One of the limits is active.
    used = (np.abs(v).max() / speed, np.abs(a).max() / acceleration, 1.0)
    assert max(used) == pytest.approx(1.0, rel=1e-3)


@pytest.mark.parametrize(
    ("speed", "acceleration", "jerk"), [(INF, INF, 1e5), (INF, 20.0, 1e5), (3e-3, 20.0, 1e5)]
)
def test_no_move_within_the_limits_is_shorter(
    speed: float, acceleration: float, jerk: float
) -> None:
    move = pt.move(
        start=0.0, stop=WAY, dwell=1.0, speed=speed, acceleration=acceleration, jerk=jerk
    )
    shortest = move.duration - 2.0

    def farthest(time: float) -> float:
        """Maximise the way from rest to rest in a time, over steps of constant jerk."""
        n = 160
        h = time / n
        # Scaled: jerk in units of its limit.
        lower = np.tril(np.ones((n, n)))
        a = h * lower
        before = a - h * np.eye(n)
        v = h * (np.cumsum(before, axis=0) + 0.5 * h * lower)
        v_before = np.vstack([np.zeros(n), v[:-1]])
        x = (v_before * h + before * h * h / 2.0 + np.eye(n) * h**3 / 6.0).sum(axis=0)
        rows, ends = [], []
        for matrix, limit in ((a, acceleration / jerk), (v, speed / jerk)):
            if np.isfinite(limit):
                rows += [matrix / limit, -matrix / limit]
                ends += [np.ones(2 * n)]
        found = linprog(
            -x / h**3,
            A_ub=np.vstack(rows) if rows else None,
            b_ub=np.concatenate(ends) if rows else None,
            A_eq=np.vstack([a[-1] / h, v[-1] / h**2]),
            b_eq=[0.0, 0.0],
            bounds=(-1.0, 1.0),
        )
        assert found.status == 0
        return float(-found.fun * h**3 * jerk)

    assert farthest(1.01 * shortest) > WAY
    assert farthest(0.98 * shortest) < WAY


def vibration(move: pt.Reference, frequency: float, damping: float) -> float:
    """Simulate a mode by scipy, and return its largest amplitude after the move, over the way."""
    w = 2.0 * np.pi * frequency
    t = np.linspace(0.0, move.duration, 200001)
    x, _, _ = move.at(t)
    _, y, _ = lsim(([w * w], [1.0, 2.0 * damping * w, w * w]), x, t, interp=False)
    end = np.searchsorted(t, move.duration - 0.05)
    after = y[end:] - x[-1]
    return float(np.abs(after).max() / abs(x[-1] - x[0]))


def shaped(shape: Any, **others: Any) -> pt.Reference:
    return pt.move(
        start=0.0, stop=WAY, dwell=0.06, shape=shape, **{"frequency": FREQUENCY, **others}
    )


@pytest.mark.parametrize("damping", [0.0, 0.02, 0.2])
def test_shapers_leave_no_vibration_of_their_mode(damping: float) -> None:
    for shape in ("zv", "zvd"):
        assert vibration(shaped(shape, damping=damping), FREQUENCY, damping) < 3e-3
    rounded = shaped("zv", damping=damping, rise=4e-3)
    assert vibration(rounded, FREQUENCY, damping) < 3e-3


def test_they_differ_in_what_another_frequency_leaves() -> None:
    off = 1.08 * FREQUENCY
    left = {shape: vibration(shaped(shape), off, 0.0) for shape in ("zv", "zvd", "ei")}
    # Of ZV |cos(pi/2 f/fn)|, of ZVD its square (Singer and Seering 1990).
    zv = abs(np.cos(0.5 * np.pi * 1.08))
    assert left["zv"] == pytest.approx(zv, abs=3e-3)
    assert left["zvd"] == pytest.approx(zv**2, abs=3e-3)
    # Extra-insensitive: at most 5 % from -20 to +20 %, and that at the frequency itself.
    over = [vibration(shaped("ei"), r * FREQUENCY, 0.0) for r in np.linspace(0.81, 1.19, 9)]
    assert max(over) < 0.053
    assert vibration(shaped("ei"), FREQUENCY, 0.0) == pytest.approx(0.05, abs=3e-3)


@pytest.mark.parametrize("damping", [0.05, 0.2])
def test_the_insensitive_one_is_so_with_damping_too(damping: float) -> None:
    # The envelope at the end of the move.
    worst = []
    for ratio in (0.85, 1.0, 1.15):
        move = shaped("ei", damping=damping)
        w = 2.0 * np.pi * ratio * FREQUENCY
        late = 0.06 - 0.05
        worst.append(vibration(move, ratio * FREQUENCY, damping) * np.exp(damping * w * late))
    assert max(worst) < 0.07


def test_on_a_loop_the_move_settles_as_its_reference() -> None:
    stage = pt.PrandtlIshlinskiiStage(
        linear=1e-6, thresholds=(), weights=(), frequency=FREQUENCY, damping_ratio=DAMPING
    )
    open_loop = pt.Controller(
        dt=2e-4,
        limits=(0.0, 75.0),
        feedforward=pt.PrandtlIshlinskiiStage(linear=1e-6, thresholds=(), weights=()).inverse(),
    )
    runs = {
        text: pt.track(stage, open_loop, text).settling()[0]
        for text in (
            "s-curve:10..30um,dwell=0.3s,rise=1ms",
            "zv:160Hz,10..30um,dwell=0.3s,damping=0.02,rise=1ms",
            "zvd:160Hz,10..30um,dwell=0.3s,damping=0.02,rise=1ms",
        )
    }
    rough, zv, zvd = runs.values()
    # ln(1/0.02)/(zeta w) of the mode, but for its phase.
    assert rough.time == pytest.approx(-np.log(0.02) / (DAMPING * 2.0 * np.pi * FREQUENCY), rel=0.1)
    assert rough.overshoot > 0.8
    assert zv.time == pytest.approx(1e-3 + 0.5 / FREQUENCY, abs=1e-3)
    assert zvd.time == pytest.approx(1e-3 + 1.0 / FREQUENCY, abs=1e-3)
    assert max(zv.overshoot, zvd.overshoot) < 0.02


def test_a_first_order_lag_settles_as_the_formula_says() -> None:
    stage = pt.PrandtlIshlinskiiStage(linear=1e-6, thresholds=(), weights=(), time_constant=5e-3)
    still = pt.PrandtlIshlinskiiStage(linear=1e-6, thresholds=(), weights=())
    loop = pt.Controller(dt=1e-4, limits=(0.0, 75.0), feedforward=still.inverse())
    step = pt.move(start=10e-6, stop=30e-6, dwell=0.1, rise=1e-6)
    for band in (0.05, 0.01, 0.001):
        (found,) = pt.track(stage, loop, step).settling(band)
        assert found.time == pytest.approx(5e-3 * np.log(1.0 / band), abs=3e-4)
        assert found.overshoot == 0.0
        assert found.travel <= 2e-4


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"stop": 0.0}, "stop"),
        ({"dwell": 0.0}, "dwell"),
        ({"rise": None}, "rise"),
        ({"rise": 1e-3, "speed": 1.0}, "rise"),
        ({"rise": None, "jerk": 0.0}, "jerk"),
        ({"shape": "zv"}, "frequency"),
        ({"shape": "zv", "frequency": 160.0, "damping": 1.0}, "damping"),
        ({"shape": "zv", "frequency": -160.0}, "frequency"),
        ({"shape": "zz"}, "shape"),
        ({"frequency": 160.0}, "shaper"),
        ({"start": np.nan}, "start"),
    ],
)
def test_what_is_no_move_is_refused(wrong: dict[str, Any], named: str) -> None:
    with pytest.raises(pt.ParameterError, match=named):
        pt.move(**{"start": 0.0, "stop": WAY, "dwell": 0.1, "rise": 1e-3, **wrong})


def test_a_move_can_be_sent_to_another_process() -> None:
    move = shaped("ei", rise=1e-3)
    again = pickle.loads(pickle.dumps(move))
    t = np.linspace(0.0, move.duration, 100)
    assert (again.at(t)[0] == move.at(t)[0]).all()
