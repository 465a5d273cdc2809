"""The Maxwell-slip stage: elements, the plays that they are, what a fit finds."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from scipy.optimize import brentq

import piezotrack as pt
from piezotrack.data import datasets
from reference import multisine

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

STAGE = pt.MaxwellSlipStage(
    piezo_coefficient=0.8e-6,
    stiffness_ratios=(0.25, 0.15, 0.1),
    slip_displacements=(3e-6, 8e-6, 20e-6),
)


def balanced(stage: pt.MaxwellSlipStage, u: Array) -> Array:
    """Displacement at which springs and elements balance the drive, voltage by voltage [m]."""
    ratios, slips = np.array(stage.stiffness_ratios), np.array(stage.slip_displacements)
    strain, x, displacements = np.zeros(ratios.size), 0.0, []

    def rest(to: float, drive: float) -> float:
        force = to + float(ratios @ np.clip(strain + to - x, -slips, slips))
        return force - stage.piezo_coefficient * drive

    for drive in u:
        there = float(
            brentq(rest, x - 1e-3, x + 1e-3, args=(float(drive),), xtol=1e-18, rtol=1e-14)
        )
        strain, x = np.clip(strain + there - x, -slips, slips), there
        displacements.append(x)
    return np.array(displacements)


def test_springs_and_elements_balance_the_drive() -> None:
    u = multisine(600, 1e-2, 1.0, low=-20.0, high=75.0)
    x = STAGE.simulate(u, 1e-2).x
    assert np.ptp(x) > 4e-5
    np.testing.assert_allclose(x, balanced(STAGE, u), rtol=0, atol=1e-16)


def test_without_elements_it_is_a_spring() -> None:
    none = pt.MaxwellSlipStage(piezo_coefficient=-2e-6, stiffness_ratios=(), slip_displacements=())
    u = np.array([0.0, 30.0, -10.0])
    np.testing.assert_allclose(none.simulate(u, 1e-2).x, -2e-6 * u, rtol=1e-15)


def test_it_is_the_stage_of_these_plays() -> None:
    """One element, on paper: threshold and weight of the play from ratio and slip."""
    gain, ratio, slip = 0.8e-6, 0.25, 3e-6
    moving: dict[str, Any] = {
        "creep_weights": (0.02,),
        "creep_times": (0.5,),
        "frequency": 200.0,
        "damping_ratio": 0.1,
    }
    single = pt.MaxwellSlipStage(
        piezo_coefficient=gain, stiffness_ratios=(ratio,), slip_displacements=(slip,), **moving
    )
    plays = pt.PrandtlIshlinskiiStage(
        linear=gain / (1 + ratio),
        thresholds=(slip * (1 + ratio) / gain,),
        weights=(gain * ratio / (1 + ratio),),
        **moving,
    )
    u = multisine(2000, 1e-3, 2.0)
    np.testing.assert_allclose(
        single.simulate(u, 1e-3).x, plays.simulate(u, 1e-3).x, rtol=0, atol=1e-16
    )


def test_samples_do_not_matter() -> None:
    moving = dataclasses.replace(STAGE, time_constant=5e-3)
    u = multisine(201, 1e-2, 1.0)
    coarse = moving.simulate(u, 1e-2).x
    fine = moving.simulate(np.interp(np.arange(1601) / 8, np.arange(201), u), 1.25e-3).x
    np.testing.assert_allclose(fine[::8], coarse, rtol=0, atol=1e-15)


def test_loops_close_and_the_work_is_lost_in_the_elements() -> None:
    """Around a large loop of an amplitude a, each element loses 4 f_i (a - r_i)."""
    t = np.arange(4001) / 1000
    u = 60.0 * np.sin(2 * np.pi * t)
    x = STAGE.simulate(u, 1e-3).x
    cycle = x[-1001:]
    np.testing.assert_allclose(cycle, x[-2001:-1000], rtol=0, atol=1e-16)
    # Of the forces over k.
    drive = STAGE.piezo_coefficient * u[-1001:]
    work = float(np.sum(0.5 * (drive[1:] + drive[:-1]) * np.diff(cycle)))
    amplitude = 0.5 * np.ptp(cycle)
    forces = STAGE.slip_forces(1.0)
    lost = sum(
        4.0 * force * (amplitude - slip)
        for force, slip in zip(forces, STAGE.slip_displacements, strict=True)
    )
    assert work == pytest.approx(lost, rel=1e-3)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_inverse_after_the_stage_is_the_identity(sign: float) -> None:
    stage = dataclasses.replace(STAGE, piezo_coefficient=sign * STAGE.piezo_coefficient)
    u = multisine(500, 1e-2, 1.0)
    x = stage.simulate(u, 1e-2).x
    session = stage.inverse().start(1e-2)
    back = [session.step(float(one), velocity=0.0, acceleration=0.0) for one in x]
    np.testing.assert_allclose(back, u, rtol=0, atol=1e-11)
    # Also from a state on.
    final = stage.simulate(u[:200], 1e-2).final
    session = stage.inverse(initial=final).start(1e-2)
    back = [session.step(float(one), velocity=0.0, acceleration=0.0) for one in x[200:]]
    np.testing.assert_allclose(back, u[200:], rtol=0, atol=1e-11)


def test_a_run_can_be_carried_on() -> None:
    u = multisine(1001, 1e-3, 0.5)
    whole = STAGE.simulate(u, 1e-3)
    first = STAGE.simulate(u[:500], 1e-3)
    second = STAGE.simulate(u[499:], 1e-3, initial=first.final)
    np.testing.assert_allclose(second.x, whole.x[499:], rtol=0, atol=1e-18)


def test_least_squares_find_the_elements(tmp_path: Path) -> None:
    """With thresholds at which they slip; forces and strains then follow."""
    rest = 1.0 + sum(STAGE.stiffness_ratios)
    volts, before, thresholds = 0.0, 0.0, []
    for ratio, slip in zip(STAGE.stiffness_ratios, STAGE.slip_displacements, strict=True):
        volts += rest * (slip - before) / STAGE.piezo_coefficient
        thresholds.append(volts)
        rest, before = rest - ratio, slip
    u = np.concatenate(
        [k * 15.0 * (1 - np.cos(2 * np.pi * np.arange(400) / 400)) for k in (1, 2, 3)]
    )
    y = STAGE.simulate(u, 5e-3).x + 5e-9 * np.random.default_rng(3).standard_normal(u.size)
    log = pt.Dataset(u=u, y=y, dt=5e-3)
    asked = pt.identification.LeastSquares(thresholds=thresholds, creep=False, dynamics=None)
    fit = pt.identify(log, "maxwell-slip", method=asked)
    assert fit.cost == pytest.approx(5e-9, rel=0.1)
    assert fit.model.piezo_coefficient == pytest.approx(STAGE.piezo_coefficient, rel=1e-3)
    np.testing.assert_allclose(fit.model.stiffness_ratios, STAGE.stiffness_ratios, rtol=0.01)
    np.testing.assert_allclose(fit.model.slip_displacements, STAGE.slip_displacements, rtol=1e-3)
    assert pt.load(fit.save(tmp_path / "model.json")).model == fit.model
    assert "k_i/k" in fit.summary()


def test_stiffnesses_and_forces_scale_with_the_spring() -> None:
    assert STAGE.stiffnesses(2e6) == pytest.approx((5e5, 3e5, 2e5))
    assert STAGE.slip_forces(2e6) == pytest.approx((1.5, 2.4, 4.0))
    with pytest.raises(pt.ParameterError, match="stiffness"):
        STAGE.slip_forces("soft")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("piezo_coefficient", 0.0, "piezo_coefficient is 0 m/V"),
        ("stiffness_ratios", (0.1, -0.2, 0.1), r"stiffness_ratios\[1\] is -0.2"),
        ("slip_displacements", (3e-6, 2e-6, 1e-6), r"slip_displacements\[1\] is"),
        ("slip_displacements", (3e-6,), "stiffness_ratios has 3 entries"),
    ],
)
def test_refusals(name: str, value: object, expected: str) -> None:
    with pytest.raises(ValueError, match=expected):
        dataclasses.replace(STAGE, **{name: value})  # type: ignore[arg-type]


def test_on_a_measured_log() -> None:
    """As Prandtl-Ishlinskii without dead zones: symmetric loops of any size."""
    log, other = datasets.dbo_training(), datasets.dbo_tracking()[3.0:]
    (row,) = pt.compare(log, ["maxwell-slip"], train=(3.0, 23.0), test=other).rows
    assert row.train.rms_percent < 0.75
    assert row.test.rms_percent < 0.8
