"""Modes of a frequency response, and describing functions, against what made them and theory."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import piezotrack as pt

RATE = 2000.0
LINES = pt.RandomPhaseMultisine(band=(8.0, 800.0), low=28.0, high=32.0, settle=4)
MODE = pt.PrandtlIshlinskiiStage(
    linear=1e-6, thresholds=(), weights=(), frequency=160.0, damping_ratio=0.03
)
SEVERAL = replace(
    MODE,
    mode_weights=(0.2, -0.05),
    mode_frequencies=(310.0, 560.0),
    mode_damping_ratios=(0.01, 0.03),
)


def measured(stage: Any, lines: Any = LINES, **parts: Any) -> pt.FrequencyResponse:
    return pt.frequency_response(pt.VirtualStage.of(stage, **parts), lines, rate=RATE)


@pytest.mark.parametrize("delay", [0.0, 0.3e-3, 1.2e-3])
@pytest.mark.parametrize("bandwidth", [np.inf, 500.0])
def test_it_finds_what_made_the_response(delay: float, bandwidth: float) -> None:
    found = pt.fit_modes(measured(MODE, noise=5e-9, delay=delay, bandwidth=bandwidth))
    assert found.frequencies.size == 1
    assert found.frequencies[0] == pytest.approx(160.0, rel=1e-4)
    assert found.damping_ratios[0] == pytest.approx(0.03, rel=5e-3)
    assert found.gain == pytest.approx(1e-6, rel=1e-3)
    assert found.delay == pytest.approx(delay, abs=3e-6)
    assert 0.8 < found.misfit < 1.3
    if np.isfinite(bandwidth):
        assert found.bandwidth == pytest.approx(bandwidth, rel=0.01)
    else:
        assert found.bandwidth == np.inf


def test_it_finds_several_modes_and_their_number() -> None:
    found = pt.fit_modes(measured(SEVERAL, noise=5e-9, delay=1e-4))
    assert found.frequencies == pytest.approx([160.0, 310.0, 560.0], rel=1e-3)
    assert found.damping_ratios == pytest.approx([0.03, 0.01, 0.03], rel=0.02)
    assert found.gains == pytest.approx([0.85e-6, 0.2e-6, -0.05e-6], rel=0.01)
    # The stage made of it answers like that which was measured, at voltages of its own.
    u = 30.0 + np.cumsum(np.random.default_rng(1).standard_normal(400)) / 20.0
    ours = found.stage.simulate(u, 1 / RATE, hold="zoh").x
    truth = pt.VirtualStage.of(SEVERAL).simulate(u, 1 / RATE, hold="zoh").x
    assert np.abs(ours - truth).max() < 2e-3 * np.ptp(truth)


@pytest.mark.slow
def test_standard_deviations_hold() -> None:
    # 40 records: within two standard deviations in 95 % of them.
    scores = []
    for seed in range(40):
        lines = replace(LINES, seed=seed)
        found = pt.fit_modes(measured(MODE, lines, noise=200e-9, delay=2e-4, seed=seed), modes=1)
        scores.append(
            [
                (found.frequencies[0] - 160.0) / found.frequencies_sd[0],
                (found.damping_ratios[0] - 0.03) / found.damping_ratios_sd[0],
                (found.delay - 2e-4) / found.delay_sd,
            ]
        )
    spread = np.std(scores, axis=0)
    assert (spread > 0.7).all()
    assert (spread < 1.4).all()
    assert np.abs(np.mean(scores, axis=0)).max() < 0.6


def test_modes_survive_hysteresis() -> None:
    plays = replace(MODE, thresholds=(0.3, 1.0, 3.0), weights=(1e-7, 1e-7, 1e-7))
    found = pt.fit_modes(measured(plays, noise=5e-9, delay=2e-4))
    main = int(np.argmin(np.abs(found.frequencies - 160.0)))
    assert found.frequencies[main] == pytest.approx(160.0, rel=0.01)
    assert found.damping_ratios[main] == pytest.approx(0.03, abs=0.01)


def test_what_cannot_be_fitted_is_refused() -> None:
    response = measured(MODE, noise=5e-9)
    for wrong in ({"modes": 0}, {"modes": 5}, {"delay": -1.0}, {"delay": np.nan}):
        with pytest.raises(pt.ParameterError, match=next(iter(wrong))):
            pt.fit_modes(response, **wrong)
    with pytest.raises(pt.DataError, match="lines"):
        pt.fit_modes(response.within(8.0, 60.0), modes=4)
    with pytest.raises(pt.ParameterError, match="band with lines"):
        response.within(900.0, 950.0)


def test_the_describing_function_of_a_play_is_that_of_the_textbook() -> None:
    # Backlash of width 2 r (Gelb and Vander Velde 1968, table of appendix B).
    r = 2.0
    both = pt.PrandtlIshlinskiiStage(linear=1e-9, thresholds=(r,), weights=(1e-6,))
    sizes = np.array([2.5, 4.0, 10.0, 100.0])
    found = both.describing_function(sizes, 1.0, offset=30.0) - 1e-9
    k = 1.0 - 2.0 * r / sizes
    real = (0.5 * np.pi + np.arcsin(k) + k * np.sqrt(1.0 - k * k)) / np.pi
    imaginary = -4.0 * r / (np.pi * sizes) * (1.0 - r / sizes)
    assert 1e6 * found == pytest.approx(real + 1j * imaginary, abs=2e-4)
    # Below the dead zone it does not move.
    assert abs(both.describing_function(1.0, 1.0, offset=30.0) - 1e-9) < 1e-12
    for wrong in ({"amplitude": 0.0}, {"frequency": -1.0}, {"offset": np.inf}):
        with pytest.raises(pt.ParameterError, match=next(iter(wrong))):
            both.describing_function(**{"amplitude": 1.0, "frequency": 1.0, **wrong})


def test_the_describing_function_of_a_mode_is_its_response() -> None:
    f = np.array([20.0, 150.0, 400.0])
    found = np.array([complex(MODE.describing_function(1.0, one, offset=0.0)) for one in f])
    w, s = 2.0 * np.pi * 160.0, 2j * np.pi * f
    late = 0.03 * w * 3.0 / f
    truth = 1e-6 * w * w / (s * s + 0.06 * w * s + w * w)
    # The third period holds what is left of the transient.
    assert np.abs(found / truth - 1.0)[0] < 1e-3
    assert (np.abs(found / truth - 1.0) < 3.0 * np.exp(-late) + 1e-3).all()


def test_a_response_lies_on_the_describing_function_where_one_line_moves_the_stage() -> None:
    # Nearly a sine: the other lines are weak.
    plays = pt.PrandtlIshlinskiiStage(
        linear=1e-6, thresholds=(0.5, 2.0, 6.0), weights=(2e-7, 1e-7, 2e-7)
    )
    for size in (0.3, 3.0, 20.0):
        lines = pt.RandomPhaseMultisine(
            band=(4.0, 40.0), low=30.0 - size, high=30.0 + size, shape=[(4.0, 1.0), (8.0, 1e-3)]
        )
        found = pt.frequency_response(plays, lines, rate=RATE)
        late = np.exp(-2j * np.pi * 4.0 / RATE)
        truth = plays.describing_function(np.sqrt(2.0) * found.amplitude, 4.0, offset=30.0) * late
        assert found.value[0] == pytest.approx(truth, rel=0.01)


def test_the_modes_are_dynamics_of_a_stage_that_a_slow_log_identified() -> None:
    slow = pt.PrandtlIshlinskiiStage(linear=1e-6, thresholds=(5.0,), weights=(2e-7,))
    found = pt.fit_modes(measured(SEVERAL, noise=5e-9))
    fast = replace(slow, **found.dynamics)
    assert fast.mode_frequencies == pytest.approx((310.0, 560.0), rel=1e-3)
    assert fast.thresholds == slow.thresholds
