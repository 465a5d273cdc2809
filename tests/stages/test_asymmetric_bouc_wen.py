"""The asymmetric Bouc-Wen stage against its equation, its symmetric limit and a measured log."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import piezotrack as pt
from piezotrack.data import datasets
from reference import multisine, sine

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

STAGE = pt.AsymmetricBoucWenStage(
    mass=0.1283,
    damping=1580.0,
    stiffness=19567.0,
    piezo_coefficient=1.7339e-6,
    alpha=0.3575,
    beta=0.0364,
    gamma=0.0272,
    asymmetry=0.004,
    sign_asymmetry=0.008,
)


def reference(stage: pt.AsymmetricBoucWenStage, u: Array, dt: float) -> Array:
    """Displacement from the equations as written, each interval by itself [m]."""
    s = stage
    y, x = np.zeros(3), np.zeros(u.size)

    def rhs(t: float, y: Array, start: float, rate: float) -> list[float]:
        at, v, h = y.tolist()
        drive = start + rate * t
        psi = (
            s.beta * np.sign(rate * h)
            + s.gamma
            + s.asymmetry * np.sign(h)
            + s.sign_asymmetry * np.sign(rate)
        )
        dh = s.alpha * s.piezo_coefficient * rate - abs(h) * psi * rate
        force = s.stiffness * (s.piezo_coefficient * drive - h - at) - s.damping * v
        return [v, force / s.mass, dh]

    for k in range(u.size - 1):
        rate = float(u[k + 1] - u[k]) / dt
        run = solve_ivp(
            rhs,
            (0.0, dt),
            y,
            method="LSODA",
            args=(float(u[k]), rate),
            rtol=1e-10,
            atol=[1e-15, 1e-12, 1e-16],
        )
        y = run.y[:, -1]
        x[k + 1] = y[0]
    return x


def test_against_an_independent_solver() -> None:
    dt = 2e-3
    u = multisine(300, dt, 2.0, low=-20.0, high=60.0)
    u -= u[0]
    x = STAGE.simulate(u, dt).x
    assert np.ptp(x) > 4e-5
    assert np.abs(x - reference(STAGE, u, dt)).max() < 3e-10


def test_without_asymmetries_it_is_the_symmetric_stage() -> None:
    even = dataclasses.replace(STAGE, asymmetry=0.0, sign_asymmetry=0.0)
    names = ("mass", "damping", "stiffness", "piezo_coefficient", "alpha", "beta", "gamma")
    plain = pt.BoucWenStage(**{name: getattr(STAGE, name) for name in names})
    u = multisine(2000, 1e-3, 0.5)
    assert even.simulate(u, 1e-3).x.tobytes() == plain.simulate(u, 1e-3).x.tobytes()
    assert even.inverse().voltage(
        pt.sine(frequency=1.0, low=0.0, high=5e-5, duration=2.0), 1e-3
    ) == (
        pytest.approx(
            plain.inverse().voltage(pt.sine(frequency=1.0, low=0.0, high=5e-5, duration=2.0), 1e-3),
            abs=1e-12,
        )
    )


def test_loops_close_without_point_symmetry() -> None:
    dt = 1e-3
    u = sine(20001, dt, 1.0)
    for stage, even in (
        (dataclasses.replace(STAGE, asymmetry=0.0, sign_asymmetry=0.0), True),
        (dataclasses.replace(STAGE, sign_asymmetry=0.0), False),
        (dataclasses.replace(STAGE, asymmetry=0.0), False),
    ):
        run = stage.simulate(u, dt, accuracy=1e-13)
        cycle, before = run.hysteresis[-1001:], run.hysteresis[-2001:-1000]
        assert np.abs(cycle - before).max() < 1e-9 * np.ptp(cycle)
        # Half a cycle later the symmetric loop is itself, turned about its centre.
        turned = cycle[:501] + cycle[500:]
        assert bool(np.ptp(turned) < 1e-6 * np.ptp(cycle)) is even


def test_the_number_of_steps_does_not_matter() -> None:
    u = multisine(401, 2e-3, 1.0)
    coarse = STAGE.simulate(u, 2e-3, accuracy=1e-12).x
    between = np.interp(np.arange(4 * 400 + 1) / 4, np.arange(401), u)
    fine = STAGE.simulate(between, 5e-4, accuracy=1e-12).x
    np.testing.assert_allclose(fine[::4], coarse, rtol=0, atol=3e-12)


def test_a_run_can_be_carried_on() -> None:
    u = multisine(1001, 1e-3, 0.5)
    whole = STAGE.simulate(u, 1e-3, accuracy=1e-13)
    first = STAGE.simulate(u[:500], 1e-3, accuracy=1e-13)
    second = STAGE.simulate(u[499:], 1e-3, initial=first.final, accuracy=1e-13)
    np.testing.assert_allclose(second.x, whole.x[499:], rtol=0, atol=1e-12)


def test_the_inverse_leads_the_stage_along_the_reference() -> None:
    wanted = pt.sine(frequency=0.2, low=0.0, high=110e-6, duration=10.0)
    volts = STAGE.inverse(playback="online").voltage(wanted, 2e-4)
    error = STAGE.simulate(volts, 2e-4).x - wanted.sample(2e-4).x
    assert np.abs(error).max() < 1e-9


@pytest.mark.slow
def test_identification_finds_the_parameters(tmp_path: Path) -> None:
    dt = 2e-3
    t = np.arange(4001) * dt
    u = 37.5 * (1 - np.cos(0.5 * np.pi * t)) * (0.4 + 0.6 * t / 8.0)
    u += 10.0 * np.sin(2 * np.pi * 1.3 * t) ** 2
    y = STAGE.simulate(u, dt).x + np.random.default_rng(5).normal(0.0, 20e-9, u.size)
    log = pt.Dataset(u=u, y=y, dt=dt)
    searched = ["damping", "piezo_coefficient", "alpha", "beta", "gamma"]
    searched += ["asymmetry", "sign_asymmetry"]
    known = {"mass": STAGE.mass, "stiffness": STAGE.stiffness}
    fit = pt.identify(
        log,
        "asymmetric-bouc-wen",
        parameters={**known, "sign_asymmetry": pt.Parameter()},
        method=pt.Descents(seed=2),
    )
    assert fit.cost == pytest.approx(20e-9, rel=0.05)
    for name in searched:
        assert getattr(fit.model, name) == pytest.approx(getattr(STAGE, name), rel=0.03), name
    assert pt.load(fit.save(tmp_path / "model.json")).model == fit.model
    assert "epsilon" in fit.summary()
    # One asymmetry is searched without being asked for, the other is held at 0.
    settings = pt.identify(log[:2.0], "asymmetric-bouc-wen", method=pt.Descents(seed=2))
    assert settings.parameters["asymmetry"].free
    assert not settings.parameters["sign_asymmetry"].free
    assert settings.model.sign_asymmetry == 0.0


@pytest.mark.parametrize("name", ["asymmetry", "sign_asymmetry", "mass", "beta"])
def test_refusals(name: str) -> None:
    with pytest.raises(pt.ParameterError, match=name):
        dataclasses.replace(STAGE, **{name: float("nan")})  # type: ignore[arg-type]


def test_an_inverse_needs_a_dissipative_hysteresis() -> None:
    wild = dataclasses.replace(STAGE, sign_asymmetry=0.05)
    with pytest.raises(pt.ParameterError, match=r"^sign_asymmetry is 0.05 1/V"):
        wild.inverse()


def test_on_a_measured_log() -> None:
    """Better than the symmetric one where it was fitted and after, not at other amplitudes."""
    log = datasets.dbo_training()
    other = datasets.dbo_tracking()[3.0:]
    compared = pt.compare(log, ["bouc-wen", "asymmetric-bouc-wen"], train=(3.0, 23.0), test=other)
    even, uneven = compared.rows
    assert uneven.train.rms_percent == pytest.approx(0.41, abs=0.01)
    assert uneven.train.rms_percent < 0.65 * even.train.rms_percent
    assert uneven.test.rms_percent == pytest.approx(1.30, abs=0.02)
    rest = log[23.0:]
    assert uneven.fit.score(rest).rms_percent < 0.8 * even.fit.score(rest).rms_percent
