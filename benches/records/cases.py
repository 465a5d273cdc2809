"""Thirty cases of a seed: a stage, a record of it and a flaw, each kind several times."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import cycle, islice

import flaws
import numpy as np
import stages
from numpy.typing import NDArray

import records

Array = NDArray[np.float64]

CASES = 30
RATES = (500.0, 1000.0, 2000.0, 5000.0)  # Hz


@dataclass(frozen=True)
class Kinds:
    """Sorts of stage, record and flaw of a case."""

    stage: str
    record: str
    flaw: str


@dataclass(frozen=True)
class Case:
    """A record as a laboratory has it, and another motion of the same stage without noise."""

    kinds: Kinds
    dt: float
    u: Array
    y: Array
    noise: float  # of a reading [m]
    stroke: float  # of the stage in the record [m]
    other_u: Array
    other_y: Array


def plan(seed: int) -> list[Kinds]:
    """Deal the kinds to thirty cases: six of each stage, three or four of each record and flaw."""
    rng = np.random.default_rng(seed)
    hands = [
        rng.permutation(list(islice(cycle(rng.permutation(list(kinds)).tolist()), CASES))).tolist()
        for kinds in (stages.KINDS, records.KINDS, flaws.KINDS)
    ]
    return [Kinds(*kinds) for kinds in zip(*hands, strict=True)]


def make(seed: int, number: int) -> Case:
    """Make a case, the first being number 1."""
    kinds = plan(seed)[number - 1]
    rng = np.random.default_rng([seed, number])
    dt = 1.0 / rng.choice(RATES)
    n = int(np.clip(rng.uniform(2.0, 6.0) / dt, 2000, 10000))
    largest = float(rng.choice([10.0, 100.0, 150.0]))
    stage = stages.draw(kinds.stage, rng, largest)
    # A drive that jumps to its first sample has lost what came before it.
    lost = n // 4 if kinds.flaw == "jump" else 0
    t = np.arange(n + lost) * dt
    u = records.draw(kinds.record, rng, t, largest, from_zero=bool(rng.random() < 0.5))
    first = int(np.argmax(np.abs(u[: lost + 1])))
    t, u = t[:n], u[first : first + n]
    x = stage.simulate(u, dt)
    stroke = float(np.ptp(x))
    noise = float(rng.choice([0.0005, 0.001])) * stroke
    reading = flaws.KINDS[kinds.flaw](rng, t, x, noise)
    other_u = records.other_motion(u, dt)
    other_y = stage.simulate(other_u, dt)
    # A late sensor is late in every motion: what is due to it, no record tells from a lag.
    other_y = flaws.late(other_y) if kinds.flaw == "delay" else other_y
    return Case(kinds, dt, u, reading.y, reading.noise, stroke, other_u, other_y)
