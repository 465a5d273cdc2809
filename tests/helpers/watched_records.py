"""Records of a stage that is watched: with other drives, noise of both kinds, and changes."""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.signal import lfilter

import piezotrack as pt

DT = 1e-3
NOISE = 2e-8
STAGE = pt.PrandtlIshlinskiiStage(
    linear=0.9e-6,
    thresholds=(3.0, 8.0, 15.0, 25.0),
    weights=(0.1e-6, 0.2e-6, 0.15e-6, 0.12e-6),
    frequency=60.0,
    damping_ratio=0.1,
)
# Correlation of neighbouring readings of a slow sensor.
SLOW = 0.9


def noise_of(draw: np.random.Generator, count: int, size: float, correlation: float) -> np.ndarray:
    white = draw.standard_normal(count + 200)
    coloured = lfilter([1.0], [1.0, -correlation], white)[200:]
    return np.asarray(size * np.sqrt(1.0 - correlation**2) * coloured)


def watched(
    seed: int,
    stage: pt.PrandtlIshlinskiiStage = STAGE,
    *,
    samples: int = 4000,
    top: float = 70.0,
    noise: float = NOISE,
    correlation: float = 0.0,
    gain: float = 1.0,
    late: int = 0,
    drift: float = 0.0,
) -> pt.Dataset:
    """A record under three slow sines and a fast one; the stage has a ripple that no model has."""
    draw = np.random.default_rng(seed)
    t = DT * np.arange(samples)
    rates = np.append(draw.uniform(0.5, 6.0, 3), draw.uniform(15.0, 25.0))
    sizes = np.append(draw.uniform(0.5, 1.0, 3), 0.05)
    phases = 2.0 * np.pi * (np.outer(rates, t) + draw.uniform(0.0, 1.0, (4, 1)))
    u = sizes @ np.sin(phases)
    u = top * (u - u.min()) / np.ptp(u)
    x = stage.simulate(u, DT, initial=stage.equilibrium([0.0, float(u[0])])).x
    x = gain * (x + 1e-8 * np.sin(2.0 * np.pi * u / 30.0))
    x = np.concatenate([np.full(late, x[0]), x[: samples - late]])
    y = x + noise_of(draw, samples, noise, correlation) + drift * t / t[-1] - 4e-6
    return pt.Dataset(u=u, y=y, dt=DT)


@cache
def model_watched(seed: int = 1, correlation: float = 0.0) -> pt.identification.Identification:
    method = pt.LeastSquares(creep=False, dead_zones=False)
    record = watched(seed, samples=6000, top=77.0, correlation=correlation)
    return pt.identify(record, "prandtl-ishlinskii", drift=False, method=method, progress=False)
