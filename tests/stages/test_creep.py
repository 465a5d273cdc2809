"""Creep of the stages that a swarm searches: against SciPy, continued, inverted, in a loop."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline

import piezotrack as pt
from all_stages import STAGES

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

SEARCHED = [name for name, stage in STAGES.items() if stage.info.searched]
WEIGHTS, TIMES = (0.03, 0.02, 0.04), (2e-4, 0.05, 1.5)
DT = 1e-3


def creeping(name: str) -> Any:
    # Without dry friction, whose jumps of the force no interpolation of SciPy's follows.
    stage: Any = STAGES[name]
    if name == "dahl":
        stage = replace(stage, b0=0.0)
    return replace(stage, creep_weights=WEIGHTS, creep_times=TIMES)


def drive(count: int = 2001) -> Array:
    t = DT * np.arange(count)
    u: Array = 30.0 - 22.0 * np.cos(2 * np.pi * t) - 8.0 * np.cos(2 * np.pi * 3.0 * t)
    return u


@pytest.mark.slow
@pytest.mark.parametrize("name", SEARCHED)
def test_follows_its_equation(name: str) -> None:
    stage, u = creeping(name), drive()
    run = stage.simulate(u, DT)
    inside = replace(stage, creep_weights=(), creep_times=()).simulate(u, DT)
    mechanics = CubicHermiteSpline(inside.t, inside.x, inside.v)
    times = np.array(TIMES)
    solved = solve_ivp(
        lambda t, q: (mechanics(t) - q) / times,
        (0.0, inside.t[-1]),
        np.zeros(3),
        method="Radau",
        rtol=1e-10,
        atol=1e-16,
        max_step=DT,
        t_eval=inside.t,
    )
    expected = inside.x + np.array(WEIGHTS) @ solved.y
    assert np.abs(run.x - expected).max() < 2e-10
    np.testing.assert_allclose(run.final.creep, solved.y[:, -1], atol=2e-9)
    rates = (inside.x - solved.y) / times[:, None]
    expected = inside.v + np.array(WEIGHTS) @ rates
    assert np.abs(run.v - expected).max() < 1e-5 * np.abs(run.v).max()
    assert run.hysteresis.tobytes() == inside.hysteresis.tobytes()


@pytest.mark.parametrize("name", SEARCHED)
def test_a_simulation_can_be_continued(name: str) -> None:
    stage, u = creeping(name), drive()
    whole = stage.simulate(u, DT)
    first = stage.simulate(u[:1001], DT)
    second = stage.simulate(u[1000:], DT, initial=first.final)
    assert np.abs(second.x - whole.x[1000:]).max() < 2e-10
    with pytest.raises(pt.ShapeError, match="initial has 0 relaxations: expected 3, as the stage"):
        stage.simulate(u, DT, initial=replace(first.final, creep=()))


@pytest.mark.parametrize("name", ["dahl", "bouc-wen", "first-order-dahl"])
@pytest.mark.parametrize("dt", [2e-4, 2e-3])
def test_the_inverse_is_as_exact_as_without_creep(name: str, dt: float) -> None:
    reference = pt.sine(frequency=1.0, low=0.0, high=60e-6, duration=2.0)
    stage = creeping(name)
    error = []
    for one in (stage, replace(stage, creep_weights=(), creep_times=())):
        volts = one.inverse(playback="online").voltage(reference, dt)
        error.append(np.abs(one.simulate(volts, dt).x - reference.sample(dt).x).max())
    assert error[0] < 1.2 * error[1] + 1e-12
    assert error[1] < 2e-11 * (dt / 2e-4) ** 2


def test_a_session_is_the_voltage_of_the_whole() -> None:
    reference = pt.sine(frequency=1.0, low=0.0, high=60e-6, duration=0.5)
    inverse = creeping("first-order-dahl").inverse(playback="online")
    session, sampled = inverse.start(DT), reference.sample(DT)
    samples = zip(sampled.x, sampled.v, sampled.a, strict=True)
    volts = [session.step(x, velocity=v, acceleration=a) for x, v, a in samples]
    np.testing.assert_allclose(volts, inverse.voltage(reference, DT), rtol=1e-12, atol=1e-12)


def test_a_jump_of_the_reference_is_reached_in_equilibrium() -> None:
    stage = creeping("first-order-dahl")
    inside = replace(stage, creep_weights=(), creep_times=())
    volts = stage.inverse().start(DT).step(10e-6, velocity=0.0, acceleration=0.0)
    settled = 10e-6 / (1.0 + sum(WEIGHTS))
    expected = inside.inverse().start(DT).step(settled, velocity=0.0, acceleration=0.0)
    assert volts == pytest.approx(expected, rel=1e-12)


def test_creeps_in_a_closed_loop_as_it_does_under_the_same_voltage() -> None:
    # Slower than the steps of the loop.
    bare: Any = STAGES["first-order-dahl"]
    stage = replace(bare, creep_weights=(0.02, 0.04), creep_times=(0.05, 1.5))
    reference = pt.sine(frequency=1.0, low=0.0, high=50e-6, duration=2.0)
    controller = pt.Controller(dt=0.01, limits=(0.0, 75.0), feedforward=stage.inverse())
    # On the settled loop 0 um is below what 0 V gives: the command is clipped there.
    run = pt.track(stage, controller, reference, beyond_reach=True)
    dt = float(run.fine_t[1] - run.fine_t[0])
    # The voltage of an instant is that until it.
    alone = stage.simulate(run.fine_voltage[1:], dt, hold="zoh")
    assert np.abs(run.fine_displacement[:-1] - alone.x).max() < 1e-9


def test_a_loop_is_analysed_without_it() -> None:
    stage = creeping("first-order-dahl")
    inside = replace(stage, creep_weights=(), creep_times=())
    controller = pt.Controller(dt=0.02, limits=(0.0, 75.0), feedback=pt.Pid.xu_li_2010())
    assert str(pt.check_loop(stage, controller)) == str(pt.check_loop(inside, controller))


@pytest.mark.parametrize("name", SEARCHED)
def test_refuses(name: str) -> None:
    stage: Any = STAGES[name]
    with pytest.raises(pt.ShapeError, match="creep_weights has 1 entries: expected as many as"):
        replace(stage, creep_weights=[0.1])
    with pytest.raises(pt.ParameterError, match=r"creep_weights\[0\] is -0.1"):
        replace(stage, creep_weights=[-0.1], creep_times=[1.0])
    with pytest.raises(pt.ParameterError, match=r"creep_times\[1\] is 0"):
        replace(stage, creep_weights=[0.1, 0.1], creep_times=[1.0, 0.0])
    with pytest.raises(pt.ShapeError, match="8 at most"):
        replace(stage, creep_weights=[0.1] * 9, creep_times=[1.0] * 9)
