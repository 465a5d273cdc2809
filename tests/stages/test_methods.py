"""The classical integrators beside the exponential one, and lower sampling rates."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest

import piezotrack as pt

METHODS: list[Literal["exponential", "rk4", "rk45"]] = ["exponential", "rk4", "rk45"]


def slow_sine(rate: float, seconds: float) -> np.ndarray:
    t = np.arange(round(rate * seconds) + 1) / rate
    return np.asarray(37.5 * (1 - np.cos(2 * np.pi * 0.25 * t)))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("hold", ["foh", "zoh"])
def test_methods_agree(
    method: Literal["exponential", "rk4", "rk45"], hold: Literal["foh", "zoh"]
) -> None:
    stage = pt.DahlStage.xu_li_2010()
    u = slow_sine(1000.0, 1.0)
    u[300:500] += 10.0
    exact = stage.simulate(u, 1e-3, hold=hold, accuracy=1e-14)
    found = stage.simulate(u, 1e-3, hold=hold, method=method)
    np.testing.assert_allclose(found.x, exact.x, atol=1e-10, rtol=0)
    np.testing.assert_allclose(found.hysteresis, exact.hysteresis, atol=1e-5, rtol=1e-5)


def test_rk4_takes_the_steps_that_its_stability_asks_for() -> None:
    # The fastest root is -D/M nearly, and the method is stable up to 2.785 M/D = 1.96e-4 s: at
    # 500 Hz 11 steps are needed in each sample, whatever the accuracy. The exponential scheme
    # has no such bound.
    stage = pt.DahlStage.xu_li_2010()
    u, dt = slow_sine(500.0, 0.5), 2e-3
    needed = dt / (2.785 * stage.mass / stage.damping)
    assert 10.0 < needed < 11.0
    classical = stage.simulate(u, dt, method="rk4", accuracy=1e-6)
    exponential = stage.simulate(u, dt, accuracy=1e-6)
    assert classical.substeps > needed > 2 * exponential.substeps
    np.testing.assert_allclose(classical.x, exponential.x, atol=1e-6, rtol=0)


def test_unknown_method_is_named() -> None:
    with pytest.raises(pt.ParameterError, match="method is 'euler'"):
        pt.DahlStage.xu_li_2010().simulate([0.0, 1.0], 1e-3, method="euler")  # type: ignore[arg-type]


def test_decimation_keeps_slow_signals_and_takes_off_fast_ones() -> None:
    t = np.arange(20000) / 5000.0
    slow, fast = np.sin(2 * np.pi * 2.0 * t), np.sin(2 * np.pi * 1900.0 * t)
    log = pt.Dataset(u=slow + fast, y=1e-6 * slow, dt=1 / 5000.0)
    less = log.decimate(10)
    assert less.dt == pytest.approx(1 / 500.0)
    inner = slice(50, -50)
    np.testing.assert_allclose(less.u[inner], slow[::10][inner], atol=3e-4)
    np.testing.assert_allclose(less.y[inner], 1e-6 * slow[::10][inner], atol=3e-10)


def test_decimation_keeps_window_and_warm_up() -> None:
    t = np.arange(5000) / 1000.0
    log = pt.Dataset(u=np.sin(t), y=1e-6 * np.sin(t), dt=1e-3)[1.003:4.0]
    less = log.decimate(5)
    assert less.t[0] == pytest.approx(log.t[0])
    assert less.warmup == log.warmup // 5
    assert len(less) == -(-len(log) // 5)


def test_a_decimated_log_identifies_the_same_stage() -> None:
    u = slow_sine(5000.0, 4.0)
    stage = pt.DahlStage.xu_li_2010()
    noise = np.random.default_rng(1).normal(0.0, 1e-7, u.size)
    log = pt.Dataset(u=u, y=stage.simulate(u, 2e-4).x + noise, dt=2e-4)
    fit = pt.identify(
        log.decimate(25),
        "dahl",
        parameters={"mass": stage.mass, "a1": stage.a1, "a2": stage.a2, "b1": stage.b1},
        method=pt.Descents(seed=1),
    )
    assert fit.cost < 0.3e-7, "white noise falls with the root of the factor"
    assert fit.model.stiffness == pytest.approx(stage.stiffness, rel=5e-3)
    assert fit.model.damping / fit.model.stiffness == pytest.approx(0.0996470, rel=2e-3)


@pytest.mark.parametrize("factor", [0, 1, -3, 2.5, "10", None, True, 4000])
def test_bad_factors_are_named(factor: object) -> None:
    log = pt.Dataset(u=np.sin(np.arange(5000.0)), y=np.sin(np.arange(5000.0)), dt=1e-3)
    with pytest.raises(pt.ParameterError, match="factor"):
        log.decimate(factor)  # type: ignore[arg-type]
