"""Tuned gains on stages that differ from their model: of another kind, from another log."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

import piezotrack as pt
from piezotrack import _core
from piezotrack.control.tuning.margins import plants_of
from piezotrack.control.tuning.model_set import searched
from piezotrack.control.tuning.model_set.representatives import farthest
from piezotrack.control.tuning.starts import simc

DT, LIMITS, NOISE = 5e-3, (0.0, 3.6), 65e-9
TIMING = pt.Timing(delay=2e-3)
MOTIONS = {
    "triangle": pt.triangle(frequency=1.0, low=8e-6, high=38e-6, duration=4.0),
    "sine": pt.sine(frequency=4.0, low=10e-6, high=36e-6, duration=2.0),
    "multisine": pt.multisine(
        frequencies=[0.3, 0.9, 2.1, 3.7], low=9e-6, high=37e-6, duration=5.0, seed=2
    ),
}
KINDS = ("prandtl-ishlinskii", "preisach", "first-order-dahl", "bouc-wen")
QUICK = pt.TuningSearch(particles=16, iterations=10)


@cache
def logs() -> tuple[pt.Dataset, pt.Dataset]:
    return pt.datasets.dbo_training()[3.0:23.0], pt.datasets.dbo_tracking()[3.0:43.0]


@cache
def fitted(log: int, kind: str) -> Any:
    return pt.identify(logs()[log], kind)


def known(log: int) -> dict[str, Any]:
    """Loop of the model of a log, with its inverse."""
    inverse = fitted(log, KINDS[0]).model.inverse()
    return {"dt": DT, "limits": LIMITS, "feedforward": inverse}


def noisy(log: int, kind: str, noise: float = NOISE, seed: int = 1) -> pt.VirtualStage:
    return pt.VirtualStage.of(fitted(log, kind).model, noise=noise, seed=seed)


def error(log: int, kind: str, motion: str, controller: pt.Controller) -> float:
    """True rms error [m], mean of two draws of the noise that no search has seen."""
    runs = [
        pt.track(
            noisy(log, kind, seed=seed), controller, MOTIONS[motion], timing=TIMING,
            unstable=True, beyond_reach=True,
        )
        for seed in (11, 12)
    ]  # fmt: skip
    return float(np.mean([run.score(true=True).rms_error for run in runs]))


def tuned(log: int, motions: list[str], **options: Any) -> pt.Controller:
    """The default, of PID and low-pass."""
    given: dict[str, Any] = {"parts": ("pid", "low-pass"), **known(log), **options}
    references = [MOTIONS[motion] for motion in motions]
    return pt.tune(noisy(log, KINDS[0]), references, timing=TIMING, **given).controller


def rule(log: int) -> pt.Controller:
    """PI by Skogestad's rule."""
    plants = plants_of([fitted(log, KINDS[0]).model], LIMITS, TIMING.delay, pt.Spread())
    gains = simc([one.plant for one in plants], DT)[0]
    law = pt.Pid(kp=gains["kp"], ti=gains["kp"] * DT / gains["ki"])
    return pt.Controller(feedback=law, **known(log))


def alone(log: int) -> pt.Controller:
    """PID from margins alone."""
    given: dict[str, Any] = {"parts": "pid", **known(log)}
    return pt.tune(noisy(log, KINDS[0]), timing=TIMING, **given).controller


def crossed(log: int, kinds: tuple[str, ...], motions: list[str], seed: int) -> np.ndarray:
    """Errors on stages of the other log: default, rule and margins alone."""
    search = pt.TuningSearch(seed=seed)
    own = {motion: tuned(log, [motion], search=search) for motion in motions}
    fixed = rule(log), alone(log)
    return np.array(
        [
            [error(1 - log, kind, motion, one) for one in (own[motion], *fixed)]
            for kind in kinds
            for motion in motions
        ]
    )


def test_gains_for_a_sine_hold_on_a_stage_of_another_kind_and_log() -> None:
    # Without an offset a slow low-pass that fits the model alone wins: 0.4 um there.
    errors = crossed(0, ("first-order-dahl",), ["sine"], seed=1)
    assert (errors[:, 0] < 1.03 * errors[:, 1:].min(axis=1)).all()
    nominal = tuned(0, ["sine"], spread=pt.Spread(offset=0.0))
    assert errors[0, 0] < 0.3 * error(1, "first-order-dahl", "sine", nominal)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_tuned_gains_are_not_worse_than_a_rule_on_stages_of_another_log(seed: int) -> None:
    errors = crossed(0, KINDS, list(MOTIONS), seed)
    assert (errors[:, 0] < 1.03 * errors[:, 1]).all()
    assert (errors[:, 0] < 1.03 * errors[:, 2]).all()
    assert errors[:, 0].mean() < 72e-9
    # The Bouc-Wen stage of the other log cannot reach the lowest points: all are alike there.
    back = crossed(1, KINDS[:3], list(MOTIONS), seed)
    assert (back[:, 0] < 1.05 * back[:, 1:].min(axis=1)).all()


@pytest.mark.slow
def test_likely_models_cost_no_integral_action() -> None:
    """The fit with its posterior models and a spread: 774 plants."""
    fit = fitted(0, KINDS[0])
    nearby = [one.model for one in pt.identification.posterior_models(fit, logs()[0])]
    stages = [noisy(0, KINDS[0]), *nearby]
    spread = pt.Spread(delay=(0.0, 2e-3), gain=0.1)
    found = pt.tune(
        stages, list(MOTIONS.values()), timing=TIMING, margins=pt.Margins(sensitivity=1.6),
        parts=("pid", "low-pass"), spread=spread, **known(0),
    )  # fmt: skip
    plants = plants_of(stages, LIMITS, TIMING.delay, spread)
    assert len(found.plants) == len(plants)
    for one in plants:
        check = _core.check_loop(found.controller._core, one.plant)
        assert check["stable"]
        assert check["sensitivity"] < 1.6 * 1.004
    # A law that keeps these margins too, of the same structure.
    plain = pt.Controller(feedback=pt.Pid(kp=0.04e6, ti=0.014), **known(0))
    for kind in KINDS:
        for motion in MOTIONS:
            assert error(1, kind, motion, found.controller) < error(1, kind, motion, plain)


def test_much_noise_does_not_take_the_integral_action() -> None:
    stage = noisy(0, KINDS[0], noise=0.5e-6)
    line = MOTIONS["triangle"]
    errors = []
    for offset in (0.0, pt.Spread().offset):
        spread = pt.Spread(offset=offset)
        found = pt.tune(
            stage, line, timing=TIMING, parts=("pid", "low-pass"), spread=spread, **known(0)
        )
        errors.append(error(1, "first-order-dahl", "triangle", found.controller))
    assert errors[0] > 0.5e-6
    assert errors[1] < 0.2 * errors[0]


def test_many_plants_are_all_kept_though_few_are_searched(monkeypatch: pytest.MonkeyPatch) -> None:
    fit = fitted(0, KINDS[0])
    nearby = [one.model for one in pt.identification.posterior_models(fit, logs()[0])]
    stages = [noisy(0, KINDS[0]), *nearby[:7]]
    spread = pt.Spread(delay=(0.0, 2e-3), gain=0.1)
    margins = pt.Margins(sensitivity=1.6)
    line = MOTIONS["triangle"]
    given: dict[str, Any] = {"parts": "pid", "spread": spread, "search": QUICK, **known(0)}
    found = pt.tune(stages, line, timing=TIMING, margins=margins, **given)
    plants = plants_of(stages, LIMITS, TIMING.delay, spread)
    assert len(found.plants) == len(plants) == 8 * 3 * 2 * 3
    checks = [_core.check_loop(found.controller._core, one.plant) for one in plants]
    assert all(one["stable"] for one in checks)
    worst = max(one["sensitivity"] for one in checks)
    assert worst < 1.6 * 1.004
    kept = {one.name: one.value for one in found.kept}
    assert kept["sensitivity"] == worst
    assert kept["gain margin"] == min(one["gain_margin"] for one in checks)
    # The same with all plants and all stages in the search.
    monkeypatch.setattr(searched, "PLANTS", len(plants))
    monkeypatch.setattr(searched, "STAGES", len(stages))
    whole = pt.tune(stages, line, timing=TIMING, margins=margins, **given)
    assert found.value == pytest.approx(whole.value, rel=0.02)


def test_the_figure_is_that_of_the_worst_stage() -> None:
    stiff = pt.PrandtlIshlinskiiStage(
        linear=0.9e-6, thresholds=(5.0,), weights=(0.2e-6,), time_constant=5e-3
    )
    soft = pt.PrandtlIshlinskiiStage(
        linear=1.2e-6, thresholds=(5.0,), weights=(0.2e-6,), time_constant=5e-3
    )
    line = pt.triangle(frequency=1.0, low=10e-6, high=40e-6, duration=3.0)
    given: dict[str, Any] = {
        "dt": 2e-3,
        "limits": (0.0, 60.0),
        "parts": "pid",
        "feedforward": stiff.inverse(),
        "search": QUICK,
        "spread": pt.Spread(offset=0.0),
    }
    found = pt.tune([stiff, soft], line, **given)
    runs = [pt.track(one, found.controller, line).metrics.rms_error for one in (stiff, soft)]
    assert found.value == pytest.approx(max(runs), rel=0.02)
    assert runs[1] > 1.5 * runs[0]


def test_a_set_of_many_plants_that_no_gains_keep_is_refused_in_one_sentence() -> None:
    spread = pt.Spread(delay=(0.0, 2e-3), mode=0.1, gain=0.2)
    margins = pt.Margins(gain=2e6)
    given: dict[str, Any] = {"parts": "pid", "search": QUICK, "margins": margins, **known(0)}
    words = r"margins\.gain is .*: expected one that some gains can keep; .*high gain, 2 ms.*"
    with pytest.raises(pt.ParameterError) as refused:
        pt.tune(noisy(0, KINDS[0]), MOTIONS["sine"], timing=TIMING, spread=spread, **given)
    assert re.fullmatch(words, str(refused.value))


def test_the_gains_are_tried_on_a_stage_of_another_kind_of_the_same_record() -> None:
    fit = fitted(0, KINDS[0])
    lowest = float(fit.data.y.min())
    line = pt.triangle(frequency=1.0, low=lowest + 8e-6, high=lowest + 38e-6, duration=3.0)
    found = pt.tune(fit, line, timing=TIMING, parts="pid", search=QUICK)
    assert found.other_kind is not None
    model, left = found.other_kind
    assert model == "bouc-wen"
    other = pt.identify(logs()[0][:10.0], model)
    # Both begin at the same reading.
    stage = replace(pt.VirtualStage.of(other), sensor=pt.VirtualStage.of(fit).sensor)
    run = pt.track(stage, found.controller, line, timing=TIMING, unstable=True, beyond_reach=True)
    assert left == pytest.approx(run.metrics.rms_error, rel=0.1)
    assert left < 3.0 * found.value
    assert f"on a bouc-wen stage fitted to the same record: {1e6 * left:.4g} um rms" in str(found)
    assert found.document()["other_kind"]["rms_error"] == left
    # A stage alone has no record.
    bare = pt.tune(fit.model, MOTIONS["triangle"], dt=DT, limits=LIMITS, search=QUICK)
    assert bare.other_kind is None


def test_the_farthest_points_are_no_farther_from_the_others_than_twice_the_least() -> None:
    rng = np.random.default_rng(1)
    points = np.concatenate([centre + 0.01 * rng.random((20, 3)) for centre in np.eye(3)])
    chosen = farthest(points, 3)
    # One of each cluster.
    assert {i // 20 for i in chosen} == {0, 1, 2}
    assert farthest(np.zeros((5, 2)), 3) == [0]


@pytest.mark.parametrize("offset", [-0.1, 0.95, float("nan"), float("inf")])
def test_an_offset_is_a_share(offset: float) -> None:
    with pytest.raises(pt.ParameterError, match="offset is"):
        pt.Spread(offset=offset)
