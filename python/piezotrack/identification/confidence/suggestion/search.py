"""Choice of the blocks of a drive whose record has the most information."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ....errors import NumericalError
from .blocks import SHORTEST, Block, Span, blocks_of, reach

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ....stages.motion import StageState
    from .information import Truth

    Array = NDArray[np.float64]

__all__ = ["COUNTS", "FEWEST", "DriveSearch", "Plan"]

# Accuracy of the displacement in the choice of blocks [m].
ROUGH = 1e-8
# Numbers of blocks that are tried, and the least samples of a block.
COUNTS, FEWEST = (4, 8, 16), 25
# Samples times values from which on blocks are judged by every second sample, and so on.
BUDGET, THINNEST = 60_000, 10
# Blocks of a place that are tried again after the others are chosen, and times that it is done.
AGAIN, SWEEPS = 5, 2
# Cycles of the plain sine.
CYCLES = 4.0


class _Place(NamedTuple):
    """Where a drive has come to: voltage, states, products so far, and time [s]."""

    volts: float
    states: Sequence[StageState | None]
    gram: Array
    samples: int


class Plan(NamedTuple):
    """Blocks by their numbers, and the logarithm of the determinant."""

    chosen: tuple[int, ...]
    score: float


class DriveSearch:
    """The choice of blocks."""

    def __init__(
        self, truth: Truth, span: Span, samples: int, dt: float, noise: float, seed: int
    ) -> None:
        self.truth, self.span, self.dt, self.noise = truth.one_sided(), span, dt, noise
        self.thin = min(THINNEST, -(-samples * len(truth.pairs) // BUDGET))
        self.home = min(max(0.0, span.low), span.high)
        self.samples = samples
        # The way back is kept free at the end.
        way = max(abs(self.home - span.low), abs(span.high - self.home)) / span.step
        self.room = samples - 1 - math.ceil(way)
        self.blocks = {
            count: blocks_of(span, self._length(count), dt, seed, max(SHORTEST, 4 * self.thin))
            for count in self.counts()
        }
        states = self.truth.beginning(self.home)
        self.begin = _Place(self.home, states, self.truth.gram_at_rest(states), 1)

    def counts(self) -> list[int]:
        """Numbers of blocks that leave enough samples for each."""
        return [n for n in COUNTS if self.room // n >= FEWEST] or [COUNTS[0]]

    def _length(self, count: int) -> int:
        """Return the samples of each of so many blocks, a multiple of the thinning."""
        return self.room // count // self.thin * self.thin

    def plan(self, count: int) -> Plan:
        """Choose the blocks of a drive of so many."""
        place, chosen, ranks = self.begin, [], []
        for _ in range(count):
            after = [self._after(place, block, count) for block in self.blocks[count]]
            scores = [self._score(one) for one in after]
            rank = sorted(range(len(scores)), key=lambda k: (-scores[k], k))
            best = after[rank[0]]
            if best is None:
                raise NumericalError("the stage cannot be simulated under any of the blocks")
            place = best
            chosen.append(rank[0])
            ranks.append(rank[1 : 1 + AGAIN])
        plan = Plan(tuple(chosen), self._score(place))
        for _ in range(SWEEPS):
            exchanged = self._exchanged(plan, ranks)
            if exchanged.chosen == plan.chosen:
                break
            plan = exchanged
        return plan

    def _exchanged(self, plan: Plan, ranks: list[list[int]]) -> Plan:
        """Try other blocks in each place in turn, and keep those that are better."""
        count, place = len(plan.chosen), self.begin
        for k in range(count):
            for other in ranks[k]:
                chosen = (*plan.chosen[:k], other, *plan.chosen[k + 1 :])
                found = self._score(self._through(place, chosen[k:], count))
                if found > plan.score + 1e-9:
                    plan = Plan(chosen, found)
            following = self._through(place, plan.chosen[k : k + 1], count)
            assert following is not None
            place = following
        return plan

    def _through(self, place: _Place, chosen: Sequence[int], count: int) -> _Place | None:
        following: _Place | None = place
        for k in chosen:
            if following is None:
                return None
            following = self._after(following, self.blocks[count][k], count)
        return following

    def _after(self, place: _Place, block: Block, count: int) -> _Place | None:
        """Where a block leads to; None where it is too fast from there, or cannot be simulated."""
        u = block.after(place.volts, self._length(count), self.span)
        if u is None:
            return None
        judged, dt = u[self.thin - 1 :: self.thin], self.thin * self.dt
        try:
            columns, states = self.truth.after(place.states, place.volts, judged, dt, ROUGH)
        except NumericalError:
            return None
        t = self.dt * (place.samples - 1) + dt * np.arange(1, judged.size + 1, dtype=np.float64)
        gram = place.gram + self.thin * self.truth.gram_of(columns, t)
        return _Place(float(u[-1]), states, gram, place.samples + u.size)

    def _score(self, place: _Place | None) -> float:
        return -math.inf if place is None else self.truth.score(place.gram, self.noise)

    def whole(self, plan: Plan) -> Array:
        """Drive of a plan, from home and back [V]."""
        count = len(plan.chosen)
        return self._whole([self.blocks[count][k] for k in plan.chosen], self._length(count))

    def _whole(self, blocks: Sequence[Block], length: int) -> Array:
        parts = [np.array([self.home])]
        for block in blocks:
            part = block.after(float(parts[-1][-1]), length, self.span)
            assert part is not None
            parts.append(part)
        parts.append(reach(float(parts[-1][-1]), self.home, self.span.step))
        u = np.concatenate(parts)
        rest = np.full(self.samples - u.size, self.home)
        whole: Array = np.concatenate([u, rest])
        return whole.clip(self.span.low, self.span.high)

    def sine(self) -> Array:
        """Plain sine over the whole range [V]."""
        half = 0.5 * (self.span.high - self.span.low)
        cycles = min(CYCLES, 0.9 * self.room * self.span.step / (2.0 * math.pi * half))
        rate = 2.0 * math.pi * cycles / self.room

        def shape(count: int) -> Array:
            return np.asarray(self.span.at(0.5) - half * np.cos(rate * np.arange(count)))

        return self._whole([Block("sine", shape)], self.room)
