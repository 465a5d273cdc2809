"""`watch`: which changes of a stage a new record shows, and which it does not."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from scipy.signal import lfilter

import piezotrack as pt
from piezotrack.identification.watching.correlated import Autoregression
from piezotrack.identification.watching.motion import HYSTERESIS
from piezotrack.stages.registry import MODELS
from watched_records import DT, NOISE, SLOW, STAGE, model_watched, watched

if TYPE_CHECKING:
    from pathlib import Path

# Changes, what they are of the stage or of the record, and what is to be read.
WIDER = replace(STAGE, weights=tuple(1.15 * one for one in STAGE.weights))
LOWER = replace(STAGE, frequency=0.95 * (STAGE.frequency or 0.0))
CHANGES: dict[str, tuple[dict[str, Any], float, float]] = {
    "gain": ({"gain": 1.02}, 0.02, 0.001),
    "hysteresis": ({"stage": WIDER}, 0.15, 0.015),
    "mode": ({"stage": LOWER}, -0.05, 0.012),
    "delay": ({"late": 1}, DT, 0.05 * DT),
    "drift": ({"drift": 3e-7}, 3e-7, 4e-8),
    "noise": ({"noise": 2.0 * NOISE}, 2.0, 0.2),
}


def changed(health: pt.identification.Health) -> set[str]:
    return {one.name for one in health.changes if one.verdict == "changed"}


@pytest.mark.parametrize("correlation", [0.0, SLOW])
def test_another_drive_of_the_same_stage_is_no_change(correlation: float) -> None:
    record = watched(22, top=55.0, correlation=correlation)
    health = pt.watch(model_watched(1, correlation), record)
    assert health.healthy
    assert changed(health) == set()
    judged = {one.name for one in health.changes if one.verdict == "unchanged"}
    # In correlated noise the shape of the lag is not seen so well.
    assert judged >= {one.name for one in health.changes} - {"lag"}


@pytest.mark.parametrize("name", CHANGES)
def test_a_known_change_is_read_with_its_size(name: str) -> None:
    given, size, within = CHANGES[name]
    health = pt.watch(model_watched(), watched(31, **given))
    change = health[name]
    assert change.verdict == "changed"
    assert not health.healthy
    assert change.value == pytest.approx(size, abs=within)
    assert change.interval is not None
    assert change.interval[0] < size < change.interval[1]
    if name not in ("hysteresis", "mode"):
        # Wider loops travel further, and a lower mode with the same damping ratio lags more.
        assert changed(health) <= {name, "residual"}


def test_a_file_gives_the_same_bits(tmp_path: Path) -> None:
    record = watched(31, gain=1.02)
    stored = pt.load(model_watched().save(tmp_path / "model.json"))
    assert pt.watch(stored, record).document() == pt.watch(model_watched(), record).document()


def test_a_model_that_is_known_less_well_has_wider_intervals(tmp_path: Path) -> None:
    model = pt.load(model_watched().save(tmp_path / "model.json"))
    assert model.covariance is not None
    record, widths = watched(31), []
    for times in (0.0, 1e2, 1e4):
        known = replace(model.covariance, matrix=times * model.covariance.matrix)
        change = pt.watch(replace(model, covariance=known), record)["gain"]
        assert change.interval is not None
        widths.append(change.interval[1] - change.interval[0])
    assert widths[0] < widths[1] < widths[2]
    # Where the model decides the width, it goes with the deviations.
    assert widths[2] - widths[0] > 5.0 * (widths[1] - widths[0])


def test_a_slow_record_does_not_judge_the_mode() -> None:
    t = DT * np.arange(4000)
    u = 35.0 - 35.0 * np.cos(2.0 * np.pi * 0.3 * t)
    y = LOWER.simulate(u, DT).x + NOISE * np.random.default_rng(3).standard_normal(u.size)
    health = pt.watch(model_watched(), pt.Dataset(u=u, y=y, dt=DT))
    assert health["mode"].verdict == "not judged"
    assert health["mode"].interval is None
    assert health["mode"].reason
    assert health["gain"].verdict == "unchanged"


def test_a_change_that_could_not_be_seen_is_not_called_unchanged() -> None:
    health = pt.watch(model_watched(), watched(22, top=55.0))
    gain, lag = health["gain"], health["lag"]
    for one in (gain, lag):
        assert one.verdict == "unchanged"
        assert one.detectable == pytest.approx(0.5 * np.ptp(one.interval or (0.0, 0.0)))
    assert not gain.reason
    assert lag.detectable is not None
    assert lag.detectable > 0.1
    assert f"{100.0 * lag.detectable:.2g} %" in lag.reason
    entry = next(one for one in health.document()["changes"] if one["name"] == "lag")
    assert entry["detectable"] == lag.detectable
    rows = {line.partition(" ")[0]: line for line in health.summary().splitlines()}
    assert "unchanged" in rows["gain"]
    assert "unchanged" not in rows["lag"]
    assert lag.reason in rows["lag"]


def test_a_sensor_without_noise_is_judged_too() -> None:
    log = watched(31)
    health = pt.watch(model_watched(), pt.Dataset(u=log.u, y=np.full(log.u.size, 2e-6), dt=DT))
    assert health["noise"].value == 0.0
    assert health["noise"].verdict == "changed"
    assert health["noise"].detectable is None


def test_a_small_drive_does_not_judge_the_loop() -> None:
    health = pt.watch(model_watched(), watched(8, top=9.0))
    assert {health[one].verdict for one in ("gain", "hysteresis")} == {"not judged"}
    assert "12 % of the range" in health["hysteresis"].reason


def test_noise_at_another_rate_is_not_judged() -> None:
    log = watched(9)
    health = pt.watch(model_watched(), pt.Dataset(u=log.u[::2], y=log.y[::2], dt=2.0 * DT))
    assert health["noise"].verdict == "not judged"
    assert "every 2 ms" in health["noise"].reason


def test_a_refit_is_accepted_only_where_it_is_better(tmp_path: Path) -> None:
    same = pt.watch(model_watched(), watched(41, samples=1500), refit=True).refit
    assert same is not None
    assert not same.accepted
    assert same.model is None
    # Where the residual grows, its square is higher, and so are both ends of the interval.
    kept = same._replace(improvement=-0.25, interval=(-0.3, -0.2))
    worse = replace(pt.watch(model_watched(), watched(41)), refit=kept)
    assert "mean square 25 % higher (20 to 30 %)" in str(worse)
    record = watched(41, gain=1.02)
    health = pt.watch(model_watched(), record, refit=True)
    refit = health.refit
    assert refit is not None
    assert refit.accepted
    assert refit.interval[0] > 0.0
    assert refit.rms_after < 1.2 * NOISE < refit.rms_before
    assert refit.model is not None
    stored = pt.load(refit.model.save(tmp_path / "model.json"))
    written = stored.details["provenance"]["watch"]
    assert written["accepted"] is True
    assert written["replaces"]["sha256"] == model_watched().data.sha256
    assert health.document()["refit"]["accepted"] is True
    # Of the new model the record is one of an unchanged stage.
    assert pt.watch(stored, watched(42, gain=1.02)).healthy


def test_what_cannot_be_watched_is_refused_in_a_sentence() -> None:
    model, log = model_watched(), watched(9)
    newtons = pt.Dataset(u=log.u, y=log.y, dt=DT, drive_unit="N")
    bare = pt.identification.IdentifiedModel(
        model=STAGE, offset=0.0, offset_fitted=True, stroke=9e-5
    )
    refused: list[tuple[Any, Any, type[pt.PiezotrackError], str]] = [
        (model, newtons, pt.ParameterError, "driven in N: expected a drive in V"),
        (model, log[: 50 * DT], pt.ShapeError, "samples: expected 100 or more"),
        (model, watched(9, top=90.0), pt.ParameterError, "beyond what was identified"),
        (bare, log, pt.ParameterError, "model has no residual"),
        (STAGE, log, pt.ParameterError, "model is"),
        (model, log.y, pt.ParameterError, "record is"),
        (model, pt.Dataset(u=0.0 * log.u + 5.0, y=log.y, dt=DT), pt.DataError, "stays at 5 V"),
    ]
    for known, record, error, words in refused:
        with pytest.raises(error, match=words):
            pt.watch(known, record)


def test_every_model_says_what_its_hysteresis_is() -> None:
    assert set(HYSTERESIS) == {info.name for info in MODELS}
    for info in MODELS:
        assert set(HYSTERESIS[info.name]) <= {one.name for one in info.parameters}


def test_an_autoregression_gives_the_spread_of_a_mean_and_of_an_rms() -> None:
    draws = np.random.default_rng(5).standard_normal((400, 2200))
    noise = lfilter([1.0], [1.0, -0.8], draws)[:, 200:]
    processes = [Autoregression(one, 1) for one in noise[:40]]
    # (1 + r) / (1 - r) of the variance for the mean, (1 + r^2) / (1 - r^2) for the rms.
    mean = np.median([one.of_mean for one in processes])
    assert mean == pytest.approx(noise.mean(axis=1).std(), rel=0.15)
    effective = np.median([one.effective for one in processes])
    assert effective == pytest.approx(2000.0 * (1.0 - 0.64) / (1.0 + 0.64), rel=0.15)


def test_a_measured_stage_under_another_motion_is_unchanged() -> None:
    fit = pt.identify(pt.datasets.dbo_training()[3.0:23.0], progress=False)
    health = pt.watch(fit, pt.datasets.dbo_tracking()[3.0:23.0])
    assert health.healthy
    assert health["residual"].value is not None
    assert 1.3 < health["residual"].value < 2.0


@pytest.mark.study
def test_the_rates_of_false_alarms_and_of_hits() -> None:
    judged, alarms, hits = 0, Counter[str](), Counter[str]()
    draw = np.random.default_rng(11)
    for seed in range(100):
        correlation = SLOW * (seed % 2)
        model = model_watched(1000 + seed, correlation)
        given: dict[str, Any] = {
            "samples": int(draw.integers(2500, 6000)),
            "top": float(draw.uniform(45.0, 75.0)),
        }
        record = watched(2000 + seed, correlation=correlation, **given)
        if judged == 60 or model.extrapolation_notes(record.u, DT):
            # Faster than the model allows: refused.
            continue
        alarms[f"correlation {correlation}"] += not pt.watch(model, record).healthy
        for name in CHANGES if judged < 20 else ():
            other = watched(2000 + seed, correlation=correlation, **{**given, **CHANGES[name][0]})
            hits[name] += pt.watch(model, other)[name].verdict == "changed"
        judged += 1
    print(f"false alarms of {judged}: {dict(alarms)}; found of 20 each: {dict(hits)}")
    assert judged == 60
    assert alarms.total() <= 3
    assert all(hits[name] >= (16 if name == "mode" else 19) for name in CHANGES)
