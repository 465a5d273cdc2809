"""Several modes in parallel behind play operators: motion, state, inverse, loop, file."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import signal

import piezotrack as pt

FILES = Path(__file__).parents[1] / "files"
BARE = pt.PrandtlIshlinskiiStage(linear=1e-6, thresholds=(), weights=())
MODES: dict[str, Any] = {
    "frequency": 150.0,
    "damping_ratio": 0.05,
    "mode_weights": (0.3, 0.15),
    "mode_frequencies": (320.0, 900.0),
    "mode_damping_ratios": (0.02, 0.1),
}
STAGE = replace(BARE, **MODES)
PLAYS = replace(STAGE, thresholds=(2.0, 6.0), weights=(2e-7, 1e-7))
ENVELOPE = pt.GeneralisedPrandtlIshlinskiiStage(
    linear=1e-6,
    thresholds=(2.0, 6.0),
    weights=(2e-7, 1e-7),
    scale=100.0,
    slope=0.01,
    shift=0.0,
    level=0.0,
    **MODES,
)
OF_BOTH = pytest.mark.parametrize("stage", [PLAYS, ENVELOPE], ids=["plays", "envelope"])


@OF_BOTH
def test_equilibrium_stays(stage: Any) -> None:
    start = stage.equilibrium([60.0, 40.0])
    x = stage.simulate(np.full(200, 40.0), 1e-4, initial=start).x
    assert x == pytest.approx(x[0], rel=1e-12)
    assert start.mode_x == pytest.approx([x[0]] * 2, rel=1e-12)


def parts(stage: Any) -> list[tuple[float, float, float]]:
    """Weight, rate and damping ratio of each mode, the main one first."""
    weights = (1.0 - sum(stage.mode_weights), *stage.mode_weights)
    frequencies = (stage.frequency, *stage.mode_frequencies)
    damping = (stage.damping_ratio, *stage.mode_damping_ratios)
    rates = [2.0 * np.pi * one for one in frequencies]
    return list(zip(weights, rates, damping, strict=True))


def scipys(stage: Any, d: np.ndarray, dt: float) -> np.ndarray:
    """The sum of the modes of SciPy for a static displacement linear between samples."""
    t = np.arange(d.size) * dt
    total: np.ndarray = np.sum(
        [
            g * signal.lsim(([w * w], [1.0, 2.0 * z * w, w * w]), d, t)[1]
            for g, w, z in parts(stage)
        ],
        axis=0,
    )
    return total


def test_the_displacement_is_the_weighted_sum_of_the_modes() -> None:
    u = 30.0 * np.sin(np.cumsum(np.random.default_rng(1).random(3000)) * 0.05)
    u -= u[0]
    x = STAGE.simulate(u, 1e-4).x
    np.testing.assert_allclose(x, scipys(STAGE, 1e-6 * u, 1e-4), rtol=0.0, atol=1e-14)
    # Without the further modes it is another motion.
    alone = replace(BARE, frequency=150.0, damping_ratio=0.05).simulate(u, 1e-4).x
    assert np.abs(alone - x).max() > 1e-6


def test_a_held_step_ends_at_the_static_displacement() -> None:
    x = STAGE.simulate(np.full(20001, 10.0), 1e-4, hold="zoh").x
    assert x[-1] == pytest.approx(10e-6, rel=1e-12)
    t = np.arange(300) * 1e-4
    step = np.zeros(300)
    for g, w, z in parts(STAGE):
        wd = w * np.sqrt(1.0 - z * z)
        ring = np.cos(wd * t) + z * w / wd * np.sin(wd * t)
        step += g * (1.0 - np.exp(-z * w * t) * ring)
    np.testing.assert_allclose(x[:300], 10e-6 * step, rtol=0.0, atol=1e-17)


def test_the_velocity_is_that_of_the_displacement() -> None:
    u = np.sin(2.0 * np.pi * 40.0 * np.arange(4000) * 1e-5)
    run = STAGE.simulate(u, 1e-5)
    slope = (run.x[2:] - run.x[:-2]) / 2e-5
    np.testing.assert_allclose(run.v[1:-1], slope, rtol=0.0, atol=1e-3 * np.abs(slope).max())


def test_a_main_mode_without_weight_is_no_hindrance() -> None:
    halves: dict[str, Any] = {"mode_weights": (0.5, 0.5)}
    u = np.sin(np.arange(2000) * 0.02)
    stage = replace(STAGE, **halves)
    np.testing.assert_allclose(
        stage.simulate(u, 1e-4).x, scipys(stage, 1e-6 * u, 1e-4), rtol=0.0, atol=1e-14
    )


@OF_BOTH
def test_a_state_carries_on(stage: Any) -> None:
    u = 30.0 * np.sin(np.arange(3000) * 0.013)
    whole = stage.simulate(u, 1e-4)
    first = stage.simulate(u[:1000], 1e-4)
    assert len(first.final.mode_x) == len(first.final.mode_v) == 2
    second = stage.simulate(u[999:], 1e-4, initial=first.final)
    np.testing.assert_allclose(second.x, whole.x[999:], rtol=0.0, atol=1e-18)
    with pytest.raises(pt.ShapeError, match="1 and 2 entries of mode_x and mode_v"):
        stage.simulate(u, 1e-4, initial=replace(first.final, mode_x=(0.0,)))


@OF_BOTH
def test_the_inverse_undoes_the_modes(stage: Any) -> None:
    reference = pt.sine(frequency=20.0, low=0.0, high=20e-6, duration=0.5)
    volts = stage.inverse().voltage(reference, 2e-5)
    error = stage.simulate(volts, 2e-5).x - reference.sample(2e-5).x
    later = error[15000:]
    assert np.abs(later).max() < 2e-9
    one = replace(stage, mode_weights=(), mode_frequencies=(), mode_damping_ratios=())
    untold = one.inverse().voltage(reference, 2e-5)
    missed = stage.simulate(untold, 2e-5).x - reference.sample(2e-5).x
    assert np.abs(missed[15000:]).max() > 50e-9


def test_an_inverse_that_would_grow_is_refused() -> None:
    # A zero of the sum of the modes is in the right half plane, or there are too few of them.
    reference = pt.sine(frequency=5.0, low=0.0, high=20e-6, duration=0.5)
    none: dict[str, Any] = {
        "mode_weights": (-0.5,),
        "mode_frequencies": (900.0,),
        "mode_damping_ratios": (0.1,),
    }
    stage = replace(STAGE, **none)
    gains = parts(stage)
    total = np.zeros(3)
    for (g, w, _), (_, other, z) in ((gains[0], gains[1]), (gains[1], gains[0])):
        total += g * w * w * np.array([1.0, 2.0 * z * other, other * other])
    assert np.roots(total).real.max() > 0.0
    with pytest.raises(pt.ParameterError, match=r"^mode_weights is -0\.5: .*right half plane"):
        stage.inverse().voltage(reference, 1e-4)


def test_a_loop_sees_all_modes() -> None:
    plant = STAGE._core.loop_plants(0.0, 30.0, 0.0)[0]
    a, b, c, d, _ = (np.array(part) for part in plant.matrices())
    w = 2.0 * np.pi * np.array([10.0, 150.0, 320.0, 900.0])
    a = a.reshape(b.size, b.size)
    found = [c @ np.linalg.solve(1j * one * np.eye(b.size) - a, b) + d for one in w]
    made = sum(g * n * n / (n * n - w * w + 2j * z * n * w) for g, n, z in parts(STAGE))
    np.testing.assert_allclose(found, 1e-6 * made, rtol=1e-9)


REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "weight": ({"mode_weights": (0.3, 1.0)}, "mode_weights[1] is 1: "),
    "nan": ({"mode_weights": (float("nan"), 0.1)}, "mode_weights[0] is NaN: "),
    "frequency": ({"mode_frequencies": (0.0, 900.0)}, "mode_frequencies[0] is 0 Hz: "),
    "damping": ({"mode_damping_ratios": (0.1, -0.1)}, "mode_damping_ratios[1] is -0.1: "),
    "length": ({"mode_frequencies": (320.0,)}, "mode_frequencies has 1 entries: "),
    "many": (
        {name: (0.1,) * 4 for name in MODES if name.startswith("mode_")},
        "mode_frequencies has 4 entries: ",
    ),
    "alone": ({"frequency": None, "damping_ratio": None}, "mode_weights is 2 entries: "),
}


@OF_BOTH
@pytest.mark.parametrize("name", REFUSED)
def test_modes_that_cannot_be_are_refused(stage: Any, name: str) -> None:
    changes, begin = REFUSED[name]
    with pytest.raises(pt.PiezotrackError) as caught:
        replace(stage, **changes)
    assert str(caught.value).startswith(begin)


def test_files_without_modes_are_read(tmp_path: Path) -> None:
    model = pt.load(FILES / "prandtl_ishlinskii_version_1.json")
    assert model.model.mode_weights == ()
    path = model.save(tmp_path / "now.json")
    document = json.loads(path.read_text())
    for name in list(document["parameters"]):
        if name.startswith("mode_"):
            del document["parameters"][name]
    (tmp_path / "before.json").write_text(json.dumps(document))
    assert pt.load(tmp_path / "before.json").model == model.model


def test_files_keep_modes(tmp_path: Path) -> None:
    model = pt.load(FILES / "prandtl_ishlinskii_version_1.json")
    more = {**MODES, "time_constant": None}
    model = replace(model, model=replace(model.model, **more))
    assert pt.load(model.save(tmp_path / "modes.json")).model == model.model
