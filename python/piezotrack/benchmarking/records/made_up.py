"""Made-up stages: plays, and one thing more in each: creep, a mode, asymmetry, or rate.

All have ten plays and a stroke of about 40 um at 0 to 100 V, and noise of 20 nm. What is fitted is
a sine whose amplitude falls to a fifth; the rest of the record repeats it in other steps, and the
other record is another motion. The stage whose plays depend on the rate is also judged at another
rate than the one that is fitted; one record of it has three rates, and is judged at each of them.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ...data.dataset import Dataset
from ...stages.plays.prandtl_ishlinskii import PrandtlIshlinskiiStage
from ..record import BenchmarkRecord

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Motion = Callable[[Array, float], Array]

__all__ = ["RECORDS", "rate_dependent_plays"]

NOISE = 20e-9
LINEAR = 0.3e-6
THRESHOLDS = np.linspace(4.0, 40.0, 10)
WEIGHTS = 0.03e-6 * np.exp(-THRESHOLDS / 25.0)
# Samples in a cycle, and cycles in each part.
CYCLE, CYCLES = 200, 12
# Of the record of several rates: frequencies [Hz], cycles of each in a part, samples in a second.
RATES = {0.1: 1, 1.0: 4, 10.0: 24}
SAMPLES = 400.0
# Lag of the thresholds behind the rate: V per V/s.
RATE = 2e-3


# What each stage of plays has besides, and the drive's frequency [Hz].
ONE_MORE: tuple[tuple[str, dict[str, Any], float], ...] = (
    ("creep", {"creep_weights": (0.02, 0.02), "creep_times": (1.0, 10.0)}, 1.0),
    ("mode", {"frequency": 300.0, "damping_ratio": 0.05}, 20.0),
    (
        "asymmetry",
        {"dead_zone_thresholds": (12e-6, 26e-6), "dead_zone_weights": (-0.1, -0.12)},
        1.0,
    ),
)


def rate_dependent_plays(u: Array, dt: float) -> Array:
    """Simulate plays whose thresholds grow with the rate of the drive.

    Al Janaideh and Krejci 2013, doi 10.1109/TMECH.2012.2205265: the play with the threshold
    r(t) = r + beta abs(u'), so that z follows max(u - r, min(u + r, z)) at each instant.

    Parameters
    ----------
    u : ndarray, shape (n,)
        Drive [V].
    dt : float
        Sampling interval [s].

    Returns
    -------
    ndarray, shape (n,)
        Displacement [m].
    """
    rate = np.abs(np.gradient(u, dt))
    x, z = np.empty(u.size), np.zeros(THRESHOLDS.size)
    for k, (volts, fast) in enumerate(zip(u, rate, strict=True)):
        r = THRESHOLDS + RATE * fast
        z = np.maximum(volts - r, np.minimum(volts + r, z))
        x[k] = LINEAR * volts + WEIGHTS @ z
    return x


def _plays(more: dict[str, Any], u: Array, dt: float) -> Array:
    stage = PrandtlIshlinskiiStage(
        linear=LINEAR, thresholds=tuple(THRESHOLDS), weights=tuple(WEIGHTS), **more
    )
    return stage.simulate(u, dt).x


def _falling(seed: int, cycles: int = CYCLES, samples: int = CYCLE) -> Array:
    """Cycles from 0 V whose heights fall to a fifth, in another order for each seed."""
    heights = np.linspace(100.0, 20.0, cycles)
    heights[1:] = np.random.default_rng(seed).permutation(heights[1:])
    phase = 2.0 * np.pi * np.arange(samples) / samples
    return np.concatenate([0.5 * height * (1.0 - np.cos(phase)) for height in heights])


def _of_three_rates(seed: int) -> Array:
    """Cycles of 0.1 Hz, 1 Hz and 10 Hz, one after the other in one record."""
    parts = [
        _falling(seed + k, cycles, round(SAMPLES / frequency))
        for k, (frequency, cycles) in enumerate(RATES.items())
    ]
    return np.concatenate(parts)


def _wandering(seed: int) -> Array:
    """Add three sines about the middle."""
    t = np.arange(CYCLE * CYCLES) / CYCLE
    shifts = 2.0 * np.pi * np.random.default_rng(seed).random(3)
    parts = [
        np.sin(2.0 * np.pi * f * t + s) for f, s in zip((0.31, 0.83, 1.7), shifts, strict=True)
    ]
    # From 0 V, so that the first cycle begins at rest.
    u = 50.0 * (1.0 + np.sum(parts, axis=0) / 3.0) * np.minimum(1.0, t / 2.0)
    return np.asarray(u, dtype=np.float64)


def _log(u: Array, motion: Motion, frequency: float, seed: int) -> Dataset:
    """Simulate a drive at a number of cycles in a second, with noise."""
    return _noisy(u, motion, 1.0 / (CYCLE * frequency), seed)


def _noisy(u: Array, motion: Motion, dt: float, seed: int) -> Dataset:
    noise = NOISE * np.random.default_rng(seed).standard_normal(u.size)
    return Dataset(u=u, y=motion(u, dt) + noise, dt=dt)


def _made(
    name: str, title: str, motion: Motion, frequency: float, also: float | None = None
) -> BenchmarkRecord:
    """Make the record of a stage, the rest of it, another motion, and one at the rate `also`."""
    whole = _log(np.concatenate([_falling(1), _falling(2)]), motion, frequency, 3)
    middle = float(whole.t[CYCLE * CYCLES])
    others = {"other": _log(_wandering(4), motion, frequency, 5)}
    if also is not None:
        others[f"at {also:g} Hz"] = _log(_wandering(4), motion, also, 6)
    return BenchmarkRecord(
        name=name,
        title=title,
        fitted=whole[:middle],
        rest=whole[middle:],
        others=others,
        noise=NOISE,
    )


def _of_plays(name: str, more: dict[str, Any], frequency: float) -> BenchmarkRecord:
    return _made(name, name, partial(_plays, more), frequency)


def _of_rate(frequency: float) -> BenchmarkRecord:
    name, also = f"rate-{frequency:g}hz", 1.0 if frequency == 10.0 else 10.0
    return _made(name, f"rate: {frequency:g} Hz", rate_dependent_plays, frequency, also)


def _of_rates() -> BenchmarkRecord:
    """Make one record of all rates, judged on another of them and at each rate alone."""
    u = _of_three_rates(1)
    whole = _noisy(np.concatenate([u, _of_three_rates(11)]), rate_dependent_plays, 1 / SAMPLES, 3)
    middle = float(whole.t[u.size])
    others = {
        f"at {frequency:g} Hz": _log(_wandering(4), rate_dependent_plays, frequency, 6 + k)
        for k, frequency in enumerate(RATES)
    }
    return BenchmarkRecord(
        name="rate-three",
        title="rate: 0.1, 1 and 10 Hz",
        fitted=whole[:middle],
        rest=whole[middle:],
        others=others,
        noise=NOISE,
    )


RECORDS: Mapping[str, Callable[[], BenchmarkRecord]] = (
    {name: partial(_of_plays, name, more, frequency) for name, more, frequency in ONE_MORE}
    | {f"rate-{frequency:g}hz": partial(_of_rate, frequency) for frequency in RATES}
    | {"rate-three": _of_rates}
)
