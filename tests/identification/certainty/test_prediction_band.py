"""The band of a prediction: cycles left out, coverage on other drives, and its parts."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt
from piezotrack.data.checks.diagnostics import turns
from piezotrack.identification.confidence.held_out import HeldOut, held_out
from piezotrack.identification.linearised.sensitivity import sensitivity
from piezotrack.identification.linearised.values import fitted_values

if TYPE_CHECKING:
    from pathlib import Path

DT, NOISE = 4e-3, 2e-8
STAGE = pt.PrandtlIshlinskiiStage(
    linear=0.9e-6, thresholds=(3.0, 8.0, 15.0, 25.0), weights=(1e-7, 2e-7, 1.5e-7, 1.2e-7)
)
# What a fit with these thresholds does not have.
RICHER = replace(
    STAGE, thresholds=(3.0, 5.0, 11.0, 21.0), creep_times=(0.5,), creep_weights=(0.02,)
)
PLAYS = pt.LeastSquares(thresholds=STAGE.thresholds, creep=False, dynamics=None, dead_zones=False)


def drive(seed: int, count: int = 4000, top: float = 70.0) -> np.ndarray:
    draw = np.random.default_rng(seed)
    t = DT * np.arange(count)
    turned = 2.0 * np.pi * (np.outer(draw.uniform(0.8, 1.6, 3), t) + draw.uniform(0.0, 1.0, (3, 1)))
    u = draw.uniform(0.4, 1.0, 3) @ np.sin(turned)
    return np.asarray(top * (u - u.min()) / np.ptp(u))


def record(seed: int, stage: Any = STAGE, *, top: float = 70.0) -> pt.Dataset:
    u = drive(seed, top=top)
    noise = NOISE * np.random.default_rng(seed + 1000).standard_normal(u.size)
    return pt.Dataset(u=u, y=stage.simulate(u, DT).x + noise, dt=DT)


def identified(data: pt.Dataset) -> pt.identification.Identification:
    return pt.identify(
        data,
        "prandtl-ishlinskii",
        method=PLAYS,
        drift=False,
        history="virgin",
        progress=False,
    )


@cache
def fitted(seed: int = 1, *, richer: bool = False) -> pt.identification.Identification:
    return identified(record(seed, RICHER if richer else STAGE))


def known_cycles(fit: pt.identification.Identification) -> HeldOut:
    return held_out(fit, [(fit.data, 1.0)], [sensitivity(fit, fit.data, fitted_values(fit))])


def test_the_errors_of_a_cycle_are_those_of_a_fit_without_it() -> None:
    fit = fitted(richer=True)
    errors = known_cycles(fit)
    ends = turns(fit.data.u)[1::2]
    assert errors.cycles() == len(ends) + 1
    for part in (2, 5, errors.cycles() - 2):
        kept = errors.cycle != part
        y = np.where(kept, fit.data.y, np.nan)
        without = pt.Dataset(u=fit.data.u, y=y, dt=DT, missing="drop")
        expected = np.abs(fit.data.y - identified(without).simulate(without).x)[~kept]
        scale = float(np.sqrt(np.mean(expected**2)))
        np.testing.assert_allclose(errors.errors[~kept], expected, rtol=0.0, atol=0.02 * scale)
    # Larger than those of the fit that knows all cycles.
    assert np.mean(errors.errors**2) > fit.cost**2


@pytest.mark.parametrize("parts", [4, 10, 40])
@pytest.mark.parametrize("unequal", [0.0, 0.3])
def test_a_new_cycle_is_within_the_quantile(parts: int, unequal: float) -> None:
    draw = np.random.default_rng(7)
    within = []
    for _ in range(300):
        # Cycles differ by their size: samples of one are alike.
        sizes = np.exp(unequal * draw.standard_normal(parts + 1))
        errors = np.abs(sizes[:, None] * draw.standard_normal((parts + 1, 50)))
        flat = np.zeros(parts * 50)
        known = HeldOut(
            errors=errors[:-1].ravel(),
            amplitude=flat,
            rate=flat,
            cycle=np.repeat(np.arange(parts), 50),
        )
        within.append(np.mean(errors[-1] <= known.quantile(0.9)))
    # 0.9 or more, to three deviations of the mean.
    assert np.mean(within) > 0.9 - 3.0 * np.std(within) / np.sqrt(300.0)
    assert np.mean(within) < 0.94


def test_a_drift_that_is_over_in_one_cycle_is_not_unlimited_there() -> None:
    # Of its size, 50 nm, the cycles after the first show nothing.
    t = DT * np.arange(1000)
    u = 35.0 - 35.0 * np.cos(2.0 * np.pi * t)
    noise = NOISE * np.random.default_rng(1).standard_normal(u.size)
    y = STAGE.simulate(u, DT).x + 5e-8 * np.exp(-t / 0.15) + noise
    fit = pt.identify(pt.Dataset(u=u, y=y, dt=DT), "prandtl-ishlinskii", method=PLAYS, drift=0.15)
    assert fit.covariance is not None
    assert 1.96 * NOISE < fit.covariance.predicted < 3.0 * NOISE


def test_an_exact_model_has_the_noise_alone() -> None:
    band = fitted().prediction_band(record(2))
    assert float(np.median(band.noise)) == pytest.approx(1.96 * NOISE, rel=0.3)
    assert float(np.median(band.model_error)) < 0.3 * float(np.median(band.noise))
    assert float(band.parameters.max()) < 0.3 * float(np.median(band.noise))
    assert band.coverage is not None
    assert 0.94 < band.coverage < 0.995


@pytest.mark.parametrize("level", [0.68, 0.95])
def test_readings_under_other_drives_are_in_the_band(level: float) -> None:
    shares = [
        fitted(seed, richer=True).prediction_band(record(seed + 50, RICHER), level=level).coverage
        for seed in range(1, 9)
    ]
    assert np.mean(np.array(shares, dtype=np.float64)) > level - 0.03


def test_the_error_of_the_model_is_told_from_the_noise() -> None:
    exact, inexact = (fitted(richer=richer) for richer in (False, True))
    drives = drive(3) - drive(3)[0]
    bands = [fit.prediction_band(drives, DT) for fit in (exact, inexact)]
    noises = [float(np.median(band.noise)) for band in bands]
    assert noises[1] == pytest.approx(noises[0], rel=0.2)
    assert np.median(bands[1].model_error) > 3.0 * np.median(bands[0].model_error)
    for band in bands:
        parts = band.noise**2 + band.parameters**2 + band.model_error**2
        np.testing.assert_allclose(band.upper - band.lower, 2.0 * np.sqrt(parts))
        np.testing.assert_allclose(band.x, 0.5 * (band.lower + band.upper))


def test_a_larger_drive_is_unlike_the_records_and_its_errors_larger() -> None:
    fit = fitted(richer=True)
    same, larger = (fit.prediction_band(times * drive(1), DT) for times in (1.0, 1.5))
    assert not same.unlike.any()
    assert larger.unlike.any()
    errors = known_cycles(fit)
    ends = np.array([errors.amplitude.max()]), np.array([errors.rate.max()])
    at, above = (errors.at(times * ends[0], ends[1], 0.95, NOISE) for times in (1.0, 1.5))
    assert above.model_error == pytest.approx(1.5 * at.model_error)
    assert above.noise == pytest.approx(at.noise)
    assert "have an amplitude" not in str(same)
    assert f"{100 * larger.unlike.mean():.2g} % of the drive" in str(larger)


def test_parameters_move_the_prediction_by_their_covariance() -> None:
    """Fits of the same drive with other noise spread as the band of the parameters has it."""
    u, sizes = drive(1), []
    clean = STAGE.simulate(u, DT).x
    other = drive(9)
    draw = np.random.default_rng(5)
    for _ in range(40):
        data = pt.Dataset(u=u, y=clean + NOISE * draw.standard_normal(u.size), dt=DT)
        sizes.append(identified(data).model.simulate(other, DT).x)
    spread = np.std(sizes, axis=0)
    stated = fitted().prediction_band(other, DT).parameters / 1.96
    assert float(np.median(stated / spread)) == pytest.approx(1.0, abs=0.3)


def test_a_model_from_a_file_predicts_with_records(tmp_path: Path) -> None:
    fit = fitted(richer=True)
    stored = pt.load(fit.save(tmp_path / "model.json"))
    with pytest.raises(pt.ParameterError, match="records is none: expected records of the stage"):
        stored.prediction_band(drive(3), DT)
    again = stored.prediction_band(drive(3), DT, records=[fit.data])
    np.testing.assert_array_equal(again.half, fit.prediction_band(drive(3), DT).half)
    # Errors of a record that was not fitted are what they are.
    other = record(60, RICHER)
    errors = held_out(stored, [(other, 1.0)], [None])
    np.testing.assert_allclose(errors.errors, np.abs(other.y - stored.simulate(other).x))


def test_a_band_is_refused_in_a_sentence() -> None:
    fit = fitted()
    newtons = pt.Dataset(u=drive(1), y=1e-6 * drive(1), dt=DT, drive_unit="N")
    for level in (0.0, 1.0, -1.0, 95.0, float("nan")):
        with pytest.raises(pt.ParameterError, match=r"level is .*: expected a number"):
            fit.prediction_band(drive(1), DT, level=level)
    with pytest.raises(pt.ParameterError, match="a drive in N: expected one in V"):
        fit.prediction_band(drive(1), DT, records=[newtons])
    with pytest.raises(pt.ParameterError, match="records is one Dataset: expected a list"):
        fit.prediction_band(drive(1), DT, records=record(1))  # type: ignore[arg-type]
    with pytest.raises(pt.ParameterError, match="records is an empty list"):
        fit.prediction_band(drive(1), DT, records=[])
    with pytest.raises(pt.ParameterError, match="dt is None: expected the sampling interval"):
        fit.prediction_band(drive(1))
    with pytest.raises(pt.ShapeError, match="u has 3 samples: expected 8 or more"):
        fit.prediction_band([1.0, 2.0, 3.0], DT)
