"""A search whose steps are too coarse for a candidate does not return it."""

from __future__ import annotations

import numpy as np
import pytest

import piezotrack as pt

RATE = 250


@pytest.mark.parametrize("seed", [1, 2])
def test_the_cost_of_a_fit_is_the_error_of_its_motion(seed: int) -> None:
    """Stiff candidates have a low cost by coarse steps where the hysteresis is of another kind."""
    t = np.arange(8 * RATE) / RATE
    u = 37.5 * (1 - np.cos(2 * np.pi * 0.25 * t))
    stage = pt.DahlStage.xu_li_2010()
    log = pt.Dataset(u=u, y=stage.simulate(u, 1 / RATE).x, dt=1 / RATE)[4.0:]
    fit = pt.identify(
        log,
        "first-order-dahl",
        parameters={"stiffness": stage.stiffness},
        method=pt.Descents(seed=seed),
    )
    error = fit.simulate(log).x - log.y
    assert np.std(error) == pytest.approx(fit.cost, rel=0.01)
    # The same minimum for each seed.
    assert fit.cost == pytest.approx(1.057e-6, rel=0.01)
