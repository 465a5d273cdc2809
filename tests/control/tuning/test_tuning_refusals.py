"""Tunings that are refused: the argument, the value, and what can be reached."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Any

import pytest

import piezotrack as pt

if TYPE_CHECKING:
    from collections.abc import Callable

LIMITS = (0.0, 75.0)
QUICK: dict[str, Any] = {"search": pt.TuningSearch(particles=24, iterations=25)}


def published_stage() -> pt.VirtualStage:
    return pt.VirtualStage.xu_li_2010(seed=1)


def motion(duration: float = 15.0) -> pt.Reference:
    return pt.sine(frequency=0.2, low=0.0, high=100e-6, duration=duration)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"dt": None}, "dt is missing"),
        ({"dt": -1.0}, "dt is -1"),
        ({"dt": []}, "dt is empty"),
        ({"limits": None}, "limits are missing"),
        ({"limits": (75.0, 0.0)}, "expected the lower one first"),
        ({"parts": "pdi"}, "parts is 'pdi'"),
        ({"parts": "notch"}, "expected a mode that rings below half the sampling rate, 25 Hz"),
        ({"parts": "repetitive", "reference": None}, "expected references that repeat"),
        ({"margins": 2.0}, "margins is float"),
        ({"spread": 0.1}, "spread is float"),
        ({"reference": "sine"}, "reference 'sine': there is no frequency"),
        ({"feedforward": "dahl"}, "feedforward is 'dahl'"),
        ({"goal": "rms"}, "goal is str: expected pt.Goal"),
        ({"goal": pt.Goal(effort=-1.0)}, "effort is -1"),
        ({"goal": pt.Goal(slew=0.0)}, "slew is 0"),
        ({"goal": pt.Goal(slew=math.nan)}, "slew is NaN"),
        ({"goal": pt.Goal(largest_error=-1e-6)}, "largest_error is -"),
        ({"goal": pt.Goal(largest_saturation=2.0)}, "largest_saturation is 2"),
        (
            {"goal": pt.Goal(largest_error=1e-6), "reference": None},
            "largest_error is 1 um without a reference",
        ),
        ({"timing": 0.002}, "timing is float: expected pt.Timing"),
        ({"timing": pt.Timing(delay=-1.0)}, "delay is -1"),
        ({"timing": pt.Timing(jitter=-1.0)}, "jitter is -1"),
        ({"timing": pt.Timing(voltages_before=[9.0])}, "voltages_before is (9.0,): expected none"),
        ({"search": 40}, "search is int: expected pt.TuningSearch"),
        ({"search": pt.TuningSearch(particles=1)}, "particles is 1"),
        ({"stage": []}, "stage is empty"),
        ({"stage": "mine"}, "stage is '"),
    ],
)
def test_wrong_arguments_are_named(changes: dict[str, Any], words: str) -> None:
    given: dict[str, Any] = {
        "stage": published_stage(),
        "reference": motion(5.0),
        "dt": 0.02,
        "limits": LIMITS,
    }
    with pytest.raises(pt.ParameterError, match=re.escape(words)):
        pt.tune(**{**given, **QUICK, **changes})


def test_margins_that_no_gains_keep_are_refused_with_the_nearest() -> None:
    # The least gains of the search still have a sensitivity above 1.0001.
    with pytest.raises(
        pt.ParameterError, match=r"margins\.sensitivity is 1\.0001: .* nearest gains reach"
    ):
        pt.tune(
            published_stage(), motion(10.0), dt=0.02, limits=LIMITS, parts="pid",
            margins=pt.Margins(sensitivity=1.0001), timing=pt.Timing(delay=0.2), **QUICK,
        )  # fmt: skip


def test_a_gain_margin_far_out_of_reach_is_named_not_stability() -> None:
    words = (
        r"margins\.gain is 180 dB, a factor of 1e\+09: .* "
        r"nearest gains reach \d+\.?\d* dB .* dB too low"
    )
    with pytest.raises(pt.ParameterError, match=words):
        pt.tune(published_stage(), dt=0.02, limits=LIMITS, margins=pt.Margins(gain=1e9), **QUICK)


def test_a_slew_that_the_reference_itself_exceeds_is_refused_with_what_is_needed() -> None:
    stage = pt.stages.PrandtlIshlinskiiStage(
        linear=1.2e-6, thresholds=(10.0,), weights=(0.2e-6,), time_constant=1e-3
    )
    reference = pt.sine(frequency=0.2, low=4e-6, high=64e-6, duration=10.0)
    # The feedforward alone: 60 um in 2.5 s, at some 1.3 um/V.
    with pytest.raises(pt.ParameterError, match=r"slew is 10 V/s: expected [23]\d\.\d* V/s"):
        pt.tune(stage, reference, dt=0.02, limits=LIMITS, goal=pt.Goal(slew=10.0), **QUICK)


def test_a_reference_beyond_reach_is_refused() -> None:
    far = pt.sine(frequency=0.2, low=0.0, high=150e-6, duration=10.0)
    with pytest.raises(pt.ParameterError, match="beyond"):
        pt.tune(published_stage(), far, dt=0.02, limits=LIMITS, **QUICK)


def test_a_model_of_the_set_that_cannot_follow_is_named() -> None:
    weak = pt.stages.PrandtlIshlinskiiStage(
        linear=0.5e-6, thresholds=(10.0,), weights=(0.1e-6,), time_constant=1e-3
    )
    words = (
        "model 2: reference is 100 um .* expected .* to 43.01 um .*largest_saturation=0.5 or more"
    )
    with pytest.raises(pt.ParameterError, match=words):
        pt.tune([published_stage(), weak], motion(10.0), dt=0.02, limits=LIMITS, **QUICK)


def test_a_delay_beyond_the_memory_of_a_search_is_refused() -> None:
    with pytest.raises(pt.ParameterError, match=r"delay is 1e\+09 s in all: expected 2000 s"):
        pt.tune(
            published_stage(),
            motion(),
            dt=0.02,
            limits=LIMITS,
            timing=pt.Timing(delay=1e9),
            **QUICK,
        )


def test_plants_of_both_signs_are_refused() -> None:
    rising = pt.stages.PrandtlIshlinskiiStage(linear=1e-6, thresholds=(10.0,), weights=(0.2e-6,))
    other = pt.stages.PrandtlIshlinskiiStage(linear=-1e-6, thresholds=(10.0,), weights=(-0.2e-6,))
    with pytest.raises(pt.ParameterError, match="all of one sign"):
        pt.tune([rising, other], dt=1e-3, limits=LIMITS, parts="pid", **QUICK)


@pytest.mark.parametrize(
    ("name", "value"), [("gain", 1.0), ("phase", 30.0), ("sensitivity", 0.5), ("learning", 2.0)]
)
def test_impossible_margins_are_named(name: str, value: float) -> None:
    with pytest.raises(pt.ParameterError, match=f"{name} is {value:g}"):
        pt.Margins(**{name: value})


def test_an_error_that_is_not_reached_is_refused_with_the_least() -> None:
    stage, reference = published_stage(), motion()
    options: dict[str, Any] = {"dt": 0.02, "limits": LIMITS, "parts": "pid", **QUICK}
    words = r"largest_error is 0.001 um: expected 0\.\d+ um or more"
    with pytest.raises(pt.ParameterError, match=words):
        pt.tune(stage, reference, goal=pt.Goal(largest_error=1e-9), **options)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: pt.Goal(minimise="max"), "minimise is 'max': expected one of 'rms'"),  # type: ignore[arg-type]
        (lambda: pt.Goal(error="both"), "error is 'both'"),  # type: ignore[arg-type]
        (lambda: pt.Goal(slew="fast"), "slew is 'fast': expected a number"),  # type: ignore[arg-type]
        (lambda: pt.Goal(minimise="effort"), "minimise is 'effort' without largest_error"),
        (lambda: pt.Timing(delay="late"), "delay is 'late': expected a number"),  # type: ignore[arg-type]
        (lambda: pt.Timing(voltages_before=[None]), "voltages_before[0] is None"),  # type: ignore[list-item]
        (lambda: pt.TuningSearch(seed=-1), "seed is -1: expected a whole number"),
        (lambda: pt.TuningSearch(draws=0), "draws is 0: expected 1 to 100"),
        (lambda: pt.TuningSearch(draws=101), "draws is 101: expected 1 to 100"),
    ],
)
def test_settings_of_other_types_are_named(make: Callable[[], object], words: str) -> None:
    with pytest.raises(pt.ParameterError, match=re.escape(words)):
        make()
