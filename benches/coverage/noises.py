"""Noises of a sensor."""

from __future__ import annotations

import zlib

import numpy as np

# First-order autoregressions by their pole; the drift is one of a pole near 1.
POLES = {"white": 0.0, "AR 0.8": 0.8, "AR 0.95": 0.95}
DRIFT, SLOW = "white + drift", 0.995
# White noise on a stage that creeps, of which the model has no creep.
RICHER = "richer truth"
NOISES = (*POLES, DRIFT, RICHER)
LEADING = 3000


def seed_of(case: str, noise: str, seed: int) -> int:
    """Seed of a cell, from its names."""
    return zlib.crc32(f"{case}|{noise}|{seed}".encode())


def noise_of(name: str, rng: np.random.Generator, count: int, size: float) -> np.ndarray:
    """Noise of a cell, whose standard deviation is `size`, with a drift 1.2 times that."""
    if name == DRIFT:
        return 0.6 * size * rng.standard_normal(count) + autoregression(rng, count, SLOW, size)
    return autoregression(rng, count, POLES.get(name, 0.0), size)


def autoregression(rng: np.random.Generator, count: int, pole: float, size: float) -> np.ndarray:
    """First-order autoregression of standard deviation `size`."""
    drawn = rng.standard_normal(count + LEADING) * size * np.sqrt(1.0 - pole**2)
    if pole == 0.0:
        return drawn[LEADING:]
    series, last = [], 0.0
    for innovation in drawn.tolist():
        last = pole * last + innovation
        series.append(last)
    return np.array(series[LEADING:])
