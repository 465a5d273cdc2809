"""Decoupling and loops of several axes, against slow transcriptions."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

import piezotrack as pt
from piezotrack import _core
from piezotrack.multiaxis import (
    MultiAxisModel,
    VirtualAxes,
    check_axes,
    decoupling_matrix,
    identify_axes,
    repeating_drive,
    track_axes,
)

if TYPE_CHECKING:
    from pathlib import Path

LAW = pt.Pid(kp=0.005, ti=5e-4)


@pytest.fixture(scope="module")
def stage() -> VirtualAxes:
    return VirtualAxes.three(noise=1e-9, seed=1)


@pytest.fixture(scope="module")
def model(stage: VirtualAxes) -> MultiAxisModel:
    return identify_axes(stage.record())


def step(samples: int = 2000, start: int = 100) -> np.ndarray:
    """One axis moves by 1 um, smoothly over 100 samples."""
    wanted = np.zeros((samples, 3))
    ramp = np.clip((np.arange(samples) - start) / 100.0, 0.0, 1.0)
    wanted[:, 0] = 1e-6 * (3.0 * ramp**2 - 2.0 * ramp**3)
    return wanted


def transcribed(
    stage: VirtualAxes, wanted: np.ndarray, laws: list[pt.Pid], matrix: np.ndarray,
    low: float, high: float,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """The loop sample by sample, from the equations."""
    terms, dt = stage.terms, stage.dt
    x = np.zeros(terms.poles.size, dtype=complex)
    u, excess = np.zeros(3), np.zeros(3)
    feedback, errors = np.zeros(3), None
    outputs, drives = [], []
    for target in wanted:
        y = 2.0 * (terms.outputs.T @ x).real + terms.direct @ u
        x = terms.poles * x + terms.inputs @ u
        outputs.append(y)
        drives.append(u)
        e = target - y
        e1, e2 = errors if errors is not None else (e, e)
        for k, law in enumerate(laws):
            tt = law.ti if law.tt is None else law.tt
            feedback[k] += (
                law.kp * (e[k] - e1[k])
                + law.kp * dt / law.ti * e[k]
                + law.kp * law.td / dt * (e[k] - 2.0 * e1[k] + e2[k])
                + dt / tt * excess[k]
            )
        errors = (e, e1)
        raw = matrix @ feedback
        u = np.clip(raw, low, high)
        excess = np.linalg.inv(matrix) @ (u - raw)
    return np.array(outputs), np.array(drives)


@pytest.mark.parametrize("limit", [np.inf, 0.3])
def test_a_run_is_that_of_its_equations(
    stage: VirtualAxes, model: MultiAxisModel, limit: float
) -> None:
    laws = [LAW, pt.Pid(kp=0.004, ti=6e-4, td=1e-4, tt=1e-3), pt.Pid(kp=0.006, ti=5e-4)]
    wanted, matrix = step(600), decoupling_matrix(model)
    limits = None if np.isinf(limit) else (-limit, limit)
    run = track_axes(stage, wanted, laws, model=model, limits=limits, noise=0.0)
    y, u = transcribed(stage, wanted, laws, matrix, -limit, limit)
    assert np.abs(run.y - y).max() < 1e-9 * np.abs(y).max()
    assert np.abs(run.u - u).max() < 1e-9 * np.abs(u).max()
    assert (np.abs(run.u) <= limit).all()
    assert (np.abs(run.u).max() == limit) == np.isfinite(limit)


def test_decoupling_takes_the_coupling_away(stage: VirtualAxes, model: MultiAxisModel) -> None:
    before = track_axes(stage, step(), LAW, decoupling="diagonal", model=model)
    after = track_axes(stage, step(), LAW, decoupling="static", model=model)
    others = [run.cross_coupling[1:].max() for run in (before, after)]
    assert others[0] > 0.05
    assert others[1] < 0.2 * others[0]
    assert after.margins.sensitivity < before.margins.sensitivity
    # Static errors vanish in both.
    assert np.abs(after.error[-100:]).max() < 10e-9
    assert np.abs(before.error[-100:]).max() < 10e-9


def test_the_matrix_decouples_at_rest(stage: VirtualAxes, model: MultiAxisModel) -> None:
    product = stage.static_gain @ decoupling_matrix(model)
    assert np.abs(product - np.eye(3)).max() < 1e-3
    with pytest.raises(pt.ParameterError, match="kind is 'dynamic'"):
        decoupling_matrix(model, "dynamic")


def test_axes_that_depend_on_each_other_are_refused(stage: VirtualAxes) -> None:
    alike = replace(stage, sensor_shapes=np.repeat(stage.sensor_shapes[:, :1], 3, axis=1))
    with pytest.raises(pt.NumericalError, match="no inverse"):
        decoupling_matrix(alike)


def test_the_verdict_is_that_of_a_simulation(stage: VirtualAxes) -> None:
    """At the edge of stability the poles and the motion agree."""
    low, high = 1.0, 20.0
    for _ in range(24):
        factor = np.sqrt(low * high)
        if check_axes(stage, replace(LAW, kp=factor * LAW.kp)).stable:
            low = factor
        else:
            high = factor
    bump = step(20000, 10)
    wanted = bump - np.roll(bump, 200, axis=0) * (np.arange(20000) > 300)[:, None]
    ends = []
    for factor in (0.98 * low, 1.02 * low):
        run = track_axes(stage, wanted, replace(LAW, kp=factor * LAW.kp), noise=0.0)
        early, late = (np.abs(run.error[a:b]).max() for a, b in ((2000, 4000), (18000, 20000)))
        ends.append(late / early)
    assert ends[0] < 0.9
    assert ends[1] > 1.1


def test_margins_by_singular_values_are_safe(stage: VirtualAxes) -> None:
    for kind in ("static", "diagonal"):
        margins = check_axes(stage, LAW, decoupling=kind)
        assert margins.stable
        assert margins.gain_margin > 3.5
        # Gains of the loops rise by themselves, to just below the margin.
        for corner in np.ndindex(2, 2, 2):
            gains = 10.0 ** (0.98 * margins.gain_margin / 20.0 * np.array(corner))
            laws = [replace(LAW, kp=gain * LAW.kp) for gain in gains]
            assert check_axes(stage, laws, decoupling=kind).stable
    # The peak is that of the slow computation over a fine grid.
    z = np.exp(2j * np.pi * np.arange(1, 200000) / 400000)
    loop = stage.terms.response(z) @ decoupling_matrix(stage)
    k = LAW.kp * (1.0 + stage.dt / LAW.ti / (1.0 - 1.0 / z)) / z
    least = np.linalg.svd(np.eye(3) + k[:, None, None] * loop, compute_uv=False)[:, -1].min()
    assert check_axes(stage, LAW).sensitivity == pytest.approx(1.0 / least, rel=1e-3)


def test_a_repeating_reference_is_followed_without_feedback(
    stage: VirtualAxes, model: MultiAxisModel
) -> None:
    time = np.arange(400) / 400.0
    wanted = 1e-6 * np.stack([np.sin(2 * np.pi * (k + 1) * 9 * time) for k in range(3)], axis=1)
    drive = repeating_drive(model, wanted, regularisation=1e-6)
    error = stage.simulate(drive) - wanted
    still = stage.simulate(wanted @ decoupling_matrix(model).T) - wanted
    assert np.abs(error).max() < 1e-3 * np.abs(wanted).max()
    assert np.abs(still).max() > 0.05 * np.abs(wanted).max()
    # A heavier regularisation takes smaller drives.
    small = repeating_drive(model, wanted, regularisation=1.0)
    assert np.square(small).sum() < np.square(drive).sum()


def test_an_unstable_loop_says_so(stage: VirtualAxes) -> None:
    law = replace(LAW, kp=0.2)
    margins = check_axes(stage, law)
    assert not margins.stable
    assert "unstable" in str(margins)
    with pytest.raises(pt.NumericalError, match="range of numbers"):
        track_axes(stage, step(60000), law)


@pytest.mark.parametrize(
    ("changed", "error", "words"),
    [
        ({"feedback": [LAW, LAW]}, pt.ShapeError, "2 laws: expected 3"),
        ({"feedback": 1.0}, pt.ParameterError, "feedback is 1.0"),
        ({"reference": np.zeros((10, 2))}, pt.ShapeError, "samples x 3 axes"),
        ({"limits": (1.0, 1.0)}, pt.ParameterError, r"limits are \(1, 1\) V"),
        ({"feedforward": np.zeros((3, 3))}, pt.ShapeError, "feedforward has the shape"),
        ({"feedforward": "dynamic"}, pt.ParameterError, "feedforward is 'dynamic'"),
        ({"stage": pt.DahlStage.xu_li_2010()}, pt.ParameterError, "a MultiAxisModel"),
    ],
)
def test_what_does_not_fit_a_loop_is_refused(
    stage: VirtualAxes, changed: dict[str, object], error: type[Exception], words: str
) -> None:
    arguments: dict[str, object] = {
        "stage": stage, "reference": step(20), "feedback": LAW, **changed
    }  # fmt: skip
    with pytest.raises(error, match=words):
        track_axes(**arguments)  # type: ignore[arg-type]


def test_a_run_is_printed_and_saved(stage: VirtualAxes, tmp_path: Path) -> None:
    run = track_axes(stage, step(300), LAW, noise=0.0)
    paths = run.save(tmp_path)
    assert {path.name for path in paths} >= {"axes_run.csv", "axes_run.json", "axes_run.png"}
    columns = np.loadtxt(tmp_path / "axes_run.csv", delimiter=",", skiprows=1)
    assert columns.shape == (300, 10)
    assert columns[:, 4:7] == pytest.approx(1e6 * run.y, abs=1e-9)
    # Errors below 1 um are in nm.
    assert "max nm" in run.summary()
    assert f"{1e9 * run.metrics[0].max_error:.3f}" in run.summary()
    assert "stable, Ms" in run.summary()


@pytest.mark.parametrize(
    ("changed", "error", "words"),
    [
        ({"poles": ([1.0], [0.0])}, pt.ParameterError, "poles inside the unit circle"),
        ({"poles": ([0.5, 0.1], [0.0, 0.0])}, pt.ShapeError, "inputs has 1 entries: expected 2"),
        ({"outputs": ([1.0], [0.0, 1.0])}, pt.ShapeError, "1 real and 2 imaginary parts"),
        ({"direct": [1.0, 2.0]}, pt.ShapeError, "direct has 2 entries: expected 1"),
    ],
)
def test_the_core_refuses_modes_that_do_not_fit(
    changed: dict[str, object], error: type[Exception], words: str
) -> None:
    one = ([1.0], [0.0])
    parts: dict[str, object] = {
        "poles": ([0.5], [0.0]), "inputs": one, "outputs": one, "direct": [0.0], **changed
    }  # fmt: skip
    with pytest.raises(error, match=words):
        _core.ModalSystem(1, 1, **parts)  # type: ignore[arg-type]
    lag = _core.ModalSystem(1, 1, ([0.5], [0.0]), one, one, [0.0])
    with pytest.raises(pt.ShapeError, match="state has 2 entries: expected 1"):
        lag.simulate(([0.0, 0.0], [0.0, 0.0]), [1.0])
    with pytest.raises(pt.ShapeError, match="drive has 0 entries"):
        lag.simulate(([0.0], [0.0]), [])
