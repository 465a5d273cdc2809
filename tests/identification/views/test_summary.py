"""The block that a summary begins with: quantities of the stage, errors and noise."""

from __future__ import annotations

import math
import re
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest

import piezotrack as pt

if TYPE_CHECKING:
    from pathlib import Path

STAGE = pt.PrandtlIshlinskiiStage(
    linear=0.9e-6,
    thresholds=(3.0, 8.0, 15.0),
    weights=(0.1e-6, 0.2e-6, 0.15e-6),
    creep_weights=(0.03,),
    creep_times=(0.5,),
)
NOISE = 30e-9
# What is planted: several readings, or it would be a glitch.
FAR, WHEN = 1e-6, 2.5


@cache
def fitted() -> pt.identification.Identification:
    rng = np.random.default_rng(3)
    t = np.arange(4000) * 1e-3
    u = 40.0 - 30.0 * np.cos(2.0 * np.pi * t) * (1.0 - t / 8.0)
    y = STAGE.simulate(u, 1e-3).x + NOISE * rng.normal(size=t.size) + 0.5e-6 * t / 4.0
    y += FAR * np.exp(-(((t - WHEN) / 0.01) ** 2))
    settings = pt.LeastSquares(count=6, creep=[0.5], dynamics="first")
    data = pt.Dataset(t=t, u=u, y=y)
    return pt.identify(data, "prandtl-ishlinskii", method=settings, drift=True, progress=False)


def row(text: str, name: str) -> str:
    found = re.search(rf"^ +{name} +(.+)$", text, re.MULTILINE)
    assert found, f"no {name} in\n{text}"
    return found[1]


def number(text: str, unit: str) -> float:
    found = re.search(rf"(-?[\d.]+(?:e-?\d+)?) {unit}", text)
    assert found, f"no {unit} in {text}"
    return float(found[1])


def test_the_block_has_what_the_stage_is() -> None:
    text, loop = fitted().summary(), fitted().slow_loop
    assert loop is not None
    gain, _, spread = row(text, "gain").partition(" +- ")
    assert float(gain.split()[-1]) == pytest.approx(1e6 * loop.gain, rel=5e-3)
    assert 1e-4 < number(spread, "um/V") < 0.02
    wide, _, spread = row(text, "hysteresis").partition(" +- ")
    assert float(wide.split()[-1]) == pytest.approx(loop.width_percent, rel=5e-3)
    assert 0.01 < number(spread, "% of") < 1.0
    assert number(spread, "um") == pytest.approx(1e6 * loop.width, rel=5e-3)
    assert loop.width_percent == pytest.approx(15.0, abs=6.0)
    creep, _, spread = row(text, "creep").partition(" +- ")
    assert float(creep.split()[-1]) == pytest.approx(3.0, abs=1.0)
    assert 0.01 < number(spread, "% in") < 1.0
    assert number(spread, "s") == 0.5
    # Along 4 s.
    moved, _, spread = row(text, "drift").partition(" +- ")
    assert float(moved.split()[-1]) == pytest.approx(0.5, abs=0.1)
    assert 1e-3 < number(spread, "um over") < 0.5


def test_errors_stand_beside_the_noise() -> None:
    errors = row(fitted().summary(), "rms error")
    assert number(errors, "nm") == pytest.approx(1e9 * fitted().cost, rel=5e-3)
    most = errors.partition("largest ")[2]
    scale = {"nm": 1e-9, "um": 1e-6}[most.split()[1]]
    assert scale * float(most.split()[0]) == pytest.approx(FAR, rel=0.2)
    assert number(most, "s,") == pytest.approx(WHEN, abs=0.01)
    assert number(errors.partition("noise ")[2], "nm") == pytest.approx(1e9 * NOISE, rel=0.1)


def test_a_model_from_a_file_prints_the_same_block(tmp_path: Path) -> None:
    text = pt.load(fitted().save(tmp_path / "model.json")).summary()
    for name in ("gain", "hysteresis", "creep", "drift", "offset", "rms error", "predicted"):
        assert row(text, name) == row(fitted().summary(), name)


def test_lists_are_in_the_file_only() -> None:
    text, model = fitted().summary(), fitted().model
    assert len(model.thresholds) == 6
    shown = [float(one) for one in re.findall(r"-?\d[\d.]*(?:e-?\d+)?", text)]
    assert not any(
        math.isclose(one, shown_one, rel_tol=1e-4)
        for one in model.thresholds[1:]
        for shown_one in shown
    )
    assert "thresholds r, weights w" in text
    assert fitted().document()["parameters"]["thresholds"]["value"] == list(model.thresholds)


def test_what_a_model_does_not_have_is_not_printed() -> None:
    t = np.arange(2000) * 1e-3
    u = 40.0 - 30.0 * np.cos(2.0 * np.pi * t)
    plain = pt.PrandtlIshlinskiiStage(linear=1e-6, thresholds=(10.0,), weights=(0.5e-6,))
    data = pt.Dataset(u=u, y=plain.simulate(u, 1e-3).x, dt=1e-3)
    settings = pt.LeastSquares(count=3, creep=False, dynamics=None)
    fit = pt.identify(data, "prandtl-ishlinskii", method=settings, drift=False, progress=False)
    block = fit.summary().partition("\n\n")[0]
    for name in ("creep", "lag", "drift", "mode", "delay"):
        assert not re.search(rf"^ +{name} ", block, re.MULTILINE)


def test_creep_of_no_weight_is_not_counted() -> None:
    without = pt.PrandtlIshlinskiiStage(
        linear=1e-6, thresholds=(10.0,), weights=(0.5e-6,),
        creep_weights=(0.0, 0.0), creep_times=(0.1, 1.0),
    )  # fmt: skip
    assert "creep" not in repr(without)


@pytest.mark.parametrize("r", [0.0, 0.9])
def test_standard_deviations_account_for_correlated_residuals(r: float) -> None:
    rng, size, stage = np.random.default_rng(5), 3000, pt.DahlStage.xu_li_2010()
    noise = rng.normal(size=size)
    for i in range(1, size):
        noise[i] += r * noise[i - 1]
    u = 37.5 - 37.5 * np.cos(np.pi * np.arange(size) * 2e-3)
    data = pt.Dataset(u=u, y=stage.simulate(u, 2e-3).x + 50e-9 * noise, dt=2e-3)
    held = {name: getattr(stage, name) for name in ("stiffness", "mass", "a1", "a2", "b1")}
    fit = pt.identify(data, "dahl", parameters=held, method=pt.Descents(seed=1, runs=2))
    assert fit.autocorrelations == pytest.approx((r,), abs=0.05)
    # Of a value that shows slowly the deviation is so many times that for independent noise
    # (Bartlett 1935, doi 10.2307/2342284).
    factor = ((1.0 + r) / (1.0 - r)) ** 0.5
    assert fit.covariance is not None
    widened = fit.covariance.deviations / fit.covariance.independent
    assert widened[fit.covariance.names.index("piezo_coefficient")] == pytest.approx(
        factor, rel=0.2
    )


@pytest.mark.parametrize("entry", [None, "much", {}, {"value": "much"}, {"value": 1e-6}])
def test_a_file_with_a_part_of_the_errors_prints_that_part(entry: object) -> None:
    model = pt.identification.IdentifiedModel(
        model=STAGE,
        offset=0.0,
        offset_fitted=False,
        stroke=1e-4,
        details={"fit": {"cost": {"value": 1e-7}, "max_error": entry, "noise": entry}},
    )
    errors = row(model.summary(), "rms error")
    assert number(errors, "nm") == 100.0
    # No largest error without its time.
    assert "largest" not in errors
    assert ("noise 1 um" in errors) == (entry == {"value": 1e-6})
    assert "gain" not in model.summary()
