"""Stages with plays behind a drive that goes straight from sample to sample: exact in between."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy import signal

import piezotrack as pt

PLAYS = pt.PrandtlIshlinskiiStage(
    linear=8e-7,
    thresholds=(3.0, 8.0, 15.0, 25.0),
    weights=(2e-7, 1e-7, 2e-7, 1e-7),
    dead_zone_thresholds=(1.3e-5, 3.1e-5),
    dead_zone_weights=(0.2, -0.3),
)
ENVELOPE = pt.GeneralisedPrandtlIshlinskiiStage(
    linear=8e-7,
    thresholds=(3.0, 8.0, 15.0, 25.0),
    weights=(2e-7, 1e-7, 2e-7, 1e-7),
    scale=60.0,
    slope=0.02,
    shift=-0.3,
    level=17.0,
)
TWO_ENVELOPES = replace(
    ENVELOPE, falling_scale=60.0, falling_slope=0.019, falling_shift=-0.3, falling_level=24.0
)
KINDS: dict[str, Any] = {"plays": PLAYS, "envelope": ENVELOPE, "two envelopes": TWO_ENVELOPES}
BEHIND: dict[str, dict[str, Any]] = {
    "mode": {"frequency": 160.0, "damping_ratio": 0.065},
    "lag": {"time_constant": 1.2e-4},
    "creep": {"creep_weights": (0.02, 0.01), "creep_times": (0.003, 0.1)},
    "modes": {
        "frequency": 160.0,
        "damping_ratio": 0.065,
        "mode_weights": (0.3,),
        "mode_frequencies": (410.0,),
        "mode_damping_ratios": (0.03,),
    },
}
FINELY = 256
# The accuracy that is promised [m].
ACCURACY = 1e-10


def jumping() -> np.ndarray:
    """A drive with steps in one sample, up and down, small and large."""
    turns = [0.0, 0.0, 60.0, 60.0, 60.0, 5.0, 5.0, 48.0, 30.0, 33.0, 70.0, 0.0, 0.0]
    return np.array(turns + [60.0] * 8 + [0.0] * 8)


def between(u: np.ndarray, times: int = FINELY) -> np.ndarray:
    """The same drive with more samples on its straight lines."""
    places = np.arange((u.size - 1) * times + 1) / times
    volts: np.ndarray = np.interp(places, np.arange(u.size), u)
    return volts


@pytest.mark.parametrize("rate", [50.0, 200.0, 1000.0, 5000.0])
@pytest.mark.parametrize("behind", BEHIND)
@pytest.mark.parametrize("kind", KINDS)
def test_samples_on_the_drives_lines_change_nothing(kind: str, behind: str, rate: float) -> None:
    stage = replace(KINDS[kind], **BEHIND[behind])
    u = jumping()
    coarse = stage.simulate(u, 1.0 / rate)
    fine = stage.simulate(between(u), 1.0 / rate / FINELY)
    assert np.abs(coarse.x - fine.x[::FINELY]).max() < ACCURACY
    assert coarse.error_estimate <= ACCURACY


@pytest.mark.parametrize("rate", [50.0, 1000.0])
def test_it_is_the_answer_of_the_mode_to_the_path_between(rate: float) -> None:
    u = jumping()
    finely = 4096
    volts = between(u, finely)
    p, h = np.empty_like(volts), np.empty_like(volts)
    z = np.zeros(4)
    r, w = np.array(PLAYS.thresholds), np.array(PLAYS.weights)
    for k, one in enumerate(volts):
        z = np.maximum(one - r, np.minimum(one + r, z))
        p[k] = PLAYS.linear * one + w @ z
    zones = zip(PLAYS.dead_zone_thresholds, PLAYS.dead_zone_weights, strict=True)
    h = p + sum(s * np.maximum(p - d, 0.0) for d, s in zones)
    wn, zeta = 2.0 * np.pi * 160.0, 0.065
    t = np.arange(volts.size) / rate / finely
    x = signal.lsim(([wn * wn], [1.0, 2.0 * zeta * wn, wn * wn]), h, t)[1][::finely]
    found = replace(PLAYS, **BEHIND["mode"]).simulate(u, 1.0 / rate)
    assert np.abs(found.x - x).max() < ACCURACY
    # That of a drive which goes straight in the hysteresis' output instead is micrometres off.
    wrong = signal.lsim(([wn * wn], [1.0, 2.0 * zeta * wn, wn * wn]), h[::finely], t[::finely])[1]
    assert np.abs(wrong - x).max() > 1e-7


@pytest.mark.parametrize("kind", KINDS)
def test_without_memory_behind_it_samples_are_as_they_were(kind: str) -> None:
    u = jumping()
    run = KINDS[kind].simulate(u, 0.01)
    assert run.error_estimate == 0.0
    np.testing.assert_allclose(
        run.x, KINDS[kind].simulate(between(u, 64), 0.01 / 64).x[::64], rtol=0.0, atol=1e-18
    )


def test_an_accuracy_is_kept_and_told() -> None:
    stage = replace(ENVELOPE, **BEHIND["mode"])
    u = jumping()
    right = stage.simulate(between(u), 0.005 / FINELY).x[::FINELY]
    errors = []
    for accuracy in (1e-6, 1e-8, 1e-10):
        run = stage.simulate(u, 0.005, accuracy=accuracy)
        errors.append(np.abs(run.x - right).max())
        assert errors[-1] < run.error_estimate <= accuracy
    assert errors[0] > 10.0 * errors[1]
    with pytest.raises(pt.ParameterError, match=r"^accuracy is 0 m"):
        stage.simulate(u, 0.005, accuracy=0.0)


def test_the_output_of_the_hysteresis_is_that_at_the_samples() -> None:
    u = jumping()
    bare, behind = PLAYS.simulate(u, 0.005), replace(PLAYS, **BEHIND["mode"]).simulate(u, 0.005)
    np.testing.assert_array_equal(behind.hysteresis, bare.hysteresis)


def test_small_steps_around_a_threshold_are_followed() -> None:
    # Where p stands at a dead zone's threshold but for a rounding.
    stage = replace(PLAYS, **BEHIND["mode"])
    turn = 14.4 / 1.1
    u = turn + 1e-9 * np.sin(np.arange(2000.0))
    coarse, fine = stage.simulate(u, 1e-3).x, stage.simulate(between(u, 64), 1e-3 / 64).x[::64]
    np.testing.assert_allclose(coarse, fine, rtol=0.0, atol=1e-15)


def test_a_huge_drive_is_followed() -> None:
    stage = replace(ENVELOPE, **BEHIND["mode"])
    u = np.array([0.0, 1e9, -1e9, 1e9])
    x = stage.simulate(u, 0.01).x
    assert np.isfinite(x).all()
