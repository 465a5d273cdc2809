"""Records that are sampled far above what their drive moves: thinned for choices and descents."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

import piezotrack as pt
from play_records import PLAIN

if TYPE_CHECKING:
    from piezotrack.stages.base import Stage

NOISE = 5e-9


DAHL = pt.FirstOrderDahlStage(
    mass=0.1828,
    damping=100.0,
    stiffness=26065.0,
    piezo_coefficient=0.0468,
    rest_stiffness=9e3,
    coulomb_force=0.15,
)


def slow(stage: Stage, samples: int = 20_000) -> pt.Dataset:
    """Return a record of six periods of a sine whose amplitude falls."""
    t = np.linspace(0.0, 6.0, samples)
    u = 37.5 * (1.0 - np.exp(-t / 12.0) * np.cos(2.0 * np.pi * t))
    dt = float(t[1])
    noise = NOISE * np.random.default_rng(1).standard_normal(samples)
    return pt.Dataset(u=u, y=stage.simulate(u, dt).x + noise, dt=dt)


@pytest.mark.parametrize(("model", "stage"), [("first-order-dahl", DAHL), ("bouc-wen", PLAIN)])
def test_descents_on_a_thinned_record_end_where_a_search_on_all_samples_does(
    model: str, stage: Stage
) -> None:
    log = slow(stage)
    thinned = pt.identify(log, model, method=pt.Descents(seed=1), history="virgin")
    swarm = pt.ParticleSwarm(seed=1, runs=1)
    whole = pt.identify(log, model, method=swarm, history="virgin")
    assert thinned.cost == pytest.approx(whole.cost, rel=1e-5)
    run = whole.simulate(log).x - thinned.simulate(log).x
    assert float(np.abs(run).max()) < 0.1 * NOISE


def test_weights_of_a_thinned_record_are_those_of_all_its_samples() -> None:
    log = slow(PLAIN)
    fit = pt.identify(log, "prandtl-ishlinskii", history="virgin")
    assert fit.cost < 1.02 * NOISE
    other = slow(PLAIN, 2000)
    assert fit.score(other, history="virgin").rms < 1.1 * NOISE
