"""Readings where the sensor is at its end: found, left out, and no motion is taken for them."""

from __future__ import annotations

import numpy as np
import pytest

import piezotrack as pt
from piezotrack.data.checks.record_flags import record_warnings

RATE, NOISE = 1000.0, 20e-9
T = np.arange(6000) / RATE
STAGE = pt.PrandtlIshlinskiiStage(
    linear=3e-7, thresholds=(5.0, 15.0, 30.0), weights=(8e-8, 5e-8, 4e-8)
)
DRIVES = {
    "sine": 50.0 - 50.0 * np.cos(2.0 * np.pi * T),
    "triangle": 100.0 * np.abs((2.0 * T % 1.0) * 2.0 - 1.0),
    "trapezoid": np.clip(150.0 * np.abs((T % 1.0) * 2.0 - 1.0) - 25.0, 0.0, 100.0),
    "staircase": 100.0 * (1.0 - np.abs(np.floor(5.0 * T) / 15.0 - 1.0)),
    "falling": 50.0 + 50.0 * np.exp(-T / 3.0) * np.sin(4.0 * np.pi * T),
    "chirp": 50.0 + 50.0 * np.sin(2.0 * np.pi * (0.5 * T + T * T)),
    "one step": 100.0 * (T > 1.0),
}


def readings(drive: str, noise: float = NOISE) -> np.ndarray:
    """Displacement of the stage with the noise of a sensor [m]."""
    x = STAGE.simulate(DRIVES[drive], 1.0 / RATE).x
    return np.asarray(x + noise * np.random.default_rng(1).standard_normal(T.size))


@pytest.mark.parametrize("step", [0.0, 50e-9, 400e-9])
@pytest.mark.parametrize("noise", [0.0, NOISE])
@pytest.mark.parametrize("drive", DRIVES)
def test_no_motion_is_taken_for_an_end(drive: str, noise: float, step: float) -> None:
    y = readings(drive, noise)
    y = step * np.round(y / step) if step else y
    log = pt.Dataset(u=DRIVES[drive], y=y, dt=1.0 / RATE)
    assert not log.at_end.any()
    assert log.without_faulty_readings() is log


def test_a_small_loop_within_a_dead_band_is_no_end() -> None:
    # A play alone: at its top it stays while the drive goes back and comes again.
    u = np.concatenate([np.linspace(0.0, 100.0, 500), np.linspace(100.0, 80.0, 100)])
    u = np.concatenate([u, np.linspace(80.0, 100.0, 100), np.linspace(100.0, 0.0, 500)])
    y, place = np.empty(u.size), 0.0
    for k, volts in enumerate(u):
        place = min(max(place, volts - 15.0), volts + 15.0)
        y[k] = 1e-7 * place
    assert not pt.Dataset(u=u, y=y, dt=1e-3).at_end.any()


@pytest.mark.parametrize("step", [0.0, 100e-9])
@pytest.mark.parametrize("rate", [97.0, 431.0])
def test_a_quick_drive_that_the_stage_does_not_follow_shows_no_end(
    rate: float, step: float
) -> None:
    slow = 50.0 - 50.0 * np.cos(2.0 * np.pi * T)
    y = STAGE.simulate(slow, 1.0 / RATE).x
    y = step * np.round(y / step) if step else y
    u = slow + 20.0 * np.sin(2.0 * np.pi * rate * T)
    assert not pt.Dataset(u=u, y=y, dt=1.0 / RATE).at_end.any()


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("gain", [1.0, -1.0])
@pytest.mark.parametrize("level", [0.7, 0.9, 0.97])
def test_ends_of_the_sensor_are_found_and_left_out(level: float, gain: float, side: float) -> None:
    y = readings("triangle")
    top = level * float(np.ptp(y))
    clipped = np.minimum(y, top) if side > 0.0 else np.maximum(y, float(y.max()) - top)
    log = pt.Dataset(u=DRIVES["triangle"], y=gain * clipped, dt=1.0 / RATE)
    lost = np.abs(clipped - y) > 0.0
    assert log.at_end[lost].all()
    # Nearly no others.
    assert log.at_end.sum() <= lost.sum() + 0.01 * T.size
    whole = log.without_faulty_readings()
    assert whole.left_out is not None
    assert np.array_equal(whole.left_out, log.at_end)
    assert np.array_equal(whole.recorded, log.y)
    assert whole.sha256 == log.sha256
    assert whole.without_faulty_readings() is whole


def test_a_noisy_end_is_found() -> None:
    # An amplifier that saturates before the converter, which is noisy.
    x = STAGE.simulate(DRIVES["sine"], 1.0 / RATE).x
    noise = NOISE * np.random.default_rng(2).standard_normal(T.size)
    log = pt.Dataset(u=DRIVES["sine"], y=np.minimum(x, 0.8 * x.max()) + noise, dt=1.0 / RATE)
    assert log.at_end[x > 0.81 * x.max()].all()
    assert not log.at_end[x < 0.78 * x.max()].any()


def test_ringing_that_is_cut_off_under_a_constant_drive_is_found() -> None:
    u = np.repeat([0.0, 80.0, 20.0, 100.0, 40.0, 60.0], 1000)
    mode = pt.PrandtlIshlinskiiStage(
        linear=3e-7, thresholds=(5.0,), weights=(8e-8,), frequency=20.0, damping_ratio=0.05
    )
    x = mode.simulate(u, 1.0 / RATE).x
    y = x + NOISE * np.random.default_rng(3).standard_normal(T.size)
    top = 1.1 * float(np.median(x[3500:4000]))
    log = pt.Dataset(u=u, y=np.minimum(y, top), dt=1.0 / RATE)
    assert log.at_end[y > top].all()
    assert log.at_end.sum() < 400


def test_a_fit_to_a_record_that_is_cut_off_holds_where_it_is_not() -> None:
    y = readings("sine")
    cut = pt.Dataset(u=DRIVES["sine"], y=np.minimum(y, 0.85 * y.max()), dt=1.0 / RATE)
    fit = pt.identify(cut, "prandtl-ishlinskii", method=pt.LeastSquares(creep=False))
    # In the range of the drive that the sensor saw; 1.3 um are cut off at the top.
    seen = y < 0.8 * y.max()
    left = y - fit.simulate(pt.Dataset(u=DRIVES["sine"], y=y, dt=1.0 / RATE)).x
    assert float(np.std(left[seen])) < 1.2 * NOISE
    assert fit.cost < 1.2 * NOISE


def test_a_record_that_is_mostly_at_an_end_is_left_as_it_is() -> None:
    y = np.minimum(readings("sine"), 10e-6)
    log = pt.Dataset(u=DRIVES["sine"], y=y, dt=1.0 / RATE)
    assert log.ends
    assert not log.at_end.any()
    assert log.without_faulty_readings() is log
    assert any("all of them count" in note for note in record_warnings(log))


def test_windows_and_other_rates_keep_what_is_left_out() -> None:
    y = readings("sine")
    log = pt.Dataset(u=DRIVES["sine"], y=np.minimum(y, 0.85 * y.max()), dt=1.0 / RATE)
    window = log.without_faulty_readings()[2.0:4.0]
    assert window.left_out is not None
    assert np.array_equal(window.left_out, log.at_end[2000:4000])
    for factor in (2, 5):
        less = log.decimate(factor)
        assert less.left_out is not None
        assert abs(less.left_out.mean() - log.at_end.mean()) < 0.01
