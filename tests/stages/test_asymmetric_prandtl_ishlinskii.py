"""The asymmetric Prandtl-Ishlinskii stage: its equations, its inverse, and what a fit finds."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest

import piezotrack as pt
from piezotrack.data import datasets
from piezotrack.identification import LeastSquares

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

NAME = "asymmetric-prandtl-ishlinskii"
STAGE = pt.AsymmetricPrandtlIshlinskiiStage(
    linear=0.6e-6,
    low=0.0,
    high=75.0,
    thresholds=(3.0, 8.0, 15.0, 25.0),
    weights=(0.1e-6, 0.2e-6, 0.15e-6, 0.12e-6),
    concave_thresholds=(3.0, 8.0, 15.0, 25.0),
    concave_weights=(0.04e-6, 0.0, 0.08e-6, 0.05e-6),
    convex_thresholds=(3.0, 8.0, 15.0, 25.0),
    convex_weights=(0.02e-6, 0.01e-6, 0.0, 0.0),
)
CREEPING = replace(STAGE, creep_weights=(0.004, 0.01), creep_times=(0.1, 1.0))
FAMILIES = ("", "concave_", "convex_")


def wandering(samples: int = 20000) -> Array:
    """A path with large and small loops, from 0 to 75."""
    rng = np.random.default_rng(1)
    turns = np.concatenate([[0.0], 75.0 * rng.random(200), 30.0 + 2.0 * rng.random(100), [75.0]])
    path: Array = np.interp(np.linspace(0.0, turns.size - 1.0, samples), range(turns.size), turns)
    return path


def edges(u: Array) -> list[Array]:
    """What the plays of each family follow, within the range."""
    s = u / 75.0
    return [u, 75.0 * (1.0 - (1.0 - s) ** 3), 75.0 * s**3]


def test_it_is_a_sum_of_plays_of_the_drive_and_of_functions_of_it() -> None:
    u = wandering(2000)
    expected = STAGE.linear * u
    for prefix, edge in zip(FAMILIES, edges(u), strict=True):
        settings = zip(
            getattr(STAGE, f"{prefix}thresholds"), getattr(STAGE, f"{prefix}weights"), strict=True
        )
        for r, w in settings:
            z = 0.0
            for k, value in enumerate(edge):
                z = max(value - r, min(value + r, z))
                expected[k] += w * z
    np.testing.assert_allclose(STAGE.simulate(u, 0.01).x, expected, rtol=0.0, atol=1e-18)


def test_beyond_its_range_each_function_goes_on_straight() -> None:
    # All plays move: the concave function is level above the range, the convex one rises by 3.
    x = STAGE.simulate([0.0, 75.0, 85.0], 0.01).x
    slope = STAGE.linear + sum(STAGE.weights) + 3.0 * sum(STAGE.convex_weights)
    assert x[2] - x[1] == pytest.approx(10.0 * slope, rel=1e-12)
    below = STAGE.simulate([0.0, -50.0, -60.0], 0.01).x
    slope = STAGE.linear + sum(STAGE.weights) + 3.0 * sum(STAGE.concave_weights)
    assert below[1] - below[2] == pytest.approx(10.0 * slope, rel=1e-12)


def test_without_bent_plays_it_is_the_stage_of_prandtl_and_ishlinskii() -> None:
    u = wandering(3000)
    bare = replace(
        CREEPING,
        concave_thresholds=(),
        concave_weights=(),
        convex_thresholds=(),
        convex_weights=(),
        time_constant=0.02,
    )
    plain = pt.PrandtlIshlinskiiStage(
        linear=bare.linear,
        thresholds=bare.thresholds,
        weights=bare.weights,
        creep_weights=bare.creep_weights,
        creep_times=bare.creep_times,
        time_constant=0.02,
    )
    found, expected = bare.simulate(u, 0.01).x, plain.simulate(u, 0.01).x
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-17)


def test_a_state_carries_on() -> None:
    u = wandering(3000)
    whole = CREEPING.simulate(u, 0.01)
    first = CREEPING.simulate(u[:1000], 0.01)
    # Those of the drive, of the concave and of the convex function.
    assert len(first.final.plays) == 12
    second = CREEPING.simulate(u[999:], 0.01, initial=first.final)
    np.testing.assert_allclose(second.x, whole.x[999:], rtol=0.0, atol=1e-18)


@pytest.mark.parametrize("stage", [STAGE, CREEPING], ids=["plays", "creep"])
def test_the_inverse_undoes_the_stage_along_any_path(
    stage: pt.AsymmetricPrandtlIshlinskiiStage,
) -> None:
    # Major and minor loops, then beyond the range on both sides.
    u = np.concatenate([wandering(), np.linspace(75.0, 95.0, 500), np.linspace(95.0, -30.0, 3000)])
    session = stage.inverse(playback="online").start(0.01)
    x = stage.simulate(u, 0.01).x
    back = np.array([session.step(one, velocity=0.0, acceleration=0.0) for one in x])
    # Creep is of second order where the hysteresis is not straight between samples.
    exact = stage is STAGE
    np.testing.assert_allclose(back, u, rtol=0.0, atol=75.0 * 1e-12 if exact else 1e-3)
    again = stage.simulate(back, 0.01).x
    atol = 1e-9 * float(np.ptp(x)) if exact else 1e-9
    np.testing.assert_allclose(again, x, rtol=0.0, atol=atol)


def test_weights_that_turn_back_are_refused() -> None:
    with pytest.raises(pt.ParameterError, match=r"^concave_weights\[1\] is -1e-7 m/V"):
        replace(STAGE, concave_weights=(0.0, -1e-7, 0.0, 0.0))
    with pytest.raises(pt.ParameterError, match=r"^high is 0 V: expected above low"):
        replace(STAGE, high=0.0)


def test_a_record_gives_back_the_stage_that_made_it() -> None:
    u = wandering(3000)
    log = pt.Dataset(u=u, y=STAGE.simulate(u, 1e-3).x - 4e-6, dt=1e-3)
    settings = LeastSquares(thresholds=STAGE.thresholds, creep=False, dynamics=None)
    fit = pt.identify(log, NAME, method=settings)
    assert fit.cost < 1e-12
    assert fit.offset == pytest.approx(-4e-6, abs=1e-9)
    assert (fit.model.low, fit.model.high) == (0.0, 75.0)
    for prefix in FAMILIES:
        weights = getattr(fit.model, f"{prefix}weights")
        expected = getattr(STAGE, f"{prefix}weights")
        np.testing.assert_allclose(weights, expected, rtol=0.0, atol=1e-10)


def test_a_noisy_record_is_described_to_its_noise() -> None:
    noise = 20e-9
    rng = np.random.default_rng(3)
    # The first cycle goes all along the range, which the fit takes from the drive.
    turns = np.concatenate([[1.0], np.linspace(1.0, 0.1, 12), np.linspace(0.1, 1.0, 11)])
    phase = np.linspace(0.0, 24.0, 4801)[:-1]
    u = 37.5 * (1.0 - np.interp(phase, range(24), turns) * np.cos(2.0 * np.pi * phase))
    y = STAGE.simulate(u, 5e-3).x + noise * rng.standard_normal(u.size)
    log = pt.Dataset(u=u, y=y, dt=5e-3)
    settings = LeastSquares(thresholds=STAGE.thresholds, creep=False, dynamics=None)
    found = pt.identify(log[:18.0], NAME, method=settings)
    assert found.cost == pytest.approx(noise, rel=0.05)
    assert found.score(log[18.0:]).rms < 1.1 * noise
    # No symmetric stage describes it.
    symmetric = pt.identify(log[:18.0], "maxwell-slip", method=settings)
    assert symmetric.cost > 10.0 * noise


@cache
def measured() -> pt.identification.Comparison:
    log, other = datasets.dbo_training(), datasets.dbo_tracking()
    return pt.compare(log, ["prandtl-ishlinskii", NAME], train=(3.0, 23.0), test=other[3.0:])


def test_a_measured_loop_is_wider_on_one_side() -> None:
    plain, asymmetric = measured().rows
    assert asymmetric.title == "asymmetric Prandtl-Ishlinskii"
    assert asymmetric.train.rms_percent < 0.7 * plain.train.rms_percent
    assert asymmetric.test.rms_percent < plain.test.rms_percent
    assert asymmetric.test.rms_percent <= 0.35
    # This loop is wider at its lower end: the plays of the convex function have no part.
    model = measured().fits[NAME].model
    assert sum(model.concave_weights) > 10.0 * sum(model.convex_weights)


def test_it_is_saved_and_tracks(tmp_path: Path) -> None:
    fit = measured().fits[NAME]
    loaded = pt.load(fit.save(tmp_path / "stage.json"))
    assert loaded.model == fit.model
    reference = pt.sine(frequency=1.0, low=8e-6, high=35e-6, duration=4.0)
    inverse = loaded.model.inverse(playback="online")
    loop = pt.Controller(dt=1e-3, limits=(0.0, 3.6), feedforward=inverse)
    run = pt.track(loaded.model, loop, reference)
    assert run.metrics.rms_error < 0.1e-6
