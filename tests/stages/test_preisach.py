"""The Preisach stage: its equations, its inverse, and what a fit finds."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
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

STAGE = pt.PreisachStage(
    linear=0.4e-6,
    levels=(-8.0, 0.0, 20.0, 40.0, 80.0),
    masses=tuple(1e-6 * mass for mass in (2.0, 0.5, 6.0, 0.0, 3.0, 7.0, 0.2, 2.0, 4.0, 15.0)),
)
CREEPING = replace(STAGE, creep_weights=(0.004, 0.01), creep_times=(0.1, 1.0))
SETTINGS = LeastSquares(levels=STAGE.levels, creep=False, dynamics=None)


def wandering(samples: int = 20000) -> Array:
    """A path with large and small loops, from 0 to 75."""
    rng = np.random.default_rng(1)
    turns = np.concatenate([[0.0], 75.0 * rng.random(200), 30.0 + 2.0 * rng.random(100)])
    path: Array = np.interp(np.linspace(0.0, turns.size - 1.0, samples), range(turns.size), turns)
    return path


def relays(u: Array, steps: int = 40) -> Array:
    """What comes out of many relays after a visit to -8 V, where all of them are off."""
    levels = np.array(STAGE.levels)
    shares = (np.arange(steps) + 0.5) / steps
    up, down, mass = [], [], []
    masses = iter(STAGE.masses)
    for i, (low, high) in enumerate(pairwise(levels)):
        for j, (under, over) in enumerate(pairwise(levels[: i + 2])):
            rises, falls = low + shares * (high - low), under + shares * (over - under)
            pairs = (rises, falls) if i == j else [one.ravel() for one in np.meshgrid(rises, falls)]
            up.append(pairs[0])
            down.append(pairs[1])
            mass.append(np.full(pairs[0].size, next(masses) / pairs[0].size))
    up_at, down_at, all_masses = (np.concatenate(one) for one in (up, down, mass))
    on = np.zeros(up_at.size, dtype=bool)
    out: Array = np.empty(u.size)
    for k, volts in enumerate(u):
        on |= volts >= up_at
        on &= ~((volts <= down_at) & (volts < up_at))
        out[k] = all_masses[on].sum() + STAGE.linear * volts
    return out


def test_it_is_a_plane_of_relays() -> None:
    u = np.concatenate([[-8.0], wandering(1500)])
    x = STAGE.simulate(u, 0.01).x
    expected = relays(u)
    error = (x - x[0]) - (expected - expected[0])
    # The relays of the finest cells are half a volt apart.
    assert np.abs(error).max() < 0.3e-6
    assert np.sqrt(np.mean(error**2)) < 0.1e-6


def test_a_state_carries_on() -> None:
    k = np.arange(1000)
    dying = 40.0 + 30.0 * np.exp(-k / 400.0) * np.cos(k / 20.0)
    u = np.concatenate([dying, wandering(2000)])
    whole = CREEPING.simulate(u, 0.01)
    first = CREEPING.simulate(u[:1000], 0.01)
    remembered = first.final.reversals
    spans = np.abs(np.diff(remembered))
    assert len(remembered) > 10
    assert np.all(np.diff(spans) <= 0.0)
    second = CREEPING.simulate(u[999:], 0.01, initial=first.final)
    np.testing.assert_allclose(second.x, whole.x[999:], rtol=0.0, atol=1e-18)


def test_reversals_that_cannot_be_are_refused() -> None:
    final = STAGE.simulate([0.0, 40.0, 20.0], 0.01).final
    with pytest.raises(pt.ShapeError, match="maxima and minima in turn, from -8 V to 80 V"):
        STAGE.simulate([20.0, 30.0], 0.01, initial=replace(final, reversals=(40.0, 50.0)))


@pytest.mark.parametrize("stage", [STAGE, CREEPING], ids=["relays", "creep"])
def test_the_inverse_undoes_the_stage_along_any_path(stage: pt.PreisachStage) -> None:
    u = wandering()
    session = stage.inverse(playback="online").start(0.01)
    x = stage.simulate(u, 0.01).x
    back = np.array([session.step(one, velocity=0.0, acceleration=0.0) for one in x])
    # Creep is of second order where the hysteresis is not straight between samples.
    atol = 75.0 * 1e-12 if stage is STAGE else 1e-3
    np.testing.assert_allclose(back, u, rtol=0.0, atol=atol)


def test_a_record_gives_back_the_stage_that_made_it() -> None:
    u = wandering(3000)
    log = pt.Dataset(u=u, y=STAGE.simulate(u, 1e-3).x - 4e-6, dt=1e-3)
    fit = pt.identify(log, "preisach", method=SETTINGS)
    # Neighbouring masses are drawn together by a trace.
    assert fit.cost < 1e-10
    assert fit.offset == pytest.approx(-4e-6, abs=1e-9)
    again = np.concatenate([np.linspace(75.0, 10.0, 300), np.linspace(10.0, 40.0, 300)])
    moved = fit.model.simulate(again, 1e-3).x - STAGE.simulate(again, 1e-3).x
    assert np.abs(moved).max() < 5e-9


def test_a_noisy_record_is_explained_to_the_noise() -> None:
    u = wandering(3000)
    noise = 20e-9 * np.random.default_rng(2).standard_normal(u.size)
    log = pt.Dataset(u=u, y=STAGE.simulate(u, 1e-3).x + noise, dt=1e-3)
    found = pt.identify(log, "preisach", method=SETTINGS)
    assert found.cost == pytest.approx(20e-9, rel=0.03)


def test_plays_are_explained_as_finely_as_the_cells_are() -> None:
    plays = pt.PrandtlIshlinskiiStage(
        linear=0.9e-6, thresholds=(3.0, 8.0, 15.0, 25.0), weights=(1e-7, 2e-7, 1.5e-7, 1.2e-7)
    )
    # A first rise switches relays on that a drive above 0 V never switches off again.
    u = np.concatenate([np.linspace(0.0, 75.0, 200), wandering(3000)])
    log = pt.Dataset(u=u, y=plays.simulate(u, 1e-3).x, dt=1e-3)[0.2:]
    costs = [
        pt.identify(
            log, "preisach", method=LeastSquares(count=count, creep=False, dynamics=None)
        ).cost
        for count in (3, 6, 12)
    ]
    assert costs[1] < 0.7 * costs[0]
    assert costs[2] < 0.7 * costs[1]
    assert costs[2] < 0.005 * log.stroke


def test_settings_of_other_models_are_refused() -> None:
    u = wandering(800)
    log = pt.Dataset(u=u, y=STAGE.simulate(u, 0.01).x, dt=0.01)
    for model, settings, match in (
        ("preisach", LeastSquares(thresholds=[5.0, 10.0]), "thresholds is .* has no thresholds"),
        ("prandtl-ishlinskii", LeastSquares(levels=[5.0, 10.0]), "levels is .* has no levels"),
        ("preisach", LeastSquares(count=17), "count is 17: expected 1 to 16 intervals"),
        ("preisach", LeastSquares(levels=[5.0, 5.0]), r"levels\[1\] is 5 V: expected above 5 V"),
        ("preisach", LeastSquares(dead_zones=2), "no dead zones"),
    ):
        with pytest.raises(pt.ParameterError, match=match):
            pt.identify(log, model, method=settings)


def test_it_explains_a_measured_log_and_foretells_another(tmp_path: Path) -> None:
    log, other = datasets.dbo_training(), datasets.dbo_tracking()
    compared = pt.compare(
        log, ["prandtl-ishlinskii", "preisach"], train=(3.0, 23.0), test=other[3.0:]
    )
    plain, relay = compared.rows
    assert relay.title == "Preisach"
    assert relay.train.rms_percent < 2.0 * plain.train.rms_percent
    assert relay.test.rms_percent < 2.0 * plain.test.rms_percent
    fit = compared.fits["preisach"]
    loaded = pt.load(fit.save(tmp_path / "stage.json"))
    assert loaded.model == fit.model
    reference = pt.sine(frequency=1.0, low=5e-6, high=35e-6, duration=4.0)
    inverse = loaded.model.inverse(playback="online")
    loop = pt.Controller(dt=1e-3, limits=(0.0, 3.6), feedforward=inverse)
    run = pt.track(loaded.model, loop, reference)
    assert run.metrics.rms_error < 0.1e-6
