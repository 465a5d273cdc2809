"""A network as feedforward: the gradient, what it learns, and that Rust runs what was trained."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import numpy as np
import pytest

import piezotrack as pt
from piezotrack.control import train_network
from piezotrack.control.laws.neural_network import _motion, _Network

DT = 2e-3
LIMITS = (0.0, 75.0)
PLAYS = pt.PrandtlIshlinskiiStage(
    linear=1e-6, thresholds=(3.0, 8.0, 15.0, 25.0), weights=(1e-7, 2e-7, 1.5e-7, 1.2e-7)
)


def record(seed: int, stage: Any = PLAYS, noise: float = 0.0) -> pt.Dataset:
    """Return 8 s of two sines that fill the range, with minor loops."""
    t = DT * np.arange(4000)
    phase = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi)
    u = 37.5 * (1.0 - 0.7 * np.cos(2.0 * np.pi * t) - 0.3 * np.cos(7.3 * t + phase))
    return pt.VirtualStage.of(stage, noise=noise, seed=seed).record(u, DT)


@pytest.fixture(scope="module")
def network() -> pt.control.NetworkInverse:
    return train_network(record(1)[1.0:], units=6)


def test_the_jacobian_is_the_derivative() -> None:
    generator = np.random.default_rng(0)
    network = _Network(
        0.0, np.ones(3), np.arange(1, 3) / 3, 3, generator.normal(size=3 * 5 + 3 + 3 + 6)
    )
    inputs, step = generator.normal(size=(9, 5)), 1e-6
    numeric = [
        (
            network.output(network.weights + step * e, inputs)
            - network.output(network.weights - step * e, inputs)
        )
        / (2.0 * step)
        for e in np.eye(network.weights.size)
    ]
    assert np.abs(network.jacobian(inputs) - np.transpose(numeric)).max() < 1e-8


def test_it_follows_another_motion_than_it_was_trained_on(network: Any) -> None:
    other = record(5)
    linear = np.polyfit(record(1).u, record(1).y, 1)
    run = network._begun(DT).along(
        other.y - network.offset,
        np.gradient(other.y, DT),
        np.gradient(np.gradient(other.y, DT), DT),
    )
    settled = slice(1000, -5)
    found = np.sqrt(np.mean((run - other.u)[settled] ** 2))
    line = np.sqrt(np.mean(((other.y - linear[1]) / linear[0] - other.u)[settled] ** 2))
    assert found < 0.1 * line


def test_it_is_a_feedforward_of_a_controller(network: Any) -> None:
    loop = pt.Controller(dt=DT, limits=LIMITS, feedforward=network)
    reference = pt.sine(frequency=1.0, low=15e-6, high=80e-6, duration=4.0)
    run = pt.track(PLAYS, loop, reference)
    alone = pt.PrandtlIshlinskiiStage(linear=network.stage.linear, thresholds=(), weights=())
    straight = pt.Controller(
        dt=DT, limits=LIMITS, feedforward=pt.Inverse(stage=alone, offset=network.offset)
    )
    assert run.metrics.rms_error < 0.25 * pt.track(PLAYS, straight, reference).metrics.rms_error


def test_what_rust_runs_is_what_was_trained(network: Any) -> None:
    """Sample by sample, along a path, and after a copy in the middle of it."""
    x = 40e-6 * (1.0 - np.cos(np.arange(500) / 60.0))
    v = np.gradient(x, DT)
    a = np.gradient(v, DT)
    along = network._begun(DT).along(x - network.offset, v, a)
    session = network.start(DT)
    stepped = []
    for k in range(500):
        if k == 250:
            session = pickle.loads(pickle.dumps(session))
        stepped.append(session.step(x[k], velocity=v[k], acceleration=a[k]))
    assert np.array_equal(along, stepped)
    again = copy.deepcopy(network)
    assert np.array_equal(again._begun(DT).along(x - network.offset, v, a), along)
    numbers = network.numbers
    plays = np.full(len(numbers[2]), -numbers[0] / numbers[1][0])
    hidden = np.reshape(numbers[3], (len(numbers[4]), -1))
    for k in range(20):
        i = np.array([x[k] - network.offset - numbers[0], v[k], a[k]]) / numbers[1]
        plays = np.maximum(np.minimum(plays, i[0] + numbers[2]), i[0] - numbers[2])
        inputs = np.concatenate([i, plays])
        volts = (
            np.tanh(hidden @ inputs + numbers[4]) @ numbers[5] + inputs @ numbers[6] + numbers[7]
        )
        assert along[k] == pytest.approx(volts, abs=1e-9)


def test_the_same_seed_gives_the_same_network_and_noise_does_not_break_it() -> None:
    log = record(2, noise=20e-9)
    first, same, other = (train_network(log[1.0:], units=3, seed=seed) for seed in (1, 1, 2))
    assert first.numbers == same.numbers
    assert first.numbers != other.numbers
    assert first.held_out < 0.02 * 75.0
    # The part held out decides: it is not far worse than the part that was trained on.
    assert first.held_out < 3.0 * first.trained


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"units": 0}, "units is 0: expected 1 to 16"),
        ({"units": 17}, "units is 17"),
        ({"plays": 9}, "plays is 9: expected 0 to 8"),
        ({"held_out": 0.05}, "held_out is 0.05: expected 0.1 to 0.5"),
        ({"held_out": 0.9}, "held_out is 0.9"),
        ({"delay": -1.0}, "delay is -1"),
        ({"seed": -1}, "seed"),
    ],
)
def test_settings_are_checked(options: dict[str, Any], words: str) -> None:
    with pytest.raises(pt.ParameterError, match=words):
        train_network(record(1), **options)


def test_records_that_cannot_be_trained_on() -> None:
    with pytest.raises(pt.DataError, match="100 samples and a stroke"):
        train_network(pt.Dataset(u=np.arange(100.0), y=1e-6 * np.arange(100.0), dt=DT))
    with pytest.raises(pt.DataError, match="and a motion"):
        train_network(pt.Dataset(u=np.arange(300.0), y=np.zeros(300), dt=DT))
    with pytest.raises(pt.ParameterError, match=r"record is \[.*expected a pt.Dataset"):
        train_network([1.0])  # type: ignore[arg-type]


def test_on_measured_logs_beside_the_inverse_of_the_plays() -> None:
    """The figures of docs/control.md: the drive of one log, by inverses from the other."""
    rich = pt.datasets.dbo_tracking()[3.0:43.0]
    other = pt.datasets.dbo_training().full
    network = train_network(rich, delay=0.005)
    plays = pt.identify(rich, "prandtl-ishlinskii").inverse()
    apart = []
    for inverse in (network, plays):
        # A sample of delay, and after 23 s; the logs have zeros of their own.
        late = round(inverse.delay / other.dt)
        motion = _motion(other.y - inverse.offset, other.dt)[late:]
        x, v, a = np.ascontiguousarray(motion.T)
        volts = inverse._begun(other.dt).along(x, v, a)
        apart.append(float(np.std((volts - other.u[: volts.size])[4600:-5])))
    assert apart[0] == pytest.approx(8.5e-3, abs=2e-3)
    assert apart[0] < 0.6 * apart[1]
