"""Stages that differ from the one that the controllers were tuned for, and usual references."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..._support.arguments import as_numbers
from ...errors import ParameterError
from ...references.waveforms import multisine, sine, staircase, triangle
from ..plant import displacement_range, lowest_settled_displacement

if TYPE_CHECKING:
    from ...references.reference import Reference
    from ...stages.base import Stage
    from ...stages.virtual import VirtualStage

__all__ = ["Variant", "usual_references", "variants"]

# Periods of a usual reference, the first of which is its smooth start.
PERIODS = 6
# Part of the stroke about its middle.
STROKE = 0.6
# Reach of the stage, sampled like this [s].
REACH_STEP = 1e-3
# Samples of the longest usual reference.
MOST_SAMPLES = 2e6


class Variant(NamedTuple):
    """A stage, and the delay of its loop [s] in addition to the usual one."""

    name: str
    stage: VirtualStage
    delay: float


def variants(stage: VirtualStage) -> list[Variant]:
    """Make the stage itself, and with other gains, more delay and a slower mode."""
    return [
        Variant("as tuned for", stage, 0.0),
        Variant("1.3 times the gain", replace(stage, stage=_amplified(stage.stage, 1.3)), 0.0),
        Variant("0.7 times the gain", replace(stage, stage=_amplified(stage.stage, 0.7)), 0.0),
        Variant("1 ms more delay", stage, 1e-3),
        Variant("dynamics 10 % slower", replace(stage, stage=_slowed(stage.stage, 0.9)), 0.0),
    ]


def _amplified(stage: Stage, factor: float) -> Stage:
    """Scale the displacement of a stage for the same voltage, as far as its model allows."""
    names: tuple[str, ...] = ("linear", "weights", "dead_zone_thresholds")
    if any(one.name == "piezo_coefficient" for one in fields(stage)):  # type: ignore[arg-type]
        names = ("piezo_coefficient",)
    return _scaled(stage, dict.fromkeys(names, factor))


def _slowed(stage: Stage, rate: float) -> Stage:
    """Make all linear dynamics of a stage slower."""
    factors = {
        "frequency": rate,
        "mode_frequencies": rate,
        "time_constant": 1.0 / rate,
        "mass": 1.0 / rate**2,
        "damping": 1.0 / rate,
    }
    return _scaled(stage, factors)


def _scaled(stage: Stage, factors: dict[str, float]) -> Stage:
    """Multiply those parameters of a stage that it has."""
    changed: dict[str, Any] = {}
    for parameter in fields(stage):  # type: ignore[arg-type]
        value = getattr(stage, parameter.name)
        if parameter.name in factors and value is not None:
            changed[parameter.name] = (np.array(value) * factors[parameter.name]).tolist()
    return replace(stage, **changed)  # type: ignore[type-var]


def usual_references(
    stage: VirtualStage,
    limits: tuple[float, float],
    rates: tuple[float, float, float],
    dt: float,
) -> list[Reference]:
    """Make a sine at three rates, a triangle, a staircase and a random motion within reach."""
    rates = _checked(rates, dt)
    _, top = displacement_range(stage, limits, REACH_STEP)
    # Once up, the stage no longer comes all the way down.
    bottom = lowest_settled_displacement(stage, limits, top, REACH_STEP)
    middle, half = 0.5 * (bottom + top), 0.5 * STROKE * (top - bottom)
    low, high = middle - half, middle + half
    slow, medium, fast = rates
    sines = [sine(frequency=rate, low=low, high=high, duration=PERIODS / rate) for rate in rates]
    draws = np.random.default_rng(1)
    # Whole multiples of a basis, so that the motion repeats.
    basis = slow / 2.0
    tones = basis * np.sort(draws.choice(np.arange(1, max(8, int(fast / basis))), 6, replace=False))
    return [
        *sines,
        triangle(frequency=medium, low=low, high=high, duration=PERIODS / medium),
        staircase(dwell=1.0 / medium, steps=6, low=low, high=high),
        multisine(frequencies=tones, low=low, high=high, duration=3.0 / basis, seed=1),
    ]


def _checked(rates: tuple[float, float, float], dt: float) -> tuple[float, float, float]:
    """Check that rates rise, and what they ask of samples every `dt` seconds."""
    listed = as_numbers("rates", rates)
    if len(listed) != 3 or not 0.0 < listed[0] < listed[1] < listed[2]:
        raise ParameterError("rates", listed, "three rates in Hz in rising order")
    slow, medium, fast = listed
    if not fast < 0.5 / dt:
        raise ParameterError(
            "rates",
            f"{fast:g} Hz",
            f"one below half the sampling rate, {0.5 / dt:.6g} Hz",
            verb="ends with",
        )
    if PERIODS / slow / dt > MOST_SAMPLES:
        least = PERIODS / MOST_SAMPLES / dt
        raise ParameterError(
            "rates",
            f"{slow:g} Hz",
            f"{least:.3g} Hz or more, of which {PERIODS} periods are {MOST_SAMPLES:g} samples "
            f"of {dt:g} s",
            verb="begins with",
        )
    return slow, medium, fast
