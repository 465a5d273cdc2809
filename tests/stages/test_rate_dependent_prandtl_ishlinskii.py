"""Plays that the rate of the drive dilates: equations, limits, inverse, several rates."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

STAGE = pt.RateDependentPrandtlIshlinskiiStage(
    linear=0.5e-6,
    thresholds=(4.0, 9.0, 16.0),
    weights=(0.1e-6, 0.06e-6, 0.08e-6),
    dilation=4e-3,
)
KIND = "rate-dependent-prandtl-ishlinskii"
NOISE = 5e-9


def drive(frequency: float, cycles: float = 4.0, samples: int = 800) -> tuple[Array, float]:
    """Cycles whose amplitude falls, and the sampling interval [V, s]."""
    part = np.arange(round(cycles * samples)) / samples
    u: Array = 38.0 * (1.0 - np.cos(2.0 * np.pi * part)) * (1.0 - 0.5 * part / cycles)
    return u, 1.0 / (samples * frequency)


def transcribed(stage: pt.RateDependentPrandtlIshlinskiiStage, u: Array, dt: float) -> Array:
    """The equations, play by play and sample by sample."""
    z = np.clip(0.0, u[0] - np.array(stage.thresholds), u[0] + np.array(stage.thresholds))
    x = [stage.linear * u[0] + float(stage.weights @ z)]
    for before, now in pairwise(u):
        r = np.array(stage.thresholds) + stage.dilation * abs(now - before) / dt
        # The rate changes first, then the drive.
        for at in (before, now):
            z = np.maximum(at - r, np.minimum(at + r, z))
        x.append(stage.linear * now + float(stage.weights @ z))
    return np.array(x)


@pytest.mark.parametrize("frequency", [0.1, 1.0, 10.0])
def test_the_motion_is_that_of_the_equations(frequency: float) -> None:
    u, dt = drive(frequency)
    x = STAGE.simulate(u, dt).x
    assert np.abs(x - transcribed(STAGE, u, dt)).max() < 1e-18


def test_without_a_dilation_it_is_a_prandtl_ishlinskii_stage() -> None:
    slow: Any = {"time_constant": 3e-3, "creep_weights": (0.02,), "creep_times": (1.0,)}
    still = replace(STAGE, dilation=0.0, **slow)
    plain = pt.PrandtlIshlinskiiStage(
        linear=still.linear,
        thresholds=still.thresholds,
        weights=still.weights,
        **slow,
    )
    u, dt = drive(2.0)
    assert np.array_equal(still.simulate(u, dt).x, plain.simulate(u, dt).x)


def test_a_play_that_moves_is_late_by_the_dilation() -> None:
    """Under a ramp a play follows u - r - lambda u', the drive that was there lambda before."""
    play = replace(STAGE, linear=1e-9, thresholds=(5.0,), weights=(1e-6,))
    t = 1e-3 * np.arange(1000)
    x = play.simulate(60.0 * t, 1e-3).x - 1e-9 * 60.0 * t
    late = 1e-6 * (60.0 * (t - STAGE.dilation) - 5.0)
    assert x[500:] == pytest.approx(late[500:], rel=1e-9)


def test_a_loop_widens_with_the_rate() -> None:
    widths = []
    for frequency in (0.1, 1.0, 10.0):
        part = np.arange(3200) / 800.0
        u = 38.0 * (1.0 - np.cos(2.0 * np.pi * part))
        x = STAGE.simulate(u, 1.0 / (800.0 * frequency)).x[-801:]
        rising = np.gradient(u[-801:]) > 0.0
        level = 38.0
        up = np.interp(level, u[-801:][rising], x[rising])
        down = np.interp(level, u[-801:][~rising][::-1], x[~rising][::-1])
        widths.append(down - up)
    assert widths[0] < widths[1] < widths[2]


@pytest.mark.parametrize("frequency", [0.1, 1.0, 10.0])
def test_the_inverse_is_the_inverse(frequency: float) -> None:
    stage = replace(STAGE, dilation=0.4e-3, dead_zone_thresholds=(15e-6,), dead_zone_weights=(0.1,))
    u, _ = drive(frequency)
    u, dt = np.interp(np.arange(0.0, u.size, 0.8 / frequency), np.arange(u.size), u), 1e-3
    x = stage.simulate(u, dt).x
    session = stage.inverse(playback="online").start(dt)
    volts = np.array([session.step(one) for one in x])
    assert np.abs(volts - u)[1:].max() < 1e-9


def test_intervals_that_are_too_short_have_no_inverse() -> None:
    share = sum(STAGE.weights) / (STAGE.linear + sum(STAGE.weights))
    shortest = STAGE.dilation * share
    STAGE.inverse().start(1.01 * shortest)
    with pytest.raises(pt.ParameterError, match=r"dt is .* plays would go back"):
        STAGE.inverse().start(0.99 * shortest)


def record(frequency: float, seed: int) -> pt.Dataset:
    u, dt = drive(frequency)
    noise = NOISE * np.random.default_rng(seed).standard_normal(u.size)
    return pt.Dataset(u=u, y=STAGE.simulate(u, dt).x + noise + 1e-7 * seed, dt=dt)


def test_records_at_three_rates_determine_it() -> None:
    logs = [record(frequency, seed) for seed, frequency in enumerate([0.1, 1.0, 10.0])]
    settings = pt.identification.LeastSquares(
        thresholds=STAGE.thresholds, dead_zones=False, creep=False, dynamics=None
    )
    options: dict[str, Any] = {"history": "virgin", "drift": False, "method": settings}
    fit = pt.identify(logs, KIND, **options)
    assert fit.model.dilation == pytest.approx(STAGE.dilation, rel=0.01)
    assert fit.model.weights == pytest.approx(STAGE.weights, rel=0.02)
    assert fit.cost == pytest.approx(NOISE, rel=0.05)
    # Without rate dependence the three contradict each other, with a lag too.
    plain = pt.identify(logs, "prandtl-ishlinskii", **options)
    late = replace(settings, dynamics="first")
    lagging = pt.identify(logs, "prandtl-ishlinskii", history="virgin", drift=False, method=late)
    assert plain.cost > lagging.cost > 10.0 * fit.cost
    # And foretells a rate that it was not fitted to.
    other = record(4.0, 7)
    assert fit.score(other, history="virgin").rms == pytest.approx(NOISE, rel=0.1)


def test_what_does_not_depend_on_the_rate_gets_no_dilation() -> None:
    still = replace(STAGE, dilation=0.0)
    logs = []
    for seed, frequency in enumerate([0.3, 3.0]):
        u, dt = drive(frequency)
        noise = NOISE * np.random.default_rng(seed).standard_normal(u.size)
        logs.append(pt.Dataset(u=u, y=still.simulate(u, dt).x + noise, dt=dt))
    fit = pt.identify(logs, KIND)
    assert fit.model.dilation < 1e-5
