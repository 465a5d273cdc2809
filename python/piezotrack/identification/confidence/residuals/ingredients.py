"""Ingredients that a model may lack: groups of regressors of its residual."""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from ...._support.line_search import least_on_line
from ....data.checks.hum import hum_lines
from .responses import late, relaxed, ringing
from .situation import Explained, criterion, independent_samples

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from .situation import Situation

    Array = NDArray[np.float64]

__all__ = ["explanations"]

# Time constants of creep: so many a decade, from this share of the drive's period.
CREEPS, SLOW = 4, 0.15
# How often the regressors of creep are made anew, of the motion beside it.
PASSES = 2
# Damping ratios and coarse frequencies of a mode, peaks of the spectrum that are tried.
DAMPINGS, MODES, PEAKS = (0.006, 0.025, 0.08, 0.25), 24, 6
# Lowest frequency of a mode, in those of the drive: below it harmonics of the drive are many.
ABOVE = 4.0
# Steps of the search of a mode, how far the first one goes and the next ones of it.
STEPS, FIRST, NEXT, MOST_DAMPED = 5, 1.15, 0.55, 0.4
# Shortest delay in samples, longest in periods, places of a grid, sections between two.
SHORTEST, LONGEST, PLACES, SECTIONS = 0.02, 1.0 / 6.0, 9, 9
# Thresholds of bent plays and of those that the rate dilates, of half of the range.
BENT = (0.06, 0.15, 0.3, 0.5, 0.7)
DILATED = (0.03, 0.07, 0.12, 0.18, 0.25, 0.33, 0.42, 0.53, 0.65, 0.8)
# Growth of thresholds at the largest rate, of half of the range.
DILATIONS, LARGEST = (0.03, 0.08, 0.15), 0.995
# Degrees of the polynomials of a drift, and its time constants as shares of the window.
DEGREES, RELAXING = (1, 2, 3, 5, 8), (0.05, 0.1, 0.2, 0.4, 0.8)


def explanations(here: Situation) -> dict[str, Explained]:
    """Fit each ingredient that a model may lack to a residual.

    Parameters
    ----------
    here : Situation
        The fit and its residual.

    Returns
    -------
    dict of str to Explained
        The best group of each ingredient; those that the record cannot show are left out.
    """
    groups = {name: tuple(group(here)) for name, group in GROUPS.items()}
    return {name: _best(group) for name, group in groups.items() if group}


def _best(groups: tuple[Explained, ...]) -> Explained:
    """Return the group of the lowest criterion."""
    samples = independent_samples(min(groups, key=lambda group: group.squares).left)
    return min(groups, key=lambda group: criterion(group, samples))


def _creep(here: Situation) -> Iterator[Explained]:
    """Relaxations of the motion, one or two (Kuhnen 2003, doi 10.3166/ejc.9.407-418)."""
    low = max(SLOW * here.period, 5.0 * here.data.dt)
    high = here.data.dt * here.x.size
    if high <= 2.0 * low:
        return
    times = np.geomspace(low, high, round(CREEPS * np.log10(high / low)) + 2)
    x = here.x
    for _ in range(1 + PASSES):
        tried = tuple(_relaxations(here, x, times))
        yield from tried
        if not tried:
            return
        x = here.beside(_best(tried))


def _relaxations(here: Situation, x: Array, times: Array) -> Iterator[Explained]:
    columns = [relaxed(x, time / here.data.dt) - x for time in times]
    free, _ = here.freed(columns)
    gram, along = free.T @ free, free.T @ here.null
    for size in (1, 2):
        gains = {
            picked: _gain(gram, along, picked) for picked in combinations(range(times.size), size)
        }
        picked = max(gains, key=lambda one: gains[one])
        if gains[picked] > 0.0:
            detail = " and ".join(f"{times[i]:.2g} s" for i in picked)
            yield here.explained([columns[i] for i in picked], 2 * size, detail)


def _gain(gram: Array, along: Array, picked: tuple[int, ...]) -> float:
    """Square that some columns explain; below 0 where a weight is, as none of a relaxation."""
    sides = along[list(picked)]
    weights = np.linalg.lstsq(gram[np.ix_(picked, picked)], sides, rcond=1e-10)[0]
    return float(sides @ weights) if (weights > 0.0).all() else -1.0


def _delay(here: Situation) -> Iterator[Explained]:
    """All of the motion late, or behind a first-order lag."""
    ms = 1e3 * here.data.dt
    longest = min(LONGEST * here.period / here.data.dt, 0.1 * here.x.size)

    def delayed(samples: float) -> Explained:
        return here.through(lambda x: late(x, samples), 1, f"{ms * samples:.3g} ms")

    def lagging(samples: float) -> Explained:
        return here.through(lambda x: relaxed(x, samples), 1, f"a lag of {ms * samples:.3g} ms")

    if longest > SHORTEST:
        yield _least(delayed, SHORTEST, longest)
        yield _least(lagging, SHORTEST, longest)


def _least(group: Callable[[float], Explained], low: float, high: float) -> Explained:
    """Search the number with which a group leaves least: a grid, then a golden section."""
    places = np.geomspace(low, high, PLACES)
    return least_on_line(group, places, SECTIONS, lambda one: one.squares)[1]


def _mode(here: Situation) -> Iterator[Explained]:
    """Part of the motion through a mode, or all of it."""
    dt, x = here.data.dt, here.x
    low, high = max(3.0 / (here.rest.size * dt), ABOVE / here.period), 0.45 / dt
    if low >= high:
        return

    def inside(f: float) -> float:
        return max(low, min(f, high))

    def part(f: float, zeta: float) -> tuple[float, float, float]:
        column = here.freed([ringing(x, f * dt, zeta) - x])[0][:, 0]
        square, along = float(column @ column), float(column @ here.null)
        return (along**2 / square if square > 0.0 and along > 0.0 else -1.0), f, zeta

    places = [*np.geomspace(low, high, MODES), *_peaks(here, low, high)]
    tried = sorted(part(float(f), zeta) for f in places for zeta in DAMPINGS)
    for _, f, zeta in tried[-2:]:
        wide = FIRST
        for _ in range(STEPS + 2):
            near = [
                part(inside(f * wide**i), min(zeta * wide ** (3 * j), MOST_DAMPED))
                for i in (-1, 0, 1)
                for j in (-1, 0, 1)
            ]
            tried += near
            _, f, zeta = max(near)
            wide = wide**NEXT
    gain, f, zeta = max(tried)
    if gain <= 0.0:
        return
    yield here.explained([ringing(x, f * dt, zeta) - x], 3, f"{f:.4g} Hz")

    def whole(f: float, zeta: float) -> Explained:
        return here.through(lambda x: ringing(x, f * dt, zeta), 2, f"{f:.4g} Hz")

    best, wide = whole(f, zeta), FIRST
    for _ in range(STEPS):
        for along, damped in ((wide, 1.0), (1.0 / wide, 1.0), (1.0, wide**4), (1.0, wide**-4)):
            while True:
                place = inside(f * along), min(zeta * damped, MOST_DAMPED)
                other = whole(*place)
                if place == (f, zeta) or other.squares >= (1.0 - 1e-6) * best.squares:
                    break
                (f, zeta), best = place, other
        wide = wide**NEXT
    yield best


def _peaks(here: Situation, low: float, high: float) -> Iterator[float]:
    """Frequencies at which the residual is strong, and those at which it stands out [Hz]."""
    n = here.rest.size
    power = np.abs(np.fft.rfft(np.hanning(n) * (here.rest - here.rest.mean()))) ** 2
    frequencies = np.fft.rfftfreq(n, here.data.dt)
    width = max(3, n // 100)
    around = np.convolve(power, np.ones(width) / width, "same")
    inside = (frequencies > low) & (frequencies < high)
    for values in (power, power / np.maximum(around, 1e-300)):
        places: list[int] = []
        for i in np.argsort(np.where(inside, values, 0.0))[::-1]:
            if len(places) < PEAKS and all(abs(int(i) - place) > 3 for place in places):
                places.append(int(i))
        yield from (float(frequencies[i]) for i in places if inside[i])


def _asymmetry(here: Situation) -> Iterator[Explained]:
    """Functions of the motion without point symmetry, and plays of a bent drive.

    The plays are those of Al Janaideh, Rakheja and Su 2011, doi 10.1109/TMECH.2010.2052366.
    """
    x = 2.0 * (here.x - here.x.min()) / np.ptp(here.x) - 1.0
    u = (here.drive + 1.0) ** 2 / 2.0 - 1.0
    bent = [x**2, x**3, x**4, *(np.abs(x - place) for place in (-0.5, 0.0, 0.5))]
    wide = [here.drive**2, *(here.play(u, threshold) for threshold in BENT)]
    for columns in (bent[:1], bent, wide, [*bent, *wide]):
        yield here.explained(columns, len(columns))


def _rate(here: Situation) -> Iterator[Explained]:
    """Plays that the rate dilates (Al Janaideh and Krejci 2013, doi 10.1109/TMECH.2012.2205265)."""
    fastest = float(np.quantile(np.abs(np.diff(here.drive)), LARGEST))
    if fastest == 0.0:
        return
    for most in DILATIONS:
        columns = [here.play(here.drive, threshold, most / fastest) for threshold in DILATED]
        for chosen in (columns[1::3], columns):
            yield here.explained(chosen, len(chosen) + 1)


def _hum(here: Situation) -> Iterator[Explained]:
    """Lines of the mains, as `hum_lines` has them of the residual or of what is left of it."""
    rest, t = here.rest.copy(), here.data.dt * np.arange(here.x.size)
    rest[~here.kept] = rest[here.kept].mean()
    left = rest.copy()
    left[here.kept] = here.null
    for values in (rest, left):
        lines = hum_lines(values, here.data.u, here.data.y, here.data.dt)
        angles = [2.0 * np.pi * line.frequency * t for line in lines]
        columns = [wave(angle) for angle in angles for wave in (np.sin, np.cos)]
        if columns:
            detail = ", ".join(f"{line.frequency:.4g} Hz" for line in lines)
            yield here.explained(columns, 3 * len(lines), detail)


def _drift(here: Situation) -> Iterator[Explained]:
    """Polynomials and exponential functions of time."""
    t = np.linspace(-1.0, 1.0, here.x.size)
    powers = np.polynomial.legendre.legvander(t, max(DEGREES)).T
    for degree in DEGREES:
        yield here.explained(list(powers[1 : degree + 1]), degree)
    for share in RELAXING:
        yield here.explained([np.exp(-(t + 1.0) / (2.0 * share))], 2)


GROUPS: dict[str, Callable[[Situation], Iterator[Explained]]] = {
    "creep": _creep,
    "mode": _mode,
    "delay": _delay,
    "asymmetry": _asymmetry,
    "rate": _rate,
    "hum": _hum,
    "drift": _drift,
}
