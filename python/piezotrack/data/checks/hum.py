"""Hum of the mains in a displacement, and in what a fit leaves of it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.polynomial import Chebyshev

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = ["Line", "Quick", "hum_lines", "hum_notes", "power_of", "quick_part"]

# Frequencies of the mains [Hz], how far they wander, and how many harmonics are looked for.
MAINS, WANDERS, HARMONICS = (50.0, 60.0), 0.2, 10
# Cycles that a line takes to be seen; distance within which it has to stand out [Hz].
CYCLES, AROUND = 20.0, 12.0
# How many times the largest power around it a line has, and which share of the residual.
STANDS_OUT, SHARE = 6.0, 0.03
# Amplitude of the drive at a line, as the mean gain makes it, from which the line is the drive's.
DRIVEN = 0.3
# Degree of a mean loop, too low to follow a drive's higher harmonics.
DEGREE = 9
# Longest residual that is looked at, and values of its spectrum to a bin.
LOOKED_AT, FINE = 400_000, 4


class Line(NamedTuple):
    """A line of a spectrum.

    Attributes
    ----------
    frequency : float
        Frequency [Hz].
    amplitude : float
        Amplitude [m].
    """

    frequency: float
    amplitude: float


def hum_lines(rest: Array, u: Array, y: Array, dt: float) -> list[Line]:
    """Find the mains in what a fit leaves.

    Of a drive of 1 Hz every harmonic of the mains is one of the drive too: a line counts where it
    stands out of the lines beside it, and where the drive has none.

    Parameters
    ----------
    rest : ndarray, shape (n,)
        Residual [m].
    u, y : ndarray, shape (n,)
        Drive [V] and displacement [m].
    dt : float
        Sampling interval [s].

    Returns
    -------
    list of Line
        Lines at 50 Hz or 60 Hz and their harmonics, the lowest first; none without the lowest.

    Examples
    --------
    >>> t = np.arange(5000) / 1000.0
    >>> noise = 1e-8 * np.random.default_rng(1).normal(size=t.size)
    >>> u = np.sin(2.0 * np.pi * t)
    >>> rest = 2e-8 * np.sin(2.0 * np.pi * 50.0 * t) + noise
    >>> [f"{f:.0f} Hz, {1e9 * size:.0f} nm" for f, size in hum_lines(rest, u, 1e-6 * u, 1e-3)]
    ['50 Hz, 20 nm']
    """
    rest, u, y = rest[:LOOKED_AT], u[:LOOKED_AT], y[:LOOKED_AT]
    length, power = dt * rest.size, float(np.var(rest))
    if length * MAINS[0] < CYCLES or power == 0.0 or np.ptp(u) == 0.0:
        return []
    frequencies, left = _amplitudes(rest, dt)
    driven = _amplitudes(u, dt)[1] * float(np.ptp(y)) / float(np.ptp(u))
    # Half of the width of a line.
    width = max(WANDERS, 2.0 / length)
    top = 0.45 / dt
    # A quick drive has lines of its own, further apart.
    drive_frequency = float(frequencies[int(np.argmax(driven))])
    around = max(AROUND, 1.2 * drive_frequency)
    best: list[Line] = []
    for mains in MAINS:
        lines: list[Line] = []
        for k in range(1, HARMONICS + 1):
            place = k * mains
            reach = max(k * WANDERS, 2.0 / length)
            apart = np.abs(frequencies - place)
            here = apart <= reach
            beside = (apart > reach + 2.0 * width) & (apart <= around)
            if place > top or not here.any() or not beside.any():
                continue
            at = int(np.flatnonzero(here)[np.argmax(left[here])])
            size = float(left[at])
            if (
                size**2 > STANDS_OUT * float(left[beside].max()) ** 2
                and float(driven[here].max()) < DRIVEN * size
                and not _is_harmonic(place, drive_frequency, reach)
            ):
                lines.append(Line(float(frequencies[at]), size))
        # A harmonic alone may be a mode of the stage.
        is_hum = any(line.frequency < 1.5 * mains for line in lines)
        if is_hum and power_of(lines) > max(power_of(best), SHARE * power):
            best = lines
    return best


def _is_harmonic(place: float, drive_frequency: float, reach: float) -> bool:
    """Whether a frequency is one of the first harmonics of a quick drive."""
    order = round(place / drive_frequency) if drive_frequency > 0.0 else 0
    return 1 <= order <= HARMONICS and abs(place - order * drive_frequency) <= reach


def _amplitudes(values: Array, dt: float) -> tuple[Array, Array]:
    """Return frequencies [Hz] and the amplitude of a sine that would show there as it does."""
    window = np.hanning(values.size)
    size = FINE * values.size
    spectrum = np.abs(np.fft.rfft(window * (values - values.mean()), size))
    scaled: Array = 2.0 * spectrum / float(window.sum())
    frequencies: Array = np.arange(scaled.size) / (size * dt)
    return frequencies, scaled


class Quick(NamedTuple):
    """The part of a displacement that is as quick as the mains.

    Attributes
    ----------
    frequencies, amplitudes : ndarray, shape (m,)
        Its spectrum: the amplitude [m] of a sine of each frequency [Hz].
    hum : list of Line
        The mains in it, as `hum_lines`.
    """

    frequencies: Array
    amplitudes: Array
    hum: list[Line]


def quick_part(u: Array, y: Array, dt: float) -> Quick:
    """Look for the mains in a displacement itself, less the mean loop and what is slower.

    Parameters
    ----------
    u, y : ndarray, shape (n,)
        Drive [V] and displacement [m].
    dt : float
        Sampling interval [s].

    Returns
    -------
    Quick
        Empty of a record that is too short, or sampled too slowly.

    Examples
    --------
    >>> t = np.arange(5000) / 1000.0
    >>> u = np.sin(2.0 * np.pi * t)
    >>> y = 1e-6 * u + 2e-8 * np.sin(2.0 * np.pi * 50.0 * t)
    >>> [f"{f:.0f} Hz, {1e9 * size:.0f} nm" for f, size in quick_part(u, y, 1e-3).hum]
    ['50 Hz, 20 nm']
    """
    width = round(1.0 / (MAINS[0] * dt))
    if width < 2 or y.size * dt * MAINS[0] < CYCLES or np.ptp(u) == 0.0:
        return Quick(np.empty(0), np.empty(0), [])
    u, y = u[:LOOKED_AT], y[:LOOKED_AT]
    rest = y - _mean_loop(u, y, width)
    # The mean over a period of each of the mains has nothing of either.
    slow = rest
    for mains in MAINS:
        count = round(1.0 / (mains * dt))
        sums = np.cumsum(np.concatenate([[0.0], slow]))
        slow = (sums[count:] - sums[:-count]) / count
    whole = slice((y.size - slow.size) // 2, (y.size - slow.size) // 2 + slow.size)
    rest = rest[whole] - slow
    return Quick(*_amplitudes(rest, dt), hum_lines(rest, u[whole], y[whole], dt))


def _mean_loop(u: Array, y: Array, width: int) -> Array:
    """Return the displacement as a polynomial of the drive, one upwards and one downwards."""
    places = 2.0 * (u - u.min()) / np.ptp(u) - 1.0
    later = np.minimum(np.arange(u.size) + width, u.size - 1)
    up = u[later] > u[np.maximum(later - 2 * width, 0)]
    mean = np.zeros_like(y)
    for part in (up, ~up):
        if np.count_nonzero(part) > 2 * HARMONICS:
            mean[part] = Chebyshev.fit(places[part], y[part], DEGREE, domain=[-1.0, 1.0])(
                places[part]
            )
    return mean


def power_of(lines: Sequence[Line]) -> float:
    """Return the mean square of lines [m^2]."""
    return 0.5 * math.fsum(line.amplitude**2 for line in lines)


def hum_notes(lines: Sequence[Line], where: str = "is left") -> list[str]:
    """Say which lines of the mains a residual or a record has.

    Parameters
    ----------
    lines : sequence of Line
        The lines.
    where : str, optional
        Verb and place.

    Returns
    -------
    list of str
        One sentence, or none.

    Examples
    --------
    >>> hum_notes([Line(50.0, 23e-9), Line(150.0, 5e-9)])
    ['hum of the mains is left: 50 Hz with an amplitude of 23 nm, 150 Hz with 5 nm']
    """
    if not lines:
        return []
    first, *others = (f"{f:.4g} Hz with {{}}{1e9 * size:.3g} nm" for f, size in lines)
    texts = [first.format("an amplitude of "), *(one.format("") for one in others)]
    return [f"hum of the mains {where}: {', '.join(texts)}"]
