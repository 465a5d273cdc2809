"""Closed loops and margins of the stage models beside Dahl's."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt
from commands import ran

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from piezotrack.control.plant import Plant

BOUC_WEN = pt.BoucWenStage.xu_li_2010_corrected()
PLAYS = pt.PrandtlIshlinskiiStage(
    linear=0.9e-6,
    thresholds=(3.0, 8.0, 15.0, 25.0),
    weights=(0.1e-6, 0.2e-6, 0.15e-6, 0.12e-6),
    dead_zone_thresholds=(20e-6, 50e-6),
    dead_zone_weights=(0.08, -0.05),
)
FRICTION = pt.FirstOrderDahlStage(
    mass=0.1828,
    damping=100.0,
    stiffness=26065.0,
    piezo_coefficient=0.0468,
    rest_stiffness=9e3,
    coulomb_force=0.15,
)
STAGES: dict[str, Plant] = {
    "bouc-wen": BOUC_WEN,
    "first-order dahl": FRICTION,
    "plays": PLAYS,
    "plays with a lag": replace(PLAYS, time_constant=5e-3),
    "plays with a mode": replace(PLAYS, frequency=160.0, damping_ratio=0.5),
    "creeping plays": replace(PLAYS, creep_weights=(0.004, 0.01), creep_times=(0.1, 1.0)),
}
# Where no voltage of the inverse is clipped.
WIDE = (-20.0, 95.0)


def loop(stage: Plant | None = None, dt: float = 0.02, **parts: Any) -> pt.Controller:
    if stage is not None:
        assert not isinstance(stage, pt.VirtualStage)
        parts["feedforward"] = stage.inverse(playback="online")
    wanted: dict[str, Any] = {"dt": dt, "limits": WIDE}
    return pt.Controller(**(wanted | parts))


def sine(frequency: float, duration: float, low: float = 0.0) -> pt.Reference:
    return pt.sine(frequency=frequency, low=low, high=60e-6, duration=duration)


def travel(x: NDArray[np.float64]) -> float:
    return float(np.ptp(x))


# Plant.


@pytest.mark.parametrize("name", STAGES)
def test_feedback_tracks(name: str) -> None:
    """With an integrator at the head of the loop the error is the velocity over Kp G / Ti."""
    stage = STAGES[name]
    pid = pt.Pid.from_um(kp=0.06, ti=0.009, td=0.044)
    run = pt.track(stage, loop(feedback=pid), sine(0.05, 60.0, low=10e-6))
    assert not run.saturated.any()
    settled = run.t >= 20.0
    gain = travel(run.displacement[settled]) / travel(run.voltage[settled])
    assert run.metrics.phase_lag == pytest.approx(
        2.0 * math.pi * 0.05 * 0.009 / (0.06e6 * gain), rel=0.1
    )
    assert run.metrics.max_error < 0.03 * 50e-6
    # There is no sensor: what is read is where the stage is.
    assert np.array_equal(run.measured, run.displacement)


def test_a_static_stage_under_its_own_inverse_is_one_sample_late_and_no_more() -> None:
    for dt in (0.02, 1e-3):
        run = pt.track(PLAYS, loop(PLAYS, dt), sine(0.5, 6.0))
        assert np.abs(run.measured[1:] - run.desired[:-1]).max() < 1e-18


@pytest.mark.parametrize("name", ["bouc-wen", "first-order dahl", "plays with a mode"])
def test_mechanics_under_their_own_inverse_are_half_a_sample_late(name: str) -> None:
    """As Dahl's: the held voltage is half an interval behind the one that is wanted."""
    fastest = math.pi * 0.5 * 60e-6
    largest = []
    for dt in (2e-3, 1e-3, 5e-4):
        run = pt.track(STAGES[name], loop(STAGES[name], dt), sine(0.5, 4.0))
        largest.append(run.score(2.0).max_error)
        assert largest[-1] == pytest.approx(0.5 * dt * fastest, rel=0.03)
        dahl = pt.DahlStage.xu_li_2010()
        same = pt.track(dahl, loop(dahl, dt), sine(0.5, 4.0)).score(2.0).max_error
        assert largest[-1] == pytest.approx(same, rel=0.03)
    assert np.array(largest[:-1]) / largest[1:] == pytest.approx(2.0, rel=0.03)


@pytest.mark.parametrize("name", STAGES)
def test_the_motion_is_that_of_the_stage_under_the_held_voltage(name: str) -> None:
    stage = STAGES[name]
    assert not isinstance(stage, pt.VirtualStage)
    run = pt.track(stage, loop(stage), sine(0.5, 4.0), substeps=8)
    held = np.repeat(run.voltage, 8)[: run.fine_t.size]
    alone = stage.simulate(held, 0.02 / 8, hold="zoh").x
    assert np.abs(run.fine_displacement - alone).max() < 1e-12


@pytest.mark.parametrize("name", STAGES)
def test_a_part_of_a_sample_of_delay_shifts_the_motion(name: str) -> None:
    stage = STAGES[name]
    course, forward = sine(0.5, 3.0), loop(stage)
    plain, late = (
        pt.track(stage, forward, course, timing=pt.Timing(delay=delay)) for delay in (0.0, 0.006)
    )
    # 0.006 s are three of the ten instants kept in an interval.
    shifted = late.fine_displacement[3:] - plain.fine_displacement[:-3]
    assert np.abs(shifted).max() < 1e-12
    assert np.abs(late.fine_displacement - plain.fine_displacement).max() > 1e-7


def test_an_identified_one_has_its_offset() -> None:
    model = pt.identification.IdentifiedModel(
        model=PLAYS, offset=-5e-6, offset_fitted=True, stroke=90e-6
    )
    run = pt.track(
        model, pt.Controller(dt=0.02, limits=WIDE, feedforward=model.inverse()), sine(0.5, 6.0)
    )
    late = run.t >= 2.0
    assert np.abs(run.measured[1:] - run.desired[:-1])[late[1:]].max() < 1e-6
    bare = pt.track(
        PLAYS, pt.Controller(dt=0.02, limits=WIDE, feedforward=model.inverse()), sine(0.5, 6.0)
    )
    assert run.measured - bare.measured == pytest.approx(-5e-6, abs=1e-12)


def test_a_reference_out_of_reach_is_refused() -> None:
    course = pt.sine(frequency=0.5, low=0.0, high=200e-6, duration=4.0)
    for stage in (BOUC_WEN, PLAYS):
        with pytest.raises(pt.ParameterError, match=r"200 um at .* beyond .* from -20 to 95 V"):
            pt.track(stage, loop(stage), course)


# Checked.


def gains(stage: Plant, limits: tuple[float, float] = (0.0, 75.0)) -> list[float]:
    report = pt.check_loop(stage, loop(limits=limits, feedback=pt.Pid.xu_li_2010()))
    return [one.gain for one in (report.low, report.middle, report.high)]


@pytest.mark.parametrize("stage", [BOUC_WEN, PLAYS])
def test_the_gains_are_those_of_the_settled_loop(stage: Plant) -> None:
    """Slopes of a quasi-static loop, by differences of the simulated displacement."""
    assert not isinstance(stage, pt.VirtualStage)
    up = np.linspace(0.0, 75.0, 20001)
    u = np.concatenate([up, up[::-1], up, up[::-1], up, up[::-1]])
    x = stage.simulate(u, 50.0).x[-40002:]
    slopes = np.diff(x)[np.abs(np.diff(u[-40002:])) > 0.0] / (75.0 / 20000)
    slopes[20000:] *= -1.0
    low, middle, high = gains(stage)
    assert low == pytest.approx(slopes.min(), rel=2e-3)
    assert high == pytest.approx(slopes.max(), rel=2e-3)
    assert middle == pytest.approx(travel(x) / 75.0, rel=1e-3)
    assert low < middle < high


def test_a_bouc_wen_loop_over_a_wide_range_has_the_slopes_of_the_paper() -> None:
    """Just after a reversal at its limit h' = 2 alpha d beta/(beta + gamma), at the limit 0."""
    d, alpha, beta, gamma = 1.7339e-6, 0.3575, 0.0364, 0.0272
    low, _, high = gains(BOUC_WEN, (-500.0, 500.0))
    assert low == pytest.approx(d * (1.0 - 2.0 * alpha * beta / (beta + gamma)), rel=1e-6)
    assert high == pytest.approx(d, rel=1e-6)


def test_a_loop_with_friction_is_stiffest_just_after_a_reversal() -> None:
    """There the friction adds twice its rest stiffness, and at the Coulomb force none."""
    low, middle, high = gains(FRICTION)
    assert low == pytest.approx(0.0468 / (26065.0 + 2.0 * 9e3), rel=0.02)
    assert high == pytest.approx(0.0468 / 26065.0, rel=0.02)
    assert middle == pytest.approx(0.0468 / (26065.0 + 2.0 * 0.15 / 130e-6), rel=0.02)


def test_gains_of_a_stage_that_pulls_are_negative() -> None:
    """With -d and -gamma, -h solves the same equation."""
    pulling = replace(BOUC_WEN, piezo_coefficient=-1.7339e-6, gamma=-BOUC_WEN.gamma)
    assert gains(pulling) == pytest.approx([-gain for gain in gains(BOUC_WEN)], rel=1e-12)


@pytest.mark.parametrize(("gain", "stable"), [(1.27e-6, True), (1.29e-6, False)])
def test_the_published_gains_hold_a_static_stage_up_to_128(gain: float, stable: bool) -> None:
    static = pt.PrandtlIshlinskiiStage(linear=gain, thresholds=(), weights=())
    controller = loop(limits=(-75.0, 75.0), feedback=pt.Pid.xu_li_2010())
    assert pt.check_loop(static, controller).stable is stable
    # And so it moves: what the start stirs up decays or grows, in 1000 samples.
    run = pt.track(static, controller, sine(0.1, 20.0), unstable=True)
    ripple = np.abs(np.diff(run.error, 3))
    early, late = float(ripple[200:300].max()), float(ripple[-100:].max())
    assert (late > 3.0 * early) is not stable


def test_the_time_constant_counts_as_a_lag() -> None:
    """1/(T s + 1) behind a hold has the pole exp(-Ts/T), so a P controller holds up to a gain."""
    lagging = pt.PrandtlIshlinskiiStage(linear=1e-6, thresholds=(), weights=(), time_constant=0.05)
    law = pt.control.StateSpace(a=[[0.0]], b=[0.0], c=[0.0], d=1e6)
    margin = pt.check_loop(lagging, loop(feedback=law)).middle.gain_margin
    pole = math.exp(-0.02 / 0.05)
    # z = -1 is on the circle: 1 + k (1 - pole)/(z - pole) = 0.
    assert margin == pytest.approx((1.0 + pole) / (1.0 - pole), rel=1e-6)


@pytest.mark.parametrize("share", [0.05, 0.5])
def test_the_bandwidth_is_where_the_closed_loop_is_3_decibels_below_1(share: float) -> None:
    """A PI law whose zero cancels a lag leaves T = g/(z - 1 + g)."""
    dt, gain, time = 0.02, 1e-6, 0.05
    lagging = pt.PrandtlIshlinskiiStage(linear=gain, thresholds=(), weights=(), time_constant=time)
    pole = math.exp(-dt / time)
    law = pt.Pid(kp=share * pole / (1.0 - pole) / gain, ti=dt * pole / (1.0 - pole))
    cosine = (1.0 + (1.0 - share) ** 2 - 2.0 * share**2) / (2.0 * (1.0 - share))
    expected = math.acos(cosine) / (2.0 * math.pi * dt)
    found = pt.check_loop(lagging, loop(dt=dt, feedback=law)).middle
    assert found.bandwidth == pytest.approx(expected, rel=1e-3)
    assert found.margins()["bandwidth_Hz"] == found.bandwidth
    # Without feedback there is none.
    assert pt.check_loop(lagging, loop(dt=dt)).middle.bandwidth is None


def test_a_repetitive_loop_prints_its_own_margin() -> None:
    """A feedback with a margin of 10 helps nothing where the learning is unstable."""
    feedback = pt.Pid(kp=0.05e6, ti=0.02, td=0.0)
    learning = pt.Repetitive(period=1.0, kq=1.9e6, smoothing=None)

    def check(gain: float) -> pt.control.LoopCheck:
        static = pt.PrandtlIshlinskiiStage(linear=gain, thresholds=(), weights=())
        return pt.check_loop(static, loop(feedback=feedback, repetitive=learning)).middle

    report = check(1.3e-6)
    assert report.gain_margin == pytest.approx(10.26, rel=1e-3)
    assert report.stable_gains is not None
    factor = report.stable_gains[1]
    assert factor < 1.0
    assert str(report) == f"1.3 um/V: UNSTABLE, gain margin {20.0 * np.log10(factor):.3g} dB"
    # At that gain the loop is at its limit.
    assert check(0.99 * factor * 1.3e-6).stable
    assert "Ms of the feedback" in str(check(0.99 * factor * 1.3e-6))
    assert not check(1.01 * factor * 1.3e-6).stable


def test_an_unstable_loop_is_refused() -> None:
    with pytest.raises(pt.ParameterError, match=r"the loop is unstable on this stage, 1\.\d+ um/V"):
        pt.track(PLAYS, loop(feedback=pt.Pid.from_um(kp=0.2, ti=0.009, td=0.044)), sine(0.2, 5.0))


@pytest.mark.parametrize("stage", [5, None, "dahl", pt.stages.DahlState()])
def test_what_cannot_be_led_is_refused(stage: Any) -> None:
    words = r"^stage is .*: expected a stage or an identified model"
    with pytest.raises(pt.ParameterError, match=words):
        pt.track(stage, loop(), sine(0.5, 2.0))
    with pytest.raises(pt.ParameterError, match=words):
        pt.check_loop(stage, loop(feedback=pt.Pid.xu_li_2010()))


def test_a_hysteresis_that_grows_without_bound_has_no_gain() -> None:
    with pytest.raises(pt.NumericalError, match="does not stay finite from 0 V to 75 V"):
        gains(replace(BOUC_WEN, beta=-1.0))


# The command.


@pytest.mark.usefixtures("_no_pictures")
@pytest.mark.parametrize("stage", [BOUC_WEN, PLAYS])
def test_the_command_leads_the_model_itself(
    stage: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    model = pt.identification.IdentifiedModel(
        model=stage, offset=2e-6, offset_fitted=True, stroke=90e-6
    )
    model.save("model.json")
    course = "sine:0.5Hz,20..60um,6s"
    loop_options = ("--online", "--dt", "0.002", "--limits", "0:75")
    printed = ran("track", "model.json", course, *loop_options)
    found = float(printed.partition("from 2 s on: max ")[2].partition(" um")[0])
    # One interval of the hold at most, at the fastest place.
    assert found < 1e6 * math.pi * 0.5 * 40e-6 * 0.002 * 1.02
    assert "feedforward.csv" in ran(
        "feedforward", "model.json", "sine:0.5Hz,10..60um,6s", "--dt", "0.02"
    )
