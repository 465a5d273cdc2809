"""H-infinity design: what is asked for is what the loop has, on every gain of a stage."""

from __future__ import annotations

import builtins
import math
from typing import Any

import numpy as np
import pytest

import piezotrack as pt
from piezotrack.control import mixed_sensitivity

STAGE = pt.VirtualStage.xu_li_2010(seed=1)
LIMITS = (0.0, 75.0)


@pytest.mark.parametrize(("dt", "bandwidth"), [(1e-3, 10.0), (1e-3, 40.0), (2e-4, 40.0)])
def test_the_loop_is_stable_and_below_the_peak_at_every_gain(dt: float, bandwidth: float) -> None:
    law = mixed_sensitivity(STAGE, dt=dt, limits=LIMITS, bandwidth=bandwidth)
    loop = pt.Controller(dt=dt, limits=LIMITS, feedback=law)
    report = pt.check_loop(STAGE, loop)
    assert law.gamma < 1.05
    assert report.everywhere
    assert max(one.sensitivity for one in (report.low, report.middle, report.high)) < 2.0
    # The weight W1 is kept by gamma at every frequency, in the scale of the bilinear transform.
    response = report.response()
    s = 1j * np.tan(math.pi * response.frequency * dt)
    edge = math.tan(math.pi * bandwidth * dt)
    weighted = np.abs((s / 2.0 + edge) / (s + 1e-4 * edge) * response.sensitivity)
    assert weighted.max() <= 1.001 * law.gamma
    assert np.abs(response.sensitivity[response.frequency < 0.5 * bandwidth]).max() < 0.71


def test_the_effort_and_the_roll_off_are_kept() -> None:
    dt, gain = 2e-4, pt.check_loop(STAGE, pt.Controller(dt=1e-3, limits=LIMITS)).middle.gain
    law = mixed_sensitivity(STAGE, dt=dt, limits=LIMITS, bandwidth=20.0, effort=3.0, roll_off=100.0)
    loop = pt.Controller(dt=dt, limits=LIMITS, feedback=law)
    response = pt.check_loop(STAGE, loop).response()
    rows, b, c, d, _ = law._matrices
    a = np.reshape(rows, (len(b), len(b)))
    z = np.exp(2j * math.pi * response.frequency * dt)
    gains = [c @ np.linalg.solve(one * np.eye(len(b)) - a, b) + d for one in z]
    effort = gain * np.abs(np.array(gains) * response.sensitivity)
    assert effort.max() <= 1.001 * 3.0 * law.gamma
    beyond = response.frequency > 200.0
    assert np.abs(response.complementary[beyond]).max() < 0.51 * law.gamma


@pytest.mark.parametrize("bandwidth", [10.0, 30.0, 80.0])
def test_noise_is_kept_from_the_voltage(bandwidth: float) -> None:
    """Poles near -1, of the law of the least gamma, ring from sample to sample."""
    law = mixed_sensitivity(STAGE, dt=1e-3, limits=LIMITS, bandwidth=bandwidth)
    rows, b, c, d, _ = law._matrices
    a = np.reshape(rows, (len(b), len(b)))
    assert np.linalg.eigvals(a).real.min() > -0.5
    # At half the sampling rate, where the plant has no gain: a fifth of the effort below it.
    at_end = abs(c @ np.linalg.solve(-np.eye(len(b)) - a, b) + d)
    gain = pt.check_loop(STAGE, pt.Controller(dt=1e-3, limits=LIMITS)).middle.gain
    assert gain * at_end < 2.0 * law.gamma


def test_it_follows_a_reference_on_the_stage_with_hysteresis() -> None:
    law = mixed_sensitivity(STAGE, dt=2e-4, limits=LIMITS, bandwidth=40.0)
    loop = pt.Controller(dt=2e-4, limits=LIMITS, feedback=law)
    reference = pt.sine(frequency=1.0, low=10e-6, high=80e-6, duration=2.0)
    run = pt.track(STAGE, loop, reference)
    # |S| is about f over the bandwidth below it: 1/40 of 35 um and the noise of the sensor.
    assert run.metrics.max_error < 1.5 * 35e-6 / 40.0 + 4 * 0.1e-6


def test_a_stage_that_falls_as_the_voltage_rises_gets_a_negative_law() -> None:
    falling = pt.PrandtlIshlinskiiStage(linear=-1e-6, thresholds=(5.0,), weights=(-5e-7,))
    law = mixed_sensitivity(falling, dt=1e-3, limits=LIMITS, bandwidth=20.0)
    loop = pt.Controller(dt=1e-3, limits=LIMITS, feedback=law)
    assert pt.check_loop(falling, loop).everywhere


def test_a_delay_is_in_the_design_and_too_long_a_one_is_refused() -> None:
    for delay in (1e-3, 5e-3):
        law = mixed_sensitivity(STAGE, dt=2e-4, limits=LIMITS, bandwidth=10.0, delay=delay)
        loop = pt.Controller(dt=2e-4, limits=LIMITS, feedback=law)
        assert pt.check_loop(STAGE, loop, delay=delay).everywhere
    with pytest.raises(pt.ParameterError, match="bandwidth is 60 Hz, with which gamma is"):
        mixed_sensitivity(STAGE, dt=2e-4, limits=LIMITS, bandwidth=60.0, delay=5e-3)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"bandwidth": 200.0}, r"bandwidth is 200 Hz, with which gamma is 2.2"),
        ({"bandwidth": 300.0}, "expected below 250 Hz"),
        ({"effort": 0.3}, "an effort above 0.3"),
        ({"largest_sensitivity": 1.0}, "largest_sensitivity is 1: expected above 1"),
        ({"roll_off": 5.0}, "roll_off is 5 Hz"),
        ({"limits": None}, "limits are missing"),
        ({"dt": math.nan}, "dt is nan"),
    ],
)
def test_what_cannot_be_had_is_refused(options: dict[str, Any], words: str) -> None:
    given: dict[str, Any] = {"dt": 1e-3, "limits": LIMITS, "bandwidth": 40.0, **options}
    with pytest.raises(pt.ParameterError, match=words):
        mixed_sensitivity(STAGE, **given)


def test_without_slycot_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    real = builtins.__import__

    def without(name: str, *rest: Any, **named: Any) -> Any:
        if name == "slycot":
            raise ImportError(name=name)
        return real(name, *rest, **named)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(pt.ParameterError, match=r"needs slycot: .*piezotrack\[robust\]"):
        mixed_sensitivity(STAGE, dt=1e-3, limits=LIMITS, bandwidth=10.0)


def test_a_law_that_holds_its_state_under_saturation_is_named() -> None:
    """A root outside the unit circle that C misses has no stable gain of back-calculation."""
    held = pt.control.StateSpace([[0.9, 0.0], [0.0, 1.01]], [0.0, 2000.0], [1.0, 0.0], d=1e4)
    integrator = pt.control.StateSpace([[1.0]], [2000.0], [1.0])
    for law, holds in ((held, True), (integrator, False)):
        report = pt.check_loop(STAGE, pt.Controller(dt=1e-3, limits=LIMITS, feedback=law))
        assert report.holds_state is holds
        assert ("held" in report.summary()) is holds
        assert report.design().get("antiwindup") == ("held state" if holds else None)


def test_a_compared_law_keeps_the_phase_margin() -> None:
    """More phase than Ms implies costs bandwidth."""
    reference = [pt.sine(frequency=2.0, low=20e-6, high=60e-6, duration=3.0)]
    crossovers: list[float] = []
    for phase in (0.5, 1.3):
        found = pt.compare_controllers(
            STAGE,
            pt.stages.DahlStage.xu_li_2010(),
            dt=1e-3,
            limits=LIMITS,
            references=reference,
            controllers=["inverse + H-infinity"],
            margins=pt.Margins(phase=phase),
            seeds=1,
        )
        report = pt.check_loop(STAGE, found.rows[0].controller)
        for case in (report.low, report.middle, report.high):
            assert case.phase_margin is not None
            assert case.phase_margin >= phase
        crossovers.append(report.high.crossover or math.inf)
    assert crossovers[1] < crossovers[0]


def test_the_phase_at_the_crossover_is_the_margin() -> None:
    law = mixed_sensitivity(STAGE, dt=2e-4, limits=LIMITS, bandwidth=40.0)
    report = pt.check_loop(STAGE, pt.Controller(dt=2e-4, limits=LIMITS, feedback=law))
    response = report.response(4000)
    crossing = int(np.flatnonzero(np.abs(response.open_loop) > 1.0)[-1])
    margin = report.middle.phase_margin
    assert margin is not None
    assert response.phase[crossing] == pytest.approx(margin - math.pi, abs=0.02)
