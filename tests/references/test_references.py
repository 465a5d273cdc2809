"""References: exact derivatives, no jumps, nothing out of range, and words for bad input."""

from __future__ import annotations

import dataclasses
import math
import pickle
import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import piezotrack as pt

Array = NDArray[np.float64]

UM = 1e-6
PAGE_ONE: dict[str, Any] = {"frequency": 0.2, "low": 0.0, "high": 110e-6, "duration": 20.0}
RANGE: dict[str, Any] = {"low": 10e-6, "high": 60e-6, "duration": 6.0}
LINES = [0.5, 1.0, 1.5, 2.5]


def sampled_sine(**more: Any) -> pt.Reference:
    x = 50e-6 + 40e-6 * np.sin(2.0 * np.pi * np.arange(200) / 200)
    return pt.Reference.from_samples(x, 0.01, **more)


SMOOTH: dict[str, pt.Reference] = {
    "sine": pt.sine(**PAGE_ONE),
    "sine from its middle": pt.sine(frequency=1.0, phase=math.pi / 2, **RANGE),
    "sine with a long ramp": pt.sine(frequency=2.0, ramp=3.0, **RANGE),
    "triangle": pt.triangle(frequency=0.5, **RANGE),
    "triangle all round": pt.triangle(frequency=0.5, rounding=1.0, **RANGE),
    "staircase": pt.staircase(steps=3, low=10e-6, high=40e-6, dwell=0.8, rise=0.4),
    "staircase twice": pt.staircase(steps=2, low=0.0, high=40e-6, dwell=0.5, duration=5.0),
    "staircase without rest": pt.staircase(steps=2, low=0.0, high=4e-6, dwell=0.0, rise=1.0),
    "levels": pt.staircase(levels=[10e-6, 60e-6, 30e-6, 31e-6], dwell=1.0),
    "chirp": pt.chirp(start_frequency=0.5, stop_frequency=3.0, **RANGE),
    "chirp down": pt.chirp(start_frequency=3.0, stop_frequency=0.5, **RANGE),
    "multisine": pt.multisine(frequencies=LINES, **RANGE),
    "multisine of random phases": pt.multisine(frequencies=LINES, seed=3, **RANGE),
    "multisine of given size": pt.multisine(
        frequencies=[2.5, 0.7], amplitudes=[2e-6, 20e-6], offset=40e-6, duration=6.0
    ),
    "samples with a ramp": sampled_sine(ramp=0.5),
    "samples that repeat": sampled_sine(period=2.0, duration=6.0, ramp=0.5),
}
ABRUPT: dict[str, pt.Reference] = {
    "sine": pt.sine(ramp=0.0, **PAGE_ONE),
    "triangle": pt.triangle(frequency=0.5, ramp=0.0, **RANGE),
    "chirp": pt.chirp(start_frequency=0.5, stop_frequency=3.0, ramp=0.0, **RANGE),
    "multisine": pt.multisine(frequencies=LINES, ramp=0.0, **RANGE),
    "samples": sampled_sine(),
}
ALL = {**SMOOTH, **{f"abrupt {name}": value for name, value in ABRUPT.items()}}


def sizes(reference: pt.Reference, count: int = 20001) -> tuple[Array, Array, Array, Array]:
    t = np.linspace(0.0, reference.duration, count)
    return (t, *reference.at(t))


# Derivatives and their continuity.


@pytest.mark.parametrize("name", ALL)
def test_the_derivatives_are_those_of_the_motion(name: str) -> None:
    reference = ALL[name]
    # Central differences of fourth order, away from the ends.
    h = 1e-4
    t = np.linspace(2.0 * h, reference.duration - 2.0 * h, 4001)
    near = {k: reference.at(np.clip(t + k * h, 0.0, reference.duration)) for k in (-2, -1, 0, 1, 2)}
    for k in (0, 1):
        difference = (8.0 * (near[1][k] - near[-1][k]) - (near[2][k] - near[-2][k])) / (12.0 * h)
        exact = near[0][k + 1]
        error = np.abs(difference - exact) / np.abs(exact).max()
        assert np.quantile(error, 0.98) < 1e-8
        # Where the third derivative jumps, the difference itself is of a lower order.
        assert error.max() < (1e-5, 1e-2)[k]


@pytest.mark.parametrize("name", SMOOTH)
def test_neither_velocity_nor_acceleration_jumps(name: str) -> None:
    reference = SMOOTH[name]
    x, v, a = reference.at(np.zeros(1))
    rest = [np.abs(values).max() for values in sizes(reference)[1:]]
    assert abs(v[0]) <= 1e-12 * rest[1]
    assert abs(a[0]) <= 1e-12 * rest[2]
    for fewer, more in ((10001, 20001), (20001, 40001)):
        for k in (1, 2, 3):
            coarse, fine = (
                np.abs(np.diff(sizes(reference, count)[k])).max() for count in (fewer, more)
            )
            # A jump would stay as large on the finer grid.
            assert fine < 0.6 * coarse
    assert reference.low - 1e-15 <= x[0] <= reference.high + 1e-15


@pytest.mark.parametrize("name", ALL)
def test_the_range_is_kept(name: str) -> None:
    reference = ALL[name]
    _, x, _, _ = sizes(reference, 40001)
    assert x.min() >= reference.low - 1e-15
    assert x.max() <= reference.high + 1e-15


@pytest.mark.parametrize("name", ABRUPT)
def test_the_range_is_reached(name: str) -> None:
    _, x, _, _ = sizes(ABRUPT[name], 40001)
    stroke = ABRUPT[name].high - ABRUPT[name].low
    assert x.min() == pytest.approx(ABRUPT[name].low, abs=1e-6 * stroke)
    assert x.max() == pytest.approx(ABRUPT[name].high, abs=1e-6 * stroke)


@pytest.mark.parametrize("name", [name for name in ALL if ALL[name].period is not None])
def test_the_motion_repeats(name: str) -> None:
    reference = ALL[name]
    assert reference.period is not None
    t = np.linspace(reference.ramp, reference.duration - reference.period, 999)
    if t[-1] > t[0]:
        now, later = reference.at(t), reference.at(t + reference.period)
        for k in range(3):
            np.testing.assert_allclose(now[k], later[k], atol=1e-9 * np.abs(now[k]).max())


# The smooth start.


def test_page_one_begins_at_low_at_rest_and_keeps_its_phase() -> None:
    reference = pt.sine(**PAGE_ONE)
    t, x, v, a = sizes(reference)
    assert (x[0], v[0], a[0]) == (0.0, 0.0, 0.0)
    later = t >= reference.ramp
    np.testing.assert_allclose(
        x[later], 55e-6 * (1.0 - np.cos(0.4 * np.pi * t[later])), rtol=0.0, atol=1e-18
    )
    # The start is a sixth of a period and asks for no more speed than the sine.
    assert reference.ramp == pytest.approx(5.0 / 6.0)
    assert np.abs(v).max() <= 55e-6 * 0.4 * np.pi * (1.0 + 1e-12)


def test_without_a_start_the_sine_is_bare() -> None:
    t, x, v, a = sizes(pt.sine(ramp=0.0, **PAGE_ONE))
    rate = 0.4 * np.pi
    np.testing.assert_allclose(x, 55e-6 * (1.0 - np.cos(rate * t)), rtol=0.0, atol=1e-18)
    np.testing.assert_allclose(v, 55e-6 * rate * np.sin(rate * t), rtol=0.0, atol=1e-18)
    np.testing.assert_allclose(a, 55e-6 * rate**2 * np.cos(rate * t), rtol=0.0, atol=1e-18)


def test_a_start_at_full_speed_is_at_most_1_8_times_as_fast() -> None:
    def line(t: Array) -> tuple[Array, Array, Array]:
        return t, np.ones_like(t), np.zeros_like(t)

    reference = pt.Reference(name="line", duration=1.0, low=0.0, high=1.0, motion=line, ramp=0.5)
    assert 1.7 < sizes(reference)[2].max() < 1.8


def test_a_short_reference_has_a_short_start() -> None:
    assert pt.sine(**{**PAGE_ONE, "duration": 0.5}).ramp == 0.5


# The kinds.


def test_the_fundamental_is_what_was_asked_for() -> None:
    samples = pt.sine(**PAGE_ONE).sample(0.02)
    second_half = samples.x[len(samples) // 2 :]
    lines = np.fft.rfft(second_half) / second_half.size
    size = 2.0 * np.abs(lines)
    assert np.argmax(size[1:]) + 1 == 2  # two periods
    assert size[2] == pytest.approx(55e-6, rel=1e-12)
    assert lines[0].real == pytest.approx(55e-6, rel=1e-12)
    assert np.delete(size, [0, 2]).max() < 1e-18


def test_a_phase_of_pi_begins_at_high() -> None:
    reference = pt.sine(phase=math.pi, **PAGE_ONE)
    assert reference.at(0.0)[0] == pytest.approx(110e-6, rel=1e-12)


def test_a_triangle_goes_straight_between_its_corners() -> None:
    reference = pt.triangle(frequency=0.5, rounding=0.2, ramp=0.0, **RANGE)
    t, _, v, a = sizes(reference)
    within = np.abs((t + 0.5) % 1.0 - 0.5) > 0.1 + 1e-9
    speed = 50e-6 / (1.0 - 0.75 * 0.1)
    np.testing.assert_allclose(np.abs(v[within]), speed, rtol=1e-12)
    assert np.abs(a[within]).max() == 0.0
    assert np.count_nonzero(within) / t.size == pytest.approx(0.8, abs=0.01)
    x = reference.at([0.0, 1.0, 2.0])[0]
    np.testing.assert_allclose(x, [10e-6, 60e-6, 10e-6], rtol=1e-12)


def test_sharp_corners_have_the_velocity_behind_them() -> None:
    reference = pt.triangle(frequency=0.5, rounding=0.0, ramp=0.0, **RANGE)
    x, v, a = reference.at([0.0, 0.5, 1.0, 1.5, 2.0])
    np.testing.assert_allclose(x, np.array([10.0, 35.0, 60.0, 35.0, 10.0]) * UM, rtol=1e-12)
    np.testing.assert_allclose(v, np.array([1.0, 1.0, -1.0, -1.0, 1.0]) * 50e-6, rtol=1e-12)
    assert not a.any()


def test_a_staircase_rests_on_its_levels() -> None:
    reference = pt.staircase(steps=2, low=0.0, high=20e-6, dwell=1.0, rise=0.25)
    assert (reference.period, reference.duration) == (5.0, 5.0)
    for k, level in enumerate([0.0, 10e-6, 20e-6, 10e-6]):
        x, v, a = reference.at(1.25 * k + np.linspace(0.0, 1.0, 11))
        np.testing.assert_allclose(x, level, rtol=0.0, atol=1e-18)
        assert np.abs(v).max() < 1e-15
        assert np.abs(a).max() < 1e-12
    # Fastest in the middle of a rise: 15/8 of the mean.
    assert reference.at(1.125)[1] == pytest.approx(10e-6 / 0.25 * 15.0 / 8.0)


def test_the_last_of_given_levels_is_held() -> None:
    reference = pt.staircase(levels=(0.0, 5e-6), dwell=1.0, duration=9.0)
    assert reference.period is None
    np.testing.assert_allclose(reference.at([2.5, 9.0])[0], 5e-6)


def test_a_chirp_goes_from_one_frequency_to_the_other() -> None:
    reference = pt.chirp(
        start_frequency=1.0, stop_frequency=5.0, low=-1e-6, high=1e-6, duration=10.0, ramp=0.0
    )
    t, _, v, _ = sizes(reference, 400001)
    # One turn after the other ends at a lowest point, where the velocity goes through zero.
    lows = t[1:][(v[:-1] < 0.0) & (v[1:] >= 0.0)]
    assert lows.size == pytest.approx(0.5 * (1.0 + 5.0) * 10.0, abs=1)
    rate = 1.0 / np.diff(lows)
    middle = 0.5 * (lows[1:] + lows[:-1])
    np.testing.assert_allclose(rate, 1.0 + 0.4 * middle, rtol=1e-2)
    assert reference.period is None


def test_a_multisine_has_its_lines_and_no_others() -> None:
    sizes_um = np.array([4.0, 3.0, 2.0, 1.0])
    reference = pt.multisine(
        frequencies=LINES, amplitudes=sizes_um * UM, offset=20e-6, duration=8.0, ramp=0.0
    )
    assert reference.period == 2.0
    samples = reference.sample(0.01)
    lines = 2.0 * np.abs(np.fft.rfft(samples.x)) / len(samples)
    at = (np.array(LINES) * 8.0).astype(int)
    np.testing.assert_allclose(lines[at], sizes_um * UM, rtol=1e-12)
    assert lines[0] / 2.0 == pytest.approx(20e-6, rel=1e-12)
    assert np.delete(lines, [0, *at]).max() < 1e-18


def test_amplitudes_as_ratios_keep_their_order() -> None:
    reference = pt.multisine(
        frequencies=[2.0, 1.0], amplitudes=[1.0, 3.0], low=0.0, high=9e-6, duration=1.0, ramp=0.0
    )
    found = np.abs(np.fft.rfft(reference.sample(0.01).x))
    assert found[1] / found[2] == pytest.approx(3.0)


def test_schroeders_phases_are_flatter_than_equal_ones() -> None:
    lines = np.arange(1, 21)
    reference = pt.multisine(frequencies=lines, amplitudes=UM, offset=0.0, duration=1.0, ramp=0.0)
    rms = UM * math.sqrt(lines.size / 2.0)
    # Cosines all in phase would have a crest factor of sqrt(2 n) = 6.3.
    assert max(-reference.low, reference.high) / rms < 1.8


def test_a_seed_gives_the_same_phases() -> None:
    first, same, other = (
        pt.multisine(frequencies=LINES, seed=seed, **RANGE).sample(0.01).x for seed in (1, 1, 2)
    )
    assert np.array_equal(first, same)
    assert not np.allclose(first, other)


def test_a_multisine_that_does_not_repeat_in_time_has_no_period() -> None:
    assert pt.multisine(frequencies=[1.0, math.sqrt(2.0)], **RANGE).period is None
    assert pt.multisine(frequencies=[0.01, 1.0], **RANGE).period is None


# Samples.


@pytest.mark.parametrize("period", [None, 2.0])
def test_the_spline_of_a_sine_is_a_sine(period: float | None) -> None:
    reference = sampled_sine(period=period)
    # Without a period the ends know of one side only.
    t = np.linspace(0.1, 1.9, 1001) if period is None else np.linspace(0.0, 2.0, 1001)
    x, v, a = reference.at(t)
    angle = np.pi * t
    # A quintic spline: 1/200 of a period between samples, errors of h^6, h^5 and h^4.
    np.testing.assert_allclose(x, 50e-6 + 40e-6 * np.sin(angle), atol=40e-6 * 1e-10)
    np.testing.assert_allclose(v, 40e-6 * np.pi * np.cos(angle), atol=40e-6 * np.pi * 1e-8)
    np.testing.assert_allclose(a, -40e-6 * np.pi**2 * np.sin(angle), atol=40e-6 * np.pi**2 * 1e-6)
    assert reference.high == pytest.approx(90e-6, rel=1e-9)


def test_the_samples_are_met() -> None:
    x = np.random.default_rng(0).normal(size=50) * UM
    for period in (None, 5.0):
        samples = pt.Reference.from_samples(x, 0.1, period=period).sample(0.1)
        np.testing.assert_allclose(samples.x, x, rtol=0.0, atol=1e-18)
        assert samples.period == period


def test_a_closing_sample_is_not_taken_twice() -> None:
    x = UM * np.cos(2.0 * np.pi * np.arange(101) / 100)
    reference = pt.Reference.from_samples(x, 0.02, period=2.0, duration=20.0)
    assert reference.duration == 20.0
    np.testing.assert_allclose(reference.at([0.0, 2.0, 14.0])[0], UM, rtol=1e-9)


def test_a_longer_record_is_followed_as_it_is() -> None:
    x = UM * (np.cos(2.0 * np.pi * np.arange(400) / 100) + np.arange(400) / 400)
    reference = pt.Reference.from_samples(x, 0.02, period=2.0)
    assert (reference.period, reference.duration) == (2.0, 8.0)
    np.testing.assert_allclose(reference.sample(0.02).x, x, rtol=0.0, atol=1e-18)


def test_a_constant_is_a_reference() -> None:
    x, v, a = pt.Reference.from_samples(np.full(10, 33e-6), 0.1).at(np.linspace(0.0, 1.0, 7))
    assert (x == 33e-6).all()
    assert not v.any()
    assert not a.any()


# Sampling.


def test_samples_are_even_read_only_and_end_before_the_end() -> None:
    samples = pt.sine(**PAGE_ONE).sample(0.02)
    assert (len(samples), samples.dt, samples.period) == (1000, 0.02, 5.0)
    assert samples.t[-1] == pytest.approx(19.98)
    for array in (samples.t, samples.x, samples.v, samples.a):
        assert array.shape == (1000,)
        assert array.dtype == np.float64
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0


@pytest.mark.parametrize(
    ("duration", "dt", "count"), [(1.0, 0.1, 10), (1.0, 0.3, 4), (0.7, 0.1, 7)]
)
def test_a_sample_at_the_very_end_is_the_next_periods(
    duration: float, dt: float, count: int
) -> None:
    assert len(pt.sine(frequency=1.0, low=0.0, high=UM, duration=duration).sample(dt)) == count


def test_at_keeps_the_shape() -> None:
    reference = pt.sine(**PAGE_ONE)
    for t in (1.0, [1.0, 2.0], np.ones((2, 3)), np.empty(0)):
        assert [part.shape for part in reference.at(t)] == [np.shape(t)] * 3


def test_a_reference_can_be_pickled_and_changed() -> None:
    for reference in (pt.sine(**PAGE_ONE), sampled_sine(period=2.0)):
        same = pickle.loads(pickle.dumps(reference))
        assert np.array_equal(same.sample(0.02).a, reference.sample(0.02).a)
    longer = dataclasses.replace(pt.sine(**PAGE_ONE), duration=40.0)
    assert len(longer.sample(0.02)) == 2000


def test_importing_does_not_import_scipy() -> None:
    code = (
        "import sys, piezotrack as pt\n"
        f"pt.sine(**{PAGE_ONE!r}).sample(0.02)\n"
        "sys.exit('scipy' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


# Refusals.

SINE = {"frequency": 1.0, **RANGE}
CHIRP = {"start_frequency": 1.0, "stop_frequency": 2.0, **RANGE}
BAD: list[tuple[Any, dict[str, Any], str]] = [
    (pt.sine, {**SINE, "frequency": 0.0}, "frequency is 0: expected a finite number above 0"),
    (pt.sine, {**SINE, "frequency": math.nan}, "frequency is nan"),
    (pt.sine, {**SINE, "frequency": "1"}, "frequency is '1'"),
    (pt.sine, {**SINE, "low": 60e-6}, "low is 6e-05"),
    (pt.sine, {**SINE, "high": math.inf}, "high is inf"),
    (pt.sine, {**SINE, "high": 110.0}, "high is 110"),
    (pt.sine, {**SINE, "duration": -1.0}, "duration is -1"),
    (pt.sine, {**SINE, "phase": math.inf}, "phase is inf"),
    (pt.sine, {**SINE, "ramp": -0.1}, "ramp is -0.1"),
    (pt.sine, {**SINE, "ramp": 7.0}, "ramp is 7"),
    (pt.triangle, {**SINE, "rounding": 1.1}, "rounding is 1.1"),
    (pt.chirp, {**CHIRP, "stop_frequency": 0.0}, "stop_frequency is 0"),
    (pt.staircase, {"dwell": 1.0}, "steps and levels"),
    (pt.staircase, {"dwell": 1.0, "steps": 1, "levels": [0.0, 1e-6]}, "both are given"),
    (pt.staircase, {"dwell": 1.0, "steps": 1}, "low is None"),
    (pt.staircase, {"dwell": 1.0, "steps": 0, "low": 0.0, "high": UM}, "steps is 0"),
    (pt.staircase, {"dwell": 1.0, "steps": 2.5, "low": 0.0, "high": UM}, "steps is 2.5"),
    (pt.staircase, {"dwell": 0.0, "steps": 2, "low": 0.0, "high": UM}, "rise is 0"),
    (pt.staircase, {"dwell": 1.0, "levels": [0.0]}, "levels has 1 entries"),
    (pt.staircase, {"dwell": 1.0, "levels": [0.0, math.nan]}, "levels has nan"),
    (
        pt.staircase,
        {"dwell": 1.0, "levels": [0.0, UM], "low": 0.0},
        "low or high is given: expected levels",
    ),
    (pt.staircase, {"dwell": 1.0, "levels": [0.0, 30.0]}, "high is 30"),
    (pt.multisine, {**RANGE, "frequencies": []}, "frequencies has 0 entries"),
    (pt.multisine, {**RANGE, "frequencies": [1.0, -2.0]}, "frequencies has -2"),
    (pt.multisine, {**RANGE, "frequencies": [1.0, 1.0]}, "frequencies has 1 Hz twice"),
    (pt.multisine, {**RANGE, "frequencies": [1.0], "amplitudes": [0.0]}, "amplitudes has 0"),
    (pt.multisine, {**RANGE, "frequencies": [1.0], "amplitudes": [1, 2]}, "has 2 entries"),
    (pt.multisine, {**RANGE, "frequencies": [1.0], "seed": -1}, "seed is -1"),
    (pt.multisine, {"frequencies": [1.0], "duration": 1.0}, "either low and high"),
    (pt.multisine, {"frequencies": [1.0], "duration": 1.0, "offset": 0.0}, "either low and high"),
    (pt.multisine, {**RANGE, "frequencies": [1.0], "offset": 0.0}, "either low and high"),
    (pt.Reference.from_samples, {"x": [1.0] * 5, "dt": 0.1}, "x has 5 samples"),
    (pt.Reference.from_samples, {"x": [1.0] * 5 + [math.nan], "dt": 0.1}, "x is nan at sample 5"),
    (pt.Reference.from_samples, {"x": [[1.0] * 6], "dt": 0.1}, "x has the shape"),
    (pt.Reference.from_samples, {"x": [0.0] * 6, "dt": 0.0}, "dt is 0"),
    (pt.Reference.from_samples, {"x": [0.0] * 6, "dt": 1.0, "period": 1.0}, "period is 1 s: .*two"),
    (
        pt.Reference.from_samples,
        {"x": [0.0] * 6, "dt": 1.0, "duration": 7.0},
        "duration is 7 s",
    ),
]


@pytest.mark.parametrize(("make", "arguments", "message"), BAD)
def test_refuses(make: Any, arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(pt.PiezotrackError, match=message):
        make(**arguments)


@pytest.mark.parametrize("name", ["sine", "triangle", "chirp", "multisine", "staircase"])
def test_arguments_are_given_by_name(name: str) -> None:
    with pytest.raises(TypeError):
        getattr(pt, name)(1.0, 0.0, 1e-6, 1.0)


def test_refuses_less_than_two_samples_a_period() -> None:
    fast = pt.sine(frequency=25.0, low=0.0, high=UM, duration=1.0)
    assert len(fast.sample(0.02)) == 50
    with pytest.raises(pt.ParameterError, match=r"dt is 0.021 s: expected at most 0.02 s"):
        fast.sample(0.021)
    chirp = pt.chirp(start_frequency=1.0, stop_frequency=30.0, low=0.0, high=UM, duration=1.0)
    with pytest.raises(pt.ParameterError, match="two samples in the shortest period"):
        chirp.sample(0.02)
    with pytest.raises(pt.ParameterError, match="dt is 0"):
        fast.sample(0.0)
    with pytest.raises(pt.ParameterError, match="expected less than the reference's 1 s"):
        pt.sine(frequency=0.1, low=0.0, high=UM, duration=1.0).sample(1.0)


@pytest.mark.parametrize("t", [-0.1, 20.1, math.nan, [0.0, 21.0], "now"])
def test_refuses_times_outside(t: Any) -> None:
    with pytest.raises(pt.ParameterError, match=r"t is .*expected times"):
        pt.sine(**PAGE_ONE).at(t)
