"""Flaws of a record, and the sentences that name them."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Callable

Array = NDArray[np.float64]

DELAY = 3  # samples by which the sensor is late
SPIKES = 8  # readings far off


@dataclass(frozen=True)
class Reading:
    """Readings of a sensor [m], and the noise of each [m], that of rounding with it."""

    y: Array
    noise: float


def late(y: Array) -> Array:
    """Return readings that come late, of a stage at rest before."""
    return np.concatenate([np.full(DELAY, y[0]), y[:-DELAY]])


def _delay(rng: np.random.Generator, t: Array, x: Array, noise: float) -> Reading:
    return _none(rng, t, late(x), noise)


def _none(rng: np.random.Generator, t: Array, x: Array, noise: float) -> Reading:  # noqa: ARG001
    return Reading(x + rng.normal(0.0, noise, len(x)), noise)


def _drift(rng: np.random.Generator, t: Array, x: Array, noise: float) -> Reading:
    moved = -np.expm1(-t / (t[-1] * np.exp(rng.uniform(np.log(0.2), np.log(5.0)))))
    share = rng.uniform(0.01, 0.03) * rng.choice([-1.0, 1.0])
    return _none(rng, t, x + share * np.ptp(x) * moved / moved[-1], noise)


def _hum(rng: np.random.Generator, t: Array, x: Array, noise: float) -> Reading:
    phase = 2.0 * np.pi * (rng.choice([50.0, 60.0]) * t + rng.random())
    return _none(rng, t, x + rng.uniform(3.0, 6.0) * noise * np.sin(phase), noise)


def _spikes(rng: np.random.Generator, t: Array, x: Array, noise: float) -> Reading:
    y, at = _none(rng, t, x, noise).y, rng.choice(len(x), SPIKES, replace=False)
    y[at] += rng.uniform(0.05, 0.5, SPIKES) * rng.choice([-1.0, 1.0], SPIKES) * np.ptp(x)
    return Reading(y, noise)


def _saturated(rng: np.random.Generator, t: Array, x: Array, noise: float) -> Reading:
    top = x.min() + rng.uniform(0.85, 0.95) * np.ptp(x)
    return Reading(np.minimum(_none(rng, t, x, noise).y, top), noise)


def _quantised(rng: np.random.Generator, t: Array, x: Array, noise: float) -> Reading:
    step = rng.uniform(4.0, 8.0) * noise
    y = step * np.round(_none(rng, t, x, noise).y / step)
    return Reading(y, float(np.hypot(noise, step / np.sqrt(12.0))))


def _missing(rng: np.random.Generator, t: Array, x: Array, noise: float) -> Reading:
    y = _none(rng, t, x, noise).y
    for at in rng.integers(1, len(y) - 21, 5):
        y[at : at + rng.integers(1, 20)] = np.nan
    return Reading(y, noise)


# "jump" is made with the drive: the first part of it is cut off, and the stage was at rest.
KINDS: dict[str, Callable[[np.random.Generator, Array, Array, float], Reading]] = {
    "none": _none,
    "delay": _delay,
    "drift": _drift,
    "hum": _hum,
    "spikes": _spikes,
    "saturated": _saturated,
    "quantised": _quantised,
    "NaN": _missing,
    "jump": _none,
}

# What a sentence has to say to name a flaw. A stage of a kind that the package does not have is
# named by a sentence that no model describes it, where the record has no flaw.
NAMED = {
    "none": r"no kind|no model|cannot describe|does not fit",
    "delay": r"delay|\blate\b|\blag\b(?! from 0 )",
    "drift": r"drift",
    "hum": r"\bhum\b|mains|[56]0(\.\d+)? Hz",
    "spikes": r"spike|outlier|far off|single reading|left out",
    "saturated": r"saturat|clipped|cut off|at its end",
    "quantised": r"quanti[sz]|resolution|readings? (go|come|change)s? in steps",
    "NaN": r"missing|drop|fill",
    "jump": r"jump|from the motion before the record|began",
}

# A sentence that says, of whatever cause, that the model may not hold.
DOUBT = (
    r"no kind|no model|cannot describe|does not|times the noise|fits equally well|"
    r"at this rate only|not determine|more than a sensor|of the squared residual|not fitted|"
    r"shorter than a period|"
    r"goes from .* that of the record|ill-conditioned"
)


def names(flaw: str, sentences: list[str]) -> bool:
    """Whether a sentence names a flaw."""
    return any(re.search(NAMED[flaw], sentence, re.IGNORECASE) for sentence in sentences)


def doubts(sentences: list[str]) -> bool:
    """Whether a sentence says that the model may not hold."""
    return any(re.search(DOUBT, sentence, re.IGNORECASE) for sentence in sentences)
