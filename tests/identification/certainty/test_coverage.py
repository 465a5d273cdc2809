"""95 % intervals cover the truth in 95 of 100 records, whatever the model and the noise."""

from __future__ import annotations

import importlib.util
import sys
from typing import Any

import numpy as np
import pytest

import piezotrack as pt
from folders import ROOT

BENCH = ROOT / "benches" / "coverage"
# Goal of every cell, records of each, and their binomial error, twice.
LEAST, MOST, RECORDS = 0.92, 0.98, 60
ERROR = 2.0 * np.sqrt(0.95 * 0.05 / RECORDS)
# What takes seconds for each record is left to the bench: an exponent is tried in coloured noise.
LONG = ("LuGre", "oscillator", "Bouc-Wen", "Bouc-Wen, exponent 2")


def loaded(name: str) -> Any:
    """Return a module of the bench, which its others import by name."""
    if name not in sys.modules:
        spec = importlib.util.spec_from_file_location(name, BENCH / f"{name}.py")
        assert spec is not None
        assert spec.loader is not None
        sys.modules[name] = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(sys.modules[name])
    return sys.modules[name]


NOISES, TRUTHS, CELLS = (loaded(name) for name in ("noises", "truths", "cells"))
REGULAR = [
    name for name, one in TRUTHS.CASES.items() if not (one.foreign or one.irregular or name in LONG)
]


def shares(case: str, noise: str, records: int) -> tuple[float, float]:
    """Shares of all intervals that cover, and of those for independent noise."""
    values = CELLS.measured(case, noise, records)["values"].values()
    given = [value["given"] for value in values]
    covered, independent = (
        float(np.average([value[what] for value in values], weights=given))
        for what in ("covered", "independent")
    )
    return covered, independent


# Records of each, whose binomial error is allowed for three times.
@pytest.mark.parametrize(
    ("case", "noise", "records"),
    [
        ("plays", "white", 40),
        ("plays", "AR 0.95", 40),
        ("first-order Dahl", "AR 0.8", 15),
        ("Maxwell slip", "white", 20),
        ("generalised plays", "AR 0.8", 20),
    ],
)
def test_intervals_cover(case: str, noise: str, records: int) -> None:
    covered, independent = shares(case, noise, records)
    assert covered > 0.95 - 3.0 * np.sqrt(0.95 * 0.05 / records)
    if noise != "white":
        assert independent < 0.75


@pytest.mark.study
@pytest.mark.parametrize("noise", [one for one in NOISES.NOISES if one != NOISES.RICHER])
@pytest.mark.parametrize("case", REGULAR)
def test_intervals_cover_with_every_model_and_noise(case: str, noise: str) -> None:
    covered, _ = shares(case, noise, RECORDS)
    assert LEAST - ERROR < covered < MOST + ERROR


def test_intervals_allow_for_a_mass_that_the_record_does_not_show() -> None:
    """Held at 0, it is made up for by damping and gain, by two and three deviations."""
    values = CELLS.measured("Dahl, mass not shown", "white", 20)["values"]
    assert "mass" not in values
    for name in ("damping", "piezo_coefficient"):
        assert values[name]["covered"] > 0.95 - 3.0 * np.sqrt(0.95 * 0.05 / 20)
        assert values[name]["independent"] < 0.75
        # Of a mass of one deviation of its own, the fit without it is biased by `bias`.
        assert 1.0 < values[name]["ratio"] / abs(values[name]["bias"]) < 2.0


def test_intervals_allow_for_a_weight_of_creep_on_its_bound() -> None:
    """At 0 the faster creep makes up for it, by six deviations, and the gain by two."""
    case = TRUTHS.CASES["plays, creep"]
    u = case.drive()
    noise = 1e-6 * np.random.default_rng(1).standard_normal(u.size)
    fit = case.fit(u, TRUTHS.motion(case.stage, u, case.dt) + noise)
    certainty = fit.covariance
    assert fit.model.creep_weights[1] == 0.0
    for name in certainty.names:
        low, high = certainty.interval(name)
        assert low < CELLS.value_of(case.stage, name) < high
    k = certainty.names.index("creep_weights[0]")
    beyond = certainty.values[k] - case.stage.creep_weights[0]
    assert beyond > 5.0 * np.sqrt(certainty.matrix[k, k])
    assert beyond < 2.5 * certainty.deviations[k]


def test_intervals_allow_for_a_value_of_a_search_on_its_bound() -> None:
    """Where a2 ends there, which the record hardly shows, the others make up for it."""
    case = TRUTHS.CASES["Dahl, a2 not shown"]
    u, rng = case.drive(), np.random.default_rng(1)
    clean = TRUTHS.motion(case.stage, u, case.dt)
    fits = [case.fit(u, clean + case.noise * rng.standard_normal(u.size)) for _ in range(8)]
    errors, reaches, covered = [], [], []
    for certainty in [fit.covariance for fit in fits if fit.parameters["a2"].at_bound]:
        for k, name in enumerate(certainty.names):
            low, high = certainty.interval(name)
            errors.append(abs(certainty.values[k] - CELLS.value_of(case.stage, name)))
            reaches.append(1.96 * certainty.widening[k] * np.sqrt(certainty.matrix[k, k]))
            covered.append(low < CELLS.value_of(case.stage, name) < high)
    assert len(errors) > 10
    assert np.mean(np.less(errors, reaches)) < 0.5
    assert np.mean(covered) > 0.9


def test_deviations_of_what_follows_from_other_values_are_those_of_the_estimates() -> None:
    # Thresholds of the drive stay, and the displacements at which elements slip follow.
    values = CELLS.measured("Maxwell slip", "white", 30)["values"]
    assert not any("slip" in name for name in values)
    assert all(0.6 < value["ratio"] < 1.6 for value in values.values())


def test_an_error_of_the_model_is_told_where_a_nested_drive_repeats() -> None:
    case = TRUTHS.CASES["plays"]
    u = case.drive(4)
    noise = 20e-9 * np.random.default_rng(1).standard_normal(u.size)
    x = TRUTHS.motion(TRUTHS.with_creep(case.stage), u, case.dt)
    shares = case.fit(u, x + noise).covariance.shares
    # The creep after the first part is not that before it.
    assert 20e-9 < shares.noise < 40e-9
    assert shares.model_error > 2.0 * shares.noise


@pytest.mark.slow
def test_the_exponent_is_that_of_the_least_cost() -> None:
    case = TRUTHS.CASES["Bouc-Wen, exponent 2"]
    u = case.drive()
    noise = case.noise * np.random.default_rng(2).standard_normal(u.size)
    fit = case.fit(u, TRUTHS.motion(case.stage, u, case.dt) + noise)
    low, high = fit.covariance.interval("exponent", 0.999)
    assert low < 2.0 < high
    assert high - low < 0.2
    held = {**case.options["parameters"], "exponent": 2.0}
    log = pt.Dataset(u=u, y=fit.data.y, dt=case.dt)
    true = pt.identify(log, "bouc-wen", history="virgin", parameters=held)
    assert fit.cost < 1.0005 * true.cost


@pytest.mark.parametrize("noise", ["white", "AR 0.95"])
def test_noise_alone_is_not_taken_for_an_error_of_the_model(noise: str) -> None:
    """Least squares and generalised ones differ by what the noise alone makes of them."""
    case = CELLS.CASES["plays"]
    u = case.drive(1)
    clean = CELLS.motion(case.truth(u), u, case.dt)
    rng = np.random.default_rng(1)
    differences = []
    for _ in range(12):
        certainty = case.fit(u, clean + CELLS.noise_of(noise, rng, u.size, case.noise)).covariance
        assert certainty.decided_by_model == ()
        moved, spread = certainty.shifts.T
        differences.append(moved / spread)
    # Of white noise both are nearly the same. 50 before, by the difference of both variances.
    assert np.sqrt(np.mean(np.square(differences))) < 1.5
    if noise != "white":
        assert np.sqrt(np.mean(np.square(differences))) > 0.6
