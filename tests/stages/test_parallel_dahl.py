"""First-order Dahl elements in parallel, in feedback on the displacement."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import piezotrack as pt

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

STAGE = pt.ParallelDahlStage(
    mass=0.1828,
    damping=50.0,
    stiffness=26065.0,
    piezo_coefficient=0.0468,
    rest_stiffness_1=8e3,
    rest_stiffness_2=6e3,
    rest_stiffness_3=4e3,
    yield_path=1.5e-6,
    path_ratio=4.0,
)


def slow_drive(n: int, dt: float) -> Array:
    """Voltage with a small loop inside a large one."""
    t = np.arange(n) * dt
    drive: Array = 37.5 * (1 - np.cos(2 * np.pi * 2.0 * t)) + 12.0 * np.sin(2 * np.pi * 14.0 * t)
    return drive


def reference(stage: pt.ParallelDahlStage, u: Array, dt: float, hold: str) -> Array:
    """Displacement by DOP853, started anew at every sample and at every reversal."""
    sigma = np.array(stage.rest_stiffnesses)
    limit = sigma * stage.yield_path * stage.path_ratio ** np.arange(3)
    state, x = np.zeros(5), [0.0]

    def turning(_t: float, y: Array, *_: float) -> float:
        return float(y[1])

    turning.terminal = True  # type: ignore[attr-defined]

    def rhs(t: float, y: Array, start: float, rate: float, sign: float) -> Array:
        force = stage.piezo_coefficient * (start + rate * t) - y[2:].sum()
        a = (force - stage.damping * y[1] - stage.stiffness * y[0]) / stage.mass
        return np.array([y[1], a, *(sigma * (1.0 - y[2:] * sign / limit) * y[1])])

    for k in range(u.size - 1):
        rate = (u[k + 1] - u[k]) / dt if hold == "foh" else 0.0
        now = 0.0
        while now < dt:
            a = rhs(now, state, u[k], rate, 1.0)[1]
            moving = state[1] if abs(state[1]) > 1e-14 else (a if abs(a) > 1e-12 else rate)
            sign = 1.0 if moving >= 0 else -1.0
            turning.direction = -sign  # type: ignore[attr-defined]
            solution = solve_ivp(
                rhs,
                (now, dt),
                state,
                method="DOP853",
                args=(u[k], rate, sign),
                rtol=1e-10,
                atol=[1e-14, 1e-12, 1e-11, 1e-11, 1e-11],
                events=turning,
            )
            state, now = solution.y[:, -1], solution.t[-1]
            if solution.status == 1:
                state[1] = 0.0
        x.append(float(state[0]))
    return np.array(x)


@pytest.mark.parametrize("hold", ["foh", "zoh"])
def test_against_an_independent_solver(hold: str) -> None:
    """Reversals of every size, with elements that slide and one that never quite does."""
    dt = 1 / 500.0
    # Above 0 from the first sample on: at rest without a force the events have no end.
    u = 1.0 + slow_drive(150, dt)
    run = STAGE.simulate(u, dt, hold=hold)  # type: ignore[arg-type]
    assert np.ptp(run.x) > 1e-4
    np.testing.assert_allclose(run.x, reference(STAGE, u, dt, hold), rtol=0, atol=1e-10)


def test_elements_with_equal_paths_are_one() -> None:
    """Whose rest stiffness and Coulomb force are the sums."""
    equal = dataclasses.replace(STAGE, path_ratio=1.0)
    joined = pt.FirstOrderDahlStage(
        mass=STAGE.mass,
        damping=STAGE.damping,
        stiffness=STAGE.stiffness,
        piezo_coefficient=STAGE.piezo_coefficient,
        rest_stiffness=sum(equal.rest_stiffnesses),
        coulomb_force=sum(equal.coulomb_forces),
    )
    u, dt = slow_drive(2000, 1e-3), 1e-3
    many, single = equal.simulate(u, dt), joined.simulate(u, dt)
    assert many.substeps == single.substeps
    np.testing.assert_allclose(many.x, single.x, rtol=0, atol=1e-17)
    np.testing.assert_allclose(many.hysteresis, single.hysteresis, rtol=0, atol=1e-14)


@pytest.mark.parametrize("others", [(2, 3), (1, 3), (1, 2)])
def test_elements_without_force_do_nothing(others: tuple[int, int]) -> None:
    """What is left is one first-order Dahl element, with the path of its place."""
    (left,) = {1, 2, 3} - {*others}
    none: dict[str, Any] = {f"rest_stiffness_{j}": 0.0 for j in others}
    alone = dataclasses.replace(STAGE, **none)
    without = pt.FirstOrderDahlStage(
        mass=STAGE.mass,
        damping=STAGE.damping,
        stiffness=STAGE.stiffness,
        piezo_coefficient=STAGE.piezo_coefficient,
        rest_stiffness=STAGE.rest_stiffnesses[left - 1],
        coulomb_force=STAGE.coulomb_forces[left - 1],
    )
    u, dt = slow_drive(500, 1e-3), 1e-3
    np.testing.assert_allclose(
        alone.simulate(u, dt).x, without.simulate(u, dt).x, rtol=0, atol=1e-16
    )


def test_loops_close_and_dissipate() -> None:
    """Cycle for cycle the same, and heat in each; the force stays within its limit."""
    t = np.arange(20 * 1000 + 1) / 1000
    u = 37.5 * (1 - np.cos(2 * np.pi * t))
    run = STAGE.simulate(u, 1e-3, accuracy=1e-13)
    cycles = run.x[:-1].reshape(20, -1)
    assert np.abs(cycles[5:] - cycles[-1]).max() < 1e-11
    assert np.abs(run.hysteresis).max() <= sum(STAGE.coulomb_forces)
    for cycle in range(20):
        part = slice(1000 * cycle, 1000 * (cycle + 1) + 1)
        x, force = run.x[part], run.hysteresis[part]
        assert float(np.sum(0.5 * (force[1:] + force[:-1]) * np.diff(x))) > 0


def test_the_force_after_a_long_path() -> None:
    """Forward and back over many paths of each element: plus and minus all Coulomb forces."""
    far = 400 * STAGE.stiffness * STAGE.yield_paths[-1] / STAGE.piezo_coefficient
    total = sum(STAGE.coulomb_forces)
    # So slow that it does not swing back.
    heavy = dataclasses.replace(STAGE, damping=50.0 * STAGE.stiffness)
    there = heavy.simulate(np.r_[0.0, np.full(100, far)], 10.0)
    assert there.hysteresis[-1] == pytest.approx(total, rel=1e-9)
    back = heavy.simulate(np.zeros(100), 10.0, initial=there.final)
    assert back.hysteresis[-1] == pytest.approx(-total, rel=1e-9)


def test_the_inverse_leads_the_stage_along_the_reference() -> None:
    """Feedforward of a stage that never moved, at 5 kHz."""
    path = pt.sine(frequency=1.0, low=0.0, high=100e-6, duration=2.0)
    volts = STAGE.inverse(playback="online").voltage(path, 2e-4)
    error = STAGE.simulate(volts, 2e-4).x - path.sample(2e-4).x
    assert np.abs(error).max() < 5e-11


def test_a_run_can_be_carried_on() -> None:
    """The forces of the elements are all that matters of the past."""
    u, dt = slow_drive(400, 2e-3), 2e-3
    whole = STAGE.simulate(u, dt, accuracy=1e-13)
    first = STAGE.simulate(u[:201], dt, accuracy=1e-13)
    second = STAGE.simulate(u[200:], dt, initial=first.final, accuracy=1e-13)
    np.testing.assert_allclose(second.x, whole.x[200:], rtol=0, atol=1e-12)


def test_identification_finds_the_motion(tmp_path: Path) -> None:
    """From a noisy record, also of another drive; the file gives the same stage."""
    dt = 1 / 500.0
    u = slow_drive(1000, dt)
    noise = 20e-9 * np.random.default_rng(5).standard_normal(u.size)
    log = pt.Dataset(u=u, y=STAGE.simulate(u, dt).x + noise, dt=dt)
    fit = pt.identify(log, "parallel-dahl", method=pt.Descents(seed=2))
    assert fit.cost == pytest.approx(20e-9, rel=0.1)
    other = 0.4 * u[::-1] + 10.0
    expected, found = STAGE.simulate(other, dt).x, fit.model.simulate(other, dt).x
    assert np.abs(found - expected).max() < 2e-3 * np.ptp(expected)
    # One element leaves the tips, which a drift could take a part of.
    method = pt.Descents(seed=2)
    single = pt.identify(log, "first-order-dahl", method=method, delay=False, drift=False)
    assert single.cost > 10 * fit.cost
    assert pt.load(fit.save(tmp_path / "friction.json")).model == fit.model
    assert "sigma3/K" in fit.summary()


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("rest_stiffness_2", -1.0, "rest_stiffness_2 is -1 N/m"),
        ("yield_path", 0.0, "yield_path is 0 m: expected a finite number above 0"),
        ("path_ratio", 0.5, "path_ratio is 0.5: expected a number from 1 to 1000"),
        ("piezo_coefficient", 0.0, "piezo_coefficient is 0 N/V"),
        ("mass", float("nan"), "mass"),
    ],
)
def test_refusals(name: str, value: float, expected: str) -> None:
    """By name, with the value and the unit."""
    with pytest.raises(pt.ParameterError, match=expected):
        dataclasses.replace(STAGE, **{name: value})  # type: ignore[arg-type]
