"""Gain and width of the slow loop, against stages whose loop is known."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import all_stages
import piezotrack as pt

DAHL = pt.FirstOrderDahlStage(
    mass=0.18, damping=100.0, stiffness=2.6e4, piezo_coefficient=0.0468,
    rest_stiffness=9e3, coulomb_force=0.15,
)  # fmt: skip


def test_plays_add_their_weights_and_twice_their_thresholds() -> None:
    stage = pt.PrandtlIshlinskiiStage(
        linear=0.9e-6, thresholds=(3.0, 8.0), weights=(0.1e-6, 0.2e-6),
        creep_weights=(0.05,), creep_times=(10.0,), time_constant=0.01,
    )  # fmt: skip
    loop = pt.stages.SlowLoop.of(stage, 10.0, 70.0)
    # Each play follows the drive but for twice its threshold.
    moved = 0.9e-6 * 60.0 + 0.1e-6 * (60.0 - 6.0) + 0.2e-6 * (60.0 - 16.0)
    assert loop.travel == pytest.approx(moved, rel=1e-12)
    assert loop.gain == pytest.approx(moved / 60.0, rel=1e-12)
    assert loop.width == pytest.approx(0.1e-6 * 6.0 + 0.2e-6 * 16.0, rel=1e-12)
    assert loop.width_percent == pytest.approx(100.0 * loop.width / loop.travel)


def test_dahl_friction_holds_by_twice_its_force() -> None:
    """On either branch the friction has come to its limit: 2 Fc / K is between them."""
    loop = pt.stages.SlowLoop.of(DAHL, 0.0, 150.0)
    assert loop.width == pytest.approx(2.0 * 0.15 / 2.6e4, rel=0.01)
    # At both ends the friction is that of the limit, upwards and downwards.
    free = 0.0468 / 2.6e4 * 150.0
    assert loop.travel == pytest.approx(free - 2.0 * 0.15 / 2.6e4, rel=0.01)


@pytest.mark.parametrize("factor", [-1.0, 0.5])
def test_a_stage_that_falls_has_a_negative_gain_and_the_same_width(factor: float) -> None:
    stage = replace(DAHL, piezo_coefficient=0.0468 * factor)
    there = pt.stages.SlowLoop.of(stage, 0.0, 75.0)
    assert np.sign(there.gain) == np.sign(factor)
    assert there.width > 0.0


@pytest.mark.parametrize("model", sorted(all_stages.STAGES))
def test_the_loop_is_that_of_a_slow_simulation(model: str) -> None:
    changes: dict[str, Any] = {"b0": 0.0} if model == "dahl" else {}
    any_stage: Any = all_stages.STAGES[model]
    stage = replace(any_stage, creep_weights=(), creep_times=(), **changes)
    high = 7.5 if stage.info.drive_unit == "N" else 75.0
    loop = pt.stages.SlowLoop.of(stage, 0.0, high)
    u = 0.5 * high * (1.0 - np.cos(np.linspace(0.0, 4.0 * np.pi, 40001)))
    x = stage.simulate(u, 0.05).x
    x = x[20000:]
    branches = np.interp(u[20000:30001], u[:-10002:-1], x[:-10002:-1])
    travel = x[10000] - x[0]
    assert loop.travel == pytest.approx(travel, abs=1e-3 * abs(travel))
    width = np.abs(branches - x[:10001]).max()
    assert loop.width == pytest.approx(width, rel=0.03, abs=2e-4 * abs(travel))


def test_a_model_has_the_loop_of_its_range() -> None:
    t = np.arange(2000) * 1e-3
    u = 40.0 - 30.0 * np.cos(2.0 * np.pi * t)
    stage = pt.PrandtlIshlinskiiStage(linear=1e-6, thresholds=(10.0,), weights=(0.5e-6,))
    data = pt.Dataset(u=u, y=stage.simulate(u, 1e-3).x, dt=1e-3)
    fit = pt.identify(data, "prandtl-ishlinskii", method=pt.LeastSquares(count=6), progress=False)
    assert fit.slow_loop is not None
    assert fit.slow_loop.low == pytest.approx(10.0, abs=1e-3)
    assert fit.slow_loop.high == pytest.approx(70.0, abs=1e-3)
    assert fit.slow_loop.gain == pytest.approx(1e-6 + 0.5e-6 * 40.0 / 60.0, rel=2e-3)
    assert fit.slow_loop.width == pytest.approx(10e-6, rel=0.02)
    nothing = pt.identification.IdentifiedModel(
        model=stage, offset=0.0, offset_fitted=False, stroke=1e-4
    )
    assert nothing.slow_loop is None
