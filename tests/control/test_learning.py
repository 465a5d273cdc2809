"""Iterative learning: convergence against simulation, the end at the noise, wrong inputs."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt
from piezotrack.control.learning.plants import learning_plants
from piezotrack.control.learning.rules import _largest

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

DT = 1e-3
LIMITS = (0.0, 75.0)
SINE = pt.sine(frequency=10.0, low=10e-6, high=50e-6, duration=0.5)
# Without hysteresis: a linear stage, for which the convergence can be computed by hand.
LINEAR = pt.PrandtlIshlinskiiStage(
    linear=1e-6, thresholds=(), weights=(), frequency=160.0, damping_ratio=0.065
)
PLAYS = pt.PrandtlIshlinskiiStage(
    linear=1e-6,
    thresholds=(5.0, 15.0, 30.0),
    weights=(2e-7, 2e-7, 2e-7),
    frequency=160.0,
    damping_ratio=0.065,
)
OPEN = pt.Controller(dt=DT, limits=LIMITS)
CLOSED = replace(OPEN, feedback=pt.Pid(kp=4e4, ti=0.001))


def response(frequency: Array, mode: float, zeta: float, delay: float) -> NDArray[np.complex128]:
    """Return the sampled response of a mode of 1 um/V behind a hold, from its aliases."""
    total = np.zeros(frequency.size, dtype=complex)
    for k in range(-4000, 4001):
        s = 2j * math.pi * (frequency + k / DT)
        natural = 2.0 * math.pi * mode
        with np.errstate(invalid="ignore", divide="ignore"):
            hold = np.where(s == 0.0, 1.0, (1.0 - np.exp(-s * DT)) / (s * DT))
        total += hold * np.exp(-s * delay) / (1.0 + 2.0 * zeta * s / natural + (s / natural) ** 2)
    return np.asarray(1e-6 * total)


def test_the_convergence_factor_is_that_of_the_transfer_functions() -> None:
    """Of a linear stage: |Q (1 - gain P/P0)| with P from the aliases of the continuous mode."""
    learner = pt.control.IterativeLearning(
        LINEAR, SINE, OPEN, cutoff=100.0, gain=0.7, more_delays=(0.0, 1e-3), mode_scales=(1.0, 0.9)
    )
    f = np.arange(51) / (100 * DT)
    nominal = response(f, 160.0, 0.065, 0.0)
    low_pass = 1.0 / (1.0 + (f / 100.0) ** 6)
    worst = max(
        np.abs(low_pass * (1.0 - 0.7 * response(f, 160.0 * scale, 0.065, more) / nominal)).max()
        for scale in (1.0, 0.9)
        for more in (0.0, 1e-3)
    )
    assert learner.convergence.factor == pytest.approx(worst, rel=2e-3)
    assert "1 ms more delay" in learner.convergence.model


@pytest.mark.parametrize("method", ["frequency", "lifted"])
@pytest.mark.parametrize("controller", [OPEN, CLOSED], ids=["open", "closed"])
@pytest.mark.parametrize("frequency", [160.0, 144.0], ids=["nominal", "mode 10 % lower"])
def test_the_distance_to_the_final_table_falls_by_the_factor_in_every_trial(
    method: Any, controller: pt.Controller, frequency: float
) -> None:
    reference = replace(SINE, duration=0.2 if method == "lifted" else 0.6, ramp=0.05, origin=0.0)
    stage = replace(LINEAR, frequency=frequency)
    learning = pt.learn(
        stage, reference, controller, model=LINEAR, method=method, trials=40, noise=0.0, settle=12
    )
    tables = learning.learner.tables
    distance = np.linalg.norm(tables[:-1] - tables[-1], axis=1)
    falling = distance[: np.argmax(distance < 1e-5 * distance[0]) or None]
    assert falling.size > 3
    assert learning.convergence.factor < 0.91
    # The reference is the last table, which is a trial's share of the distance off.
    assert np.all(falling[1:] <= (learning.convergence.factor + 1e-3) * falling[:-1])
    best = learning.learner.best
    assert np.all(np.diff(learning.errors[: best + 1]) <= 0.0)


def test_a_sine_on_a_stage_with_hysteresis_ends_at_the_noise() -> None:
    stage = pt.VirtualStage.of(PLAYS, noise=10e-9, seed=3)
    loop = replace(OPEN, feedforward=replace(PLAYS, linear=0.9e-6).inverse())
    slow = pt.sine(frequency=5.0, low=10e-6, high=50e-6, duration=1.0)
    learning = pt.learn(stage, slow, loop, model=PLAYS, settle=4, mode_scales=1.0)
    assert learning.stopped == "noise"
    assert learning.errors[0] > 1e-6
    # The mean of two records of 10 nm, and at gain 0.7 half as much again of earlier trials.
    assert learning.errors[learning.best] < 1.4 * 10e-9 / math.sqrt(2.0)
    again = replace(stage, sensor=replace(stage.sensor, seed=999))
    played = learning.learner.tables[learning.best]
    motion = again.simulate(np.tile(played, 8), DT, hold="zoh").x[-200:]
    # What was learnt is not the noise of its trials: the true motion follows as well.
    assert np.sqrt(np.mean((motion - learning.learner.desired) ** 2)) < 10e-9


def test_the_error_falls_monotonically_with_hysteresis_creep_and_a_lower_mode() -> None:
    stage = pt.VirtualStage.of(PLAYS, creep={0.1: 0.004, 1.0: 0.004}, mode=(144.0, 0.065))
    found = pt.learn(stage, SINE, OPEN, model=PLAYS, trials=8, noise=0.0)
    assert np.all(np.diff(found.errors[: found.best + 1]) < 0.0)
    assert found.errors[found.best] < 1e-2 * found.errors[0]


def test_a_model_set_lowers_the_cutoff_and_a_fixed_one_is_refused_by_name() -> None:
    narrow = pt.control.IterativeLearning(LINEAR, SINE, OPEN, mode_scales=1.0, more_delays=0.0)
    wide = pt.control.IterativeLearning(LINEAR, SINE, OPEN, mode_scales=(1.0, 0.9))
    late = pt.control.IterativeLearning(LINEAR, SINE, OPEN, mode_scales=1.0, more_delays=(0, 2e-3))
    # A quarter of the sampling rate at most; and no more than the model set lets pass.
    assert narrow.cutoff == 250.0
    assert wide.cutoff < 200.0
    assert late.cutoff < 250.0
    with pytest.raises(
        pt.ParameterError, match=r"modes at 0.9 times.*at 1[4-6]0 Hz.*cutoff of .* in place of 300"
    ):
        pt.control.IterativeLearning(LINEAR, SINE, OPEN, mode_scales=(1.0, 0.9), cutoff=300.0)
    with pytest.raises(pt.ParameterError, match=r"1 ms more delay.*cutoff of .* in place of 400"):
        pt.control.IterativeLearning(
            LINEAR, SINE, OPEN, mode_scales=1.0, more_delays=(0.0, 1e-3), cutoff=400.0
        )


def test_the_refusal_is_right_on_the_stage_that_it_names() -> None:
    """The update that is refused for a mode 10 % lower grows on it."""
    nominal, (lower, *_) = learning_plants(
        [LINEAR], OPEN, delay=0.0, more_delays=0.0, mode_scales=(0.9, 1.0)
    )
    f = np.arange(51) / (100 * DT)
    share = np.abs(1.0 - 0.7 * lower.response(f) / nominal.response(f))
    worst = int(np.argmax(share / (1.0 + (f / 300.0) ** 6)))
    assert share[worst] > 1.0
    # Trials of that harmonic alone, played on the stage itself, with what the refused update does.
    stage, table = replace(LINEAR, frequency=144.0), np.zeros(100)
    keep = np.zeros(51)
    keep[worst] = 1.0 / (1.0 + (f[worst] / 300.0) ** 6)
    wanted = 1e-8 * np.cos(2.0 * math.pi * f[worst] * DT * np.arange(100))
    sizes = []
    for _ in range(30):
        error = wanted - stage.simulate(np.tile(table, 12), DT, hold="zoh").x[-100:]
        spectrum = np.fft.rfft(table) + 0.7 * np.fft.rfft(error) / nominal.response(f)
        table = np.fft.irfft(keep * spectrum, 100)
        sizes.append(float(np.linalg.norm(table)))
    assert sizes[-1] > 10.0 * sizes[0]


def test_the_table_stays_within_the_limits_and_does_not_wind_up() -> None:
    loop = replace(OPEN, limits=(0.0, 40.0))
    stage = replace(LINEAR, linear=1e-6)
    learning = pt.learn(stage, SINE, loop, trials=60, beyond_reach=True, noise=0.0)
    assert learning.stopped != "grows"
    assert learning.tables.min() >= 0.0
    assert learning.tables.max() <= 40.0
    # Where the table is at its limit, and two delays around it, nothing better is possible.
    reachable = learning.learner.desired < 35e-6
    error = learning.final.error[-100:]
    assert np.abs(error[reachable]).max() < 0.1 * np.abs(error).max()
    # A lower reference is followed at once: nothing was stored beyond the limits.
    learner = learning.learner
    within = learner.desired - np.minimum(learner.desired, 30e-6)
    settled = learner.update(learner.desired + within)
    assert settled.max() < 40.0


def test_what_does_not_repeat_is_forgotten_and_what_is_known_as_noise_ends_it() -> None:
    learner = pt.control.IterativeLearning(
        LINEAR, SINE, OPEN, forgetting_factor=0.5, noise=1e-9, cutoff=100.0
    )
    spike = learner.desired - 1e-6 * np.sin(2 * math.pi * np.arange(100) / 100)
    first = learner.update(spike)
    learnt = np.ptp(first)
    for _ in range(5):
        last = learner.update(learner.desired)
    assert np.ptp(last) < 0.05 * learnt
    assert learner.stopped == "noise"


def test_a_growing_error_ends_it_with_the_best_table() -> None:
    # A model without the mode of the stage: nothing can show that before the first trial.
    rigid = pt.PrandtlIshlinskiiStage(linear=1e-6, thresholds=(), weights=())
    slow = replace(LINEAR, frequency=60.0)
    learning = pt.learn(slow, SINE, OPEN, model=rigid, noise=0.0, cutoff=250.0)
    assert learning.stopped == "grows"
    assert learning.best < len(learning.trials) - 1
    assert np.array_equal(learning.table, learning.tables[learning.best])


def test_a_slow_loop_is_given_the_periods_that_it_takes_or_said_not_to_have_settled() -> None:
    """An integrator that takes seconds, on a stage of 1.5 times the gain of its model."""
    stage = pt.VirtualStage.of(
        replace(PLAYS, linear=1.5e-6, weights=tuple(1.5 * one for one in PLAYS.weights)),
        noise=5e-9, seed=1,
    )  # fmt: skip
    law = pt.Pid(kp=2e3, ti=0.01)
    loop = replace(OPEN, feedforward=PLAYS.inverse(), feedback=law)
    motion = pt.sine(frequency=5.0, low=10e-6, high=45e-6, duration=1.0)
    options: Any = {"model": PLAYS, "trials": 12}
    early = pt.learn(stage, motion, loop, settle=3, **options)
    assert early.stopped == "not settled"
    assert early.errors[early.best] > 5e-6
    # A transient of that time constant, from one period to the next.
    last = early.trials[-1]
    gain = pt.check_loop(stage, loop).middle.gain
    share = 1.0 - math.exp(-0.2 * law.kp * gain / law.ti)
    assert abs(last.unsettled) == pytest.approx(share * last.rms_error, rel=0.3)
    # The noise is that of the sensor, not the transient.
    assert last.noise == pytest.approx(5e-9 / math.sqrt(2.0), abs=8e-9)
    assert "has not settled when it is recorded" in early.summary()
    whole = pt.learn(stage, motion, loop, **options)
    assert whole.stopped in ("no change", "noise")
    assert whole.errors[whole.best] < 50e-9
    assert whole.trials[-1].unsettled == 0.0


@pytest.mark.parametrize("bandwidth", [math.inf, 20.0], ids=["white", "below 20 Hz"])
def test_noise_is_not_taken_for_a_transient(bandwidth: float) -> None:
    stage = pt.VirtualStage.of(PLAYS, noise=20e-9, noise_bandwidth=bandwidth, seed=4)
    learner = pt.control.IterativeLearning(PLAYS, SINE, OPEN, mode_scales=1.0)
    n = learner.t.size
    record = stage.record(np.full(n * 120, 10.0), DT, hold="zoh").y[-100 * n :]
    level = learner.desired - learner.desired.mean()
    found = []
    for pair in record.reshape(50, 2, n):
        learner.update(level + pair)
        found.append(learner.trials[-1].unsettled)
    assert np.count_nonzero(found) <= 1
    # A drift of the sensor of a few times its noise is seen.
    drifting = pair + np.array([[0.0], [60e-9]])
    learner.update(level + drifting)
    assert learner.trials[-1].unsettled == pytest.approx(60e-9, abs=30e-9)


def test_records_of_several_periods_show_what_does_not_repeat() -> None:
    learner = pt.control.IterativeLearning(LINEAR, SINE, OPEN)
    noise = 5e-9 * np.random.default_rng(1).standard_normal((50, 100))
    learner.update(learner.desired + noise)
    # The mean of fifty.
    assert learner.trials[0].noise == pytest.approx(5e-9 / math.sqrt(50.0), rel=0.05)
    assert learner.stopped == "noise"


@pytest.mark.parametrize(
    ("measured", "kind", "words"),
    [
        (np.full(100, np.nan), pt.DataError, "measured is nan m at sample 0"),
        (np.full(100, 5.0), pt.DataError, "measured is 5 m at sample 0: expected finite"),
        (np.zeros(99), pt.ShapeError, r"expected \(100,\)"),
        (np.zeros((2, 3, 100)), pt.PiezotrackError, "measured"),
        ([], pt.PiezotrackError, "measured"),
        ("record", pt.PiezotrackError, "measured"),
        (pt.Dataset(u=np.zeros(100), y=np.zeros(100), dt=2e-3), pt.DataError, "0.002 s: expected"),
    ],
)
def test_a_record_that_cannot_be_learnt_from_changes_nothing(
    measured: Any, kind: type[Exception], words: str
) -> None:
    learner = pt.control.IterativeLearning(LINEAR, SINE, OPEN)
    with pytest.raises(kind, match=words):
        learner.update(measured)
    assert learner.trials == ()
    assert np.array_equal(learner.table, np.zeros(100))


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"method": "fourier"}, "method is 'fourier'"),
        ({"gain": 0.0}, "gain is 0"),
        ({"gain": 2.5}, "gain is 2.5: expected below 2"),
        ({"cutoff": 600.0}, "cutoff is 600 Hz: expected"),
        ({"forgetting_factor": 0.0}, "forgetting_factor is 0"),
        ({"noise": -1.0}, "noise is -1"),
        ({"mode_scales": (1.0, 0.0)}, "mode_scales"),
        ({"mode_scales": ()}, "mode_scales is empty"),
        ({"more_delays": (-1.0,)}, "more_delays"),
        ({"models": LINEAR}, "models is PrandtlIshlinskiiStage"),
        ({"models": ["dahl"]}, "stage is '"),
    ],
)
def test_settings_are_checked(options: dict[str, Any], words: str) -> None:
    with pytest.raises(pt.ParameterError, match=words):
        pt.control.IterativeLearning(LINEAR, SINE, OPEN, **options)


def test_references_and_controllers_that_cannot_be_learnt_with() -> None:
    once = pt.chirp(start_frequency=1.0, stop_frequency=20.0, low=0.0, high=10e-6, duration=1.0)
    with pytest.raises(pt.ParameterError, match="does not repeat"):
        pt.control.IterativeLearning(LINEAR, once, OPEN)
    odd = pt.sine(frequency=9.7, low=0.0, high=10e-6, duration=1.0)
    with pytest.raises(pt.ParameterError, match="whole number of samples"):
        pt.control.IterativeLearning(LINEAR, odd, OPEN)
    with pytest.raises(pt.ParameterError, match="repetitive part"):
        pt.control.IterativeLearning(
            LINEAR, SINE, replace(OPEN, repetitive=pt.Repetitive(period=0.1))
        )
    long = pt.sine(frequency=1.0, low=0.0, high=10e-6, duration=5.0)
    with pytest.raises(pt.ParameterError, match="5000 samples: expected 2000 at most"):
        pt.control.IterativeLearning(LINEAR, long, OPEN, method="lifted")


def test_the_table_is_saved_with_its_units(tmp_path: Path) -> None:
    learning = pt.learn(LINEAR, SINE, OPEN, trials=3, noise=0.0)
    path = learning.save(tmp_path / "table.csv")
    assert path.read_text().splitlines()[0] == "time_s,desired_um,voltage_V,feedforward_V"
    rows = np.loadtxt(path, delimiter=",", skiprows=1)
    assert rows[:, 2] == pytest.approx(learning.table, abs=1e-8)
    assert rows[:, 1] == pytest.approx(1e6 * learning.learner.desired, abs=1e-8)
    assert "trial" in learning.summary()
    assert len(learning.plot().axes) == 3


def test_a_trial_has_the_timing_of_its_loop() -> None:
    stage, loop = replace(PLAYS), replace(OPEN, feedforward=PLAYS.inverse())
    timings = [pt.Timing(), pt.Timing(jitter=2e-4), pt.Timing(voltages_before=(75.0, 0.0))]
    usual, late, moved = (
        pt.learn(stage, SINE, loop, trials=1, timing=timing).first for timing in timings
    )
    assert np.array_equal(usual.voltage, late.voltage)
    assert (usual.measured != late.measured).any()
    assert moved.displacement[0] == pytest.approx(PLAYS.equilibrium([75.0, 0.0]).x, rel=1e-9)
    assert moved.displacement[0] > usual.displacement[0]


def test_filters_for_firmware_learn_as_the_update_does() -> None:
    learner = pt.control.IterativeLearning(LINEAR, SINE, OPEN, cutoff=100.0)
    rule = learner.rule
    assert isinstance(rule, pt.control.FrequencyRule)
    learning, smoothing = rule.taps(40)
    rng = np.random.default_rng(2)
    table, error = np.zeros(100), np.zeros(100)
    # Smooth signals, as errors of a stage are.
    for k in range(1, 6):
        wave = np.cos(2.0 * math.pi * k * np.arange(100) / 100 + rng.uniform(0.0, 6.0))
        table, error = table + wave, error + 1e-7 * wave[::-1]

    def filtered(taps: Array, signal: Array) -> Array:
        return np.array(
            [sum(taps[40 + j] * signal[(i - j) % 100] for j in range(-40, 41)) for i in range(100)]
        )

    expected = rule.after(table, error)
    found = filtered(smoothing, table) + filtered(learning, error)
    assert np.abs(found - expected).max() < 0.02 * np.ptp(expected)


@pytest.mark.parametrize("count", [8, 50, 1500])
def test_the_largest_singular_value_of_many_that_crowd_together(count: int) -> None:
    """Of a second difference: 2 + 2 cos(pi/(n + 1)), with the next one closer the longer it is."""
    matrix = 2.0 * np.eye(count) - np.eye(count, k=1) - np.eye(count, k=-1)
    size, frequency = _largest(matrix, DT)
    known = 2.0 + 2.0 * math.cos(math.pi / (count + 1))
    assert known * (1.0 - 1e-3) < size < known * (1.0 + 1e-12)
    # Its vector changes sign from sample to sample.
    assert frequency > 0.4 / DT


@pytest.mark.slow
def test_a_long_lifted_trial_of_a_model_without_a_mode_converges() -> None:
    static = pt.PrandtlIshlinskiiStage(linear=1e-6, thresholds=(5.0,), weights=(2e-7,))
    line = pt.triangle(frequency=2.0, low=20e-6, high=60e-6, duration=1.0, rounding=0.2)
    learner = pt.control.IterativeLearning(static, line, OPEN, method="lifted")
    assert learner.convergence.monotone


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_mode_that_the_model_lacks_lowers_the_cutoff(seed: int) -> None:
    """The stage has a mode at 160 Hz; the model is that of a slow record, without one."""
    model = replace(PLAYS, frequency=None, damping_ratio=None)
    stage = pt.VirtualStage.of(PLAYS, noise=20e-9, seed=seed)
    loop = replace(OPEN, feedforward=model.inverse())
    reference = pt.triangle(frequency=5.0, low=10e-6, high=50e-6, duration=1.0, rounding=0.2)
    found = pt.learn(stage, reference, loop, model=model)
    assert found.learner.cutoff_lowered
    assert found.learner.cutoff < 140.0
    noise = found.trials[found.best].noise
    assert noise is not None
    assert found.errors[found.best] < 2.0 * noise
    assert found.stopped != "grows"
    # A cutoff that was given stays, and the same learning diverges with it.
    given = pt.learn(stage, reference, loop, model=model, cutoff=250.0)
    assert (given.learner.cutoff, given.stopped) == (250.0, "grows")
    assert given.errors[given.best] > 1.3 * found.errors[found.best]
