"""Creep found with the parameters that a swarm searches."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt

if TYPE_CHECKING:
    from pathlib import Path

STAGE = pt.FirstOrderDahlStage(
    mass=0.1828,
    damping=500.0,
    stiffness=26065.0,
    piezo_coefficient=0.0468,
    rest_stiffness=9e3,
    coulomb_force=0.15,
    creep_weights=(0.02, 0.03),
    creep_times=(0.3, 4.0),
)
# Only a few are searched: the shares are what counts here.
HELD = {"mass": 0.1828, "stiffness": 26065.0, "rest_stiffness": 9e3, "coulomb_force": 0.15}
DT = 0.01


def record(stage: Any = STAGE, offset: float = 3e-6) -> pt.Dataset:
    """Steps and waves from rest."""
    t = DT * np.arange(1500)
    u = 37.5 * (1 - np.cos(2 * np.pi * 0.5 * t)) * np.where((t > 5.0) & (t < 9.0), 0.3, 1.0)
    return pt.Dataset(u=u, y=stage.simulate(u, DT).x + offset, dt=DT)


@cache
def with_creep(
    *creep: float, offset: bool = True, delay: float = 0.0
) -> pt.identification.Identification:
    return pt.identify(
        record(offset=3e-6 if offset else 0.0),
        "first-order-dahl",
        parameters=HELD,
        creep=creep,
        offset=offset,
        delay=delay,
        method=pt.ParticleSwarm(iterations=20, particles=16, runs=1),
    )


@pytest.mark.parametrize("offset", [True, False])
def test_finds_the_weights(offset: bool) -> None:
    fit = with_creep(0.3, 4.0, offset=offset)
    model = fit.model
    assert model.creep_times == (0.3, 4.0)
    assert model.creep_weights == pytest.approx((0.02, 0.03), rel=2e-3)
    assert model.piezo_coefficient == pytest.approx(0.0468, rel=1e-4)
    assert model.damping == pytest.approx(500.0, rel=1e-2)
    assert fit.offset == pytest.approx(3e-6 if offset else 0.0, abs=1e-9)
    assert fit.cost < 1e-9


def test_without_creep_the_record_is_not_followed() -> None:
    assert with_creep().model.creep_weights == ()
    assert with_creep().cost > 100.0 * with_creep(0.3, 4.0).cost


@pytest.mark.parametrize("delay", [0.0, 0.004])
@pytest.mark.parametrize("creep", [(0.1,), (0.02, 0.3, 8.0)])
def test_the_cost_of_the_search_is_that_of_the_stage(
    creep: tuple[float, ...], delay: float
) -> None:
    fit = with_creep(*creep, delay=delay)
    # The swarm steps to within 0.2 nm.
    assert fit.score(record()).rms == pytest.approx(fit.cost, abs=2e-10)


def test_the_weights_are_those_of_linear_least_squares() -> None:
    """Small changes of a weight, the offset following, make the rest of the fit worse."""
    fit = with_creep(0.1, 1.0)
    for j in range(2):
        for change in (-1e-3, 1e-3):
            weights = list(fit.model.creep_weights)
            weights[j] += change
            if weights[j] < 0.0:
                continue
            x = replace(fit.model, creep_weights=weights).simulate(record().u, DT).x
            assert np.std(record().y - x) > fit.cost


def test_the_weights_stay_below_a_half() -> None:
    # All of the motion is delayed: what no creep is.
    slow = replace(STAGE, creep_weights=(2.0,), creep_times=(1.0,))
    swarm = pt.ParticleSwarm(iterations=20, particles=16, runs=1)
    fit = pt.identify(
        record(slow), "first-order-dahl", parameters=HELD, creep=[0.5, 1.0], method=swarm
    )
    assert min(fit.model.creep_weights) >= 0.0
    assert sum(fit.model.creep_weights) == pytest.approx(0.5, abs=1e-9)


def test_time_constants_from_the_record() -> None:
    swarm = pt.ParticleSwarm(iterations=1, particles=4, polish=False, runs=1)
    options: dict[str, Any] = {"parameters": HELD, "method": swarm, "creep": True}
    fit = pt.identify(record(), "first-order-dahl", **options)
    assert fit.model.creep_times == pytest.approx((2.0, 7.5), rel=0.1)
    short = pt.Dataset(u=record().u[:399], y=record().y[:399], dt=DT)
    with pytest.raises(pt.DataError, match="the window has 399 samples: expected at least 400"):
        pt.identify(short, "first-order-dahl", **options)


def two_records(noise: float = 0.0) -> list[pt.Dataset]:
    """A slow one and a quick one, which a wave that no stage makes disturbs each in its own way."""
    slow = record()
    t = 2e-3 * np.arange(2000)
    u = 20.0 * (1 - np.cos(2 * np.pi * 5.0 * t))
    quick = pt.Dataset(u=u, y=STAGE.simulate(u, 2e-3).x - 1e-6, dt=2e-3)
    waves = [
        noise * np.sin(2 * np.pi * rate * each.t) for rate, each in ((0.07, slow), (0.9, quick))
    ]
    return [
        pt.Dataset(u=each.u, y=each.y + wave, dt=each.dt)
        for each, wave in zip((slow, quick), waves, strict=True)
    ]


def together(
    records: list[pt.Dataset] | list[pt.Record], **settings: Any
) -> pt.identification.Identification:
    settings = {"creep": (0.3, 4.0), "history": "virgin", "progress": False, **settings}
    return pt.identify(records, "first-order-dahl", parameters=HELD, **settings)


@pytest.mark.parametrize("method", ["descents", "swarm"])
def test_several_records_have_the_same_weights(method: Any) -> None:
    swarm = pt.ParticleSwarm(iterations=20, particles=16)
    fit = together(two_records(), method=swarm if method == "swarm" else method)
    assert fit.model.creep_weights == pytest.approx((0.02, 0.03), rel=2e-3)
    assert fit.model.damping == pytest.approx(500.0, rel=1e-2)
    assert [one.offset for one in fit.records] == pytest.approx([3e-6, -1e-6], abs=1e-9)
    assert fit.cost < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("weights", [(1.0, 1.0), (1.0, 20.0)])
@pytest.mark.parametrize("offset", [True, False, [True, False]])
def test_the_weights_are_those_of_least_squares_of_all_records(
    offset: Any, weights: tuple[float, float]
) -> None:
    """Of the mechanics that were found: by the active set method of SciPy, on stacked columns."""
    nnls = pytest.importorskip("scipy.optimize").nnls
    records = two_records(noise=1e-7)
    offsets = offset if isinstance(offset, list) else [offset] * 2
    weighted = [
        pt.Record(data, offset=fitted, weight=weight, history="virgin")
        for data, fitted, weight in zip(records, offsets, weights, strict=True)
    ]
    fit = together(weighted, history=None)
    alone = replace(fit.model, creep_weights=(), creep_times=())
    rows, measured = [], []
    for i, (data, weight) in enumerate(zip(records, weights, strict=True)):
        x = alone.simulate(data.u, data.dt).x
        columns = [
            replace(alone, creep_weights=(1.0,), creep_times=(time,)).simulate(data.u, data.dt).x
            - x
            for time in (0.3, 4.0)
        ]
        # An offset of either sign.
        for k, each in enumerate(offsets):
            one = np.full(x.size, 1e-5 if each and k == i else 0.0)
            columns += [one, -one]
        rows.append(np.sqrt(weight) * np.column_stack(columns))
        measured.append(np.sqrt(weight) * (data.y - x))
    found, left = nnls(np.vstack(rows), np.concatenate(measured))
    assert fit.model.creep_weights == pytest.approx(found[:2], abs=2e-5)
    counts = sum(w * len(data) for w, data in zip(weights, records, strict=True))
    assert fit.cost == pytest.approx(left / np.sqrt(counts), rel=1e-4)


@pytest.mark.slow
def test_the_search_of_several_records_ends_at_a_minimum() -> None:
    """A parameter held a little aside, the rest fitted again, makes the cost larger."""
    records = two_records(noise=1e-7)
    fit = together(records)
    for name in ("damping", "piezo_coefficient"):
        value = getattr(fit.model, name)
        for change in (0.98, 1.02):
            held = {**HELD, name: change * value}
            beside = pt.identify(
                records, "first-order-dahl", parameters=held, creep=(0.3, 4.0), history="virgin"
            )
            assert beside.cost > fit.cost


def test_the_cost_of_several_records_is_that_of_the_stage() -> None:
    first, second = two_records(noise=1e-7)
    records = [
        pt.Record(first, history="virgin"),
        pt.Record(second, history="virgin", weight=3.0, delay=1e-3),
    ]
    fit = together(records, history=None)
    for one, score in zip(fit.records, fit.scores, strict=True):
        assert score.rms == pytest.approx(one.cost, abs=2e-10)
    counts = np.array([1.0, 3.0]) * [len(data) for data in two_records()]
    squares = np.array([one.cost**2 for one in fit.records])
    assert fit.cost == pytest.approx(np.sqrt(counts @ squares / counts.sum()), rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["descents", "swarm"])
def test_candidates_that_diverge_are_no_best_ones(method: Any) -> None:
    """Measured records, on which the bounds hold stages that do not stay finite."""
    records = [pt.datasets.dbo_training()[3.0:], pt.datasets.dbo_tracking()[3.0:]]
    settings: dict[str, Any] = {"history": "virgin", "progress": False}
    seeded = pt.ParticleSwarm(seed=1) if method == "swarm" else pt.Descents(seed=1)
    fit = pt.identify(records, "first-order-dahl", creep=True, method=seeded, **settings)
    without = pt.identify(records, "first-order-dahl", method=seeded, **settings)
    assert 0.5 * without.cost < fit.cost <= without.cost
    assert [one.rms for one in fit.scores] == pytest.approx(
        [one.cost for one in fit.records], rel=1e-3
    )


def test_time_constants_from_several_records() -> None:
    swarm = pt.ParticleSwarm(iterations=1, particles=4, polish=False, runs=1)
    options: dict[str, Any] = {"creep": True, "method": swarm}
    fit = together(two_records(), **options)
    # The period of the quick one, and half of the window of the slow one.
    assert fit.model.creep_times == pytest.approx((0.2, 7.5), rel=0.1)
    quick = pt.Dataset(u=two_records()[1].u, y=two_records()[1].y, dt=2e-4)
    fit = together([record(), quick], **options)
    assert fit.model.creep_times == pytest.approx((0.02, np.sqrt(0.02 * 7.5), 7.5), rel=0.1)


@pytest.mark.parametrize(
    ("creep", "message"),
    [
        ("yes", "creep is 'yes': expected True, False or time constants in seconds"),
        (0.1, "creep is 0.1: expected True, False or time constants in seconds"),
        ([1.0, 0.0], r"creep\[1\] is 0 s"),
        ([1.0, 2.0, 3.0, 4.0], "creep is 4 entries: expected 3 time constants at most"),
    ],
)
def test_refuses(creep: Any, message: str) -> None:
    with pytest.raises(pt.ParameterError, match=message):
        pt.identify(record(), "first-order-dahl", creep=creep)


def test_of_models_found_by_least_squares_it_is_a_setting() -> None:
    with pytest.raises(pt.ParameterError, match="creep is True: expected none with the model"):
        pt.identify(record(), "prandtl-ishlinskii", creep=True)
    with pytest.raises(pt.ParameterError, match="'creep_weights': expected one of mass"):
        pt.identify(record(), "first-order-dahl", parameters={"creep_weights": 0.1})


def test_a_model_file_keeps_it_and_older_ones_have_none(tmp_path: Path) -> None:
    fit = with_creep(0.3, 4.0)
    path = fit.save(tmp_path / "model.json")
    assert pt.load(path).model == fit.model
    content = json.loads(path.read_text())
    for name in ("creep_weights", "creep_times"):
        del content["parameters"][name]
    # Nor a covariance, which would name them.
    del content["covariance"]
    path.write_text(json.dumps(content))
    assert pt.load(path).model == replace(fit.model, creep_weights=(), creep_times=())


def test_the_summary_lists_it() -> None:
    assert "creep_weights c" in with_creep(0.3, 4.0).summary()
    assert "creep_weights" not in with_creep().summary()
