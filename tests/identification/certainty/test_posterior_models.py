"""Models as likely as an identified one: what spreads, how far, and that margins hold for them."""

from __future__ import annotations

import numpy as np
import pytest

import piezotrack as pt
from piezotrack.identification import Identification, IdentifiedModel, posterior_models

DT = 2e-3
STAGE = pt.stages.PrandtlIshlinskiiStage(
    linear=1.0e-6, thresholds=(6.0, 14.0), weights=(0.2e-6, 0.1e-6), frequency=60.0,
    damping_ratio=0.3,
)  # fmt: skip


def record(seed: int) -> pt.Dataset:
    stage = pt.VirtualStage.of(STAGE, noise=50e-9, seed=seed)
    t = np.arange(0.0, 4.0, DT)
    drive = 25.0 + (12.0 * np.sin(2.0 * np.pi * 0.5 * t) + 10.0 * np.sin(2.0 * np.pi * 3.1 * t))
    return stage.record(drive - drive[0], DT)


def fitted(log: pt.Dataset) -> Identification:
    fit = pt.identify(log, "dahl", method=pt.Descents(seed=1))
    assert isinstance(fit, Identification)
    return fit


def spread(models: tuple[IdentifiedModel, ...], name: str) -> float:
    """Standard deviation of a value from the ends of the axes."""
    values = np.array([getattr(one.model, name) for one in models])
    half = 0.5 * (values[::2] - values[1::2])
    return float(np.sqrt(np.sum(half**2)))


def simulated(seed: int, *, parameters: pt.DahlStage) -> pt.Dataset:
    stage = pt.VirtualStage.of(parameters, noise=50e-9, seed=seed)
    t = np.arange(0.0, 3.0, DT)
    drive = 30.0 * (1.0 - np.cos(2.0 * np.pi * t)) * np.linspace(1.0, 0.3, t.size)
    return stage.record(drive, DT)


def test_the_spread_is_that_of_fits_to_records_with_other_noise() -> None:
    true = pt.DahlStage.xu_li_2010()
    fits = [
        pt.identify(simulated(seed, parameters=true), "dahl", history="virgin")
        for seed in range(1, 13)
    ]
    seen = float(np.std([one.model.piezo_coefficient for one in fits], ddof=1))
    log = simulated(1, parameters=true)
    found = spread(posterior_models(fits[0], log, deviations=1.0), "piezo_coefficient")
    # A standard deviation of twelve is known to some 20 %.
    assert 0.5 * seen < found < 2.0 * seen


def test_a_model_that_is_not_exact_spreads_further_than_its_noise_says() -> None:
    # Plays are no Dahl hysteresis: the deviations are correlated.
    log = record(1)
    fit = fitted(log)
    certainty = fit.covariance
    assert certainty is not None
    independent = certainty.independent[certainty.names.index("piezo_coefficient")]
    # Not so far that axes are shortened.
    found = 10.0 * spread(posterior_models(fit, log, deviations=0.1), "piezo_coefficient")
    assert found > 2.0 * independent
    assert found == pytest.approx(certainty.deviation("piezo_coefficient"), rel=5e-2)


def test_margins_of_a_tuned_loop_hold_for_all_of_them() -> None:
    log = record(2)
    fit = pt.identify(log, "prandtl-ishlinskii")
    nearby = posterior_models(fit, log)
    assert len(nearby) >= 6
    tuned = pt.tune(
        [fit, *nearby],
        dt=DT,
        limits=(0.0, 50.0),
        parts="pid",
        search=pt.TuningSearch(particles=16, iterations=10),
    )
    assert len(tuned.plants) == 3 * (1 + len(nearby))
    loops = [pt.check_loop(one, tuned.controller) for one in nearby]
    for loop in (*loops, pt.check_loop(STAGE, tuned.controller)):
        assert max(case.sensitivity for case in (loop.low, loop.middle, loop.high)) < 2.0 * 1.02


def test_what_a_record_does_not_determine_stays_in_its_range() -> None:
    # Slow: neither mass nor damping show.
    t = np.arange(0.0, 4.0, 0.02)
    log = pt.VirtualStage.of(STAGE, noise=50e-9).record(20.0 * (1.0 - np.cos(3.0 * t)), 0.02)
    fit = fitted(log)
    for one in posterior_models(fit, log, deviations=3.0):
        for name in ("damping", "piezo_coefficient", "a1", "b1"):
            assert 0.49 < getattr(one.model, name) / getattr(fit.model, name) < 1.51


def test_wrong_arguments_are_named() -> None:
    log = record(1)
    fit = fitted(log)
    with pytest.raises(pt.ParameterError, match="deviations is 0"):
        posterior_models(fit, log, deviations=0.0)
    with pytest.raises(pt.ParameterError, match=r"data is .*: expected a Dataset"):
        posterior_models(fit, "log.csv")  # type: ignore[arg-type]
    with pytest.raises(pt.ParameterError, match=r"model is .*: expected a pt\.IdentifiedModel"):
        posterior_models(STAGE, log)  # type: ignore[arg-type]
    with pytest.raises(pt.ParameterError, match="data has 50 samples: expected 80 or more"):
        posterior_models(fit, log[:0.1])
