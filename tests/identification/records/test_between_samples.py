"""Drives that are fast for their sampling rate: interpolated where straight lines fall short."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

import piezotrack as pt
from piezotrack._support.statistics import sample_noise
from piezotrack.data.checks.fast_drive import is_fast

if TYPE_CHECKING:
    from pathlib import Path

RATE, COUNT, OVER = 750.0, 2048, 16
NOISE = 4e-6


def record(seed: int, top: float, noise: float = 0.0, drive: str = "multisine") -> pt.Dataset:
    """Simulate the oscillator far above the rate at which it is sampled; up to `top` of that."""
    n = COUNT * OVER
    lines = np.fft.rfftfreq(n, 1.0 / (RATE * OVER))
    band = (lines >= 5.0) & (lines <= top * RATE)
    rng = np.random.default_rng(seed)
    spectrum = np.zeros(lines.size, dtype=complex)
    spectrum[band] = np.exp(2j * np.pi * rng.random(int(band.sum())))
    u = np.fft.irfft(spectrum, n)
    if drive == "sweep":
        t = np.arange(n) / (RATE * OVER)
        u = np.sin(2.0 * np.pi * (18.0 * t + 0.5 * 12.0 * t**2))
    u *= 50.0 / float(np.std(u))
    x = pt.BoucWenOscillator.benchmark().simulate(u, 1.0 / (RATE * OVER)).x[::OVER]
    y = x + noise * rng.normal(size=x.size)
    # What is beyond the ends of a record is not known: the first samples are warm-up.
    return pt.Dataset(u=u[::OVER], y=y, dt=1.0 / RATE, drive_unit="N")[0.5:]


@pytest.fixture(scope="module")
def fit() -> pt.identification.Identification:
    """Fit a record whose drive goes up to a fifth of the rate."""
    method = pt.Descents(seed=1, runs=2)
    return pt.identify(record(0, 0.2, NOISE), "bouc-wen-oscillator", method=method)


def test_a_fast_drive_is_fitted_to_the_noise(
    fit: pt.identification.Identification, tmp_path: Path
) -> None:
    """The record is fitted to the noise and other motions are foretold, from a file too."""
    assert fit.interpolation == 4
    assert fit.cost < 1.1 * NOISE
    assert fit.fitted.rms == pytest.approx(fit.cost, rel=1e-3)
    assert fit.data.dt == pytest.approx(1.0 / RATE)
    loaded = pt.load(fit.save(tmp_path / "model.json"))
    for drive in ("multisine", "sweep"):
        other = record(7, 0.2, drive=drive)
        score = fit.score(other, history="virgin")
        assert score.rms < 0.2 * NOISE
        assert loaded.score(other, history="virgin").rms == score.rms
        assert fit.simulate(other).x.size == len(other)


def test_its_noise_is_that_of_the_readings(fit: pt.identification.Identification) -> None:
    """No residual beyond the noise is reported, and the parameters are those of the stage."""
    assert any("interpolated to 4 times" in note for note in fit.notes)
    assert not any("times the noise" in note for note in fit.notes)
    assert fit.model.mass == pytest.approx(2.0, rel=3e-3)


def test_slow_drives_stay_on_straight_lines() -> None:
    """Interpolation of band-limited fast drives alone: no steps, no triangle, no noise."""
    t = np.arange(4000) / 1000.0
    noise = np.random.default_rng(1).normal(size=t.size)
    fast = np.sin(2.0 * np.pi * 150.0 * t)
    slow = {
        "sine": np.sin(2.0 * np.pi * 3.0 * t),
        "steps": np.sign(np.sin(2.0 * np.pi * 3.0 * t)),
        "triangle": np.abs((3.0 * t) % 2.0 - 1.0),
        "noise": noise,
    }
    for name, u in slow.items():
        assert not is_fast(pt.Dataset(u=u, y=u, t=t)), name
    assert is_fast(pt.Dataset(u=fast, y=fast, t=t))
    assert not is_fast(pt.Dataset(u=fast, y=fast, t=t, hold="zoh"))


def test_inserted_samples_are_no_readings() -> None:
    """Noise, readings and interval of an interpolated record are those of the measured one."""
    log = record(0, 0.2, NOISE)
    fine = log.interpolate(4)
    assert fine.measured_dt == log.dt
    measured = fine.measured
    np.testing.assert_array_equal(measured.full.u, log.full.u)
    np.testing.assert_array_equal(measured.full.y, log.full.y)
    assert (len(measured), measured.warmup, measured.dt) == (len(log), log.warmup, log.dt)
    assert sample_noise(measured.y) == sample_noise(log.y)
    assert fine.counted(fine.y).size == len(log)
    # A window begins with a reading, and lower rates know what was measured.
    later = fine[0.7012:1.3]
    assert later.inserted is not None
    assert not later.inserted[0]
    assert later.measured.t[0] >= 0.7012
    assert fine.decimate(4).inserted is None
    assert fine.decimate(2).measured_dt == log.dt
    assert fine.sha256 != pt.Dataset(u=fine.u, y=fine.y, dt=fine.dt).sha256


def test_an_interpolated_record_counts_its_readings_alone() -> None:
    """A fit to it leaves the noise of the readings, and no more than that is reported."""
    t = np.arange(3000) / 1000.0
    u = 30.0 * (1.0 - np.cos(2.0 * np.pi * t)) + 5.0 * np.sin(2.0 * np.pi * 37.0 * t)
    x = pt.DahlStage.xu_li_2010().simulate(u, 1e-3).x
    y = x + 20e-9 * np.random.default_rng(3).normal(size=t.size)
    log = pt.Dataset(u=u, y=y, t=t)
    fit = pt.identify(log.interpolate(4), "dahl", method=pt.Descents(seed=1, runs=2))
    plain = pt.identify(log, "dahl", method=pt.Descents(seed=1, runs=2))
    assert fit.cost == pytest.approx(plain.cost, rel=0.05)
    assert not any("times the noise" in note for note in fit.notes)
    first, second = (one.parameters["a1"].deviation for one in (fit, plain))
    assert first is not None
    assert second is not None
    assert first == pytest.approx(second, rel=0.2)
