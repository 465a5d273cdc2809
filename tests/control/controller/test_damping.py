"""Laws that damp a mode: against numpy on the closed sampled loop, starts, recovery, refusals."""

from __future__ import annotations

import math
import pickle
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import scipy.linalg
import scipy.signal

import piezotrack as pt
from piezotrack.control import (
    IntegralResonantControl,
    PositivePositionFeedback,
    PositiveVelocityPositionFeedback,
)

DT, DELAY = 2e-4, 1e-4
LIMITS = (0.0, 100.0)
GAIN, MODE, RATIO = 1e-6, 160.0, 0.02
W0 = 2.0 * math.pi * MODE
STAGE = pt.stages.PrandtlIshlinskiiStage(
    linear=GAIN, thresholds=(), weights=(), frequency=MODE, damping_ratio=RATIO
)
PI, NOTHING = pt.Pid(kp=1e4, ti=4e-5, tt=DT), pt.Pid(kp=0.0, ti=math.inf)


def of(name: str, pid: pt.Pid = PI) -> Any:
    """Make a law of filters about the mode."""
    match name:
        case "integral-resonant":
            corner = 2.0**0.25 * W0
            return IntegralResonantControl(pid=pid, gain=corner / 2e-6, feedthrough=2e-6)
        case "positive-position":
            return PositivePositionFeedback(
                pid=pid, gain=0.4e6, frequency=1.3 * MODE, damping_ratio=0.6
            )
    return PositiveVelocityPositionFeedback(
        pid=pid,
        velocity_gain=-0.3e6,
        position_gain=0.5e6,
        frequency=2.0 * MODE,
        damping_ratio=0.7,
    )


NAMES = ("integral-resonant", "positive-position", "positive-velocity-position")


def filter_of(law: Any) -> tuple[Any, Any]:
    """Return K in continuous time, from the equations of the papers."""
    if isinstance(law, IntegralResonantControl):
        return [law.gain], [1.0, law.gain * law.feedthrough]
    wc = 2.0 * math.pi * law.frequency
    below = [1.0, 2.0 * law.damping_ratio * wc, wc**2]
    if isinstance(law, PositivePositionFeedback):
        return [law.gain * wc**2], below
    return [law.velocity_gain * wc, law.position_gain * wc**2], below


def sampled(law: Any) -> tuple[Any, Any, Any]:
    """Polynomials in z of the filter by scipy, and of the PI law."""
    k, k_below = scipy.signal.bilinear(*filter_of(law), fs=1.0 / DT)
    ki = law.pid.kp * DT / law.pid.ti
    return k, k_below, [law.pid.kp + ki, -law.pid.kp]


def plant() -> tuple[Any, Any]:
    """Return the mode behind a hold and half a sample of delay, as polynomials in z."""
    a = np.array([[0.0, 1.0], [-(W0**2), -2.0 * RATIO * W0]])
    b = np.array([[0.0], [GAIN * W0**2]])

    def held(h: float) -> tuple[Any, Any]:
        whole = scipy.linalg.expm(h * np.block([[a, b], [np.zeros((1, 3))]]))
        return whole[:2, :2], whole[:2, 2:]

    (whole, _), (rest, now) = held(DT), held(DT - DELAY)
    before = rest @ held(DELAY)[1]
    rows = np.block([[whole, before], [np.zeros((1, 3))]])
    above, below = scipy.signal.ss2tf(rows, np.vstack([now, [[1.0]]]), [[1.0, 0.0, 0.0]], [[0.0]])
    return above[0], below


def roots_of(law: Any) -> Any:
    """Roots of the closed sampled loop: dP dC dK + nP (nC dK - nK dC)."""
    k, k_below, c = sampled(law)
    n, d = plant()
    one = [1.0, -1.0] if math.isfinite(law.pid.ti) else [1.0]
    c = c if math.isfinite(law.pid.ti) else [law.pid.kp]
    inside = np.polysub(np.polymul(c, k_below), np.polymul(k, one))
    return np.roots(np.polyadd(np.polymul(d, np.polymul(one, k_below)), np.polymul(n, inside)))


def loop(law: Any, **more: Any) -> pt.Controller:
    return pt.Controller(dt=DT, limits=LIMITS, feedback=law, **more)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("share", [0.2, 1.0, 3.0, 8.0])
def test_stability_is_that_of_the_roots_of_the_closed_sampled_loop(name: str, share: float) -> None:
    law = of(name, pt.Pid(kp=1e4, ti=4e-5 / share, tt=DT))
    report = pt.check_loop(STAGE, loop(law), delay=DELAY).middle
    largest = np.abs(roots_of(law)).max()
    assert report.stable == (largest < 1.0)
    assert report.slowest_root == pytest.approx(largest, abs=1e-6)


@pytest.mark.parametrize("name", NAMES)
def test_damping_alone_damps_the_mode(name: str) -> None:
    law = of(name, NOTHING)
    roots = np.log(roots_of(law).astype(complex)) / DT
    about = roots[(np.abs(roots) > 0.3 * W0) & (np.abs(roots) < 3.0 * W0)]
    assert (-about.real / np.abs(about)).min() > 0.15
    report = pt.check_loop(STAGE, loop(law), delay=DELAY).middle
    assert report.stable
    assert report.slowest_root == pytest.approx(np.abs(roots_of(law)).max(), abs=1e-6)


@pytest.mark.parametrize("name", NAMES)
def test_margins_are_of_the_loop_at_the_command_and_the_bandwidth_from_the_reference(
    name: str,
) -> None:
    law = of(name)
    report = pt.check_loop(STAGE, loop(law), delay=DELAY)
    k, k_below, c = sampled(law)
    n, d = plant()
    f = np.linspace(0.05, 2500.0, 400_001)
    z = np.exp(2j * np.pi * f * DT)
    p = np.polyval(n, z) / np.polyval(d, z)
    tracking, damping = np.polyval(c, z) / (z - 1.0), np.polyval(k, z) / np.polyval(k_below, z)
    open_loop = p * (tracking - damping)
    middle = report.middle
    assert middle.sensitivity == pytest.approx((1.0 / np.abs(1.0 + open_loop)).max(), rel=1e-3)
    crossings = np.flatnonzero(np.diff(np.abs(open_loop) > 1.0))
    phases = np.abs(np.angle(-open_loop[crossings]))
    assert middle.phase_margin == pytest.approx(phases.min(), abs=2e-3)
    closed = p * tracking / (1.0 + open_loop)
    expected = f[np.flatnonzero(np.abs(closed) < math.sqrt(0.5))[0]]
    assert middle.bandwidth == pytest.approx(expected, rel=1e-3)
    curves = report.response(60)
    zs = np.exp(2j * np.pi * curves.frequency * DT)
    ps = np.polyval(n, zs) / np.polyval(d, zs)
    cs, ks = np.polyval(c, zs) / (zs - 1.0), np.polyval(k, zs) / np.polyval(k_below, zs)
    np.testing.assert_allclose(curves.complementary, ps * cs / (1.0 + ps * (cs - ks)), rtol=1e-6)


@pytest.mark.parametrize("name", NAMES)
def test_to_control_is_the_law_that_runs_from_error_and_measurement(name: str) -> None:
    control = pytest.importorskip("control")
    law = of(name)
    system = pt.to_control(law, dt=DT)
    assert system.ninputs == 2
    readings = 1e-7 * np.random.default_rng(3).standard_normal((2, 80))
    readings[:, 0] = 0.0
    session = pt.Controller(dt=DT, limits=(-100.0, 100.0), feedback=law).start()
    volts = [session.step(float(r), float(y)) for r, y in readings.T]
    inputs = np.stack([readings[0] - readings[1], readings[1]])
    expected = control.forced_response(system, inputs=inputs).outputs[0]
    np.testing.assert_allclose(volts, expected, atol=1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_a_simulated_move_is_that_of_the_linear_loop(name: str) -> None:
    law = of(name)
    reference = pt.staircase(dwell=0.05, steps=2, low=20e-6, high=30e-6)
    run = pt.track(STAGE, loop(law), reference, timing=pt.Timing(delay=DELAY))
    assert not np.any(run.saturated)
    k, k_below, c = sampled(law)
    n, d = plant()
    ys, us, es, cs, ks = ([0.0] * 4 for _ in range(5))
    expected: list[float] = []
    for r in run.desired:
        y = -np.dot(d[1:], ys[:3]) + np.dot(n[1:], us[:3])
        ys, es = [y, *ys[:3]], [r - y, *es[:3]]
        cs = [cs[0] + np.dot(c, es[:2]) if expected else c[0] * es[0] - PI.kp * es[0], *cs[:3]]
        order = len(k_below)
        ks = [np.dot(k, ys[:order]) - np.dot(k_below[1:], ks[: order - 1]), *ks[:3]]
        us = [cs[0] + ks[0], *us[:3]]
        expected.append(y)
    np.testing.assert_allclose(run.displacement, expected, atol=1e-10)


@pytest.mark.parametrize("name", NAMES)
def test_a_start_is_bumpless_and_a_session_is_kept_to_the_bit(name: str) -> None:
    for pid in (PI, NOTHING):
        session = loop(of(name, pid)).start(present=30.0)
        assert session.step(40e-6, 40e-6) == pytest.approx(30.0, abs=1e-9)
        # What stands still is no reason to move.
        assert session.step(40e-6, 40e-6) == pytest.approx(30.0, abs=1e-9)
        for k in range(50):
            session.step(40e-6 + 1e-7 * (k % 3), 40e-6)
        other = pickle.loads(pickle.dumps(session))
        for k in range(50):
            assert session.step(41e-6, 40e-6 + 1e-8 * k) == other.step(41e-6, 40e-6 + 1e-8 * k)


@pytest.mark.parametrize("name", NAMES)
def test_a_law_recovers_after_saturation_and_bad_readings(name: str) -> None:
    n, d = plant()
    for more in ({}, {"filters": [pt.LowPass(2000.0)]}):
        late = []
        for disturbed in (False, True):
            session, ys, us = loop(of(name), **more).start(), [0.0] * 4, [0.0] * 4
            for k in range(9000):
                bad = disturbed and k < 1500
                y = float(-np.dot(d[1:], ys[:3]) + np.dot(n[1:], us[:3]))
                reading = [y, np.nan, np.inf, 9.9e37, y][k % 5] if bad and k > 700 else y
                volts = session.step(900e-6 if bad else 50e-6, float(reading))
                assert LIMITS[0] <= volts <= LIMITS[1]
                ys, us = [y, *ys[:3]], [volts, *us[:3]]
            late.append(y)
        assert late[0] == pytest.approx(50e-6, abs=1e-9)
        assert late[1] == pytest.approx(late[0], abs=1e-10)


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (
            lambda: IntegralResonantControl(pid=PI, gain=1e9, feedthrough=0.0),
            "feedthrough is 0 m/V: expected",
        ),
        (
            lambda: IntegralResonantControl(pid=PI, gain=-1e9, feedthrough=1e-6),
            "gain is -1e9 V/m/s: expected",
        ),
        (
            lambda: loop(IntegralResonantControl(pid=PI, gain=1e12, feedthrough=2e-6)),
            "gain is 1e12: expected poles",
        ),
        (
            lambda: PositivePositionFeedback(pid=PI, gain=1e5, frequency=0.0, damping_ratio=0.5),
            "frequency is 0 Hz: expected",
        ),
        (
            lambda: PositivePositionFeedback(pid=PI, gain=1e5, frequency=9.0, damping_ratio=0.0),
            "damping_ratio is 0: expected",
        ),
        (
            lambda: PositivePositionFeedback(
                pid=of("positive-position"), gain=1e5, frequency=9.0, damping_ratio=0.5
            ),
            "pid is PositivePositionFeedback(",
        ),
        (
            lambda: PositiveVelocityPositionFeedback(
                pid=PI, velocity_gain=np.nan, position_gain=1.0, frequency=9.0, damping_ratio=0.5
            ),
            "velocity_gain is NaN V/m: expected",
        ),
    ],
)
def test_a_wrong_number_is_named(make: Any, sentence: str) -> None:
    with pytest.raises(pt.ParameterError, match=re.escape(sentence)):
        make()


ROUGH = replace(STAGE, linear=0.92 * GAIN, frequency=1.06 * MODE)
LINES = pt.triangle(frequency=25.0, low=20e-6, high=30e-6, duration=0.8)


def followed(controller: pt.Controller) -> pt.control.Tracking:
    return pt.track(STAGE, controller, LINES, timing=pt.Timing(delay=DELAY))


@pytest.mark.parametrize("name", NAMES)
def test_beside_an_inverse_the_filter_acts_on_the_deviation_from_the_reference(name: str) -> None:
    law = of(name)
    run = followed(loop(law, feedforward=ROUGH.inverse()))
    assert not np.any(run.saturated)
    k, k_below, c = sampled(law)
    n, d = plant()
    ys, us, es, cs, ks = ([0.0] * 4 for _ in range(5))
    expected: list[float] = []
    for r, forward in zip(run.desired, run.feedforward, strict=True):
        y = -np.dot(d[1:], ys[:3]) + np.dot(n[1:], us[:3])
        ys, es = [y, *ys[:3]], [r - y, *es[:3]]
        cs = [cs[0] + np.dot(c, es[:2]) if expected else c[0] * es[0] - PI.kp * es[0], *cs[:3]]
        order = len(k_below)
        # K (y - r): the loop of the tracking error alone, C - K
        ks = [-np.dot(k, es[:order]) - np.dot(k_below[1:], ks[: order - 1]), *ks[:3]]
        us = [forward + cs[0] + ks[0], *us[:3]]
        expected.append(y)
    np.testing.assert_allclose(run.displacement, expected, atol=1e-10)


@pytest.mark.parametrize("name", NAMES)
def test_with_an_inverse_it_follows_better_than_either_alone(name: str) -> None:
    law, inverse = of(name, pt.Pid(kp=1e4, ti=1.2e-4, tt=DT)), ROUGH.inverse()
    both, alone, open_loop = (
        followed(one).metrics.rms_error
        for one in (
            loop(law, feedforward=inverse),
            loop(law),
            pt.Controller(dt=DT, limits=LIMITS, feedforward=inverse),
        )
    )
    assert both < 0.5 * min(alone, open_loop)


@pytest.mark.parametrize("name", NAMES)
def test_a_feedforward_changes_nothing_of_the_loop_and_nothing_is_added_where_the_stage_follows(
    name: str,
) -> None:
    alone, both = loop(of(name)), loop(of(name), feedforward=STAGE.inverse())
    one, other = (pt.check_loop(STAGE, each, delay=DELAY).middle for each in (alone, both))
    assert one == other
    session = both.start()
    for k in range(300):
        place = 20e-6 + 1e-6 * math.sin(0.1 * k)
        session.step(place, place)
        assert session.last.feedback == 0.0


@pytest.mark.parametrize("name", NAMES)
def test_to_control_of_a_controller_with_an_inverse_is_of_the_error_alone(name: str) -> None:
    control = pytest.importorskip("control")
    both = loop(of(name), feedforward=STAGE.inverse())
    system = pt.to_control(both)
    assert system.ninputs == 1
    errors = 1e-7 * np.random.default_rng(3).standard_normal(80)
    errors[0] = 0.0
    session, volts = both.start(), []
    for error in errors:
        session.step(30e-6, 30e-6 - float(error), feedforward=30.0)
        volts.append(session.last.feedback)
    expected = control.forced_response(system, inputs=errors).outputs
    np.testing.assert_allclose(volts, expected, atol=1e-9)
