"""Blocks that a drive is composed of: sines, triangles, steps, rests, sweeps and mixtures."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = ["SHORTEST", "Block", "Span", "blocks_of", "reach"]

# Samples of the shortest period, and share of the range below which a sine is left out.
SHORTEST, SMALLEST = 20, 0.02
# Share of the slew rate that a block uses, so that rounding stays below the limit.
USED = 0.999
# Share of its first turn that the last one of a triangle has.
LAST = 0.1
# Levels per block of the random steps.
LEVELS = (8, 32)


class Span(NamedTuple):
    """Range of a drive, and its largest change from sample to sample.

    Attributes
    ----------
    low, high : float
        Lowest and highest drive [V].
    step : float
        Slew rate times sampling interval [V].
    """

    low: float
    high: float
    step: float

    def at(self, share: float) -> float:
        """Return the drive at a share of the range [V]."""
        return self.low + share * (self.high - self.low)


class Block(NamedTuple):
    """A part of a drive.

    Attributes
    ----------
    text : str
        For a person.
    shape : callable
        Takes a number of samples, and returns that many voltages [V].
    """

    text: str
    shape: Callable[[int], Array]

    def after(self, volts: float, count: int, span: Span) -> Array | None:
        """Return its samples after a voltage, with the way there [V]; None if that is too fast."""
        first = float(self.shape(2)[0])
        way = reach(volts, first, span.step)[:count]
        samples = np.concatenate([way, self.shape(count - way.size)])
        return samples if _is_slow(np.concatenate([[volts], samples]), span) else None


def reach(start: float, end: float, step: float) -> Array:
    """Return the way from one voltage to another in steps of equal size, without the start [V].

    Examples
    --------
    >>> reach(0.0, 3.0, 2.0)
    array([1.5, 3. ])
    """
    count = math.ceil(abs(end - start) / step - 1e-9)
    return np.linspace(start, end, count + 1)[1:]


def blocks_of(
    span: Span, count: int, dt: float, seed: int, shortest: int = SHORTEST
) -> list[Block]:
    """List the blocks that a drive is chosen from.

    Parameters
    ----------
    span : Span
        Range of the drive.
    count : int
        Samples of a block.
    dt : float
        Sampling interval [s].
    seed : int
        Of the random steps.
    shortest : int, optional
        Samples of the shortest period.

    Returns
    -------
    list of Block
        Those that the slew rate allows.
    """
    every = [
        *_levels(span),
        *_sines(span, count, dt, shortest),
        *_triangles(span, count, dt),
        *_sweeps(span, count, dt, shortest),
        *_multisines(span, count, dt, seed, shortest),
        *_steps(span, count, seed),
    ]
    return [one for one in every if _is_slow(one.shape(count), span)]


def _is_slow(volts: Array, span: Span) -> bool:
    """Whether a drive keeps to its slew rate."""
    return volts.size < 2 or float(np.abs(np.diff(volts)).max()) <= span.step * (1.0 + 1e-9)


def _periods(count: int, shortest: int) -> list[float]:
    """Cycles per block, an octave apart."""
    most = count / shortest
    return [2.0**k for k in range(-1, 1 + max(0, int(math.log2(max(most, 1.0)))))]


def _levels(span: Span) -> Iterator[Block]:
    for share in (0.0, 0.25, 0.5, 0.75, 1.0):
        yield Block(f"rest at {100 * share:.0f} %", partial(np.full, fill_value=span.at(share)))
    yield Block("slow ramp up", lambda n: np.linspace(span.low, span.high, n))
    yield Block("slow ramp down", lambda n: np.linspace(span.high, span.low, n))


def _sines(span: Span, count: int, dt: float, shortest: int) -> Iterator[Block]:
    whole = span.high - span.low
    for cycles in _periods(count, shortest):
        rate = 2.0 * math.pi * cycles / count
        for low, high in ((0.0, 1.0), (0.0, 0.5), (0.25, 0.75), (0.5, 1.0), (0.4, 0.6)):
            size = min(0.5 * whole * (high - low), USED * span.step / rate)
            if 2.0 * size < SMALLEST * whole:
                continue
            middle = span.at(0.5 * (low + high))

            def shape(n: int, size: float = size, middle: float = middle, r: float = rate) -> Array:
                return np.asarray(middle - size * np.cos(r * np.arange(n)))

            ends = [100.0 * (middle + way * size - span.low) / whole for way in (-1.0, 1.0)]
            text = f"sine {cycles / (count * dt):.3g} Hz, {ends[0]:.0f} to {ends[1]:.0f} %"
            yield Block(text, shape)
        # A fast sine upon a slow one.
        fast = min(0.15 * whole, 0.5 * USED * span.step / rate)
        if cycles >= 8.0 and 2.0 * fast >= SMALLEST * whole:
            slow, middle = 0.5 * whole - fast, span.at(0.5)

            def both(
                n: int, fast: float = fast, slow: float = slow, r: float = rate, c: float = cycles
            ) -> Array:
                k = np.arange(n)
                return np.asarray(span.at(0.5) - slow * np.cos(r / c * k) - fast * np.cos(r * k))

            text = f"sine {1.0 / (count * dt):.3g} Hz with {cycles / (count * dt):.3g} Hz upon it"
            yield Block(text, both)


def _triangles(span: Span, count: int, dt: float) -> Iterator[Block]:
    whole = span.high - span.low
    for turns in (2, 4, 8, 16):
        size = min(whole, 0.5 * USED * span.step * count / turns)
        if size < 0.5 * whole:
            continue
        rate = f"{turns / (count * dt):.3g} Hz"
        for anchor, where in ((0.0, "lowest"), (0.5, "middle"), (1.0, "highest")):
            for way in ("shrinking", "growing"):
                shape = partial(_triangle, span, turns / count, turns, size, anchor, way)
                yield Block(f"{way} triangles {rate} about the {where} drive", shape)


def _triangle(
    span: Span, rate: float, turns: int, size: float, anchor: float, way: str, count: int
) -> Array:
    """Triangles of `rate` turns per sample, whose size changes from turn to turn."""
    turn = rate * np.arange(count)
    number = np.minimum(np.floor(turn), turns - 1)
    part = 1.0 - (1.0 - LAST) * number / max(turns - 1, 1)
    if way == "growing":
        part = 1.0 + LAST - part
    phase = turn - number
    wave = 1.0 - np.abs(2.0 * phase - 1.0)
    if anchor == 1.0:
        wave = -wave
    elif anchor == 0.5:
        late = phase - 0.25
        wave = 0.5 - 2.0 * np.abs(late - np.round(late))
    return np.asarray(span.at(anchor) + size * part * wave)


def _sweeps(span: Span, count: int, dt: float, shortest: int) -> Iterator[Block]:
    octaves = math.log(max(count / shortest, 2.0))
    rate = 2.0 * math.pi / count
    half = 0.5 * (span.high - span.low)

    def shape(n: int) -> Array:
        growth = np.exp(octaves * np.arange(n) / count)
        size = np.minimum(half, 0.8 * span.step / (rate * growth))
        return np.asarray(span.at(0.5) - size * np.cos(2.0 * math.pi * (growth - 1.0) / octaves))

    top = math.exp(octaves) / (count * dt)
    yield Block(f"sweep {1.0 / (count * dt):.3g} to {top:.3g} Hz", shape)


def _multisines(span: Span, count: int, dt: float, seed: int, shortest: int) -> Iterator[Block]:
    """Add up sines whose amplitudes fall with the root of the frequency."""
    for most in (4.0, 16.0, count / shortest):
        if not 2.0 <= most <= count / shortest:
            continue
        lines = np.geomspace(1.0, most, 10)
        phases = np.random.default_rng([seed, int(most)]).uniform(0.0, 2.0 * math.pi, lines.size)
        turns = 2.0 * math.pi * np.outer(np.arange(count) / count, lines) + phases
        table = np.asarray(np.sin(turns) @ lines**-0.5)
        size = (span.high - span.low) / float(np.ptp(table))
        size = min(size, USED * span.step / float(np.abs(np.diff(table)).max()))
        table = span.at(0.5) + size * (table - 0.5 * float(table.max() + table.min()))
        rate = 1.0 / (count * dt)
        text = f"ten sines {rate:.3g} to {most * rate:.3g} Hz"
        yield Block(text, partial(_begin, table))


def _steps(span: Span, count: int, seed: int) -> Iterator[Block]:
    for levels in LEVELS:
        if count < 4 * levels:
            continue
        shares = np.random.default_rng([seed, levels]).uniform(size=levels)
        volts = [span.at(float(share)) for share in shares]
        parts, last = [], volts[0]
        for k, volt in enumerate(volts):
            length = (k + 1) * count // levels - k * count // levels
            way = reach(last, volt, span.step)[:length]
            parts.append(np.concatenate([way, np.full(length - way.size, volt)]))
            last = float(parts[-1][-1])
        table = np.concatenate(parts)
        yield Block(f"{levels} random steps", partial(_begin, table))


def _begin(table: Array, count: int) -> Array:
    return table[:count]
