"""Single readings far off: found, and quick motion is none."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest

import piezotrack as pt
from piezotrack.data.far_readings import far_readings

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

RATE = 1000.0
T = np.arange(5000) / RATE
STROKE = 50e-6
DRIVES = {
    "sine": 50.0 - 50.0 * np.cos(2.0 * np.pi * T),
    "triangle": 100.0 * np.abs((7.0 * T % 1.0) * 2.0 - 1.0),
    "steps": np.repeat(np.random.default_rng(3).uniform(0.0, 100.0, 25), 200),
    "square": 100.0 * (np.sin(6.0 * T) > 0.0),
    "stairs": 100.0 * (1.0 - np.abs(np.floor(5.0 * T) / 15.0 - 1.0)),
    "chirp": 50.0 + 50.0 * np.sin(2.0 * np.pi * (0.5 * T + 25.0 * T * T)),
    "noise": 50.0 + np.random.default_rng(4).normal(0.0, 10.0, T.size),
    "raster": 100.0 * (10.0 * T % 1.0),
    "impulses": np.where(np.arange(T.size) % 97 == 5, 100.0, 0.0),
}
# Natural frequency in cycles a sample and damping ratio; None: the drive's own motion.
MECHANICS = {
    "none": None,
    "slow ringing": (0.02, 0.01),
    "ringing": (0.1, 0.02),
    "quick ringing": (0.3, 0.05),
    "damped": (0.16, 0.7),
    "lag": (0.25, 1.5),
}


@cache
def moved(drive: str, mechanics: str) -> tuple[Array, Array]:
    """Drive, and displacement of an oscillator under it by a recursion of its own [m]."""
    u = DRIVES[drive]
    x = u - u[0]
    if (mode := MECHANICS[mechanics]) is not None:
        from scipy.signal import cont2discrete, dlsim

        w = 2.0 * np.pi * mode[0]
        system = cont2discrete(([w * w], [1.0, 2.0 * mode[1] * w, w * w]), 1.0, "foh")
        x = dlsim((np.ravel(system[0]), system[1], 1.0), x)[1].ravel()
    return u, STROKE * x / np.ptp(u)


@pytest.mark.parametrize("mechanics", MECHANICS)
@pytest.mark.parametrize("drive", DRIVES)
def test_no_motion_is_taken_for_a_glitch(drive: str, mechanics: str) -> None:
    u, x = moved(drive, mechanics)
    for noise in (0.0, 1e-4, 1e-3, 1e-2):
        y = x + noise * STROKE * np.random.default_rng(5).normal(size=x.size)
        assert not far_readings(u, y).any()
        quantum = 5.0 * max(noise, 1e-3) * STROKE
        assert not far_readings(u, np.round(y / quantum) * quantum).any()
        assert not far_readings(u, y + 0.01 * STROKE * np.sin(2.0 * np.pi * 50.0 * T)).any()


@pytest.mark.parametrize("name", ["dbo_training", "dbo_tracking"])
def test_the_measured_logs_have_none(name: str) -> None:
    log = getattr(pt.datasets, name)()
    assert not log.far.any()
    assert log.without_faulty_readings() is log


@pytest.mark.parametrize("drive", ["sine", "square", "stairs", "triangle"])
def test_glitches_are_found_and_nothing_else(drive: str) -> None:
    u, x = moved(drive, "ringing" if drive == "square" else "lag")
    random = np.random.default_rng(7)
    y = x + 1e-4 * STROKE * random.normal(size=x.size)
    places = np.sort(random.choice(np.arange(10, x.size - 10), 8, replace=False))
    y[places] += 0.5 * STROKE * random.choice([-1.0, 1.0], 8)
    found = np.flatnonzero(far_readings(u, y))
    assert set(found) <= set(places)
    assert found.size >= 7


def test_two_readings_beside_each_other_and_a_small_one_near_a_large_one_are_found() -> None:
    u, x = moved("sine", "none")
    y = x + 1e-4 * STROKE * np.random.default_rng(8).normal(size=x.size)
    y[[1000, 1001]] += 10e-6
    y[3000], y[3004] = 1.0, y[3004] + 2e-6
    assert np.flatnonzero(far_readings(u, y)).tolist() == [1000, 1001, 3000, 3004]


def log_with(share: float) -> pt.Dataset:
    u, x = moved("sine", "none")
    y = x + 1e-4 * STROKE * np.random.default_rng(9).normal(size=x.size)
    places = np.arange(20, x.size - 20, round(1.0 / share))
    y[places] += 20e-6
    return pt.Dataset(u=u, y=y, dt=1.0 / RATE)


def test_more_than_one_in_a_hundred_are_not_left_out() -> None:
    few, many = log_with(0.005), log_with(0.02)
    assert few.without_faulty_readings().left_out is not None
    assert many.without_faulty_readings() is many
    (note,) = many.far_notes
    assert "none of these is" in note
    assert few.far.sum() == 25


def test_what_is_left_out_is_not_in_stroke_and_stays_in_the_record() -> None:
    log = log_with(0.005)
    clean = log.without_faulty_readings()
    assert clean.stroke == pytest.approx(STROKE, rel=2e-3)
    assert log.stroke > 1.1 * STROKE
    assert np.array_equal(clean.recorded, log.y)
    assert clean.sha256 == log.sha256
    assert clean.without_faulty_readings() is clean
    part = clean[1.0:2.0]
    assert part.left_out is not None
    assert part.left_out.sum() == part.far.sum() == log[1.0:2.0].far.sum()


def test_a_glitch_does_not_spread_when_a_record_is_decimated() -> None:
    u, x = moved("sine", "none")
    y = x.copy()
    y[2503] += STROKE
    less = pt.Dataset(u=u, y=y, dt=1.0 / RATE).decimate(10)
    plain = pt.Dataset(u=u, y=x, dt=1.0 / RATE).decimate(10)
    assert np.abs(less.y - plain.y).max() < 1e-3 * STROKE
    assert len(less.notes) == 1
