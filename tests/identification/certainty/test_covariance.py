"""Covariance of a fit: intervals hold for noise that is white and noise that is not."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.linalg import toeplitz
from scipy.optimize import minimize
from scipy.signal import lfilter

import piezotrack as pt
from piezotrack import _core
from piezotrack.errors import ParameterError
from piezotrack.identification.fitted.certainty.covariance import Covariance

DT = 4e-3
THRESHOLDS = (5.0, 15.0, 30.0)
STAGE = pt.stages.PrandtlIshlinskiiStage(
    linear=0.8e-6, thresholds=THRESHOLDS, weights=(0.1e-6, 0.08e-6, 0.06e-6)
)
METHOD = pt.LeastSquares(thresholds=THRESHOLDS, creep=False, dynamics=None, dead_zones=0)


def certainty_of(fit: pt.identification.Identification) -> Covariance:
    assert fit.covariance is not None
    return fit.covariance


def nested(seconds: float = 8.0) -> np.ndarray:
    """Sines of falling amplitude [V]."""
    t = np.arange(0.0, seconds, DT)
    return 40.0 + 38.0 * (1.0 - t / seconds) * np.sin(2.0 * np.pi * t)


def correlated(rng: np.random.Generator, count: int, pole: float, size: float) -> np.ndarray:
    """First-order autoregression of standard deviation `size`."""
    drawn = rng.standard_normal(count + 2000) * size * np.sqrt(1.0 - pole**2)
    noise = np.zeros(count + 2000)
    for k in range(1, count + 2000):
        noise[k] = pole * noise[k - 1] + drawn[k]
    return noise[2000:]


@pytest.mark.slow
def test_an_interval_covers_where_the_shortest_lag_was_taken() -> None:
    stage = pt.FirstOrderDahlStage(
        mass=1e-3,
        damping=1e3,
        piezo_coefficient=1.0,
        stiffness=1e6,
        rest_stiffness=2e5,
        coulomb_force=5.0,
    )
    u, rng = nested(), np.random.default_rng(5)
    clean = stage.simulate(u, DT, initial=stage.equilibrium(u[0])).x
    hits = []
    for _ in range(30):
        log = pt.Dataset(u=u, y=clean + correlated(rng, u.size, 0.8, 50e-9), dt=DT)
        fit = pt.identify(log, "first-order-dahl", history="virgin")
        assert fit.lags is not None
        for name in certainty_of(fit).names:
            low, high = certainty_of(fit).interval(name)
            hits.append(low < getattr(stage, name) < high)
    assert np.mean(hits) > 0.9


def test_what_repeats_is_model_error_and_the_rest_is_noise() -> None:
    t = np.arange(0.0, 8.0, DT)
    u = 40.0 - 40.0 * np.cos(2.0 * np.pi * t)
    rng = np.random.default_rng(1)
    missing = 30e-9 * np.sin(2.0 * np.pi * 5.0 * t)
    y = (
        STAGE.simulate(u, DT, initial=STAGE.equilibrium(u[0])).x
        + missing
        + 20e-9 * rng.standard_normal(t.size)
    )
    fit = pt.identify(
        pt.Dataset(u=u, y=y, dt=DT), "prandtl-ishlinskii", method=METHOD, history="virgin"
    )
    shares = certainty_of(fit).shares
    assert shares is not None
    assert shares.noise == pytest.approx(20e-9, rel=0.05)
    assert shares.model_error == pytest.approx(30e-9 / np.sqrt(2.0), rel=0.1)


def test_a_mass_without_effect_has_no_interval_and_a_prior_gives_one() -> None:
    stage = pt.FirstOrderDahlStage(
        mass=0.01,
        damping=1e3,
        piezo_coefficient=1.0,
        stiffness=1e6,
        rest_stiffness=2e5,
        coulomb_force=5.0,
    )
    u = nested(4.0)
    y = stage.simulate(u, DT, initial=stage.equilibrium(u[0])).x + 20e-9 * np.random.default_rng(
        2
    ).standard_normal(u.size)
    log = pt.Dataset(u=u, y=y, dt=DT)
    fit = pt.identify(log, "first-order-dahl", history="virgin")
    for name in ("rest_stiffness", "coulomb_force"):
        low, high = certainty_of(fit).interval(name, 0.999)
        assert low < getattr(stage, name) < high
    known = certainty_of(fit).deviation("coulomb_force")
    prior = {"coulomb_force": pt.Parameter(prior=(5.0, 0.5 * known))}
    narrowed = pt.identify(log, "first-order-dahl", history="virgin", parameters=prior)
    expected = known * 0.5 / np.sqrt(1.0 + 0.25)
    assert certainty_of(narrowed).deviation("coulomb_force") == pytest.approx(expected, rel=0.2)


def test_several_records_determine_values_better() -> None:
    rng = np.random.default_rng(4)
    u = nested(4.0)
    logs = [
        pt.Dataset(u=u, y=STAGE.simulate(u, DT, initial=STAGE.equilibrium(u[0])).x + noise, dt=DT)
        for noise in 30e-9 * rng.standard_normal((4, u.size))
    ]
    options: dict[str, Any] = {"method": METHOD, "drift": False, "history": "virgin"}
    alone = pt.identify(logs[0], "prandtl-ishlinskii", **options)
    all_four = pt.identify(logs, "prandtl-ishlinskii", **options)
    ratio = certainty_of(all_four).deviations / certainty_of(alone).deviations
    assert np.allclose(ratio, 0.5, rtol=0.25)


def delays_of(pole: float) -> list[pt.identification.Estimate]:
    """Delays of two records of a stage with dry friction."""
    stage = pt.FirstOrderDahlStage(
        mass=1e-3,
        damping=100.0,
        piezo_coefficient=1.0,
        stiffness=1e6,
        rest_stiffness=2e5,
        coulomb_force=5.0,
    )
    rng, u = np.random.default_rng(6), nested(4.0)
    t = np.arange(u.size) * DT
    x = stage.simulate(u, DT, initial=stage.equilibrium(u[0])).x
    logs = [
        pt.Dataset(u=u, y=np.interp(t - late, t, x) + correlated(rng, u.size, pole, 50e-9), dt=DT)
        for late in (4e-3, 8e-3)
    ]
    known = {"stiffness": 1e6, "damping": 100.0, "mass": 1e-3}
    fit = pt.identify(logs, "first-order-dahl", delay=True, history="virgin", parameters=known)
    return [record.parameters["delay"] for record in fit.records]


def test_a_delay_of_each_record_has_a_deviation_that_grows_with_correlated_noise() -> None:
    white, coloured = delays_of(0.0), delays_of(0.9)
    for one, other, late in zip(white, coloured, (4e-3, 8e-3), strict=True):
        assert one.deviation is not None
        assert other.deviation is not None
        assert abs(other.value - late) < 4.0 * other.deviation
        assert abs(one.value - late) < 4.0 * one.deviation
        # A sine below the pole's frequency sees the square root of (1 + pole) / (1 - pole).
        assert 2.5 < other.deviation / one.deviation < 6.0


def test_wrong_levels_and_names_are_refused() -> None:
    u = nested(4.0)
    log = pt.Dataset(u=u, y=STAGE.simulate(u, DT, initial=STAGE.equilibrium(u[0])).x, dt=DT)
    certainty = certainty_of(pt.identify(log, "prandtl-ishlinskii", method=METHOD))
    for level in (0.0, 1.0, -1.0, 95.0):
        with pytest.raises(ParameterError) as refused:
            certainty.interval("linear", level)
        assert refused.value.argument == "level"
    with pytest.raises(ParameterError) as refused:
        certainty.deviation("mass")
    assert refused.value.argument == "name"


def test_a_quantity_is_determined_where_its_single_values_are_not() -> None:
    """Two cells of a Preisach plane move as one under any drive: their sum alone shows."""
    log = pt.datasets.dbo_tracking()[3.0:33.0]
    fit = pt.identify(log, "preisach", progress=False)
    covariance = fit.covariance
    assert covariance is not None
    assert covariance.hidden.shape[0] >= 1
    unknown = [name for name, known in zip(covariance.names, covariance.determined, strict=True)
               if not known]  # fmt: skip
    assert "linear" in unknown
    assert covariance.interval("linear").upper == np.inf
    (gain,) = (line for line in fit.summary().splitlines() if line.split()[:1] == ["gain"])
    assert "+-" in gain
    band = fit.prediction_band(log)
    assert float(np.median(band.parameters)) < 0.005 * fit.stroke
    assert float(band.parameters.max()) < 0.02 * fit.stroke


def test_the_noise_is_that_of_the_largest_restricted_likelihood() -> None:
    """The density of the residual in all directions that the fit has left, in dense matrices."""
    n, pole = 250, 0.95
    rng = np.random.default_rng(3)
    t = np.arange(n) / n
    columns = [np.cos(np.pi * k * t) for k in (1, 2)]
    fitted = np.column_stack([*columns, np.ones(n)])
    noise = lfilter([1.0], [1.0, -pole], rng.standard_normal(n + 500))[500:]
    left = np.linalg.svd(fitted)[0][:, fitted.shape[1] :]
    residual = left @ (left.T @ noise)
    record = (columns, [np.ones(n)], residual, residual, 1.0)
    matrix, *_, (order,), _ = _core.linearised_covariance([record], np.zeros((2, 2)).tolist(), 0, 0)

    def correlations(coefficients: np.ndarray) -> np.ndarray:
        answer = lfilter([1.0], [1.0, *-coefficients], np.eye(1, 20 * n)[0])
        return np.asarray(toeplitz([answer[k:] @ answer[: answer.size - k] for k in range(n)]))

    def cost(coefficients: np.ndarray) -> float:
        roots = np.roots([1.0, *-coefficients])
        if np.abs(roots).max() > 0.999:
            return float("inf")
        square = left.T @ correlations(coefficients) @ left
        power = residual @ left @ np.linalg.solve(square, left.T @ residual)
        return float((n - 3) * np.log(power) + np.linalg.slogdet(square)[1])

    begun = np.array([0.9, *np.zeros(order - 1)])
    likeliest = minimize(cost, begun, method="Nelder-Mead", options={"xatol": 1e-4}).x
    square = left.T @ correlations(likeliest) @ left
    power = residual @ left @ np.linalg.solve(square, left.T @ residual) / (n - 3)
    take = np.linalg.pinv(fitted)[:2]
    expected = power * take @ correlations(likeliest) @ take.T
    assert np.array(matrix) == pytest.approx(expected, rel=0.02)
    # An autoregression of the residual alone has less slow noise.
    alone, power = _core.autoregression(residual)
    least = power * take @ correlations(np.array(alone)) @ take.T
    assert np.all(np.diag(least) < 0.8 * np.diag(expected))


def test_values_whose_unit_the_exponent_decides_have_intervals_in_the_logarithm() -> None:
    # z^n keeps its size where ln(beta) changes by -ln(z) times the change of n, of z in m.
    exponent, beta, deviation, slope = 2.0, 1.5e4, 0.08, -np.log(3e-5)
    zeros, ones = np.zeros(2), np.ones(2)
    covered = []
    for moved in deviation * np.random.default_rng(0).standard_normal(2000):
        found = beta * np.exp(slope * moved)
        effect = np.array([1.0, slope * found])
        covariance = Covariance(
            names=("exponent", "beta"),
            values=np.array([exponent + moved, found]),
            matrix=deviation**2 * np.outer(effect, effect),
            determined=ones > 0.0,
            independent=ones,
            factors=ones,
            widening=ones,
            shifts=np.zeros((2, 2)),
            to_least_cost=zeros,
            by_held=np.zeros((2, 2)),
            samples=2000,
            orders=(0,),
            hidden=np.empty((0, 2)),
            predicted=0.0,
        )
        low, high = covariance.interval("beta")
        covered.append(low < beta < high)
        low, high = covariance.interval("exponent")
        assert high - low == pytest.approx(2.0 * 1.96 * deviation, rel=1e-3)
    assert 0.935 < np.mean(covered) < 0.965
