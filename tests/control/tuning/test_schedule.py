"""Scheduled gains: what they gain over one fixed set, bumpless changes, what is refused."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

import piezotrack as pt
from piezotrack.control import Schedule, ScheduledPid

LIMITS = (0.0, 75.0)
CENTRE = 58.5e-6
AMPLITUDES, RATES = (10e-6, 40e-6), (0.2, 0.5)
FULL: dict[str, Any] = {"dt": 0.02, "limits": LIMITS}
QUICK = {**FULL, "search": pt.TuningSearch(particles=8, iterations=4)}
SEEDS = (11, 12, 13, 14)


def motion(amplitude: float, rate: float, periods: float = 4.0) -> pt.Reference:
    low, high = CENTRE - amplitude, CENTRE + amplitude
    return pt.sine(frequency=rate, low=low, high=high, duration=periods / rate)


@cache
def whole_schedule() -> Schedule:
    stage = pt.VirtualStage.xu_li_2010(seed=1)
    return pt.schedule(stage, AMPLITUDES, RATES, centre=CENTRE, **FULL)


def law() -> ScheduledPid:
    feedback = whole_schedule().controller.feedback
    assert isinstance(feedback, ScheduledPid)
    return feedback


def errors(controller: pt.Controller, reference: pt.Reference) -> Any:
    return np.array(
        [
            pt.track(pt.VirtualStage.xu_li_2010(seed=seed), controller, reference).metrics.rms_error
            for seed in SEEDS
        ]
    )


@pytest.mark.slow
def test_better_in_the_sum_and_nowhere_worse_than_the_noise_explains() -> None:
    """On noise that the search has not seen, each motion from its own gains on."""
    sums = np.zeros(2)
    for amplitude in AMPLITUDES:
        for rate in RATES:
            reference = motion(amplitude, rate)
            own = replace(law(), first=(amplitude, rate))
            scheduled = errors(replace(whole_schedule().controller, feedback=own), reference)
            fixed = errors(whole_schedule().fixed.controller, reference)
            assert scheduled.mean() < fixed.mean() + 2.0 * fixed.std(ddof=1)
            sums += fixed.mean(), scheduled.mean()
    assert sums[1] < 0.95 * sums[0]


@pytest.mark.slow
def test_the_table_is_that_of_the_runs() -> None:
    table = whole_schedule().errors
    assert table.shape == (2, 2, 2)
    assert (table[..., 1] <= table[..., 0]).all()
    runs = whole_schedule().fixed.runs
    assert table[..., 0].ravel() == pytest.approx([one.metrics.rms_error for one in runs])
    # At a place of the grid, the controller is that of the gains found there.
    controller = replace(
        whole_schedule().controller, feedback=replace(law(), first=(AMPLITUDES[0], RATES[1]))
    )
    alone = pt.track(
        pt.VirtualStage.xu_li_2010(seed=1), controller, motion(AMPLITUDES[0], RATES[1])
    )
    assert table[0, 1, 1] == pytest.approx(alone.metrics.rms_error, rel=0.05)
    text = str(whole_schedule()).splitlines()
    assert len(text) == 5
    assert text[1].split()[:2] == ["10", "0.2"]


def test_the_margins_hold_at_every_place() -> None:
    stage = pt.VirtualStage.xu_li_2010(seed=1)
    for gains in law().gains:
        loops = pt.check_loop(stage, replace(whole_schedule().controller, feedback=gains))
        for margin in (loops.low, loops.middle, loops.high):
            assert margin.stable
            assert margin.sensitivity <= 2.0 * 1.01
            assert (margin.gain_margin or np.inf) >= 2.0 * 0.99


def test_a_change_of_gains_does_not_bump_the_voltage() -> None:
    """At rest on an offset the integral part alone holds the voltage: it has to stay there.

    Gains ten times as high in all parts, for the half wave that has just ended: with an integral
    that was not rescaled the output would jump by 90 % of what it held.
    """
    low, high = pt.Pid.from_um(kp=0.02, ti=0.2), pt.Pid.from_um(kp=0.2, ti=0.02)
    changing = ScheduledPid(
        amplitudes=[1e-6, 10e-6], rates=[1.0], gains=[low, high], first=(1e-6, 1.0)
    )
    controller = pt.Controller(dt=0.01, limits=LIMITS, feedback=changing)
    session = controller.start()
    # Half a second of an error of 20 um charges the integral; then there is no error.
    for _ in range(50):
        held = session.step(20e-6, 0.0)
    held = session.step(0.0, 0.0)
    assert held > 0.5
    voltages = []
    t = 0.01 * np.arange(300)
    for x in 10e-6 * np.sin(2.0 * np.pi * t):
        # The stage is where it should be: only the change of gains could move the voltage.
        voltages.append(session.step(x, x))
    assert np.abs(np.array(voltages) - held).max() < 1e-9 * held
    # The gains have changed: the same small error now gives ten times the voltage and more.
    before = controller.start()
    for _ in range(3):
        first = before.step(0.0, 0.0)
    answer = session.step(0.1e-6, 0.0) - session.step(0.0, 0.0)
    assert abs(first) < 1e-12
    assert answer > 5.0 * (before.step(0.1e-6, 0.0) - first)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"amplitudes": []}, "amplitudes is []: expected 1 to 4 values in m"),
        ({"amplitudes": [1e-6] * 5}, "expected 1 to 4 values in m"),
        ({"amplitudes": [2e-5, 1e-5]}, "amplitudes are (2e-05, 1e-05): expected them in rising"),
        ({"amplitudes": [-1e-6]}, "amplitudes is -1e-06"),
        ({"rates": [0.2, 0.2]}, "rates are (0.2, 0.2): expected them in rising order"),
        ({"rates": 0.2}, "rates is 0.2: expected 1 to 4 values in Hz"),
        ({"parts": ("pid", "repetitive")}, "parts has 'repetitive': expected none"),
        ({"parts": ("magic",)}, "parts is"),
        ({"amplitudes": [90e-6]}, "reference is"),
        ({"limits": None}, "limits"),
        ({"centre": float("nan")}, "low"),
    ],
)
def test_wrong_input_is_named(changes: dict[str, Any], words: str) -> None:
    given = {"amplitudes": [10e-6], "rates": [0.2], "centre": CENTRE, **QUICK, **changes}
    stage = pt.VirtualStage.xu_li_2010(seed=1)
    with pytest.raises(pt.ParameterError, match=re.escape(words)):
        pt.schedule(stage, **given)


def test_wrong_gains_of_a_law_are_named() -> None:
    gains = [pt.Pid.from_um(kp=0.1, ti=0.02)]
    with pytest.raises(pt.ParameterError, match="gains has 1 entries: expected 2"):
        ScheduledPid(amplitudes=[1e-6, 2e-6], rates=[1.0], gains=gains)
    with pytest.raises(pt.ParameterError, match=re.escape("first is (1e-06,): expected (")):
        ScheduledPid(amplitudes=[1e-6], rates=[1.0], gains=gains, first=(1e-6,))  # type: ignore[arg-type]


def test_gains_that_lose_their_margin_between_two_places_are_refused() -> None:
    """Beyond what a search gives: two sets that are stable each, and nothing between them."""
    from piezotrack.control.tuning.margins import Margins, Spread, plants_of
    from piezotrack.control.tuning.schedule import _check_between

    stage = pt.VirtualStage.xu_li_2010(seed=1)
    plants = [one.plant for one in plants_of([stage], LIMITS, 0.0, Spread())]
    high = pt.Pid.from_um(kp=2.0, ti=0.02)
    unstable = ScheduledPid(amplitudes=[1e-5, 2e-5], rates=[0.2], gains=[high, high])
    loop = pt.Controller(dt=0.02, limits=LIMITS, feedback=unstable)
    with pytest.raises(pt.ParameterError, match="half-way between two places of the grid"):
        _check_between(loop, plants, Margins())
