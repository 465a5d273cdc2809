"""Drives as laboratories apply them, from -1 to 1 or, from rest at the lower end, from 0 to 1."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
# Drives begin at 0, between -1 and 1, or at -1: a drive from 0 V upwards is moved and scaled later.
Drive = Callable[[np.random.Generator, Array, float], Array]


def _through(t: Array, points: list[float], *, smooth: bool = False) -> Array:
    """Lead through turning points; a way takes as long as it is far."""
    at = np.asarray(points)
    times = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(at)))])
    s = t / (t[-1] + t[1]) * times[-1]
    k = np.clip(np.searchsorted(times, s, side="right") - 1, 0, len(at) - 2)
    share = (s - times[k]) / (times[k + 1] - times[k])
    if smooth:
        share = 0.5 - 0.5 * np.cos(np.pi * share)
    way: Array = at[k] + share * (at[k + 1] - at[k])
    return way


def biased_sine(rng: np.random.Generator, t: Array, start: float) -> Array:  # noqa: ARG001
    """Return periods of a sine from its lower end."""
    periods = rng.uniform(3.0, 6.0)
    v: Array = -np.cos(2.0 * np.pi * periods * t / t[-1])
    return v


def sine_with_jump(rng: np.random.Generator, t: Array, start: float) -> Array:
    """Return a sine that begins well above the rest at its start."""
    phase = rng.uniform(0.0, 0.5) + 0.3 * start + 0.3
    v: Array = np.sin(2.0 * np.pi * rng.uniform(3.0, 6.0) * t / t[-1] + phase)
    return v


def steps(rng: np.random.Generator, t: Array, start: float) -> Array:
    """Return a staircase up and down, or steps to random levels."""
    if rng.random() < 0.5:
        n = int(rng.integers(4, 8))
        up = np.linspace(start, 1.0, n)
        levels = np.concatenate([up, np.linspace(1.0, -1.0, n)[1:], np.linspace(-1.0, 0.7, n)[1:]])
    else:
        n = int(rng.integers(8, 20))
        levels = np.concatenate([[start, 1.0, -1.0], rng.uniform(-1.0, 1.0, n)])
    v: Array = levels[np.minimum((t / (t[-1] + t[1]) * len(levels)).astype(int), len(levels) - 1)]
    return v


def chirp(rng: np.random.Generator, t: Array, start: float) -> Array:
    """Return a sine of rising frequency, up to 10 to 40 Hz."""
    first, last = 2.0 / t[-1], rng.uniform(10.0, 40.0)
    rate = np.log(last / first) / t[-1]
    faded: Array = np.sin(2.0 * np.pi * first * np.expm1(rate * t) / rate + 0.5 * np.pi * start)
    return faded


def falling_triangle(rng: np.random.Generator, t: Array, start: float) -> Array:
    """Return a triangle whose amplitude falls to a tenth."""
    n = int(rng.integers(5, 10))
    tops = np.linspace(1.0, 0.1, 2 * n) * np.tile([1.0, -1.0], n)
    return _through(t, [start, *([1.0, -1.0] if start < 0.0 else []), *tops.tolist()])


def noise(rng: np.random.Generator, t: Array, start: float) -> Array:
    """Return noise below 3 to 15 Hz, faded in."""
    lines = np.arange(1, int(rng.uniform(3.0, 15.0) * t[-1]))
    phases = rng.uniform(0.0, 2.0 * np.pi, len(lines))
    x = np.sum(np.cos(2.0 * np.pi * lines[:, None] * t / t[-1] + phases[:, None]), axis=0)
    x = 2.0 * (x - x.min()) / (x.max() - x.min()) - 1.0
    drive: Array = start + (x - start) * np.minimum(t / (0.1 * t[-1]), 1.0)
    return drive


def ramps(rng: np.random.Generator, t: Array, start: float) -> Array:
    """Return ramps of one rate between random turns, some with a rest there."""
    turns = [start, 1.0, -1.0, *rng.uniform(-1.0, 1.0, int(rng.integers(6, 12))).tolist()]
    slow = _through(np.arange(400) / 400.0, turns)
    rests = np.concatenate([[0.0], np.cumsum(1.0 + 40.0 * (rng.random(399) < 0.02))])
    drive: Array = np.interp(t / t[-1] * rests[-1], rests, slow)
    return drive


def several_amplitudes(rng: np.random.Generator, t: Array, start: float) -> Array:
    """Return smooth swings of several amplitudes, the largest first or last."""
    sizes = np.repeat(rng.permutation([0.25, 0.5, 0.75, 1.0]), 2)
    turns = [x for size in sizes.tolist() for x in (size, -size)]
    return _through(t, [start, *turns], smooth=True)


KINDS: dict[str, Drive] = {
    "biased sine": biased_sine,
    "sine with jump": sine_with_jump,
    "steps": steps,
    "chirp": chirp,
    "falling triangle": falling_triangle,
    "noise": noise,
    "ramps": ramps,
    "several amplitudes": several_amplitudes,
}


def draw(
    kind: str, rng: np.random.Generator, t: Array, largest: float, *, from_zero: bool
) -> Array:
    """Draw a drive [V] at the times `t` [s]; from 0 to `largest`, or to both sides of 0."""
    from_zero = from_zero or kind == "biased sine"
    v = KINDS[kind](rng, t, -1.0 if from_zero else 0.0)
    return largest * (0.5 * (1.0 + v) if from_zero else v)


def other_motion(u: Array, dt: float) -> Array:
    """Return another drive within the range of one: from rest to its middle, then sines of 1 Hz.

    A period of 0.9 of the range, two of 0.3, one of 0.9.
    """
    t = np.arange(round(4.5 / dt)) * dt
    middle, half = 0.5 * (u.max() + u.min()), 0.5 * (u.max() - u.min())
    height = np.where((t >= 1.5) & (t < 3.5), 0.3, 0.9)
    sine = height * np.sin(2.0 * np.pi * (t - 0.5))
    rise = 0.5 - 0.5 * np.cos(np.pi * np.minimum(t / 0.5, 1.0))
    drive: Array = middle * rise + half * np.where(t < 0.5, 0.0, sine)
    return drive
