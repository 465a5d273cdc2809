"""Least squares on what surrounds a stage: several records, delays and drifts of the readings."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

STAGE = pt.PrandtlIshlinskiiStage(
    linear=0.5e-6,
    thresholds=(4.0, 9.0, 16.0),
    weights=(0.1e-6, 0.06e-6, 0.08e-6),
    creep_weights=(0.02,),
    creep_times=(4.0,),
)
NOISE = 5e-9
PLAYS = pt.identification.LeastSquares(
    thresholds=STAGE.thresholds, dead_zones=False, creep=STAGE.creep_times, dynamics=None
)
KIND = "prandtl-ishlinskii"


def drive(frequency: float, amplitude: float, dt: float, seconds: float) -> NDArray[np.float64]:
    t = dt * np.arange(round(seconds / dt))
    shape: NDArray[np.float64] = 1.0 - np.cos(2.0 * np.pi * frequency * t)
    # Smaller and smaller, so that the plays are told apart.
    return amplitude * shape * (1.0 - 0.4 * t / seconds)


def record(
    frequency: float, amplitude: float, dt: float, seconds: float = 12.0, **given: Any
) -> pt.Dataset:
    """A record with what its sensor adds: offset, drift (amplitude, time), a late reading."""
    u = drive(frequency, amplitude, dt, seconds)
    # As fine as the delay asks for: the reading of a late sensor is that of another instant.
    fine = 50
    t = dt * np.arange(u.size)
    times = dt / fine * np.arange((u.size - 1) * fine + 1)
    x = STAGE.simulate(np.interp(times, t, u), dt / fine).x
    y = np.interp(t - given.get("delay", 0.0), times, x)
    height, time = given.get("drift", (0.0, 1.0))
    noise = NOISE * np.random.default_rng(given.get("seed", 1)).standard_normal(u.size)
    return pt.Dataset(
        u=u, y=y + given.get("offset", 0.0) + height * np.exp(-t / time) + noise, dt=dt
    )


def test_two_records_share_a_stage_and_nothing_else() -> None:
    slow = record(0.2, 20.0, 0.01, seconds=30.0, offset=2e-6)
    quick = record(3.0, 38.0, 1e-3, seconds=6.0, offset=-1e-6, drift=(4e-7, 2.0), seed=2)
    records = [
        pt.Record(slow, drift=False, history="virgin"),
        pt.Record(quick, drift=True, history="virgin"),
    ]
    fit = pt.identify(records, KIND, method=PLAYS)
    assert fit.model.weights == pytest.approx(STAGE.weights, rel=0.01)
    assert fit.model.linear == pytest.approx(STAGE.linear, rel=0.005)
    assert fit.model.creep_weights == pytest.approx(STAGE.creep_weights, rel=0.05)
    first, second = fit.records
    assert first.offset == pytest.approx(2e-6, abs=3e-9)
    assert first.drift is None
    assert second.offset == pytest.approx(-1e-6, abs=2e-8)
    assert second.drift is not None
    assert second.drift.amplitude == pytest.approx(4e-7, abs=2e-8)
    for fitted in fit.records:
        assert fitted.cost == pytest.approx(NOISE, rel=0.05)
    # The scores are those of the same simulation, each with its own offset, drift and start.
    for fitted, score in zip(fit.records, fit.scores, strict=True):
        assert score.rms == pytest.approx(fitted.cost, rel=1e-6)
    both = (len(slow) * first.cost**2 + len(quick) * second.cost**2) / (len(slow) + len(quick))
    assert fit.cost == pytest.approx(both**0.5, rel=1e-9)


def test_one_record_alone_does_not_tell_what_two_do() -> None:
    """A small loop says nothing of the plays beyond its range; beside a large one it is used."""
    small = record(0.5, 6.0, 0.005)
    large = record(0.5, 38.0, 0.005, seed=3)
    alone = pt.identify(small, KIND, history="virgin", method=PLAYS)
    both = pt.identify([small, large], KIND, history="virgin", method=PLAYS)
    unknown = abs(alone.model.weights[2] / STAGE.weights[2] - 1.0)
    assert unknown > 0.2
    assert both.model.weights == pytest.approx(STAGE.weights, rel=0.02)


@pytest.mark.parametrize("delay", [0.0, 0.4e-3, 3e-3, 7.3e-3])
def test_a_late_reading_is_found(delay: float) -> None:
    log = record(4.0, 35.0, 1e-3, seconds=6.0, delay=delay, offset=1e-7)
    fit = pt.identify(log, KIND, delay=True, history="virgin", method=PLAYS)
    assert fit.delay == pytest.approx(delay, abs=5e-6)
    assert fit.model.weights == pytest.approx(STAGE.weights, rel=0.02)
    assert fit.cost == pytest.approx(NOISE, rel=0.06)
    assert fit.fitted.rms == pytest.approx(fit.cost, rel=1e-4)
    known = pt.identify(log, KIND, delay=delay, history="virgin", method=PLAYS)
    assert known.delay == delay
    assert known.model.weights == pytest.approx(fit.model.weights, rel=1e-2)


def test_a_delay_is_told_from_a_lag_by_two_rates() -> None:
    """Under one slow sine both turn the phase; a lag takes off amplitude where it is quick."""
    lagging = replace(STAGE, time_constant=4e-3)
    logs = []
    for seed, (frequency, dt) in enumerate([(1.0, 1e-3), (25.0, 2e-4)]):
        u = drive(frequency, 35.0, dt, 8.0 / frequency + 1.0)
        y = lagging.simulate(u, dt).x
        noise = NOISE * np.random.default_rng(seed).standard_normal(u.size)
        logs.append(pt.Dataset(u=u, y=y + noise, dt=dt))
    lag = replace(PLAYS, dynamics="first")
    fit = pt.identify(logs, KIND, delay=True, history="virgin", method=lag)
    assert fit.model.time_constant == pytest.approx(4e-3, rel=0.02)
    for one in fit.records:
        assert one.delay < 1e-4


def test_a_drift_is_that_of_its_record_alone(tmp_path: Path) -> None:
    log = record(0.5, 35.0, 0.005, seconds=40.0, drift=(6e-7, 12.0), offset=3e-7)
    part, rest = log[0.0:24.0], log[24.0:]
    fit = pt.identify(part, KIND, history="virgin", method=PLAYS)
    assert fit.drift is not None
    assert fit.drift.amplitude == pytest.approx(6e-7, rel=0.3)
    assert re.search(r"drift +-0\.5", fit.summary())
    still = pt.identify(part, KIND, drift=False, history="virgin", method=PLAYS)
    assert still.drift is None
    assert still.cost > 1.5 * fit.cost
    # It goes on where the record does, offset and all, and is none of another record.
    carried = fit.score(rest, offset=fit.offset).rms
    assert carried < 0.3 * still.score(rest, offset=still.offset).rms
    # Another record has one of its own, as fast, which may be none.
    other = record(0.5, 30.0, 0.005, seed=9)
    assert fit.score(other).rms == pytest.approx(NOISE, rel=0.3)
    drifting = record(0.5, 30.0, 0.005, seed=9, drift=(-5e-7, fit.drift.time))
    score = fit.score(drifting)
    assert score.rms == pytest.approx(NOISE, rel=0.3)
    assert np.std(drifting.y - fit.simulate(drifting).x) == pytest.approx(score.rms, rel=1e-9)
    # With an offset that is given the stage alone speaks.
    assert np.ptp(drifting.y - fit.simulate(drifting, offset=0.0).x) > 2e-7
    # In the file too.
    kept = pt.load(fit.save(tmp_path / "stage.json"))
    assert kept.drift == fit.drift
    assert kept.score(rest, offset=kept.offset).rms == carried


def test_a_mode_far_above_the_drive_is_no_lag() -> None:
    """No resonance shows, but what the mode does to the turns of a quick drive does."""
    stage = replace(STAGE, creep_weights=(), creep_times=(), frequency=300.0, damping_ratio=0.05)
    u = drive(20.0, 35.0, 2.5e-4, 0.6)
    noise = NOISE * np.random.default_rng(4).standard_normal(u.size)
    log = pt.Dataset(u=u, y=stage.simulate(u, 2.5e-4).x + noise, dt=2.5e-4)
    settings = replace(PLAYS, creep=False, dynamics="auto")
    fit = pt.identify(log, KIND, history="virgin", drift=False, method=settings)
    assert fit.model.frequency == pytest.approx(300.0, rel=0.05)
    assert fit.cost == pytest.approx(NOISE, rel=0.1)


@pytest.mark.parametrize("kind", ["prandtl-ishlinskii", "preisach"])
def test_the_bits_do_not_depend_on_threads(kind: str) -> None:
    log = record(0.5, 35.0, 0.005, drift=(6e-7, 12.0))
    one, two = (pt.identify(log, kind, threads=count) for count in (1, 2))
    assert one.model == two.model
    assert (one.cost, one.offset, one.drift, one.nfev) == (
        two.cost,
        two.offset,
        two.drift,
        two.nfev,
    )


def test_too_many_threads_are_refused() -> None:
    with pytest.raises(pt.ParameterError, match="threads is 300: expected 0 for all cores"):
        pt.identify(record(0.5, 35.0, 0.005), KIND, threads=300)


def test_a_record_without_a_drift_gets_none() -> None:
    fit = pt.identify(record(0.5, 35.0, 0.005), KIND, history="virgin", method=PLAYS)
    assert fit.drift is None


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"drift": "yes"}, "drift is 'yes'"),
        ({"drift": 0.0}, "drift is 0: expected a finite number above 0, in s"),
        ({"drift": float("nan")}, "drift is nan: expected"),
        ({"delay": -1.0}, "delay is -1 s: expected 0 s or above"),
        ({"delay": 100.0}, "delay is 100 s: expected 0 s or above, below the record's 12"),
        ({"delay": (2.0, 1.0)}, r"delay is \(2, 1\) s: expected the lower bound first"),
    ],
)
def test_what_is_no_drift_or_delay_is_refused(given: dict[str, Any], said: str) -> None:
    with pytest.raises(pt.ParameterError, match=said):
        pt.identify(record(0.5, 35.0, 0.005), KIND, **given)


def test_records_that_go_opposite_ways_are_refused() -> None:
    log = record(0.5, 35.0, 0.005)
    turned = pt.Dataset(u=log.u, y=-log.y, dt=log.dt)
    with pytest.raises(pt.DataError, match="rises with the drive in one record and falls"):
        pt.identify([log, turned], KIND)
