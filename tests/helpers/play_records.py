"""A Prandtl-Ishlinskii stage, and noiseless records of it in which every play shows."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

import piezotrack as pt

if TYPE_CHECKING:
    from numpy.typing import NDArray

STAGE = pt.PrandtlIshlinskiiStage(
    linear=0.9e-6,
    thresholds=(3.0, 8.0, 15.0, 25.0),
    weights=(0.1e-6, 0.2e-6, 0.15e-6, 0.12e-6),
    dead_zone_thresholds=(20e-6, 50e-6),
    dead_zone_weights=(0.08, -0.05),
)
PLAIN = replace(STAGE, dead_zone_thresholds=(), dead_zone_weights=())


def drive(cycles: float = 6.0, samples: int = 3000) -> NDArray[np.float64]:
    """A sine between 0 and 75 V whose amplitude falls, so that every play shows."""
    phase = np.linspace(0.0, cycles, samples)
    fall = 1.0 - 0.75 * np.clip(phase - 2.0, 0.0, None) / (cycles - 2.0)
    volts: NDArray[np.float64] = 37.5 * (1.0 - fall * np.cos(2.0 * np.pi * phase))
    return volts


def record(stage: pt.PrandtlIshlinskiiStage, dt: float = 1e-3, **keywords: Any) -> pt.Dataset:
    u = drive(**keywords)
    return pt.Dataset(u=u, y=stage.simulate(u, dt).x - 4e-6, dt=dt)


def fit_plays(
    data: pt.Dataset, *, offset: bool = True, drift: bool | None = None, **settings: Any
) -> pt.identification.Identification:
    """Identify a Prandtl-Ishlinskii stage with these settings of the least squares."""
    method = pt.LeastSquares(**settings)
    return pt.identify(data, "prandtl-ishlinskii", offset=offset, drift=drift, method=method)
