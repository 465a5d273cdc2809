"""Modes of several axes: known truths, independent simulations, and a measured mirror."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import signal

import piezotrack as pt
from piezotrack.multiaxis import (
    ModalTerms,
    MultiAxisModel,
    MultiAxisRecord,
    VirtualAxes,
    approximate_axes,
    identify_axes,
    load_axes,
)

PAGE = Path(__file__).parents[2] / "docs/several-axes.md"
EVIDENCE = PAGE.with_name("evidence.md")
MIRROR = Path(__file__).parents[3] / "shared/data/fine_steering_mirror/training.npz"


def dense(terms: ModalTerms) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """State space of the modes with complex states, made real by their conjugates."""
    a = np.diag(np.concatenate([terms.poles, terms.poles.conj()]))
    b = np.concatenate([terms.inputs, terms.inputs.conj()])
    c = np.concatenate([terms.outputs, terms.outputs.conj()]).T
    turn = np.kron([[1.0, 1.0], [-1.0j, 1.0j]], np.eye(terms.poles.size)) / 2.0
    back = np.linalg.inv(turn)
    return (turn @ a @ back).real, (turn @ b).real, (c @ back).real, terms.direct


@pytest.fixture(scope="module")
def stage() -> VirtualAxes:
    return VirtualAxes.three(noise=5e-9, seed=1)


@pytest.fixture(scope="module")
def model(stage: VirtualAxes) -> MultiAxisModel:
    return identify_axes(stage.record())


def test_the_sampled_modes_are_those_of_the_continuous_stage(stage: VirtualAxes) -> None:
    # Each mode by scipy's own zero-order hold.
    z = np.exp(2j * np.pi * np.array([3.0, 179.0, 400.0, 900.0]) * stage.dt)
    expected = np.zeros((4, 3, 3), dtype=complex)
    for k, f in enumerate(stage.frequencies):
        w, zeta = 2.0 * np.pi * f, stage.damping_ratios[k]
        above, below, _ = signal.cont2discrete(([w * w], [1.0, 2.0 * zeta * w, w * w]), stage.dt)
        shape = np.outer(stage.sensor_shapes[k], stage.drive_shapes[k])
        expected += (np.polyval(above[0], z) / np.polyval(below, z))[:, None, None] * shape
    assert np.allclose(stage.terms.response(z), expected, rtol=1e-9, atol=0.0)


def test_a_known_stage_is_recovered_within_its_standard_deviations() -> None:
    scores = []
    for seed in range(8):
        stage = VirtualAxes.three(noise=20e-9, seed=seed)
        found = identify_axes(stage.record(samples=512))
        assert found.states == 10
        level = found.levels[0]
        order = np.argsort(np.angle(level.terms.poles))
        wanted = np.sort_complex(stage.terms.poles)[::-1]
        wanted = wanted[np.argsort(np.angle(wanted))]
        poles = level.terms.poles[order]
        decays = np.log(np.log(np.abs(poles)) / np.log(np.abs(wanted)))
        scores.append(decays / level.decay_sd[order])
        scores.append((np.angle(poles) - np.angle(wanted)) / level.angle_sd[order])
    # 80 numbers: a root mean square of 1 within 3 standard deviations.
    assert np.sqrt(np.mean(np.square(scores))) == pytest.approx(1.0, abs=0.24)


@pytest.mark.parametrize("realisations", [4, 9])
def test_modes_do_not_follow_the_distortion(realisations: int) -> None:
    stage = VirtualAxes.three(noise=2e-9, seed=1, cubic=0.04)
    record = stage.record(realisations=realisations)
    found, own = identify_axes(record), approximate_axes(record)
    assert found.states == 10
    # Gain of u + a u^3 for a normal input of 1 V rms (Bussgang).
    truth = (1.0 + 3.0 * 0.04) * stage.terms.response(own.z)
    errors = [np.linalg.norm(value - truth) for value in (found.at().response(own.z), own.value)]
    assert errors[0] < 0.4 * errors[1]


@pytest.mark.parametrize(("drives", "sensors"), [(2, 2), (1, 1), (2, 3), (3, 2)])
def test_any_numbers_of_drives_and_sensors_do(drives: int, sensors: int) -> None:
    three = VirtualAxes.three(noise=2e-9, seed=1)
    stage = replace(
        three,
        drive_shapes=three.drive_shapes[:, :drives],
        sensor_shapes=three.sensor_shapes[:, :sensors],
    )
    found = identify_axes(stage.record(samples=512))
    assert found.static_gain().shape == (sensors, drives)
    assert found.states == 10
    assert found.frequencies() == pytest.approx(stage.frequencies, rel=1e-3)
    other = replace(stage, seed=2).record(samples=512)
    sizes = np.sqrt(np.square(other.y[100:]).mean(axis=(0, 1, 3)))
    assert (found.score(other) < 1.1 * 2e-9 / sizes).all()


def test_a_delay_is_described(stage: VirtualAxes) -> None:
    record = stage.record()
    # The readings come three samples later; the lag of an amplifier is before them.
    y = np.roll(record.y, 3, axis=0)
    late = identify_axes(MultiAxisRecord(u=record.u, y=y, dt=record.dt))
    assert late.levels[0].misfit < 1.3 * late.levels[0].expected


def test_what_is_left_is_what_noise_explains(model: MultiAxisModel) -> None:
    assert model.levels[0].misfit == pytest.approx(model.levels[0].expected, rel=0.1)
    assert not model.notes


def test_a_simulation_is_that_of_scipy(model: MultiAxisModel) -> None:
    drive = np.random.default_rng(0).normal(size=(500, 3))
    a, b, c, d = dense(model.at())
    moved = drive - model.levels[0].drive_mean
    _, expected, _ = signal.dlsim((a, b, c, d, model.dt), moved)
    found = model.simulate(drive).y - model.levels[0].output_mean
    assert np.abs(found - expected).max() < 1e-12 * np.abs(expected).max()


def test_a_simulation_goes_on_from_its_state(model: MultiAxisModel) -> None:
    drive = np.random.default_rng(0).normal(size=(400, 3))
    whole = model.simulate(drive, level=1.0)
    first = model.simulate(drive[:150], level=1.0)
    then = model.simulate(drive[150:], level=1.0, start=first.state)
    assert np.array_equal(np.concatenate([first.y, then.y]), whole.y)
    assert np.array_equal(then.state, whole.state)


def test_a_periodic_start_is_the_end_of_many_periods(model: MultiAxisModel) -> None:
    drive = np.random.default_rng(0).normal(size=(200, 3))
    many = model.simulate(np.tile(drive, (40, 1)), level=1.0)
    steady = model.simulate(drive, level=1.0, start="periodic")
    size = np.abs(many.y).max()
    assert np.abs(steady.y - many.y[-200:]).max() < 1e-9 * size


def test_a_motion_from_rest_is_scored_from_rest(stage: VirtualAxes, model: MultiAxisModel) -> None:
    drive = np.random.default_rng(5).normal(size=(1500, 3))
    y = stage.simulate(drive, periodic=False)
    record = MultiAxisRecord(u=drive, y=y, dt=stage.dt)
    assert model.score(record, start="rest")[0] < 1e-3
    assert model.score(record, start="periodic")[0] > 1e-2


def test_all_poles_are_stable_and_two_runs_are_alike(stage: VirtualAxes) -> None:
    # More states than the stage has: what the noise shapes is stable too.
    first, second = (identify_axes(stage.record(), states=20) for _ in range(2))
    assert (np.abs(first.at().poles) < 1.0).all()
    assert first.document() == second.document()


def test_levels_between_two_are_interpolated(stage: VirtualAxes) -> None:
    def softer(level: float) -> VirtualAxes:
        # Frequencies fall in proportion to the level, as in a material after Rayleigh.
        return replace(stage, frequencies=stage.frequencies * (1.0 - 0.02 * level))

    found = identify_axes([softer(level).record(level=level) for level in (1.0, 0.5)])
    assert [one.level for one in found.levels] == pytest.approx([0.5, 1.0])
    z = np.exp(2j * np.pi * np.linspace(0.01, 0.4, 500))
    truth = softer(0.75).terms.response(z)

    def error(terms: ModalTerms) -> float:
        return float(np.linalg.norm(terms.response(z) - truth))

    assert error(found.at(0.75)) < 0.25 * min(error(one.terms) for one in found.levels)
    # Beyond its levels a model is the one at the end.
    assert np.array_equal(found.at(7.0).poles, found.levels[1].terms.poles)
    assert np.array_equal(found.at(0.1).direct, found.levels[0].terms.direct)


def test_a_file_gives_back_every_bit(model: MultiAxisModel, tmp_path: Path) -> None:
    paths = model.save(tmp_path)
    again = load_axes(tmp_path / "axes.json")
    assert again.document() == model.document()
    drive = np.random.default_rng(0).normal(size=(50, 3))
    assert np.array_equal(again.simulate(drive).y, model.simulate(drive).y)
    assert {path.name for path in paths} >= {"axes.csv", "axes.json", "axes.png"}
    assert again.summary().splitlines()[:5] == model.summary().splitlines()[:5]
    text = (tmp_path / "axes.json").read_text()
    for damaged, words in (
        (text.replace('"level_rms"', '"level"'), "level_rms"),
        (
            text.replace('"schema_version": 1', '"schema_version": 99'),
            "schema_version is 99: expected 1",
        ),
        (text.replace("piezotrack-axes", "piezotrack-response"), "model of several axes"),
    ):
        (tmp_path / "axes.json").write_text(damaged)
        with pytest.raises(pt.DataError, match=words):
            load_axes(tmp_path / "axes.json")


@pytest.mark.parametrize(
    ("ask", "error", "words"),
    [
        (lambda m: m.simulate(np.ones((5, 2))), pt.ShapeError, r"samples x 3 drives"),
        (lambda m: m.simulate([[np.nan, 0, 0]]), pt.DataError, r"u\[0, 0\] is nan"),
        (lambda m: m.simulate(np.eye(3), start="moving"), pt.ParameterError, "start is 'moving'"),
        (lambda m: m.simulate(np.eye(3), start=[1.0]), pt.ShapeError, "expected 5 entries"),
        (lambda m: m.at(-1.0), pt.ParameterError, "level is -1"),
    ],
)
def test_what_does_not_fit_a_model_is_refused(
    model: MultiAxisModel, ask: object, error: type[Exception], words: str
) -> None:
    with pytest.raises(error, match=words):
        ask(model)  # type: ignore[operator]


def test_states_and_lines_are_checked(stage: VirtualAxes) -> None:
    record = stage.record(samples=64)
    with pytest.raises(pt.ParameterError, match="states is 7: expected an even number"):
        identify_axes(record, states=7)
    with pytest.raises(pt.DataError, match=r"excites 27 lines: expected more than"):
        identify_axes(record, states=120)


@pytest.mark.skipif(not MIRROR.exists(), reason="the measured mirror is not beside the checkout")
def test_modes_foretell_a_measured_mirror_better_than_its_own_response() -> None:
    levels = (100, 200, 300)
    records = [
        MultiAxisRecord.from_npz(MIRROR, drive=f"u_{k}", output=f"y_{k}", dt=1.0 / 6400.0)
        for k in levels
    ]
    train, test = ([one.only(kept) for one in records] for kept in (range(5), [5]))
    modes, few, distorted = (identify_axes(train, distortion=most) for most in (False, 28, True))
    assert modes.states <= 44
    assert 2 * len(few.distortion) == 28
    board = EVIDENCE.read_text().partition("| mirror, ")[2].partition("\n")[0].split("|")[1:5]
    for k, level in enumerate(levels):
        own = approximate_axes(train[k])
        errors = [float(one.score(test[k])[0]) for one in (own, modes, few, distorted)]
        assert errors[1] < 0.85 * errors[0]
        assert errors[2] < 0.97 * errors[1]
        assert errors[3] < 0.9 * errors[2]
        # Within the ends that the page has of all realisations, and the medians of the board.
        row = PAGE.read_text().partition(f"| {level} mV |")[2].partition("\n")[0]
        for cell, in_board, found in zip(row.split("|")[:4], board, errors, strict=True):
            median, low, high = (float(text) for text in re.findall(r"[\d.]+", cell))
            assert low - 0.005 <= 100.0 * found <= high + 0.005
            assert float(re.findall(r"[\d.]+", in_board)[k]) == median
        noisy = [note for note in modes.notes if "1 (5.7 %), 2 (5.2 %)" in note]
        assert len(noisy) == 1
