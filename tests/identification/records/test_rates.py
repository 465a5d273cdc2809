"""What a record of one rate says of others: lags that fit as well, and use beyond the record."""

from dataclasses import replace

import numpy as np
import pytest

import piezotrack as pt
from piezotrack.identification.fitted import notes as fit_notes

STAGE = pt.VirtualStage.xu_li_2010(seed=3)
QUICK = pt.ParticleSwarm(iterations=30)


def record(frequency: float, rate: float = 1000.0, cycles: int = 3) -> pt.Dataset:
    t = np.arange(int(cycles * rate / frequency) + 1) / rate
    u = 37.5 * (1.0 - np.cos(2.0 * np.pi * frequency * t))
    return STAGE.record(u, 1.0 / rate)


SLOW = record(1.0, cycles=4)[1.0:]


def percent(fit: pt.identification.Identification, log: pt.Dataset) -> float:
    return 100.0 * fit.score(log).rms / SLOW.stroke


def test_plays_fitted_at_1_hz_hold_at_others() -> None:
    fit = pt.identify(SLOW, "prandtl-ishlinskii")
    assert fit.cost < 1.1 * STAGE.sensor.noise
    assert percent(fit, record(0.1)[10.0:]) < 1.0
    assert percent(fit, record(3.0)[0.4:]) < 1.0
    assert percent(fit, record(10.0, rate=5000.0)[0.1:]) < 1.0


def test_the_least_lag_is_taken_and_the_range_is_told() -> None:
    fit = pt.identify(
        SLOW,
        "first-order-dahl",
        method=replace(QUICK, seed=1, runs=2),
        progress=False,
        history="virgin",
    )
    assert fit.lags is not None
    assert fit.model.damping / fit.model.stiffness == pytest.approx(fit.lags.least, rel=1e-9)
    # With a free damping this model took 2.9 ms, and was 54 % of the stroke off at 10 Hz.
    assert fit.lags.least < 1e-3 < fit.lags.most
    assert percent(fit, record(10.0, rate=5000.0)[0.1:]) < 2.0
    assert any("fits equally well" in note and "another rate" in note for note in fit.notes)
    # The record shows no mode: the mass is too small to matter, and not searched.
    assert not fit.parameters["mass"].free
    natural = np.sqrt(fit.model.stiffness / fit.model.mass) / (2.0 * np.pi)
    assert natural > 1.0 / SLOW.dt


def test_a_loop_that_is_damping_is_told() -> None:
    fit = pt.identify(
        SLOW, "dahl", method=replace(QUICK, seed=1, runs=2), progress=False, history="virgin"
    )
    assert any("holds at this rate only" in note for note in fit.notes)


def test_a_mass_that_is_asked_for_is_searched() -> None:
    fit = pt.identify(
        SLOW,
        "first-order-dahl",
        parameters={"mass": pt.Parameter()},
        method=pt.ParticleSwarm(iterations=2, polish=False, runs=1),
        progress=False,
        history="virgin",
    )
    assert fit.parameters["mass"].free
    assert fit.lags is None


def test_use_beyond_the_record_is_remarked() -> None:
    fit = pt.identify(SLOW, "prandtl-ishlinskii")
    u = SLOW.u
    assert fit.extrapolation_notes(u, SLOW.dt) == []
    assert "that of the record identified from" in fit.extrapolation_notes(1.2 * u, SLOW.dt)[0]
    (rate,) = fit.extrapolation_notes(u, 0.1 * SLOW.dt)
    assert "V/s" in rate
    assert fit.score(record(10.0, rate=5000.0)).notes == (
        fit.extrapolation_notes(record(10.0, rate=5000.0).u, 1 / 5000)[0],
    )


def test_first_samples_that_carry_the_cost_are_named() -> None:
    rest = np.full(len(SLOW), 1e-9)
    rest[::2] *= -1.0
    assert fit_notes.first_samples(rest, SLOW) == []
    rest[:50] += 1e-6 * np.exp(-np.arange(50) / 10.0)
    (note,) = fit_notes.first_samples(rest, SLOW)
    assert "of the squared residual is in the first 0.0" in note
    assert "log[1.0" in note


def test_a_mode_above_half_the_sampling_rate_is_found_in_a_sweep() -> None:
    # The sweep ends at 40 Hz, a ninth of the mode; the stage is sampled at 500 Hz.
    stiffness, natural, dt = 1e6, 2.0 * np.pi * 350.0, 2e-3
    stage = pt.BoucWenStage(
        mass=stiffness / natural**2,
        damping=0.2 * stiffness / natural,
        stiffness=stiffness,
        piezo_coefficient=1e-6,
        alpha=0.2,
        beta=0.1,
        gamma=0.05,
    )
    t = dt * np.arange(1001)
    u = 50.0 - 50.0 * np.cos(2.0 * np.pi * (1.0 + 9.5 * t) * t)
    y = stage.simulate(u, dt).x + 2e-8 * np.random.default_rng(1).standard_normal(t.size)
    fit = pt.identify(pt.Dataset(u=u, y=y, dt=dt), "bouc-wen")
    assert np.sqrt(stiffness / fit.model.mass) == pytest.approx(natural, rel=0.03)
    assert fit.cost < 1.05 * 2e-8


def test_a_record_of_one_amplitude_does_not_determine_smaller_loops() -> None:
    def said(fit: pt.identification.Identification) -> bool:
        return any("does not determine smaller loops" in note for note in fit.notes)

    small = STAGE.record(0.5 * SLOW.full.u, SLOW.dt)[1.0:]
    assert said(pt.identify(SLOW, "prandtl-ishlinskii"))
    assert not said(pt.identify([SLOW, small], "prandtl-ishlinskii"))
    # A model of few values has the same form at every amplitude.
    assert not said(pt.identify(SLOW, "bouc-wen"))
