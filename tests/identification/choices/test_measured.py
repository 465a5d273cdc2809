"""Identification on measured logs: a piezo stack at 1 Hz, 200 samples a second."""

from __future__ import annotations

from functools import cache

import pytest

import piezotrack as pt
from piezotrack.data import datasets
from records import search_of

# Of a stroke, which the README and the pages give with two digits behind the point [%].
DIGITS = 0.005 + 1e-9
HEADLINE = {
    # fitted, the rest of that record, another record
    "dahl": (0.49, 0.81, 1.24),
    "bouc-wen": (0.71, 0.82, 1.19),
    "asymmetric-bouc-wen": (0.41, 0.55, 1.30),
    "prandtl-ishlinskii": (0.27, 0.28, 0.41),
    "first-order-dahl": (0.72, 0.83, 0.745),
    "parallel-dahl": (0.70, 0.74, 0.73),
    "lugre": (0.72, 0.83, 0.745),
    "maxwell-slip": (0.69, 0.72, 0.59),
    "generalised-prandtl-ishlinskii": (0.27, 0.285, 0.51),
    "rate-dependent-prandtl-ishlinskii": (0.27, 0.28, 0.41),
    "polynomial-prandtl-ishlinskii": (0.33, 0.34, 0.84),
    "asymmetric-prandtl-ishlinskii": (0.17, 0.195, 0.34),
    "preisach": (0.16, 0.19, 0.49),
    "duhem": (0.19, 0.215, 0.88),
}


@cache
def training() -> pt.Dataset:
    # The first 3 s are a transient from an unknown history.
    return datasets.dbo_training()[3.0:23.0]


@cache
def tracking() -> pt.Dataset:
    return datasets.dbo_tracking()[3.0:]


@cache
def fit(seed: int) -> pt.identification.Identification:
    return pt.identify(training(), "dahl", method=pt.Descents(seed=seed))


def test_the_figures_of_the_readme() -> None:
    fitted_model = fit(1)
    fitted, _, other = HEADLINE["dahl"]
    assert fitted_model.cost_percent == pytest.approx(fitted, abs=DIGITS)
    assert fitted_model.score(tracking()).rms_percent == pytest.approx(other, abs=DIGITS)


def test_the_model_follows_the_record_and_another_one() -> None:
    # The spread of such fits elsewhere: 0.84 to 0.88 % and 1.67 to 1.80 % of the stroke.
    fitted_model = fit(1)
    assert fitted_model.cost_percent <= 0.90
    assert fitted_model.score(tracking()).rms_percent <= 1.75
    assert fitted_model.stroke == training().stroke
    assert fitted_model.fitted.rms == pytest.approx(fitted_model.cost, abs=2e-10)


@pytest.mark.slow
def test_the_table_of_all_kinds() -> None:
    log = datasets.dbo_training()
    on_other = pt.compare(log, train=(3.0, 23.0), test=tracking(), seed=1)
    fits = [row.fit for row in on_other.rows]
    on_rest = pt.compare(log, fits, train=(3.0, 23.0))
    errors = {
        other.name: (other.train.rms_percent, rest.test.rms_percent, other.test.rms_percent)
        for other, rest in zip(on_other.rows, on_rest.rows, strict=True)
    }
    assert errors.keys() == HEADLINE.keys()
    for name, figures in HEADLINE.items():
        assert errors[name] == pytest.approx(figures, abs=DIGITS), name


def test_it_predicts_cycles_that_were_not_fitted() -> None:
    rest = datasets.dbo_training()[23.0:]
    assert fit(1).score(rest).rms_percent <= 2.0 * fit(1).cost_percent


def test_three_seeds_end_in_the_same_minimum() -> None:
    first, *others = (fit(seed) for seed in (1, 2, 3))
    for other in others:
        assert other.cost == pytest.approx(first.cost, rel=1e-3)
        for name in ("damping", "piezo_coefficient", "a2", "b1"):
            found = getattr(other.model, name)
            assert found == pytest.approx(getattr(first.model, name), rel=1e-3), name


def test_it_says_what_it_does_not_know() -> None:
    assert fit(1).scale_assumed
    assert not fit(1).parameters["mass"].identified
    assert "mass" in fit(1).summary().rpartition("Not determined by this record:")[2]


def test_the_papers_swarm_does_better_than_a_straight_line() -> None:
    # A line leaves 7.4 % on this record and 5.6 % on the other.
    fit = pt.identify(training(), "dahl", method=pt.ParticleSwarm.xu_li_2010(seed=1))
    assert search_of(fit).npolish == 0
    assert fit.cost_percent < 2.0
    assert fit.score(tracking()).rms_percent < 2.5


def test_the_warm_up_counts() -> None:
    # What the stage remembers at 3 s is in the drive before.
    cut = datasets.dbo_training().cut(3.0, 23.0)
    forgetting = pt.identify(cut, "dahl", method=pt.Descents(seed=1), history="virgin")
    assert forgetting.cost > 1.1 * fit(1).cost
