"""The observer of the hysteresis in closed loops of Dahl and Bouc-Wen stages."""

from __future__ import annotations

import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import piezotrack as pt
from piezotrack.control import HysteresisObserver

DT = 0.005
PI = pt.Pid.from_um(kp=0.2, ti=0.1)
DAHL = pt.DahlStage.xu_li_2010()
BOUC_WEN = pt.BoucWenStage.xu_li_2010_corrected()
STAGES: dict[str, Any] = {"dahl": DAHL, "bouc-wen": BOUC_WEN}
REFERENCE = pt.sine(frequency=0.1, low=10e-6, high=60e-6, duration=20.0)


def loop(feedback: Any) -> pt.Controller:
    """Make a controller with this law and no feedforward."""
    return pt.Controller(dt=DT, limits=(0.0, 75.0), feedback=feedback)


@pytest.mark.parametrize("name", STAGES)
@pytest.mark.parametrize("correction", [0.0, 0.1])
def test_the_error_is_below_that_of_the_pid_alone(name: str, correction: float) -> None:
    stage = STAGES[name]
    law = HysteresisObserver(stage=stage, pid=PI, correction=correction)
    assert pt.check_loop(stage, loop(law)).stable
    alone = pt.track(stage, loop(PI), REFERENCE)
    run = pt.track(stage, loop(law), REFERENCE)
    assert run.metrics.rms_error < 0.97 * alone.metrics.rms_error


@pytest.mark.parametrize("name", STAGES)
def test_a_linear_feedforward_beside_it_leaves_little(name: str) -> None:
    stage = STAGES[name]
    gain = stage.piezo_coefficient / (stage.stiffness if name == "dahl" else 1.0)
    errors = []
    for law in (PI, HysteresisObserver(stage=stage, pid=PI, correction=0.05)):
        session = loop(law).start()
        t = np.arange(1600) * DT
        # High enough that no voltage below 0 is asked for
        r = 45e-6 - 25e-6 * np.cos(2 * np.pi * 0.25 * t)
        linear = (r + stage.damping / stage.stiffness * np.gradient(r, DT)) / gain
        state, x, seen = None, 0.0, []
        volts = 0.0
        for reference, forward in zip(r, linear, strict=True):
            seen.append(reference - x)
            volts = session.step(float(reference), x, feedforward=float(forward))
            response = stage.simulate([volts, volts], DT, hold="zoh", initial=state)
            state, x = response.final, float(response.x[-1])
        errors.append(float(np.std(seen[800:])))
    assert errors[1] < 0.5 * errors[0]


@pytest.mark.parametrize("name", STAGES)
def test_a_start_is_bumpless_and_a_session_is_kept_to_the_bit(name: str) -> None:
    session = loop(HysteresisObserver(stage=STAGES[name], pid=PI)).start(present=30.0)
    assert session.step(40e-6, 40e-6) == pytest.approx(30.0, abs=1e-9)
    for k in range(50):
        session.step(40e-6 + 1e-7 * (k % 3), 40e-6)
    other = pickle.loads(pickle.dumps(session))
    for k in range(50):
        assert session.step(41e-6, 40e-6 + 1e-8 * k) == other.step(41e-6, 40e-6 + 1e-8 * k)


def test_to_control_is_the_law_that_runs_where_the_operator_is_straight() -> None:
    control = pytest.importorskip("control")
    stage = replace(BOUC_WEN, beta=0.0, gamma=0.0)
    law = HysteresisObserver(stage=stage, pid=PI, correction=0.2)
    system = pt.to_control(law, dt=DT)
    errors = 1e-7 * np.random.default_rng(3).standard_normal(60)
    errors[0] = 0.0
    session = pt.Controller(dt=DT, limits=(-75.0, 75.0), feedback=law).start()
    # The reference stays at 0: only what is measured is observed.
    volts = [session.step(0.0, -float(error)) for error in errors]
    expected = control.forced_response(system, inputs=errors).outputs
    np.testing.assert_allclose(volts, expected, atol=1e-9)


def test_the_bandwidth_is_that_of_the_motion() -> None:
    # Of a straight operator the loop is linear: a sine of the bandwidth comes out 3 dB smaller.
    stage = replace(BOUC_WEN, beta=0.0, gamma=0.0)
    law = HysteresisObserver(stage=stage, pid=PI, correction=0.2)
    bandwidth = pt.check_loop(stage, loop(law)).middle.bandwidth
    assert bandwidth is not None
    sine = pt.sine(frequency=bandwidth, low=30e-6, high=32e-6, duration=40.0 / bandwidth)
    run = pt.track(stage, loop(law), sine)
    late = run.t > 0.5 * run.t[-1]
    turn = np.exp(-2j * np.pi * bandwidth * run.t[late])
    waves = [
        np.linalg.lstsq(
            np.column_stack([turn.real, turn.imag, np.ones(turn.size)]), signal[late], rcond=None
        )[0][:2]
        for signal in (run.displacement, run.desired)
    ]
    came, asked = (float(np.hypot(*wave)) for wave in waves)
    assert came / asked == pytest.approx(np.sqrt(0.5), rel=0.01)


def test_what_cannot_be_observed_is_refused() -> None:
    with pytest.raises(pt.ParameterError, match="stage is Prandtl"):
        HysteresisObserver(
            stage=pt.PrandtlIshlinskiiStage(linear=1e-6, thresholds=[1.0], weights=[1e-7]),  # type: ignore[arg-type]
            pid=PI,
        )
    with pytest.raises(pt.ParameterError, match="stage has b0 = 1 N/m: expected 0"):
        HysteresisObserver(stage=replace(DAHL, b0=1.0), pid=PI)
    with pytest.raises(pt.ParameterError, match=r"correction is 1.5: expected a share from 0 to 1"):
        HysteresisObserver(stage=DAHL, pid=PI, correction=1.5)
    with pytest.raises(pt.ParameterError, match="pid is None: expected"):
        HysteresisObserver(stage=DAHL, pid=None)  # type: ignore[arg-type]
    with pytest.raises(pt.ParameterError, match="stroke is 0"):
        HysteresisObserver(stage=DAHL, pid=PI, stroke=0.0)
