"""Hum of the mains: named where it stands out of what is left, and not taken for the drive's."""

from __future__ import annotations

import numpy as np
import pytest

import piezotrack as pt
from piezotrack.data.checks.hum import hum_lines

RATE = 1000.0
T = np.arange(4000) / RATE
NOISE = 20e-9
STAGE = pt.PrandtlIshlinskiiStage(linear=4e-7, thresholds=(10.0, 25.0), weights=(1e-7, 5e-8))
PLAYS = pt.LeastSquares(thresholds=[10.0, 25.0], dead_zones=False, creep=False, dynamics=None)


def log_of(drive_hz: float, *hum: tuple[float, float]) -> pt.Dataset:
    u = 50.0 - 50.0 * np.cos(2.0 * np.pi * drive_hz * T)
    y = STAGE.simulate(u, 1.0 / RATE).x + NOISE * np.random.default_rng(2).normal(size=T.size)
    for frequency, amplitude in hum:
        y += amplitude * np.sin(2.0 * np.pi * frequency * T + frequency)
    return pt.Dataset(u=u, y=y, dt=1.0 / RATE)


@pytest.mark.parametrize("mains", [50.0, 60.0])
def test_hum_is_named_with_its_amplitude(mains: float) -> None:
    data = log_of(1.0, (1.001 * mains, 100e-9), (3.003 * mains, 30e-9))
    fit = pt.identify(data, "prandtl-ishlinskii", method=PLAYS, progress=False)
    rest = data.y - fit.simulate(data).x
    first, third = hum_lines(rest, data.u, data.y, data.dt)
    assert first.frequency == pytest.approx(1.001 * mains, abs=0.1)
    assert first.amplitude == pytest.approx(100e-9, rel=0.1)
    assert third.frequency == pytest.approx(3.003 * mains, abs=0.1)
    assert third.amplitude == pytest.approx(30e-9, rel=0.15)
    (note,) = [one for one in fit.notes if "hum" in one]
    assert f"{mains:.0f}" in note


@pytest.mark.parametrize("drive_hz", [0.5, 1.0, 5.0, 10.0, 25.0, 50.0, 60.0])
def test_what_a_wrong_model_leaves_is_no_hum(drive_hz: float) -> None:
    data = log_of(drive_hz)
    line = np.polyval(np.polyfit(data.u, data.y, 1), data.u)
    for rest in (data.y - line, data.y - STAGE.simulate(data.u, data.dt).x):
        assert hum_lines(rest, data.u, data.y, data.dt) == []


def test_a_line_that_the_drive_has_too_is_the_drives() -> None:
    u = 50.0 - 49.0 * np.cos(2.0 * np.pi * T) + np.sin(2.0 * np.pi * 50.0 * T)
    y = 1e-6 * u
    rest = 0.3e-6 * np.sin(2.0 * np.pi * 50.0 * T) + NOISE * np.random.default_rng(3).normal(
        size=T.size
    )
    assert hum_lines(rest, u, y, 1.0 / RATE) == []
    assert hum_lines(rest, u - np.sin(2.0 * np.pi * 50.0 * T), y, 1.0 / RATE)
