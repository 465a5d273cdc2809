"""Feedback laws besides PID and state space: tracking, stability, what they refuse."""

from __future__ import annotations

import pickle
import re
from typing import Any

import numpy as np
import pytest

import piezotrack as pt
from piezotrack.control import DisturbanceObserver, LeadLag, PerturbationEstimator, SlidingMode

DT = 0.02
LIMITS = (0.0, 75.0)
REFERENCE = pt.sine(frequency=0.2, low=10e-6, high=60e-6, duration=20.0)
PI = pt.Pid.from_um(kp=0.05, ti=0.1)
# Gain of the stage, m/V
GAIN = 1.5e-6
SLIDING = SlidingMode(switching=5.0, layer=20e-6, ti=0.05)
LAWS: dict[str, Any] = {
    "lead-lag": LeadLag(kp=0.4e6, lead=0.0, lag=0.2),
    "matched lead-lag": LeadLag(kp=0.4e6, lead=0.01, lag=0.2, method="matched"),
    "sliding": SLIDING,
    "sliding with derivative": SlidingMode(switching=5.0, layer=20e-6, ti=0.1, td=0.01, tf=0.03),
    "observer": DisturbanceObserver(pid=PI, plant_gain=GAIN, cutoff=0.5),
    "observer with lag": DisturbanceObserver(pid=PI, plant_gain=GAIN, plant_time=0.05, cutoff=0.3),
    "perturbation": PerturbationEstimator(
        sliding=SlidingMode(switching=3.0, layer=20e-6), plant_gain=GAIN, cutoff=0.5
    ),
}
STAGE = pt.VirtualStage.xu_li_2010()
INVERSE = pt.DahlStage.xu_li_2010().inverse()


def loop(law: Any, **more: Any) -> pt.Controller:
    """Make a controller with this law."""
    return pt.Controller(dt=DT, limits=LIMITS, feedback=law, **more)


@pytest.mark.parametrize("name", LAWS)
def test_a_law_around_an_inverse_is_stable_and_better_than_the_inverse_alone(name: str) -> None:
    controller = loop(LAWS[name], feedforward=INVERSE)
    report = pt.check_loop(STAGE, controller)
    assert report.everywhere
    alone = pt.track(STAGE, loop(None, feedforward=INVERSE), REFERENCE)
    run = pt.track(STAGE, controller, REFERENCE)
    assert run.metrics.rms_error < 0.7 * alone.metrics.rms_error


@pytest.mark.parametrize("name", LAWS)
def test_to_control_is_the_law_that_runs(name: str) -> None:
    control = pytest.importorskip("control")
    law = LAWS[name]
    system = pt.to_control(law, dt=DT)
    # Small, so that nothing saturates and a surface stays within its boundary layer
    errors = 1e-7 * np.random.default_rng(3).standard_normal(60)
    errors[0] = 0.0
    controller = pt.Controller(dt=DT, limits=(-75.0, 75.0), feedback=law)
    session = controller.start()
    volts = [session.step(float(error), 0.0) for error in errors]
    expected = control.forced_response(system, inputs=errors).outputs
    np.testing.assert_allclose(volts, expected, atol=1e-9)


@pytest.mark.parametrize("name", LAWS)
def test_a_start_is_bumpless_and_a_session_is_kept_to_the_bit(name: str) -> None:
    session = loop(LAWS[name]).start(present=30.0)
    assert session.step(40e-6, 40e-6) == pytest.approx(30.0, abs=1e-9)
    for k in range(50):
        session.step(40e-6 + 1e-7 * (k % 3), 40e-6)
    other = pickle.loads(pickle.dumps(session))
    for k in range(50):
        assert session.step(41e-6, 40e-6 + 1e-8 * k) == other.step(41e-6, 40e-6 + 1e-8 * k)


@pytest.mark.parametrize("name", LAWS)
def test_a_law_recovers_after_saturation_and_bad_readings(name: str) -> None:
    law = LAWS[name]
    for more in ({}, {"filters": [pt.control.LowPass(10.0)]}):
        controller = loop(law, **more)
        late = []
        for disturbed in (False, True):
            session, x = controller.start(), 0.0
            for k in range(300 if disturbed else 0):
                reading = [x, np.nan, np.inf, 9.9e37, x][k % 5] if k > 100 else x
                volts = session.step(900e-6, float(reading), feedforward=67.0)
                assert LIMITS[0] <= volts <= LIMITS[1]
                x += 0.9 * (GAIN * volts - x)
            for _ in range(400):
                volts = session.step(50e-6, x, feedforward=32.0)
                x += 0.9 * (GAIN * volts - x)
            late.append(abs(50e-6 - x))
        # The same small error as of a loop that never saturated
        assert late[1] < late[0] + 0.2e-6
        assert late[0] < 2e-6


def test_the_estimate_takes_off_a_wrong_gain_of_the_plant_without_an_integrator() -> None:
    proportional = SlidingMode(switching=5.0, layer=50e-6)
    law = PerturbationEstimator(sliding=proportional, plant_gain=GAIN, cutoff=0.5)
    left = []
    for one in (proportional, law):
        session, x = loop(one).start(), 0.0
        for _ in range(400):
            # A fifth more gain than nominal, and 3 V of disturbance
            x += 0.9 * (1.2 * GAIN * (session.step(40e-6, x, feedforward=20.0) + 3.0) - x)
        left.append(abs(40e-6 - x))
    assert left[0] > 1e-6
    assert left[1] < 1e-9


def test_a_thinner_boundary_layer_chatters_more() -> None:
    chatters = []
    for layer in (20e-6, 2e-6):
        law = SlidingMode(switching=3.0, layer=layer)
        controller = loop(law, feedforward=INVERSE)
        run = pt.track(STAGE, controller, REFERENCE, unstable=True)
        chatters.append(pt.control.chatter(run, after=5.0))
    assert chatters[1].rms_change > 2.0 * chatters[0].rms_change
    assert chatters[1].fast_share > chatters[0].fast_share
    with pytest.raises(pt.ParameterError, match="after is 100 s, which leaves 0 samples: expected"):
        pt.control.chatter(run, after=100.0)


def test_sliding_mode_gives_no_more_than_its_switching_gain() -> None:
    session = loop(SlidingMode(switching=5.0, layer=1e-6, ti=0.05)).start()
    volts = [session.step(60e-6, 10e-6, feedforward=20.0) for _ in range(100)]
    assert max(volts) == pytest.approx(25.0)
    # The integral did not go on meanwhile: the sign of the output turns with that of the error.
    assert session.step(10e-6, 20e-6, feedforward=20.0) < 20.0


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (
            lambda: DisturbanceObserver(
                pid=pt.Pid(kp=1e5, ti=float("inf")), plant_gain=1e-6, cutoff=1.0
            ),
            "pid has ti = inf: expected a finite",
        ),
        (lambda: LeadLag(kp=np.nan, lead=0.0, lag=0.1), "kp is NaN V/m: expected"),
        (lambda: LeadLag(kp=1e5, lead=-1.0, lag=0.1), "lead is -1 s: expected"),
        (
            lambda: LeadLag(kp=1e5, lead=0.0, lag=0.1, method="zoh"),  # type: ignore[arg-type]
            "method is 'zoh': expected",
        ),
        (lambda: loop(LeadLag(kp=1e5, lead=0.0, lag=0.0)), "lag is 0 s: expected"),
        (lambda: SlidingMode(switching=0.0, layer=1e-6), "switching is 0 V: expected"),
        (lambda: SlidingMode(switching=1.0, layer=-1e-6), "layer is -1e-6 m: expected"),
        (lambda: SlidingMode(switching=1.0, layer=1e-6, ti=0.0), "ti is 0 s: expected"),
        (
            lambda: DisturbanceObserver(pid=PI, plant_gain=0.0, cutoff=1.0),
            "plant_gain is 0 m/V: expected",
        ),
        (
            lambda: DisturbanceObserver(pid=PI, plant_gain=1e-6, cutoff=0.0),
            "cutoff is 0 Hz: expected",
        ),
        (
            lambda: DisturbanceObserver(pid=SLIDING, plant_gain=1e-6, cutoff=1.0),  # type: ignore[arg-type]
            "pid is SlidingMode(",
        ),
        (
            lambda: PerturbationEstimator(sliding=PI, plant_gain=1e-6),  # type: ignore[arg-type]
            "sliding is Pid(",
        ),
    ],
)
def test_a_wrong_number_is_named(make: Any, sentence: str) -> None:
    with pytest.raises(pt.ParameterError, match=re.escape(sentence)):
        make()
