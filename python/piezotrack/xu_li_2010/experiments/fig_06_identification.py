"""Fig. 6 and Table 1: the particle swarm."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...data.dataset import Dataset
from ...identification.fit import identify
from ...identification.methods.particle_swarm import ParticleSwarm
from ...stages.feedback.dahl import DahlStage
from .procedure import FITTED_SECONDS, SEARCH_BOX

if TYPE_CHECKING:
    from ...identification.fitted.identification import Identification
    from ..apparatus import Apparatus

__all__ = ["observe", "record", "search", "thinned"]

RATE, SECONDS, FREQUENCY, VOLTS = 5000.0, 12.0, 0.25, 75.0


def record(apparatus: Apparatus) -> Dataset:
    """Record Fig. 7a: 12 s of 0.25 Hz between 0 and 75 V, at 5 kHz."""
    t = np.arange(int(RATE * SECONDS) + 1) / RATE
    u = 0.5 * VOLTS * (1.0 - np.cos(2.0 * np.pi * FREQUENCY * t))
    return apparatus.x.record(u, 1.0 / RATE)


def thinned(log: Dataset, every: int) -> Dataset:
    """Keep one sample of `every`: 0.25 Hz does not need 5 kHz."""
    return Dataset(u=log.u[::every], y=log.y[::every], dt=every * log.dt)


def search(log: Dataset, seed: int) -> Identification:
    """Identify mass, damping, stiffness and piezo coefficient as in the paper.

    With its swarm, its bounds, the first 4 s, and its hysteresis parameters, of which b1 sets the
    scale of the forces. The best of three restarts is taken: a single swarm does not always reach
    the minimum.
    """
    published = DahlStage.xu_li_2010()
    return identify(
        log[:FITTED_SECONDS],
        "dahl",
        parameters={
            **SEARCH_BOX,
            "a1": published.a1,
            "a2": published.a2,
            "b1": published.b1,
        },
        history="virgin",
        method=ParticleSwarm.xu_li_2010(seed=seed, runs=3),
        threads=1,
        progress=False,
    )


def observe(fit: Identification) -> dict[str, float]:
    """Return the parameters of Table 1 that are identified, SI."""
    assert isinstance(fit.model, DahlStage)
    return {
        "table_1.mass": fit.model.mass,
        "table_1.damping": fit.model.damping,
        "table_1.stiffness": fit.model.stiffness,
        "table_1.piezo": fit.model.piezo_coefficient,
    }
