"""Motions as functions of time with their derivatives.

A motion takes times [s], an array of any shape, and returns the displacement [m], the velocity
[m/s] and the acceleration [m/s^2] at each.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from .._support.arrays import LARGEST, real_array
from .._support.messages import quoted
from ..errors import ParameterError

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

Array: TypeAlias = "NDArray[np.float64]"
Motion: TypeAlias = "Callable[[Array], tuple[Array, Array, Array]]"

__all__ = [
    "Chirp",
    "Cosines",
    "Motion",
    "Spline",
    "Steps",
    "Triangle",
    "blended",
    "common_period",
    "extremes",
    "schroeder_phases",
]

# Grid points in the shortest period to bracket an extremum, and Newton steps to refine it.
POINTS, NEWTON = 64, 5
# Most shortest periods in a motion whose extrema are sought, times its cosines: some 10 s.
MOST_PERIODS = 2_100_000


def _times(t: object) -> Array:
    """Check times [s]: numbers that are finite, and whose squares are."""
    times = real_array("t", t)
    if not (np.abs(times) < LARGEST).all():
        raise ParameterError("t", quoted(t), f"times in s, below {LARGEST:g} s")
    return times


def s_curve(u: Array) -> tuple[Array, Array, Array]:
    """S-curve from 0 to 1 in unit time: value, slope and curvature.

    The quintic ``10 u^3 - 15 u^4 + 6 u^5``, whose first two derivatives vanish at both ends; it
    is constant before and after.

    Examples
    --------
    >>> import numpy as np
    >>> s_curve(np.array([0.0, 0.5, 1.0]))[0]
    array([0. , 0.5, 1. ])
    """
    u = np.clip(u, 0.0, 1.0)
    rest = 1.0 - u
    return (
        u**3 * (10.0 + u * (6.0 * u - 15.0)),
        30.0 * (u * rest) ** 2,
        60.0 * u * rest * (1.0 - 2.0 * u),
    )


def blended(
    motion: Motion, t: Array, ramp: float, origin: float | None = None
) -> tuple[Array, Array, Array]:
    """Evaluate a motion with a smooth start from rest, which ends at `ramp`.

    Parameters
    ----------
    motion : callable
        The motion.
    t : ndarray
        Times [s], 0 or above.
    ramp : float
        Length of the start [s]; 0 for none.
    origin : float, optional
        Start o [m]; default the position of the motion at time 0.

    Returns
    -------
    x, v, a : ndarray
        ``o + s(t / ramp) (x(t) - o)`` with the quintic ``s`` of `s_curve`, and its derivatives.
    """
    x, v, a = motion(t)
    if ramp <= 0.0:
        return x, v, a
    s, slope, curvature = s_curve(t / ramp)
    start = motion(np.zeros(1))[0][0] if origin is None else origin
    travel = x - start
    at_start = t < ramp
    return (
        np.where(at_start, start + s * travel, x),
        np.where(at_start, slope * travel / ramp + s * v, v),
        np.where(at_start, curvature * travel / ramp**2 + 2.0 * slope * v / ramp + s * a, a),
    )


@dataclass(frozen=True)
class Cosines:
    """``offset + sum of amplitudes cos(2 pi frequencies t + phases)``: a sum of cosines."""

    offset: float
    amplitudes: tuple[float, ...]
    frequencies: tuple[float, ...]
    phases: tuple[float, ...]

    def __call__(self, t: Array) -> tuple[Array, Array, Array]:
        """Return displacement, velocity and acceleration at the times `t`."""
        t = _times(t)
        x, v, a = np.full(t.shape, self.offset), np.zeros(t.shape), np.zeros(t.shape)
        for size, frequency, phase in zip(
            self.amplitudes, self.frequencies, self.phases, strict=True
        ):
            rate = math.tau * frequency
            cosine = size * np.cos(rate * t + phase)
            x += cosine
            v -= rate * size * np.sin(rate * t + phase)
            a -= rate**2 * cosine
        return x, v, a


@dataclass(frozen=True)
class Chirp:
    """``mid - amplitude cos(phase)``, the frequency linear in time from `start` to `stop`."""

    mid: float
    amplitude: float
    start: float
    stop: float
    duration: float

    def __call__(self, t: Array) -> tuple[Array, Array, Array]:
        """Return displacement, velocity and acceleration at the times `t`."""
        t = _times(t)
        sweep = math.tau * (self.stop - self.start) / self.duration
        rate = math.tau * self.start + sweep * t
        phase = (math.tau * self.start + 0.5 * sweep * t) * t
        cosine, sine = self.amplitude * np.cos(phase), self.amplitude * np.sin(phase)
        return self.mid - cosine, rate * sine, rate**2 * cosine + sweep * sine


@dataclass(frozen=True)
class Triangle:
    """Triangle wave from `low` to `high` with rounded corners.

    In a corner the velocity follows ``1.5 u - 0.5 u^3`` from one speed to the other, u from -1 to
    1, so that the acceleration has no jump.
    """

    low: float
    high: float
    period: float
    rounding: float

    def __call__(self, t: Array) -> tuple[Array, Array, Array]:
        """Return displacement, velocity and acceleration at the times `t`."""
        t = _times(t)
        half = 0.5 * self.period
        # Half the duration of a corner, and the speed with which both ends are still reached.
        corner = 0.25 * self.rounding * self.period
        speed = (self.high - self.low) / (half - 0.75 * corner)
        number = np.round(t / half)
        s = t - number * half
        if corner > 0.0:
            u = np.clip(s / corner, -1.0, 1.0)
            beyond = np.maximum(np.abs(s) - corner, 0.0)
            travel = speed * (corner * (0.75 - 0.125 * u**2) * u**2 + beyond)
            v = speed * (1.5 - 0.5 * u**2) * u
            a = 1.5 * speed / corner * (1.0 - u**2)
        else:
            travel, v, a = speed * np.abs(s), np.where(s < 0.0, -speed, speed), np.zeros(t.shape)
        is_low = np.mod(number, 2.0) == 0.0
        return (
            np.where(is_low, self.low + travel, self.high - travel),
            np.where(is_low, v, -v),
            np.where(is_low, a, -a),
        )


@dataclass(frozen=True)
class Steps:
    """Levels in sequence, each held for `dwell`, with S-curves between them.

    If `cyclic`, the first level follows the last; else the last level is held.
    """

    levels: tuple[float, ...]
    dwell: float
    rise: float
    cyclic: bool

    def __call__(self, t: Array) -> tuple[Array, Array, Array]:
        """Return displacement, velocity and acceleration at the times `t`."""
        t = _times(t)
        levels = np.asarray(self.levels)
        following = np.roll(levels, -1)
        step = self.dwell + self.rise
        if self.cyclic:
            t = np.mod(t, levels.size * step)
        else:
            following[-1] = levels[-1]
        number = np.clip(np.floor(t / step), 0, levels.size - 1).astype(np.intp)
        s, slope, curvature = s_curve((t - number * step - self.dwell) / self.rise)
        travel = (following - levels)[number]
        x = levels[number] + travel * s
        return x, travel * slope / self.rise, travel * curvature / self.rise**2


@dataclass(frozen=True, eq=False)
class Spline:
    """The quintic spline through samples `x`, at interval `dt`.

    It repeats if `cyclic`; else it continues for one interval after the last sample with the
    acceleration of that sample.
    """

    x: Array
    dt: float
    cyclic: bool

    @cached_property
    def _splines(self) -> tuple[Any, Any, Any]:
        from scipy.interpolate import make_interp_spline

        # Sample indices as knots keep the system well scaled at any interval.
        values = np.append(self.x, self.x[0]) if self.cyclic else self.x
        kind = "periodic" if self.cyclic else None
        # Relative to the first sample, a constant record stays exactly constant.
        spline = make_interp_spline(np.arange(values.size), values - values[0], 5, bc_type=kind)
        return spline, spline.derivative(1), spline.derivative(2)

    def __call__(self, t: Array) -> tuple[Array, Array, Array]:
        """Return displacement, velocity and acceleration at the times `t`."""
        t = _times(t)
        place = t / self.dt
        u = np.mod(place, self.x.size) if self.cyclic else np.minimum(place, self.x.size - 1)
        x, v, a = (spline(u) for spline in self._splines)
        beyond = 0.0 if self.cyclic else place - u
        return (
            self.x[0] + x + (v + 0.5 * a * beyond) * beyond,
            (v + a * beyond) / self.dt,
            a / self.dt**2,
        )


def extremes(
    motion: Motion, duration: float, shortest: float, *, cosines: int = 1
) -> tuple[float, float]:
    """Find the lowest and the highest displacement of a motion [m].

    Parameters
    ----------
    motion : callable
        A smooth motion.
    duration : float
        Interval to search, from 0 on [s].
    shortest : float
        The shortest period in it [s].
    cosines : int, optional
        How many cosines are added for each point of the grid.

    Returns
    -------
    low, high : float
        Bracketed on a grid and refined by Newton's method [m].

    Raises
    ------
    ParameterError
        There are so many of the shortest periods that the search would take minutes or gigabytes.

    Examples
    --------
    >>> extremes(Cosines(1.0, (2.0,), (0.2,), (0.3,)), 5.0, 5.0)
    (-1.0, 3.0)
    """
    periods = duration / shortest
    if not periods * cosines <= MOST_PERIODS:
        raise ParameterError(
            f"the motion has {periods:.3g} of its shortest periods, {shortest:g} s, in "
            f"{duration:g} s: expected at most {MOST_PERIODS // cosines} to find its range",
            argument="duration",
        )
    with np.errstate(all="ignore"):
        return _extremes(motion, duration, shortest / POINTS)


def _extremes(motion: Motion, duration: float, step: float) -> tuple[float, float]:
    grid = np.linspace(0.0, duration, math.ceil(duration / step) + 1)
    x = motion(grid)[0]
    extremes = [float(x.min()), float(x.max())]
    for k, sign in enumerate((-1.0, 1.0)):
        inner = sign * x[1:-1]
        t = grid[1:-1][(inner >= sign * x[:-2]) & (inner >= sign * x[2:])]
        for _ in range(NEWTON if t.size else 0):
            _, v, a = motion(t)
            move = np.divide(-v, a, out=np.zeros(t.shape), where=sign * a < 0.0)
            t = np.clip(t + np.clip(move, -step, step), 0.0, duration)
        if t.size:
            extremes[k] = sign * max(sign * extremes[k], float((sign * motion(t)[0]).max()))
    return extremes[0], extremes[1]


def schroeder_phases(amplitudes: Array) -> Array:
    """Return phases [rad] that give a sum of neighbouring harmonics a low crest factor.

    Schroeder 1970, doi 10.1109/TIT.1970.1054411, equation (11): with the relative powers p_l the
    phase of the n-th is ``-2 pi`` times the sum of ``(n - l) p_l`` over l < n.

    Parameters
    ----------
    amplitudes : ndarray, shape (n,)
        Amplitudes in the order of the frequencies.

    Returns
    -------
    ndarray, shape (n,)
        Phases, from 0 up to 2 pi [rad].

    Examples
    --------
    >>> import numpy as np
    >>> schroeder_phases(np.ones(2)).round(3)
    array([0.   , 3.142])
    """
    # By a power of two, which changes no digit, so that no square leaves float64.
    _, exponent = np.frexp(amplitudes.max())
    squares = np.ldexp(amplitudes, -exponent) ** 2
    powers = np.cumsum(squares) / np.sum(squares)
    phases: Array = np.mod(-math.tau * np.append(0.0, np.cumsum(powers)[:-1]), math.tau)
    return phases


def common_period(frequencies: tuple[float, ...]) -> float:
    """Return the common period of frequencies [Hz] in s, or infinity.

    Examples
    --------
    >>> common_period((0.2, 0.5)), common_period((1.0, 2.0**0.5))
    (10.0, inf)
    """
    exact = [Fraction(frequency).limit_denominator(10**6) for frequency in frequencies]
    # Frequencies are taken as decimals or ratios of small integers, exact to the last digit.
    if any(
        abs(float(ratio) - frequency) > 1e-14 * frequency
        for ratio, frequency in zip(exact, frequencies, strict=True)
    ):
        return math.inf
    turns = math.gcd(*(ratio.numerator for ratio in exact))
    return math.lcm(*(ratio.denominator for ratio in exact)) / turns
