"""The polynomial Prandtl-Ishlinskii stage: its equations, its inverse, and what a fit finds."""

from __future__ import annotations

from dataclasses import replace
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

NAME = "polynomial-prandtl-ishlinskii"
STAGE = pt.PolynomialPrandtlIshlinskiiStage(
    a1=1.1e-6,
    a2=3e-9,
    a3=-6e-11,
    low=0.0,
    high=75.0,
    thresholds=(3.0, 8.0, 15.0, 25.0),
    weights=(0.1e-6, 0.2e-6, 0.15e-6, 0.12e-6),
)
CREEPING = replace(STAGE, creep_weights=(0.004, 0.01), creep_times=(0.1, 1.0))


def wandering(samples: int = 20000) -> Array:
    """A path with large and small loops, from 0 to 75."""
    rng = np.random.default_rng(1)
    turns = np.concatenate([[0.0], 75.0 * rng.random(200), 30.0 + 2.0 * rng.random(100), [75.0]])
    path: Array = np.interp(np.linspace(0.0, turns.size - 1.0, samples), range(turns.size), turns)
    return path


def test_it_is_a_polynomial_and_a_sum_of_plays() -> None:
    u = wandering(2000)
    expected = STAGE.a1 * u + STAGE.a2 * u**2 + STAGE.a3 * u**3
    for r, w in zip(STAGE.thresholds, STAGE.weights, strict=True):
        z = 0.0
        for k, volts in enumerate(u):
            z = max(volts - r, min(volts + r, z))
            expected[k] += w * z
    np.testing.assert_allclose(STAGE.simulate(u, 0.01).x, expected, rtol=0.0, atol=1e-18)


def test_beyond_its_range_the_polynomial_goes_on_straight() -> None:
    x = STAGE.simulate([0.0, 75.0, 85.0], 0.01).x
    slope = STAGE.a1 + 150.0 * STAGE.a2 + 3.0 * 75.0**2 * STAGE.a3 + sum(STAGE.weights)
    assert x[2] - x[1] == pytest.approx(10.0 * slope, rel=1e-12)


def test_a_state_carries_on() -> None:
    u = wandering(3000)
    whole = CREEPING.simulate(u, 0.01)
    first = CREEPING.simulate(u[:1000], 0.01)
    assert len(first.final.plays) == len(STAGE.thresholds)
    second = CREEPING.simulate(u[999:], 0.01, initial=first.final)
    np.testing.assert_allclose(second.x, whole.x[999:], rtol=0.0, atol=1e-18)


@pytest.mark.parametrize("stage", [STAGE, CREEPING], ids=["plays", "creep"])
def test_the_inverse_undoes_the_stage_along_any_path(
    stage: pt.PolynomialPrandtlIshlinskiiStage,
) -> None:
    u = wandering()
    session = stage.inverse(playback="online").start(0.01)
    x = stage.simulate(u, 0.01).x
    back = np.array([session.step(one, velocity=0.0, acceleration=0.0) for one in x])
    # Creep is of second order where the hysteresis is not straight between samples.
    atol = 75.0 * 1e-12 if stage is STAGE else 1e-4
    np.testing.assert_allclose(back, u, rtol=0.0, atol=atol)


def test_a_polynomial_that_turns_back_is_refused() -> None:
    with pytest.raises(pt.ParameterError, match=r"^a1 is with a2 and a3"):
        replace(STAGE, a3=-1e-9)
    with pytest.raises(pt.ParameterError, match=r"^weights\[1\] is -1e-7 m/V"):
        replace(STAGE, weights=(0.0, -1e-7, 0.0, 0.0))


def test_a_record_gives_back_the_stage_that_made_it() -> None:
    u = wandering(3000)
    log = pt.Dataset(u=u, y=STAGE.simulate(u, 1e-3).x - 4e-6, dt=1e-3)
    settings = LeastSquares(thresholds=STAGE.thresholds, creep=False, dynamics=None)
    fit = pt.identify(log, NAME, method=settings)
    assert fit.cost < 1e-12
    assert fit.offset == pytest.approx(-4e-6, abs=1e-9)
    for name in ("a1", "a2", "a3", "low", "high"):
        expected = getattr(STAGE, name)
        assert getattr(fit.model, name) == pytest.approx(expected, rel=1e-3, abs=1e-15)
    np.testing.assert_allclose(fit.model.weights, STAGE.weights, rtol=0.0, atol=1e-10)


def test_it_has_a_row_beside_the_others_on_a_measured_log(tmp_path: Path) -> None:
    log, other = datasets.dbo_training(), datasets.dbo_tracking()
    compared = pt.compare(log, ["prandtl-ishlinskii", NAME], train=(3.0, 23.0), test=other[3.0:])
    plain, bent = compared.rows
    assert bent.title == "polynomial Prandtl-Ishlinskii"
    # The polynomial bends all of the loop, two dead zones the part where they are placed.
    assert plain.train.rms_percent < bent.train.rms_percent < 1.5 * plain.train.rms_percent
    assert bent.test.rms_percent < 1.0
    fit = compared.fits[NAME]
    loaded = pt.load(fit.save(tmp_path / "stage.json"))
    assert loaded.model == fit.model
    reference = pt.sine(frequency=1.0, low=5e-6, high=35e-6, duration=4.0)
    inverse = loaded.model.inverse(playback="online")
    loop = pt.Controller(dt=1e-3, limits=(0.0, 3.6), feedforward=inverse)
    run = pt.track(loaded.model, loop, reference)
    assert run.metrics.rms_error < 0.1e-6
