"""Best linear approximation of several axes, against a stage whose response is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from piezotrack.multiaxis import MultiAxisRecord, VirtualAxes, approximate_axes


def inside(stage: VirtualAxes, record: MultiAxisRecord, gain: float = 1.0) -> float:
    """Share of the responses whose band of 95 % holds the truth."""
    found = approximate_axes(record)
    truth = gain * stage.terms.response(found.z)
    return float((np.abs(found.value - truth) <= found.band()).mean())


@pytest.mark.parametrize("realisations", [3, 4, 6])
def test_the_band_holds_a_linear_stage(realisations: int) -> None:
    stage = VirtualAxes.three(noise=20e-9, seed=2)
    share = inside(stage, stage.record(realisations=realisations, periods=3))
    assert share == pytest.approx(0.95, abs=0.025)


def test_the_band_holds_a_stage_that_distorts() -> None:
    stage = VirtualAxes.three(noise=1e-9, seed=4, cubic=0.02)
    # Gain of u + a u^3 for a normal input of 1 V rms (Bussgang).
    share = inside(stage, stage.record(realisations=9), gain=1.0 + 3.0 * 0.02)
    assert share == pytest.approx(0.95, abs=0.04)


def test_distortion_is_told_from_noise() -> None:
    stage = VirtualAxes.three(noise=5e-9, seed=4)
    linear = approximate_axes(stage.record())
    bent = approximate_axes(replace(stage, cubic=0.05).record())
    assert linear.noise is not None
    assert linear.distortion is not None
    assert bent.noise is not None
    assert bent.distortion is not None
    # The noise of a mean of two periods, as amplitudes of lines: 4 s^2/N/2.
    expected = 2.0 * (5e-9) ** 2 / 1024
    assert linear.noise.mean() == pytest.approx(expected, rel=0.05)
    assert bent.noise.mean() == pytest.approx(expected, rel=0.05)
    assert bent.distortion.mean() > 100.0 * linear.distortion.mean()


def test_independent_phases_do_as_well_as_orthogonal_blocks() -> None:
    stage = VirtualAxes.three(noise=5e-9)
    records = [replace(stage, seed=seed).record(realisations=3) for seed in range(5)]
    # Of each block one realisation: their phases have nothing to do with each other.
    mixed = MultiAxisRecord.joined([one.only([k % 3]) for k, one in enumerate(records)])
    assert inside(stage, mixed) == pytest.approx(0.95, abs=0.03)


def test_a_noisy_realisation_is_named_and_does_little_harm() -> None:
    stage = VirtualAxes.three(noise=2e-9, seed=7)
    record = stage.record(realisations=6)
    random = np.random.default_rng(0)
    y = record.y.copy()
    y[:, :, 1] += 300e-9 * random.standard_normal(y[:, :, 1].shape)
    noisy = approximate_axes(MultiAxisRecord(u=record.u, y=y, dt=record.dt))
    clean = approximate_axes(record)
    without = approximate_axes(record.only([0, 2, 3, 4, 5]))
    truth = stage.terms.response(clean.z)

    def error(found: np.ndarray) -> float:
        return float(np.sqrt(np.square(np.abs(found - truth)).mean()))

    assert any("from 0: 1 (" in note for note in noisy.notes)
    assert not clean.notes
    assert error(noisy.value) < 1.2 * error(without.value)
    flat = np.linalg.lstsq  # the same without weights, line by line
    u = np.fft.rfft(record.u.mean(axis=3), axis=0)
    plain = np.fft.rfft(y.mean(axis=3), axis=0)
    lines = record.lines()
    unweighted = np.stack([flat(u[k].T, plain[k].T, rcond=None)[0].T for k in lines])
    assert error(unweighted) > 10.0 * error(noisy.value)


def test_the_score_of_a_response_is_the_error_of_its_steady_motion() -> None:
    stage = VirtualAxes.three(noise=1e-9, seed=1)
    record = stage.record(realisations=4)
    found = approximate_axes(record)
    exact = replace(found, value=stage.terms.response(found.z))
    sizes = np.sqrt(np.square(record.y[100:]).mean(axis=(0, 1, 3)))
    assert exact.score(record) == pytest.approx(1e-9 / sizes, rel=0.03)
