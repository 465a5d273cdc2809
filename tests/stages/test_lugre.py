"""The LuGre stage against stiff solvers, its limit and its inverse."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Literal

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import piezotrack as pt
from piezotrack.data import datasets

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

STAGE = pt.LuGreStage(
    mass=0.1828,
    damping=50.0,
    stiffness=26065.0,
    piezo_coefficient=0.0468,
    rest_stiffness=2e4,
    micro_damping=20.0,
    coulomb_force=0.1,
    static_ratio=2.0,
    stribeck_velocity=1e-3,
    viscous_friction=5.0,
)
# Far from any resonance, as a search has it where a record shows no mass.
LIGHT = dataclasses.replace(STAGE, mass=1e-5, damping=150.0, viscous_friction=0.0)


def drive(n: int, dt: float) -> Array:
    """Voltage with small loops inside a large one."""
    t = np.arange(n) * dt
    u: Array = 37.5 * (1 - np.cos(2 * np.pi * 2.0 * t)) + 12.0 * np.sin(2 * np.pi * 14.0 * t)
    return u


def reference(stage: pt.LuGreStage, u: Array, dt: float, hold: str) -> tuple[Array, Array]:
    """Displacement and friction force by Radau, each interval by itself, up to reversals."""
    s = stage

    def force(v: float, z: float) -> tuple[float, float]:
        g = s.coulomb_force + (s.static_force - s.coulomb_force) * np.exp(
            -((v / s.stribeck_velocity) ** 2)
        )
        rate = v - s.rest_stiffness * abs(v) * z / g
        friction = s.rest_stiffness * z + s.micro_damping * rate + s.viscous_friction * v
        return float(friction), float(rate)

    def rhs(t: float, y: Array, start: float, slope: float) -> list[float]:
        x, v, z = y.tolist()
        friction, rate = force(v, z)
        total = s.piezo_coefficient * (start + slope * t) - friction
        return [v, (total - s.damping * v - s.stiffness * x) / s.mass, rate]

    def turning(_t: float, y: Array, *_: float) -> float:
        return float(y[1])

    turning.terminal = True  # type: ignore[attr-defined]
    y, x, forces = np.zeros(3), [0.0], [0.0]
    for k in range(u.size - 1):
        slope = (u[k + 1] - u[k]) / dt if hold == "foh" else 0.0
        now = 0.0
        while now < dt:
            moving = y[1] if y[1] != 0.0 else rhs(now, y, u[k], slope)[1]
            turning.direction = -np.sign(moving)  # type: ignore[attr-defined]
            run = solve_ivp(
                rhs,
                (now, dt),
                y,
                method="Radau",
                args=(float(u[k]), slope),
                events=turning,
                rtol=1e-10,
                atol=[1e-15, 1e-13, 1e-15],
            )
            y, now = run.y[:, -1], run.t[-1]
            if run.status == 1:
                y[1] = 0.0
        x.append(float(y[0]))
        forces.append(force(float(y[1]), float(y[2]))[0])
    return np.array(x), np.array(forces)


@pytest.mark.slow
@pytest.mark.parametrize("hold", ["foh", "zoh"])
@pytest.mark.parametrize("stage", [STAGE, LIGHT], ids=["heavy", "light"])
def test_against_a_stiff_solver(stage: pt.LuGreStage, hold: Literal["foh", "zoh"]) -> None:
    dt = 1 / 500.0
    # Above 0 from the first sample on, so that the first leg has a direction.
    u = 1.0 + drive(100, dt)
    run = stage.simulate(u, dt, hold=hold)
    x, force = reference(stage, u, dt, hold)
    assert np.ptp(x) > 1e-4
    np.testing.assert_allclose(run.x, x, rtol=0, atol=2e-10)
    np.testing.assert_allclose(run.hysteresis[1:], force[1:], rtol=0, atol=1e-4)


def test_at_one_force_it_is_first_order_dahl_friction() -> None:
    names = ("mass", "damping", "stiffness", "piezo_coefficient", "rest_stiffness", "coulomb_force")
    dahl = pt.FirstOrderDahlStage(**{name: getattr(STAGE, name) for name in names})
    same = dataclasses.replace(STAGE, static_ratio=1.0, micro_damping=0.0, viscous_friction=0.0)
    u, dt = drive(1000, 1e-3), 1e-3
    found, expected = same.simulate(u, dt, accuracy=1e-12), dahl.simulate(u, dt, accuracy=1e-12)
    np.testing.assert_allclose(found.x, expected.x, rtol=0, atol=3e-12)
    np.testing.assert_allclose(found.hysteresis, expected.hysteresis, rtol=0, atol=1e-6)


def test_the_force_of_sliding_falls_with_the_speed() -> None:
    """Along a ramp of the voltage, at steady speed: g of that speed."""
    soft = dataclasses.replace(STAGE, damping=500.0, viscous_friction=0.0)
    for speed in (1e-5, 5e-4, 5e-3):
        t = np.linspace(0.0, max(1.0, 300e-6 / speed), 4001)
        u = soft.stiffness / soft.piezo_coefficient * speed * t
        run = soft.simulate(u, float(t[1]))
        assert run.v[-1] == pytest.approx(speed, rel=1e-6)
        expected = 0.1 + 0.1 * np.exp(-((speed / 1e-3) ** 2))
        assert run.hysteresis[-1] == pytest.approx(expected, rel=1e-6)


def test_the_number_of_steps_does_not_matter() -> None:
    u = drive(201, 4e-3)
    coarse = STAGE.simulate(u, 4e-3, accuracy=1e-12).x
    between = np.interp(np.arange(8 * 200 + 1) / 8, np.arange(201), u)
    fine = STAGE.simulate(between, 5e-4, accuracy=1e-12).x
    np.testing.assert_allclose(fine[::8], coarse, rtol=0, atol=3e-12)


def test_a_run_can_be_carried_on() -> None:
    u, dt = drive(400, 2e-3), 2e-3
    whole = STAGE.simulate(u, dt, accuracy=1e-13)
    first = STAGE.simulate(u[:201], dt, accuracy=1e-13)
    second = STAGE.simulate(u[200:], dt, initial=first.final, accuracy=1e-13)
    np.testing.assert_allclose(second.x, whole.x[200:], rtol=0, atol=1e-12)


def test_the_inverse_leads_the_stage_along_the_reference() -> None:
    path = pt.sine(frequency=2.0, low=0.0, high=100e-6, duration=2.0)
    volts = STAGE.inverse(playback="online").voltage(path, 2e-4)
    error = STAGE.simulate(volts, 2e-4).x - path.sample(2e-4).x
    assert np.abs(error).max() < 1e-9


def test_an_equilibrium_is_that_of_a_slow_drive() -> None:
    there = STAGE.equilibrium([60.0, 20.0])
    slow = np.r_[np.linspace(0.0, 60.0, 3001), np.linspace(60.0, 20.0, 2001), np.full(1000, 20.0)]
    x = STAGE.simulate(slow, 0.2).x[-1]
    assert there.x == pytest.approx(x, abs=2e-9)


@pytest.mark.slow
def test_identification_finds_the_motion(tmp_path: Path) -> None:
    dt = 2e-3
    t = np.arange(1500) * dt
    # Slow and fast loops: one rate would not tell the forces of sliding apart.
    u = 37.5 * (1 - np.cos(2 * np.pi * (0.5 * t + 2.0 * t**2)))
    y = STAGE.simulate(u, dt).x + 10e-9 * np.random.default_rng(5).standard_normal(u.size)
    log = pt.Dataset(u=u, y=y, dt=dt)
    fit = pt.identify(
        log,
        "lugre",
        parameters={
            "mass": STAGE.mass,
            "stiffness": STAGE.stiffness,
            "viscous_friction": 5.0,
            "micro_damping": pt.Parameter(),
            "static_ratio": pt.Parameter(),
            "stribeck_velocity": pt.Parameter(),
        },
        method=pt.Descents(seed=2),
    )
    assert fit.cost == pytest.approx(10e-9, rel=0.1)
    for name in ("piezo_coefficient", "rest_stiffness", "static_ratio", "coulomb_force"):
        assert getattr(fit.model, name) == pytest.approx(getattr(STAGE, name), rel=0.05), name
    assert fit.model.stribeck_velocity == pytest.approx(STAGE.stribeck_velocity, rel=0.2)
    assert pt.load(fit.save(tmp_path / "friction.json")).model == fit.model
    assert "Fs/Fc" in fit.summary()


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("rest_stiffness", 0.0, "rest_stiffness is 0 N/m: expected a finite number above 0"),
        ("micro_damping", -1.0, "micro_damping is -1 N s/m"),
        ("micro_damping", 1e9, "micro_damping is 1000000000 N s/m: expected"),
        ("stribeck_velocity", 0.0, "stribeck_velocity is 0 m/s"),
        ("static_ratio", float("nan"), "static_ratio"),
        ("viscous_friction", -1.0, "viscous_friction is -1 N s/m"),
    ],
)
def test_refusals(name: str, value: float, expected: str) -> None:
    with pytest.raises(pt.ParameterError, match=expected):
        dataclasses.replace(STAGE, **{name: value})  # type: ignore[arg-type]


def test_on_a_measured_log() -> None:
    """Of one rate, so that the speed does not matter: as first-order Dahl."""
    log, other = datasets.dbo_training(), datasets.dbo_tracking()[3.0:]
    names = ["first-order-dahl", "lugre"]
    dahl, lugre = pt.compare(log, names, train=(3.0, 23.0), test=other).rows
    # What depends on the speed is held.
    assert lugre.parameters == dahl.parameters == 5
    assert isinstance(lugre.fit.model, pt.LuGreStage)
    assert (lugre.fit.model.micro_damping, lugre.fit.model.static_ratio) == (0.0, 1.0)
    assert lugre.train.rms_percent == pytest.approx(dahl.train.rms_percent, abs=0.005)
    assert lugre.test.rms_percent == pytest.approx(dahl.test.rms_percent, abs=0.01)
