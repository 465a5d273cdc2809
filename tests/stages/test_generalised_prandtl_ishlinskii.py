"""The generalised Prandtl-Ishlinskii stage: its equations, its inverse, and what a fit finds."""

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

NAME = "generalised-prandtl-ishlinskii"
# One envelope: 0 V at 0 V, 75 V at 75 V as a fit has it, its slope falling by half in between.
STAGE = pt.GeneralisedPrandtlIshlinskiiStage(
    linear=0.9e-6,
    thresholds=(3.0, 8.0, 15.0, 25.0),
    weights=(0.1e-6, 0.2e-6, 0.15e-6, 0.12e-6),
    scale=75.0 / np.tanh(0.9),
    slope=0.012,
    shift=0.0,
    level=0.0,
)
# The envelope of a falling drive above the other one.
WIDE = replace(STAGE, falling_scale=98.0, falling_slope=0.0125, falling_level=4.0)
CREEPING = replace(STAGE, creep_weights=(0.004, 0.01), creep_times=(0.1, 1.0))


def wandering(samples: int = 20000) -> Array:
    """A path with large and small loops, from 0 to 75."""
    rng = np.random.default_rng(1)
    turns = np.concatenate([[0.0], 75.0 * rng.random(200), 30.0 + 2.0 * rng.random(100)])
    path: Array = np.interp(np.linspace(0.0, turns.size - 1.0, samples), range(turns.size), turns)
    return path


def transcribed(stage: pt.GeneralisedPrandtlIshlinskiiStage, u: Array) -> Array:
    """What Al Janaideh, Rakheja and Su write, play by play."""
    rising = (stage.scale, stage.slope, stage.shift, stage.level)
    others = (
        stage.falling_scale,
        stage.falling_slope,
        stage.falling_shift,
        stage.falling_level,
    )
    falling = [one if other is None else other for one, other in zip(rising, others, strict=True)]

    def play(r: float) -> Array:
        z = 0.0
        out: Array = np.empty(u.size + 1)
        for k, volts in enumerate([0.0, *u]):
            up, down = (c0 * np.tanh(c1 * volts + c2) + c3 for c0, c1, c2, c3 in (rising, falling))
            out[k] = z = max(up - r, min(down + r, z))
        out -= out[0]
        return out[1:]

    h = stage.linear * play(0.0)
    for r, w in zip(stage.thresholds, stage.weights, strict=True):
        h = h + w * play(r)
    return h


@pytest.mark.parametrize("stage", [STAGE, WIDE], ids=["one envelope", "two"])
def test_it_is_the_sum_that_the_paper_has(stage: pt.GeneralisedPrandtlIshlinskiiStage) -> None:
    u = wandering(2000)
    expected = transcribed(stage, u)
    np.testing.assert_allclose(stage.simulate(u, 0.01).x, expected, rtol=0.0, atol=1e-18)


def test_a_straight_envelope_is_a_prandtl_ishlinskii_stage() -> None:
    straight = replace(STAGE, scale=1e6, slope=1e-6)
    plain = pt.PrandtlIshlinskiiStage(
        linear=STAGE.linear, thresholds=STAGE.thresholds, weights=STAGE.weights
    )
    u = wandering(2000)
    error = straight.simulate(u, 0.01).x - plain.simulate(u, 0.01).x
    assert np.abs(error).max() < 1e-12


def test_a_state_carries_on() -> None:
    u = wandering(3000)
    whole = CREEPING.simulate(u, 0.01)
    first = CREEPING.simulate(u[:1000], 0.01)
    assert len(first.final.plays) == 1 + len(STAGE.thresholds)
    second = CREEPING.simulate(u[999:], 0.01, initial=first.final)
    np.testing.assert_allclose(second.x, whole.x[999:], rtol=0.0, atol=1e-18)


@pytest.mark.parametrize("stage", [STAGE, CREEPING], ids=["plays", "creep"])
def test_the_inverse_undoes_the_stage_along_any_path(
    stage: pt.GeneralisedPrandtlIshlinskiiStage,
) -> None:
    u = wandering()
    session = stage.inverse(playback="online").start(0.01)
    x = stage.simulate(u, 0.01).x
    back = np.array([session.step(one, velocity=0.0, acceleration=0.0) for one in x])
    # Creep is of second order where the hysteresis is not straight between samples.
    atol = 75.0 * 1e-12 if stage is STAGE else 1e-4
    np.testing.assert_allclose(back, u, rtol=0.0, atol=atol)


def test_between_two_envelopes_the_stage_follows_its_inverse() -> None:
    reference = pt.sine(frequency=1.0, low=0.0, high=60e-6, duration=3.0)
    volts = WIDE.inverse(playback="online").voltage(reference, 1e-3)
    error = WIDE.simulate(volts, 1e-3).x - reference.sample(1e-3).x
    assert np.abs(error).max() < 1e-17
    # It jumps over where only the drive moves.
    assert np.abs(np.diff(volts)).max() > 20 * np.median(np.abs(np.diff(volts)))


def test_beyond_the_envelopes_there_is_no_drive() -> None:
    session = STAGE.inverse(playback="online").start(0.01)
    before = session.step(40e-6, velocity=0.0, acceleration=0.0)
    assert np.isnan(session.step(1e-3, velocity=0.0, acceleration=0.0))
    assert session.step(40e-6, velocity=0.0, acceleration=0.0) == before
    reference = pt.sine(frequency=1.0, low=0.0, high=300e-6, duration=2.0)
    with pytest.raises(pt.NumericalError, match="no voltage"):
        STAGE.inverse().voltage(reference, 1e-3)


def test_a_record_gives_back_the_stage_that_made_it() -> None:
    phase = np.linspace(0.0, 6.0, 1500)
    fall = 1.0 - 0.75 * np.clip(phase - 2.0, 0.0, None) / 4.0
    u = 37.5 * (1.0 - fall * np.cos(2.0 * np.pi * phase))
    log = pt.Dataset(u=u, y=STAGE.simulate(u, 1e-3).x - 4e-6, dt=1e-3)
    settings = LeastSquares(thresholds=STAGE.thresholds, dynamics=None)
    fit = pt.identify(log, NAME, method=settings)
    assert fit.cost < 5e-9
    assert fit.offset == pytest.approx(-4e-6, abs=1e-8)
    # Linear, four weights, slope, shift, two shares of the creep and the offset.
    assert fit.free_count == 10
    again = np.linspace(75.0, 0.0, 300)
    moved = fit.model.simulate(again, 1e-3).x - STAGE.simulate(again, 1e-3).x
    assert np.abs(moved).max() < 5e-8


def test_dead_zones_are_refused() -> None:
    with pytest.raises(pt.ParameterError, match="no dead zones"):
        pt.identify(
            pt.Dataset(u=wandering(500), y=STAGE.simulate(wandering(500), 0.01).x, dt=0.01),
            NAME,
            method=LeastSquares(dead_zones=2),
        )


@cache
def measured() -> pt.identification.Comparison:
    log, other = datasets.dbo_training(), datasets.dbo_tracking()
    return pt.compare(log, ["prandtl-ishlinskii", NAME], train=(3.0, 23.0), test=other[3.0:])


def test_it_has_a_row_beside_the_others_on_a_measured_log() -> None:
    plain, general = measured().rows
    assert general.title == "generalised Prandtl-Ishlinskii"
    # Its one envelope does nearly what two dead zones do, which are placed by the fit and bend the
    # loop where it does.
    assert general.train.rms_percent == pytest.approx(plain.train.rms_percent, rel=0.1)
    assert plain.test.rms_percent < general.test.rms_percent < 0.6
    assert general.title in measured().summary()


def test_a_model_file_and_a_controller_take_it_as_any_stage(tmp_path: Path) -> None:
    fit = measured().fits[NAME]
    loaded = pt.load(fit.save(tmp_path / "stage.json"))
    assert loaded.model == fit.model
    reference = pt.sine(frequency=1.0, low=5e-6, high=35e-6, duration=4.0)
    # Along the whole run: a table of one period does not know creep that goes on.
    inverse = loaded.model.inverse(playback="online")
    loop = pt.Controller(dt=1e-3, limits=(0.0, 3.6), feedforward=inverse)
    run = pt.track(loaded.model, loop, reference)
    assert run.metrics.rms_error < 0.1e-6
