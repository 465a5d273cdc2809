"""Lags that a record allows: of slow drives, whatever their length, and of quick ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import piezotrack as pt

DT = 0.02
STAGE = pt.PrandtlIshlinskiiStage(
    linear=0.4e-6, thresholds=(2.0, 6.0, 12.0, 20.0), weights=(0.06e-6, 0.05e-6, 0.04e-6, 0.03e-6)
)


def fitted(phase: np.ndarray, swarm: pt.ParticleSwarm) -> pt.identification.Identification:
    """First-order Dahl on the record of a stage without dynamics."""
    u = 37.5 * (1.0 - np.cos(phase))
    noise = 5e-9 * np.random.default_rng(1).standard_normal(u.size)
    log = pt.Dataset(u=u, y=STAGE.simulate(u, DT).x + noise, dt=DT)
    return pt.identify(log, "first-order-dahl", method=replace(swarm, runs=1), history="virgin")


@pytest.mark.parametrize("periods", [3, 6, 20])
def test_one_slow_sine_of_any_length_shows_no_lag_and_no_mode(periods: int) -> None:
    t = DT * np.arange(round(2.0 * periods / DT))
    fit = fitted(np.pi * t, pt.ParticleSwarm(iterations=15))
    assert not fit.parameters["mass"].free
    assert fit.lags is not None
    assert fit.lags.from_zero
    # The least that is searched: a ten-thousandth of the travel at the rate of the drive, pi rad/s.
    assert np.pi * fit.model.damping / fit.model.stiffness == pytest.approx(1e-4, rel=1e-3)
    assert any("another rate" in note for note in fit.notes)


def test_a_chirp_that_shows_no_mode_is_not_searched_for_one() -> None:
    t = DT * np.arange(500)
    swarm = pt.ParticleSwarm(iterations=2, polish=False)
    fit = fitted(2.0 * np.pi * (0.1 * t + 0.4 * t**2), swarm)
    assert not fit.parameters["mass"].free
    assert fit.parameters["damping"].free


@pytest.mark.parametrize("share", [0.05, 0.2])
def test_creep_faster_than_the_drive_is_among_the_alternatives_of_a_lag(share: float) -> None:
    # The phase that a relaxation of a tenth of a period turns is that of a lag of milliseconds.
    dt, rng = 1e-3, np.random.default_rng(4)
    t = dt * np.arange(4000)
    u = 37.5 * (1.0 - np.cos(2.0 * np.pi * t))
    stage = replace(STAGE, creep_weights=(0.03,), creep_times=(share,))
    y = stage.simulate(u, dt).x + 8e-9 * rng.standard_normal(u.size)
    fit = pt.identify(pt.Dataset(u=u, y=y, dt=dt), "prandtl-ishlinskii", history="virgin")
    assert fit.lags is None or fit.lags.from_zero


def test_a_lag_of_a_stage_that_creeps_has_to_explain_much() -> None:
    dt, rng = 1e-3, np.random.default_rng(5)
    t = dt * np.arange(6000)
    u = 37.5 * (1.0 - np.cos(2.0 * np.pi * t)) * np.exp(-t / 10.0)
    creeping = replace(STAGE, creep_weights=(0.03, 0.02), creep_times=(0.4, 4.0))
    noise = 8e-9 * rng.standard_normal(u.size)
    for stage, lagging in ((creeping, False), (replace(creeping, time_constant=0.02), True)):
        y = stage.simulate(u, dt).x + noise
        fit = pt.identify(pt.Dataset(u=u, y=y, dt=dt), "prandtl-ishlinskii")
        time = fit.model.time_constant
        assert (time or 0.0) == pytest.approx(0.02 if lagging else 0.0, rel=0.15)
