"""The Duhem stage of Coleman and Hodgdon: its equation, its inverse, and what a fit finds."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

import piezotrack as pt
from piezotrack.data import datasets
from piezotrack.identification import LeastSquares

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

STAGE = pt.DuhemStage(
    alpha=0.04, f1=1.1e-6, f2=3e-9, f3=-3e-11, g0=0.8e-6, g1=2e-9, g2=-2e-11, low=0.0, high=75.0
)
CREEPING = replace(STAGE, creep_weights=(0.004, 0.01), creep_times=(0.1, 1.0))


def wandering(samples: int = 20000) -> Array:
    """A path with large and small loops, from 0 to 75."""
    rng = np.random.default_rng(1)
    turns = np.concatenate([[0.0], 75.0 * rng.random(200), 30.0 + 2.0 * rng.random(100)])
    path: Array = np.interp(np.linspace(0.0, turns.size - 1.0, samples), range(turns.size), turns)
    return path


def test_its_loop_follows_the_differential_equation() -> None:
    # A fall of the drive from 60 V to 20 V in small steps of Heun's method.
    x = STAGE.simulate([0.0, 60.0, 20.0], 0.01).x

    def slope(u: float, h: float, side: float) -> float:
        f = STAGE.f1 * u + STAGE.f2 * u**2 + STAGE.f3 * u**3
        g = STAGE.g0 + STAGE.g1 * u + STAGE.g2 * u**2
        return side * STAGE.alpha * (f - h) + g

    h, u, expected = 0.0, 0.0, [0.0]
    for target in (60.0, 20.0):
        step = (target - u) / 20000
        side = np.sign(step)
        for _ in range(20000):
            first = slope(u, h, side)
            second = slope(u + step, h + step * first, side)
            h, u = h + 0.5 * step * (first + second), u + step
        expected.append(h)
    np.testing.assert_allclose(x, expected, rtol=0.0, atol=1e-14)


def test_loops_settle() -> None:
    cycle = np.concatenate([np.linspace(10.0, 50.0, 100), np.linspace(50.0, 10.0, 100)])
    x = STAGE.simulate(np.tile(cycle, 30), 0.01).x.reshape(30, -1)
    first, last = (np.abs(np.diff(x[k : k + 2], axis=0)).max() for k in (0, 28))
    assert first > 1e-7
    assert last < 1e-15


def test_a_state_carries_on() -> None:
    u = wandering(3000)
    whole = CREEPING.simulate(u, 0.01)
    first = CREEPING.simulate(u[:1000], 0.01)
    second = CREEPING.simulate(u[999:], 0.01, initial=first.final)
    np.testing.assert_allclose(second.x, whole.x[999:], rtol=0.0, atol=1e-18)
    plain = STAGE.simulate(u[:1000], 0.01)
    assert plain.final.output == plain.final.x


@pytest.mark.parametrize("stage", [STAGE, CREEPING], ids=["hysteresis", "creep"])
def test_the_inverse_undoes_the_stage_along_any_path(stage: pt.DuhemStage) -> None:
    u = wandering()
    session = stage.inverse(playback="online").start(0.01)
    x = stage.simulate(u, 0.01).x
    back = np.array([session.step(one, velocity=0.0, acceleration=0.0) for one in x])
    atol = 75.0 * 1e-12 if stage is STAGE else 1e-4
    np.testing.assert_allclose(back, u, rtol=0.0, atol=atol)


def test_parameters_with_branches_that_turn_back_are_refused() -> None:
    with pytest.raises(pt.ParameterError, match=r"^g0 is such that 2 g - f'"):
        replace(STAGE, f1=2.5e-6)
    with pytest.raises(pt.ParameterError, match=r"^f1 is such that f'"):
        replace(STAGE, f1=-1e-6)
    with pytest.raises(pt.ParameterError, match=r"^high is -1 V: expected above low, 0 V"):
        replace(STAGE, high=-1.0)


def test_a_record_gives_back_the_stage_that_made_it() -> None:
    u = wandering(3000)
    log = pt.Dataset(u=u, y=STAGE.simulate(u, 1e-3).x - 4e-6, dt=1e-3)
    settings = LeastSquares(creep=False, dynamics=None)
    fit = pt.identify(log, "duhem", method=settings)
    assert fit.cost < 1e-9
    assert fit.offset == pytest.approx(-4e-6, abs=1e-8)
    assert fit.model.alpha == pytest.approx(STAGE.alpha, rel=0.01)
    again = np.linspace(70.0, 5.0, 300)
    moved = fit.model.simulate(again, 1e-3).x - STAGE.simulate(again, 1e-3).x
    assert np.abs(moved).max() < 1e-8


def test_it_has_no_places() -> None:
    u = wandering(800)
    log = pt.Dataset(u=u, y=STAGE.simulate(u, 0.01).x, dt=0.01)
    for settings in (LeastSquares(count=5), LeastSquares(thresholds=[5.0])):
        with pytest.raises(pt.ParameterError, match="Duhem has no thresholds"):
            pt.identify(log, "duhem", method=settings)


def test_it_explains_a_measured_log_and_foretells_another(tmp_path: Path) -> None:
    log, other = datasets.dbo_training(), datasets.dbo_tracking()
    compared = pt.compare(log, ["bouc-wen", "duhem"], train=(3.0, 23.0), test=other[3.0:], seed=1)
    symmetric, bent = compared.rows
    assert bent.title == "Duhem"
    # Its loops are asymmetric, those of Bouc and Wen are not.
    assert bent.train.rms_percent < symmetric.train.rms_percent
    fit = compared.fits["duhem"]
    loaded = pt.load(fit.save(tmp_path / "stage.json"))
    assert loaded.model == fit.model
    reference = pt.sine(frequency=1.0, low=10e-6, high=35e-6, duration=4.0)
    inverse = loaded.model.inverse(playback="online")
    loop = pt.Controller(dt=1e-3, limits=(0.0, 3.6), feedforward=inverse)
    run = pt.track(loaded.model, loop, reference)
    assert run.metrics.rms_error < 0.1e-6
