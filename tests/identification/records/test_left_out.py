"""Readings that do not count: single ones far off, and missing ones."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import piezotrack as pt
from records import NOISE, quick, quick_fit

LOG = pt.datasets.dbo_training()
WINDOW = slice(3.0, 13.0)
GAP = slice(1000, 1300)
SWARM = pt.ParticleSwarm(particles=12, iterations=30, runs=1, seed=1)


def log_of(y: np.ndarray, missing: str | None = None) -> pt.Dataset:
    whole = pt.Dataset(u=LOG.u, y=y, t=LOG.t, missing=missing)  # type: ignore[arg-type]
    return whole[WINDOW]


def spiked() -> pt.Dataset:
    y = LOG.y.copy()
    y[[700, 911, 1250, 1333, 1801, 2222]] += np.array([30, -20, 12, -25, 30, 8]) * 1e-6
    return log_of(y)


def fitted(data: pt.Dataset, model: str) -> pt.identification.Identification:
    method = SWARM if model == "dahl" else None
    return pt.identify(data, model, method=method, progress=False)


@pytest.mark.parametrize("model", ["prandtl-ishlinskii", "dahl"])
def test_a_few_glitches_do_not_change_what_is_found(model: str) -> None:
    plain, glitched = fitted(LOG[WINDOW], model), fitted(spiked(), model)
    assert glitched.cost == pytest.approx(plain.cost, rel=0.05)
    assert glitched.stroke == plain.stroke
    assert glitched.score(LOG[WINDOW]).rms == pytest.approx(plain.cost, rel=0.05)
    (note,) = [one for one in glitched.notes if "far off" in one]
    assert note.startswith("6 readings")
    for time in (3.5, 4.555, 6.25, 6.665, 9.005, 11.11):
        assert f"{time:g}" in note
    # Known again, and judged in the same way.
    assert glitched.fitted_on(spiked())
    again = glitched.score(spiked(), offset=glitched.offset)
    assert again.rms == glitched.scores[0].rms
    assert again.max_error < 2e-6


@pytest.mark.parametrize("model", ["prandtl-ishlinskii", "dahl"])
def test_what_stands_in_a_gap_has_no_effect(model: str) -> None:
    y = LOG.y.copy()
    y[GAP] = np.nan
    fit = fitted(log_of(y, "drop"), model)
    assert fit.score(LOG[WINDOW]).rms == pytest.approx(fitted(LOG[WINDOW], model).cost, rel=0.05)
    assert fitted(log_of(y, "fill"), model).cost > 5.0 * fit.cost


def test_the_cost_of_a_search_is_that_of_the_samples_that_count() -> None:
    y = LOG.y.copy()
    y[GAP] = np.nan
    data = log_of(y, "drop")
    fit = fitted(data, "dahl")
    error = data.counted(data.y - fit.simulate(data, offset=fit.offset).x)
    assert fit.cost == pytest.approx(float(np.sqrt(np.mean(error**2))), rel=1e-3)


@pytest.mark.parametrize("sensor", [{}, {"drift": 1.0}, {"creep": True}, {"offset": False}])
def test_descents_go_by_the_samples_that_count(sensor: dict[str, Any]) -> None:
    """A straight line in a long gap is 8 um off; what is left all the same is the noise."""
    whole = quick()
    y = whole.y.copy()
    y[300:500] = np.nan
    data = pt.Dataset(u=whole.u, y=y, dt=whole.dt, missing="drop")
    assert np.abs(data.y - whole.y).max() > 5e-6
    fit = quick_fit(data, swarm=None, **sensor)
    assert fit.cost == pytest.approx(NOISE, rel=0.1)
    assert fit.score(whole, offset=fit.offset).rms < 1.2 * NOISE
