"""The default call on records of random stages: the mode found, the residual near the noise."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

STIFFNESS = 1e6


def steps(rng: np.random.Generator, t: Array) -> Array:
    levels: Array = rng.uniform(0.0, 75.0, 30)
    return np.repeat(levels, t.size // 30)


def chirp(rng: np.random.Generator, t: Array) -> Array:
    span, top = t[-1], rng.uniform(150.0, 300.0)
    phase = 2.0 * np.pi * (t + 0.5 * (top - 1.0) * t**2 / span)
    swept: Array = 37.5 + 35.0 * np.sin(phase) / (1.0 + 1.5 * t / span)
    return swept


def noise(rng: np.random.Generator, t: Array) -> Array:
    fast = np.convolve(rng.normal(size=t.size), np.ones(5) / 5.0, "same")
    slow = np.cumsum(rng.normal(size=t.size))
    both = 20.0 * fast + slow - np.linspace(slow[0], slow[-1], t.size)
    held: Array = 37.5 + 35.0 * both / np.abs(both).max()
    return held


def stepped_sine(rng: np.random.Generator, t: Array) -> Array:
    slow: Array = 18.75 * (1.0 - np.cos(2.0 * np.pi * t))
    return slow + np.where(t > 0.5 * t[-1], rng.uniform(20.0, 37.0), 0.0)


def two_tones(rng: np.random.Generator, t: Array) -> Array:
    one, two = rng.uniform(1.0, 3.0), rng.uniform(5.0, 9.0)
    tones: Array = (
        37.5 - 22.0 * np.cos(2.0 * np.pi * one * t) + 14.0 * np.sin(2.0 * np.pi * two * t)
    )
    return tones


def triangle(rng: np.random.Generator, t: Array) -> Array:
    place = (rng.uniform(1.5, 3.0) * t) % 1.0
    size: Array = np.where(t < 0.5 * t[-1], 75.0, 50.0)
    return size * (1.0 - np.abs(2.0 * place - 1.0))


def staircase(_rng: np.random.Generator, t: Array) -> Array:
    levels = np.r_[0.0:75.0:7.5, 75.0:0.0:-7.5, 0.0:50.0:7.5, 50.0:10.0:-7.5]
    return np.repeat(levels, -(-t.size // levels.size))[: t.size]


QUICK = (steps, chirp, noise, stepped_sine)
SLOW = (two_tones, triangle, staircase)


@dataclass(frozen=True)
class Case:
    """A record, and what is known of it."""

    log: pt.Dataset
    noise: float
    frequency: float | None


def plays(
    rng: np.random.Generator, frequency: float | None, sign: float
) -> pt.PrandtlIshlinskiiStage:
    count, zones = int(rng.integers(3, 11)), int(rng.integers(0, 3)) if sign > 0.0 else 0
    return pt.PrandtlIshlinskiiStage(
        linear=sign * 8e-7,
        thresholds=tuple(np.sort(rng.uniform(1.0, 35.0, count))),
        weights=tuple(sign * rng.uniform(0.1, 2.0, count) * 4e-7 / count),
        dead_zone_thresholds=tuple(np.sort(rng.uniform(10e-6, 60e-6, zones))),
        dead_zone_weights=tuple(rng.uniform(-0.1, 0.15, zones)),
        frequency=frequency,
        damping_ratio=damping(rng) if frequency else None,
    )


def damping(rng: np.random.Generator) -> float:
    return float(np.exp(rng.uniform(np.log(0.02), np.log(0.3))))


def mechanics(rng: np.random.Generator, frequency: float | None) -> dict[str, Any]:
    mass = STIFFNESS / (2.0 * np.pi * (frequency or 3000.0)) ** 2
    return {
        "mass": mass,
        "damping": 2.0 * damping(rng) * np.sqrt(STIFFNESS * mass),
        "stiffness": STIFFNESS,
    }


def dahl(rng: np.random.Generator, frequency: float | None, sign: float) -> pt.stages.Stage:
    return pt.FirstOrderDahlStage(
        **mechanics(rng, frequency),
        piezo_coefficient=sign * 1.6,
        rest_stiffness=rng.uniform(0.1, 0.35) * STIFFNESS,
        coulomb_force=rng.uniform(3.0, 12.0),
    )


def bouc_wen(rng: np.random.Generator, frequency: float | None, sign: float) -> pt.stages.Stage:
    return pt.BoucWenStage(
        **mechanics(rng, frequency),
        piezo_coefficient=sign * 1.6e-6,
        alpha=rng.uniform(0.1, 0.35),
        beta=rng.uniform(0.015, 0.05),
        gamma=rng.uniform(-0.005, 0.015),
    )


def case(i: int, stage_of: Callable[..., pt.stages.Stage], *, quick: bool) -> Case:
    """Record of a random stage in equilibrium at its first sample."""
    rng = np.random.default_rng([11, i])
    rate = (1000.0, 5000.0)[i % 2]
    t = np.arange(3000) / rate
    kinds = QUICK if quick else SLOW
    frequency = float(rng.choice([60.0, 160.0])) if quick else None
    stage = stage_of(rng, frequency, -1.0 if i % 5 == 4 else 1.0)
    u = kinds[i % len(kinds)](rng, t)
    x = stage.simulate(u, 1.0 / rate, initial=stage.equilibrium([float(u[0])])).x
    size = float(np.exp(rng.uniform(np.log(1e-8), np.log(1e-3 * np.ptp(x)))))
    y = x + size * rng.normal(size=x.size) + rng.uniform(-1e-5, 1e-5)
    return Case(pt.Dataset(u=u, y=y, dt=1.0 / rate), size, frequency)


def natural_frequency(model: pt.stages.Stage) -> float | None:
    if not isinstance(model, (pt.FirstOrderDahlStage, pt.BoucWenStage, pt.ParallelDahlStage)):
        # Hysteresis at the input, dynamics behind it.
        frequency: float | None = getattr(model, "frequency")  # noqa: B009
        return frequency
    return float(np.sqrt(model.stiffness / model.mass) / (2.0 * np.pi))


def score(cases: list[tuple[Case, pt.identification.Identification]]) -> tuple[int, int]:
    """How many fits are within three times the noise, and how many have the mode."""
    near = sum(fit.cost < 3.0 * one.noise for one, fit in cases)
    frequencies = [natural_frequency(fit.model) for _, fit in cases]
    modes = sum(
        one.frequency is not None and fn is not None and abs(fn / one.frequency - 1.0) < 0.05
        for (one, _), fn in zip(cases, frequencies, strict=True)
    )
    return near, modes


@pytest.mark.slow
def test_plays_on_records_of_plays() -> None:
    quick = [case(i, plays, quick=True) for i in range(12)]
    slow = [case(i, plays, quick=False) for i in range(8)]
    name = "prandtl-ishlinskii"
    near, modes = score([(one, pt.identify(one.log, name)) for one in quick])
    assert modes >= 11
    assert near >= 11
    near, _ = score([(one, pt.identify(one.log, name)) for one in slow])
    assert near >= 7


@pytest.mark.slow
@pytest.mark.parametrize("stage_of", [dahl, bouc_wen])
def test_the_default_call_on_records_of_other_kinds(
    stage_of: Callable[..., pt.stages.Stage],
) -> None:
    quick = [case(i, stage_of, quick=True) for i in range(4)]
    slow = [case(i, stage_of, quick=False) for i in range(3)]
    near, modes = score([(one, pt.identify(one.log, progress=False)) for one in quick])
    assert modes >= 3
    assert near >= 2
    near, _ = score([(one, pt.identify(one.log, progress=False)) for one in slow])
    assert near >= 1


@pytest.mark.slow
def test_two_modes() -> None:
    both = 0
    for i in range(6):
        rng = np.random.default_rng([12, i])
        t = np.arange(3000) / 1000.0
        frequency, further = 60.0, rng.uniform(120.0, 200.0)
        stage = replace(
            plays(rng, frequency, 1.0),
            mode_weights=(rng.uniform(0.1, 0.4),),
            mode_frequencies=(further,),
            mode_damping_ratios=(rng.uniform(0.02, 0.1),),
        )
        u = steps(rng, t)
        x = stage.simulate(u, 1e-3, initial=stage.equilibrium([float(u[0])])).x
        y = x + 2e-8 * rng.normal(size=x.size)
        model = pt.identify(pt.Dataset(u=u, y=y, dt=1e-3), "prandtl-ishlinskii").model
        assert isinstance(model, pt.PrandtlIshlinskiiStage)
        found = np.array([model.frequency or np.nan, *model.mode_frequencies])
        both += all(np.min(np.abs(found / one - 1.0)) < 0.05 for one in (frequency, further))
    assert both >= 5


def test_the_search_keeps_to_the_mode_that_the_record_shows() -> None:
    record = case(0, dahl, quick=True)
    short = pt.ParticleSwarm(particles=4, iterations=1, polish=False)
    fit = pt.identify(
        record.log,
        "first-order-dahl",
        method=replace(short, runs=1),
        history="virgin",
        progress=False,
    )
    bounds = fit.parameters["mass"].bounds
    assert bounds is not None
    slowest, fastest = (np.sqrt(STIFFNESS / mass) / (2.0 * np.pi) for mass in bounds[::-1])
    assert record.frequency is not None
    assert slowest < record.frequency < fastest < 3.0 * slowest


def test_plays_gather_where_those_of_the_stage_are() -> None:
    stage = pt.PrandtlIshlinskiiStage(
        linear=8e-7, thresholds=(3.8, 20.8, 26.8, 31.0), weights=(2e-8, 1e-7, 1e-7, 1.1e-7)
    )
    t = np.arange(3000) / 1000.0
    u = 37.5 - 22.0 * np.cos(14.0 * t) + 15.5 * np.sin(43.0 * t)
    x = stage.simulate(u, 1e-3, initial=stage.equilibrium([float(u[0])])).x
    noise = 1e-8
    y = x + noise * np.random.default_rng(2).normal(size=x.size)
    fit = pt.identify(pt.Dataset(u=u, y=y, dt=1e-3), "prandtl-ishlinskii")
    assert fit.cost < 1.2 * noise
