"""Distortion of several axes: a known truth, states, files, levels, and a measured mirror."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import piezotrack as pt
from piezotrack import _core
from piezotrack.multiaxis import (
    MultiAxisModel,
    MultiAxisRecord,
    VirtualAxes,
    identify_axes,
    load_axes,
)

MIRROR = Path(__file__).parents[3] / "shared/data/fine_steering_mirror/training.npz"
CUBIC, NOISE = 0.04, 2e-9


def record(level: float, seed: int, *, noise: float = NOISE, count: int = 9) -> MultiAxisRecord:
    stage = VirtualAxes.three(cubic=CUBIC, noise=noise, seed=seed)
    return stage.record(realisations=count, level=level)


@pytest.fixture(scope="module")
def model() -> MultiAxisModel:
    return identify_axes([record(0.5, 1), record(1.5, 1)])


def test_what_the_drives_bend_is_found(model: MultiAxisModel) -> None:
    linear = identify_axes([record(0.5, 1), record(1.5, 1)], distortion=False)
    assert not linear.distortion
    for level in (0.5, 1.5):
        other, truth = (record(level, 2, noise=noise, count=3) for noise in (NOISE, 0.0))
        noise = np.sqrt(np.mean(np.square(other.y - truth.y)) / np.mean(np.square(truth.y)))
        before, after = linear.score(other), model.score(other)
        assert (after < 0.06 * before).all()
        # At the smaller level nearly all that is left is the noise of the sensors.
        assert level > 1.0 or (after < 1.7 * noise).all()
    # The responses stay those of the best linear approximation.
    f = np.array([1.0, 180.0, 500.0])
    np.testing.assert_allclose(model.response(f), linear.response(f), rtol=1e-12)


def test_a_linear_stage_has_no_distortion() -> None:
    for noise in (0.0, NOISE, 1e-7):
        found = identify_axes(VirtualAxes.three(noise=noise, seed=3).record())
        assert not found.distortion
        assert found.levels[0].terms.forces.size == 0
        assert found.levels[0].distorted == 1.0


def test_regressors_are_what_they_are_called() -> None:
    rng = np.random.default_rng(4)
    u, y = rng.normal(size=(50, 2)), rng.normal(size=(50, 2))
    matrix = rng.normal(size=(3, 4))
    found, last, values = _core.Regressors(
        2, 2, matrix.ravel(), [(0, 2), (1, 1, 1)], [(2, 0.7)], [(0, 0.3)]
    ).follow(u.ravel(), y.ravel())
    v = np.hstack([u, y]) @ matrix.T
    before = np.vstack([np.zeros(3), v[:-1]])
    stop = np.zeros(51)
    for k in range(50):
        stop[k + 1] = np.clip(stop[k] + v[k, 2] - before[k, 2], -0.7, 0.7)
    moved = (v - before)[:, 0]
    expected = [v[:, 0] * v[:, 2], v[:, 1] ** 3, stop[1:], moved / (0.3 + abs(moved))]
    np.testing.assert_allclose(found.reshape(50, 4), np.transpose(expected), rtol=1e-13, atol=1e-14)
    np.testing.assert_allclose(last, v[-1], rtol=1e-13)
    np.testing.assert_allclose(values, np.array(expected)[:, -1], rtol=1e-13)


def test_a_simulation_goes_on_from_its_state(model: MultiAxisModel) -> None:
    u = record(1.5, 2, count=1).u[:, :, 0, 0]
    whole = model.simulate(u, level=1.0)
    half = model.simulate(u[:300], level=1.0)
    rest = model.simulate(u[300:], level=1.0, start=half.state)
    np.testing.assert_array_equal(np.vstack([half.y, rest.y]), whole.y)
    np.testing.assert_array_equal(rest.state, whole.state)
    with pytest.raises(pt.ShapeError, match="entries"):
        model.simulate(u, start=half.state[:-1])


def test_the_steady_motion_is_that_after_many_periods(model: MultiAxisModel) -> None:
    u = record(1.5, 2, count=1).u[:, :, 0, 0]
    steady = model.simulate(u, start="periodic").y
    long = model.simulate(np.tile(u, (6, 1)), level=1.5).y[-len(u) :]
    assert np.abs(long - steady).max() < 1e-6 * np.abs(steady).max()


def test_independent_sums_give_the_distorted_motion(model: MultiAxisModel) -> None:
    # Impulse responses of the modes, convolved, in place of states.
    level = model.levels[1]
    u = record(1.5, 2, count=1).u[:200, :, 0, 0]
    terms, moved = model.at(level.level), u - level.drive_mean
    k = np.arange(1, 200)[:, np.newaxis]
    impulses = 2.0 * np.einsum("kq,qi,qj->kij", terms.poles ** (k - 1), terms.outputs, terms.inputs)
    forced = 2.0 * np.einsum("kq,qi,qj->kij", terms.poles ** (k - 1), terms.outputs, terms.forces)

    def answer(kernel: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        found = np.zeros((200, 3))
        for n in range(1, 200):
            found[n] = np.einsum("kij,kj->i", kernel[:n].real, inputs[n - 1 :: -1][:n])
        return found

    y = answer(impulses, moved) + moved @ terms.direct.T
    gains = terms.response(np.ones(1, dtype=complex))[0].real
    v = np.hstack([moved, y @ np.linalg.inv(gains).T]) / level.level
    one = model.distortion.regressors
    columns = [np.prod(v[:, list(each)], axis=1) for each in one.products]
    before = np.vstack([np.zeros(6), v[:-1]])
    for variable, threshold in one.stops:
        stop = np.zeros(201)
        for n in range(200):
            away = stop[n] + v[n, variable] - before[n, variable]
            stop[n + 1] = min(max(away, -threshold), threshold)
        columns.append(stop[1:])
    for variable, scale in one.changes:
        change = (v - before)[:, variable]
        columns.append(change / (scale + abs(change)))
    y += answer(forced, np.hstack([moved, np.transpose(columns)])) + level.output_mean
    found = model.simulate(u, level=level.level).y
    np.testing.assert_allclose(found, y, atol=1e-10 * np.abs(y).max())


def test_the_file_holds_the_distortion(model: MultiAxisModel, tmp_path: Path) -> None:
    whole = tmp_path / "axes.json"
    whole.write_text(json.dumps(model.document()))
    again = load_axes(whole)
    assert again.distortion == model.distortion
    u = record(1.0, 2, count=1).u[:, :, 0, 0]
    np.testing.assert_array_equal(again.simulate(u).y, model.simulate(u).y)
    for entry, wrong in (
        ("products", [[0, 9]]),
        ("products", 3),
        ("products", [[-1]]),
        ("stops", [[0, -1.0]]),
        ("stops", [[0]]),
        ("changes", "none"),
        ("forces", [[0, 99, 1, 1.0, 0.0]]),
        ("forces", [[99, 0, 1, 1.0, 0.0]]),
        ("forces", [[0, 0, 1, 1.0]]),
        ("reference_rms", 0.0),
    ):
        broken = model.document()
        broken["distortion"][entry] = wrong
        path = tmp_path / "broken.json"
        path.write_text(json.dumps(broken))
        with pytest.raises(pt.DataError, match=r"broken\.json"):
            load_axes(path)


def test_one_law_holds_between_the_levels(model: MultiAxisModel) -> None:
    # Cubes of the drives: to the level squared in the share of the motion, at levels that no
    # record has. The modes of both levels alone leave more.
    linear = identify_axes([record(0.5, 1), record(1.5, 1)], distortion=False)
    other = record(1.0, 2, count=3)
    assert (model.score(other) < 0.25 * linear.score(other)).all()
    # In volts the cube is the same at all levels.
    cubes = [k for k, one in enumerate(model.distortion.regressors.products) if one == (0, 0, 0)]
    strongest = max(
        (one for one in model.distortion.forces if one.regressor in cubes),
        key=lambda one: abs(one.value),
    )
    assert strongest.power == 3


def test_the_most_numbers_are_chosen(model: MultiAxisModel) -> None:
    records = [record(0.5, 1), record(1.5, 1)]
    few = identify_axes(records, distortion=7)
    assert len(few.distortion) == 3
    # The best come first.
    pairs = [(one.mode, one.power) for one in few.distortion.forces]
    assert pairs == [(one.mode, one.power) for one in model.distortion.forces[:3]]
    assert not identify_axes(records, distortion=0).distortion
    for wrong in (-2, 1.5, "yes"):
        with pytest.raises(pt.PiezotrackError, match="distortion"):
            identify_axes(records, distortion=wrong)  # type: ignore[arg-type]


def test_forces_turn_with_the_modes(model: MultiAxisModel) -> None:
    # The same modes, b and e turned and c turned back, are the same system between the levels.
    lower, upper = (one.terms for one in model.levels)
    turn = np.exp(1j * np.linspace(0.3, 5.0, upper.poles.size))[:, np.newaxis]
    turned = replace(
        upper,
        inputs=upper.inputs * turn,
        outputs=upper.outputs / turn,
        forces=upper.forces * turn,
    )
    one, other = (lower.between(each, 0.4) for each in (upper, turned))
    np.testing.assert_allclose(one.forces, other.forces, rtol=1e-9, atol=1e-12)


@pytest.mark.slow
@pytest.mark.skipif(not MIRROR.exists(), reason="the mirror's record is not there")
def test_the_mirror_is_described_beyond_its_own_distortion() -> None:
    # Goals of 5, 4 and 3.5 % on a realisation that was not fitted; the best published model of the
    # test records leaves 6.37, 4.84 and 4.19 % (Floren and others, ISMA-USD 2024).
    records = [
        MultiAxisRecord.from_npz(MIRROR, drive=f"u_{k}", output=f"y_{k}", dt=1.0 / 6400.0)
        for k in (100, 200, 300)
    ]
    train = [one.only([0, 1, 2, 3, 5]) for one in records]
    for numbers, goals in ((28, (0.050, 0.040, 0.038)), (True, (0.040, 0.034, 0.033))):
        model = identify_axes(train, distortion=numbers)
        errors = [float(model.score(one.only([4]))[0]) for one in records]
        assert (np.array(errors) < goals).all(), errors
