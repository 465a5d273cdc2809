"""Drift of a sensor beside parameters that are searched."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt
from piezotrack.identification.fitted.drift import Drift
from records import selection_of

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

STAGE = pt.DahlStage.xu_li_2010()
HELD = {"mass": 0.1828, "a1": 121.9874, "a2": 1.1773e6, "b1": 1.8485e6}
DT = 5e-3
NOISE = 10e-9


def record(
    *,
    drift: tuple[float, float] = (0.0, 1.0),
    offset: float = 1.2e-6,
    seconds: float = 40.0,
    seed: int = 3,
    stage: Any = STAGE,
) -> pt.Dataset:
    """Waves from rest, with a drift (amplitude [m], time constant [s]) and an offset."""
    t = DT * np.arange(round(seconds / DT))
    u = 30.0 * (1.0 - np.cos(np.pi * t)) * (0.6 + 0.4 * np.cos(0.1 * np.pi * t))
    size, time = drift
    noise = NOISE * np.random.default_rng(seed).standard_normal(t.size)
    y = stage.simulate(u, DT).x + offset + size * np.exp(-t / time) + noise
    return pt.Dataset(u=u, y=y, dt=DT)


def with_drift(data: Any, **given: Any) -> pt.identification.Identification:
    asked: dict[str, Any] = {"parameters": HELD, "history": "virgin", "drift": True}
    return pt.identify(data, "dahl", **asked | given)


@cache
def drifting() -> pt.identification.Identification:
    return with_drift(record(drift=(6e-7, 12.0)))


def fading(t: NDArray[np.float64], time: float) -> NDArray[np.float64]:
    left: NDArray[np.float64] = np.exp(-t / time) - np.exp(-t[-1] / time)
    return left


def test_finds_the_drift_and_the_stage() -> None:
    fit = drifting()
    assert fit.drift is not None
    assert fit.drift.amplitude == pytest.approx(6e-7, rel=0.01)
    assert fit.drift.time == pytest.approx(12.0, rel=0.02)
    # What the sensor shows in the end.
    assert fit.offset == pytest.approx(1.2e-6 + 6e-7 * np.exp(-40.0 / 12.0), abs=3e-9)
    assert fit.model.stiffness == pytest.approx(STAGE.stiffness, rel=1e-3)
    assert fit.cost == pytest.approx(NOISE, rel=0.03)
    assert fit.fitted.rms == pytest.approx(fit.cost, rel=2e-3)
    still = with_drift(fit.data, drift=False)
    assert still.drift is None
    assert still.cost > 5.0 * fit.cost


@pytest.mark.slow
def test_a_searched_model_finds_a_drift_that_is_not_given() -> None:
    fit = with_drift(record(drift=(6e-7, 12.0)), drift=None)
    assert fit.drift == drifting().drift
    assert fit.cost == drifting().cost
    # An error of the model is not taken for one, nor is noise.
    simple = pt.identify(record(), "first-order-dahl", history="virgin")
    assert simple.cost > 2.0 * NOISE
    assert simple.drift is None
    assert with_drift(record(), drift=None).drift is None


def of_few_turns(drift: float) -> pt.Dataset:
    """Levels up and down and up of a Bouc-Wen stage, with a drift that fades in the record."""
    stage = pt.BoucWenStage(
        mass=2.8e-3,
        damping=20.0,
        stiffness=1e6,
        piezo_coefficient=1.6e-7,
        alpha=0.25,
        beta=0.03,
        gamma=0.01,
    )
    u = np.repeat(np.r_[0.0:75.0:15.0, 75.0:-60.0:-15.0, -60.0:60.0:20.0], 200)
    t = np.arange(u.size) / 1000.0
    noise = 5e-9 * np.random.default_rng(4).standard_normal(u.size)
    y = stage.simulate(u, 1e-3).x + drift * np.exp(-t / 3.0) + noise
    return pt.Dataset(u=u, y=y, dt=1e-3)


def test_a_drift_of_few_turns_is_found_where_it_leaves_nothing_but_noise() -> None:
    for model, drift, found in (
        ("bouc-wen", 3e-7, True),
        ("bouc-wen", 0.0, False),
        # An error of the model stays beside a drift.
        ("first-order-dahl", 3e-7, False),
    ):
        fit = pt.identify(of_few_turns(drift), model)
        assert (fit.drift is not None) == found
        if fit.drift is not None:
            assert fit.cost < 1.1 * 5e-9
            assert fit.drift.amplitude == pytest.approx(drift, rel=0.1)


def test_the_time_constant_has_a_standard_deviation() -> None:
    """Of twelve records with other noise the time constants spread by it."""
    fits = [with_drift(record(drift=(6e-7, 12.0), seed=seed)) for seed in range(12)]
    estimates = [fit.parameters["drift_time"] for fit in fits]
    away = [(one.value - 12.0) / one.deviation for one in estimates if one.deviation]
    assert len(away) == 12
    # The mean of twelve squares of normal deviates: 0.4 to 2.1 with a probability of 99 %.
    assert 0.3 < float(np.mean(np.square(away))) < 2.4
    assert not any(one.at_bound for one in estimates)


@pytest.mark.parametrize("creep", [False, (0.4, 6.0)])
def test_the_cost_is_that_of_linear_least_squares(creep: Any) -> None:
    """Offset, drift and shares of the creep by SciPy, on candidates beside the best one."""
    nnls = pytest.importorskip("scipy.optimize").nnls
    stage = replace(STAGE, creep_weights=(0.02, 0.03), creep_times=(0.4, 6.0)) if creep else STAGE
    data = record(drift=(6e-7, 12.0), stage=stage)
    objective = pt.identification.Objective(
        data, "dahl", parameters=HELD, drift=True, history="virgin", creep=creep
    )
    assert list(objective.ranges)[-1] == "drift_time"
    draws, count = np.random.default_rng(5), len(objective.ranges)
    ends, costs, _ = objective.descend(draws.uniform(0.3, 0.7, (12, count)))
    places = ends[np.argmin(costs)] + draws.uniform(-2e-3, 2e-3, (6, count))
    places[:, -1] = draws.uniform(0.0, 1.0, 6)
    low, high = objective.ranges["drift_time"]
    for place, cost in zip(places, objective(places), strict=True):
        time = low * (high / low) ** place[-1]
        values: dict[str, Any] = objective.parameters(place)
        model = pt.DahlStage(**values)
        x = model.simulate(data.u, DT).x
        crept = [
            replace(model, creep_weights=(1.0,), creep_times=(one,)).simulate(data.u, DT).x - x
            for one in creep or ()
        ]
        # Offset and drift of either sign.
        level = [
            1e-6 * sign * g for g in (np.ones(x.size), fading(data.t, time)) for sign in (1, -1)
        ]
        shares, left = nnls(np.column_stack(crept + level), data.y - x)
        # The most that counts as creep.
        assert sum(shares[: len(crept)]) < 0.5
        assert cost == pytest.approx(left / np.sqrt(x.size), rel=2e-5)


def test_the_search_ends_at_the_best_time_constant() -> None:
    """A time constant held a little aside, the rest fitted again, makes the cost larger."""
    fit = drifting()
    assert fit.drift is not None
    for factor in (0.97, 1.03):
        beside = with_drift(fit.data, drift=factor * fit.drift.time)
        assert beside.drift is not None
        assert beside.drift.time == pytest.approx(factor * fit.drift.time)
        assert beside.cost > fit.cost
    known = with_drift(fit.data, drift=12.0)
    assert known.cost == pytest.approx(fit.cost, rel=1e-4)
    # A swarm finds the same.
    swarm = with_drift(fit.data, method=pt.ParticleSwarm(iterations=60, particles=24))
    assert swarm.cost == pytest.approx(fit.cost, rel=1e-6)


def test_each_record_has_a_drift_of_its_own() -> None:
    fades = record(drift=(6e-7, 12.0))
    rises = record(drift=(-3e-7, 6.0), seconds=30.0, offset=-4e-7, seed=4)
    still = record(seed=5, seconds=30.0)
    records = [
        pt.Record(fades, drift=True, history="virgin"),
        pt.Record(rises, drift=6.0, history="virgin"),
        pt.Record(still, drift=False, history="virgin"),
    ]
    fit = pt.identify(records, "dahl", parameters=HELD)
    first, second, third = fit.records
    assert first.drift is not None
    assert second.drift is not None
    assert third.drift is None
    assert first.drift.time == pytest.approx(12.0, rel=0.02)
    assert first.drift.amplitude == pytest.approx(6e-7, rel=0.01)
    assert second.drift.time == 6.0
    assert second.drift.amplitude == pytest.approx(-3e-7, rel=0.02)
    assert third.offset == pytest.approx(1.2e-6, abs=3e-9)
    for one, score in zip(fit.records, fit.scores, strict=True):
        assert one.cost == pytest.approx(NOISE, rel=0.05)
        assert score.rms == pytest.approx(one.cost, rel=5e-3)
    assert re.search(r"drift +-0\.5", fit.summary())


def test_creep_and_drift_of_several_records() -> None:
    """One creep for all of them, a drift for each."""
    stage = replace(STAGE, creep_weights=(0.02, 0.03), creep_times=(0.4, 6.0))
    data = [
        record(drift=(6e-7, 12.0), stage=stage),
        record(drift=(-4e-7, 8.0), stage=stage, seconds=30.0, seed=8),
    ]
    fit = with_drift(data, creep=(0.4, 6.0))
    assert fit.model.creep_weights == pytest.approx((0.02, 0.03), rel=0.03)
    assert fit.cost == pytest.approx(NOISE, rel=0.05)
    for one, size in zip(fit.records, (6e-7, -4e-7), strict=True):
        assert one.drift is not None
        assert one.drift.amplitude == pytest.approx(size, rel=0.1)


def test_it_goes_on_in_the_file_and_on_other_records(tmp_path: Path) -> None:
    whole = record(drift=(6e-7, 12.0))
    part, rest = whole[0.0:24.0], whole[24.0:]
    fit = with_drift(part)
    kept = pt.load(fit.save(tmp_path / "stage.json"))
    assert kept.drift == fit.drift
    assert kept.score(rest, offset=kept.offset).rms == pytest.approx(NOISE, rel=0.2)
    other = record(drift=(-5e-7, 12.0), seed=9)
    assert kept.score(other).rms == pytest.approx(NOISE, rel=0.1)
    still = with_drift(part, drift=False)
    assert still.score(rest, offset=still.offset).rms > 2.0 * NOISE


@pytest.mark.parametrize("history", [None, "fit"])
def test_beside_a_history(history: Any) -> None:
    # One wave and a rest.
    before = 30.0 * (1.0 - np.cos(np.pi * np.minimum(DT * np.arange(800), 2.0)))
    data = record(drift=(6e-7, 12.0))
    moved = STAGE.simulate(np.concatenate([before, data.u]), DT).x[before.size :]
    alone = STAGE.simulate(data.u, DT).x
    data = pt.Dataset(u=data.u, y=data.y - alone + moved, dt=DT)
    fit = with_drift(data, history=history)
    assert fit.drift is not None
    assert fit.cost < 1.6 * NOISE
    assert fit.drift.amplitude == pytest.approx(6e-7, rel=0.2)


def test_its_values_are_counted() -> None:
    """Size and time constant; the size alone where the time constant is known."""
    none = with_drift(drifting().data, drift=False).free_count
    assert none is not None
    assert drifting().free_count == none + 2
    assert with_drift(drifting().data, drift=12.0).free_count == none + 1


@pytest.mark.parametrize("time", [1e-3, 1.0, 30.0, 1e6, 1e18])
def test_a_drift_is_what_is_left_of_an_exponential(time: float) -> None:
    """At the beginning all of it, at the end nothing; a straight line where it is slow."""
    data = record()
    drift = Drift._fading(6e-7, time, data, time_fitted=False)
    x = drift.at(data.t)
    assert x[0] == pytest.approx(6e-7)
    assert x[-1] == pytest.approx(0.0, abs=1e-20)
    assert drift.moved == pytest.approx(-6e-7)
    assert np.all(np.diff(x) <= 0.0)
    if time > 1e3:
        assert x == pytest.approx(6e-7 * (1.0 - data.t / data.t[-1]), abs=1e-11)
    # Nothing is known of it before.
    assert drift.at(data.t - 100.0)[0] == x[0]


def test_a_loop_that_is_not_closed_is_no_drift() -> None:
    """Fewer than six reversals: none, unless one is given."""
    data = record(seconds=4.0)
    assert with_drift(data, drift=None).drift is None
    for given in (True, 5.0):
        assert with_drift(data, drift=given).drift is not None


def test_a_drift_that_is_a_part_of_the_motion_is_said() -> None:
    large = record(drift=(4e-5, 12.0))
    fit = with_drift(large)
    assert any("the drift of -38" in note and "% of the stroke" in note for note in fit.notes)
    assert not any("drift" in note for note in drifting().notes)


@pytest.mark.slow
def test_auto_tries_the_kinds_that_are_searched_too() -> None:
    fit = pt.identify(record(drift=(6e-7, 12.0)), drift=True)
    assert {one.model for one in selection_of(fit).trials} >= {
        "prandtl-ishlinskii",
        "first-order-dahl",
    }


def test_a_checkpoint_is_of_one_drift(tmp_path: Path) -> None:
    data, path = record(drift=(6e-7, 12.0)), tmp_path / "search"
    first = with_drift(data, checkpoint=path)
    again = with_drift(data, checkpoint=path)
    assert (again.cost, again.drift, again.offset) == (first.cost, first.drift, first.offset)
    with pytest.raises(pt.DataError, match="is that of another search"):
        with_drift(data, drift=12.0, checkpoint=path)


@pytest.mark.parametrize("threads", [1, 2])
def test_the_bits_do_not_depend_on_threads(threads: int) -> None:
    fit = with_drift(drifting().data, threads=threads)
    assert (fit.cost, fit.drift, fit.offset) == (
        drifting().cost,
        drifting().drift,
        drifting().offset,
    )


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"drift": 0.0}, "drift is 0: expected a finite number above 0, in s"),
        ({"drift": "yes"}, "drift is 'yes'"),
        ({"drift": True, "offset": False}, "drift is True: expected none with offset=False"),
    ],
)
def test_wrong_input_gets_one_sentence(given: dict[str, Any], said: str) -> None:
    with pytest.raises(pt.ParameterError, match=f"^{said}"):
        with_drift(record(seconds=10.0), **given)


@pytest.mark.slow
@pytest.mark.parametrize("line", [False, True])
def test_the_deviation_of_a_drift_is_its_scatter(tmp_path: Path, line: bool) -> None:
    t = DT * np.arange(2000)
    u = 30.0 * (1.0 - np.cos(np.pi * t))
    plays = pt.PrandtlIshlinskiiStage(linear=1e-6, thresholds=(10.0, 20.0), weights=(3e-7, 1e-7))
    moved = 4e-8 * t if line else 4e-7 * np.exp(-t / 3.0)
    method = pt.LeastSquares(thresholds=[10.0, 20.0], creep=False, dynamics=None, dead_zones=0)
    errors, deviations = [], []
    for seed in range(20):
        noise = np.random.default_rng(seed).normal(0.0, 20e-9, t.size)
        data = pt.Dataset(u=u, y=plays.simulate(u, DT).x + moved + noise, dt=DT)
        fit = pt.identify(data, "prandtl-ishlinskii", method=method, drift=True)
        assert fit.drift is not None
        assert fit.drift.deviation is not None
        errors.append(fit.drift.moved - (moved[-1] - moved[0]))
        deviations.append(fit.drift.deviation)
    # Of 20 the scatter itself is known to 16 % (one standard deviation).
    assert np.std(errors) == pytest.approx(np.median(deviations), rel=0.5)
    assert np.mean(np.abs(errors) < 1.96 * np.array(deviations)) >= 0.8
    reach = re.search(r"drift .*[0-9] \+- ([0-9.]+) um", fit.summary())
    assert reach is not None
    assert float(reach[1]) == pytest.approx(1.96e6 * deviations[-1], rel=0.5)
    again = pt.load(fit.save(tmp_path / "drift.json"))
    assert again.drift == fit.drift
