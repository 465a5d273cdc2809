"""Moves from one displacement to another: S-curves within limits, and input shapers of a mode."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from .._support.arguments import check_reach, finite, hertz, in_range, one_of, positive
from ..errors import ParameterError
from .motions import s_curve
from .reference import Reference

if TYPE_CHECKING:
    from .motions import Array, Motion

__all__ = ["Shape", "move"]

Shape = Literal["s-curve", "zv", "zvd", "ei"]
# Residual vibration that an extra-insensitive shaper leaves at the frequency of the mode.
RESIDUAL = 0.05


def move(
    *,
    start: float,
    stop: float,
    dwell: float,
    shape: Shape = "s-curve",
    frequency: float | None = None,
    damping: float = 0.0,
    rise: float | None = None,
    speed: float = math.inf,
    acceleration: float = math.inf,
    jerk: float = math.inf,
    duration: float | None = None,
) -> Reference:
    r"""Move from one displacement to another, without exciting a mode.

    The move is the fastest within limits of speed, acceleration and jerk, a quintic S-curve of the
    length `rise`, or a step. A shaper splits it into parts, of which each cancels the vibration of
    those before:

    .. math:: x(t) = \sum_i A_i \, m(t - t_i), \qquad \sum_i A_i = 1

    Parameters
    ----------
    start, stop : float
        Displacement before and after [m].
    dwell : float
        Time at `start` before, and at `stop` after [s].
    shape : {"s-curve", "zv", "zvd", "ei"}, optional
        Without a shaper, or one of zero vibration in two parts, with zero derivative in three
        (Singer and Seering 1990, doi 10.1115/1.2894142), or extra-insensitive in three, which
        leaves 5 % at the frequency and little on both sides (Singhose, Seering and Singer 1994,
        doi 10.1115/1.2919428).
    frequency, damping : float, optional
        Undamped frequency [Hz] and damping ratio of the mode, as of `fit_modes`; of shapers.
    rise : float, optional
        Length of a quintic S-curve [s].
    speed, acceleration, jerk : float, optional
        Limits [m/s], [m/s^2], [m/s^3], in place of `rise`.
    duration : float, optional
        Length [s]; default until `stop` has been held for `dwell`.

    Returns
    -------
    Reference
        With its exact derivatives. Where the displacement or its velocity jumps, the derivatives
        are those after the jump; a jump between two samples of a loop shows at the second, which
        a shaper is sensitive to: a `rise` or limits of some samples avoid it.

    Raises
    ------
    ParameterError
        A number is out of its range or missing, or an argument has no effect.

    Examples
    --------
    >>> import piezotrack as pt
    >>> pt.move(start=0.0, stop=20e-6, dwell=0.05, speed=10e-3, acceleration=20.0, jerk=1e5)
    Reference(move s-curve, 0 to 20 um, 0.1027 s)
    >>> pt.move(start=0.0, stop=20e-6, dwell=0.05, shape="zv", frequency=160.0, damping=0.02)
    Reference(move zv, 0 to 20 um, 0.103126 s)
    """
    one_of("shape", shape, ("s-curve", "zv", "zvd", "ei"))
    first, last = finite("start", start, "m"), finite("stop", stop, "m")
    check_reach(min(first, last), max(first, last))
    if first == last:
        raise ParameterError("stop", f"{last:g} m", "another displacement than start")
    pause = positive("dwell", dwell, "s")
    limits = {"speed": speed, "acceleration": acceleration, "jerk": jerk}
    for name, value in limits.items():
        if not value > 0.0:
            raise ParameterError(name, f"{value:g}", "above 0")
    limited = any(math.isfinite(value) for value in limits.values())
    if rise is not None and limited:
        raise ParameterError("rise", f"{rise:g} s", "none beside speed, acceleration or jerk")
    base: Motion
    if rise is not None:
        length = positive("rise", rise, "s")
        base = Quintic(last - first, length)
    elif limited:
        base = Segments.fastest(last - first, speed, acceleration, jerk)
        length = base.length
    elif shape == "s-curve":
        raise ParameterError("rise", "missing", "rise, or a limit as speed or jerk")
    else:
        base, length = Segments.fastest(last - first, math.inf, math.inf, math.inf), 0.0
    if shape == "s-curve":
        if frequency is not None or damping != 0.0:
            raise ParameterError("frequency or damping", "given", "neither without a shaper")
        parts = [(1.0, 0.0)]
    else:
        if frequency is None:
            raise ParameterError("frequency", "missing", "that of the mode [Hz]")
        parts = shaper(shape, hertz("frequency", frequency), _ratio(damping))
    total = 2.0 * pause + length + parts[-1][1]
    return Reference(
        name=f"move {shape}",
        duration=total if duration is None else positive("duration", duration, "s"),
        low=min(first, last),
        high=max(first, last),
        motion=Shaped(first, base, tuple(parts), pause),
    )


def _ratio(damping: float) -> float:
    ratio = in_range("damping", damping, 1.0, "damping ratio")
    if ratio >= 1.0:
        raise ParameterError("damping", f"{ratio:g}", "below 1, a mode that rings")
    return ratio


def shaper(shape: Shape, frequency: float, damping: float) -> list[tuple[float, float]]:
    """Return sizes and times [s] of the parts of a shaper.

    Those of the extra-insensitive one for a damped mode are the fits of Singhose, Seering and
    Singer 1997 (Journal of Mechanical Design 119, 198).

    Examples
    --------
    >>> [(round(size, 3), time) for size, time in shaper("zv", 100.0, 0.0)]
    [(0.5, 0.0), (0.5, 0.005)]
    """
    root = math.sqrt(1.0 - damping * damping)
    period = 1.0 / (frequency * root)
    k = math.exp(-math.pi * damping / root)
    if shape == "zv":
        sizes = np.array([1.0, k])
    elif shape == "zvd":
        sizes = np.array([1.0, 2.0 * k, k * k])
    else:
        v, z = RESIDUAL, damping
        one = 0.24968 + 0.24962 * v + (0.80008 + 1.23328 * v) * z + (0.49599 + 3.17316 * v) * z * z
        last = 0.25149 + 0.21474 * v - (0.83249 - 1.41498 * v) * z + (0.85181 - 4.90094 * v) * z * z
        sizes = np.array([one, 1.0 - one - last, last])
    times = np.arange(sizes.size) * 0.5 * period
    if shape == "ei":
        v, z = RESIDUAL, damping
        middle = 0.49990 + v * z * (0.46159 + z * (4.26169 + z * 1.75601))
        middle += v * v * z * (8.57843 + z * (-108.644 + z * 336.989))
        times[1] = middle * period
    sizes /= sizes.sum()
    return list(zip(sizes.tolist(), times.tolist(), strict=True))


@dataclass(frozen=True)
class Shaped:
    """The sum of parts of a motion that begins at 0, each with its size and time."""

    start: float
    base: Motion
    parts: tuple[tuple[float, float], ...]
    pause: float

    def __call__(self, t: Array) -> tuple[Array, Array, Array]:
        """Return displacement, velocity and acceleration at the times `t`."""
        x, v, a = (np.zeros(np.shape(t)) for _ in range(3))
        for size, time in self.parts:
            for total, one in zip((x, v, a), self.base(t - self.pause - time), strict=True):
                total += size * one
        return self.start + x, v, a


@dataclass(frozen=True)
class Quintic:
    """The quintic S-curve over a way [m] in a time [s], from time 0 on."""

    way: float
    length: float

    def __call__(self, t: Array) -> tuple[Array, Array, Array]:
        """Return displacement, velocity and acceleration at the times `t`."""
        s, slope, curvature = s_curve(t / self.length)
        return (
            self.way * s,
            self.way / self.length * slope,
            self.way / self.length**2 * curvature,
        )


@dataclass(frozen=True)
class Segments:
    """A motion of constant jerk in each of some segments, at rest before and after.

    Attributes
    ----------
    begins : tuple of float
        Begin of each segment [s], that of the rest at the end the last.
    states : tuple of (float, float, float, float)
        Displacement, velocity, acceleration and jerk at the begin of each.
    """

    begins: tuple[float, ...]
    states: tuple[tuple[float, float, float, float], ...]

    @property
    def length(self) -> float:
        """Time from rest to rest [s]."""
        return self.begins[-1]

    @classmethod
    def fastest(cls, way: float, speed: float, acceleration: float, jerk: float) -> Segments:
        """Make the fastest motion over a way [m] within limits, which may be infinite.

        Lambrechts, Boerlage and Steinbuch 2005, Control Engineering Practice 13, 145, section 2.
        """
        size, sign = abs(way), math.copysign(1.0, way)
        # The time in which the acceleration builds up, and that of the whole acceleration.
        build = 0.0
        if math.isfinite(jerk):
            build = min(
                math.sqrt(speed / jerk), acceleration / jerk, (size / (2 * jerk)) ** (1 / 3)
            )
        most = min(jerk * build, acceleration) if build else acceleration
        whole = 2.0 * build
        # The acceleration stays at its limit, where it reaches it.
        if math.isfinite(most) and most >= acceleration * (1.0 - 1e-12):
            whole = min(
                build + speed / most,
                0.5 * (build + math.sqrt(build * build + 4.0 * size / most)),
            )
        top = most * (whole - build) if whole else speed
        top = min(top, speed)
        cruise = max(0.0, size / top - whole) if math.isfinite(top) else 0.0
        return cls._of(sign, size, top, most, build, whole, cruise)

    @classmethod
    def _of(
        cls,
        sign: float,
        size: float,
        top: float,
        most: float,
        build: float,
        whole: float,
        cruise: float,
    ) -> Segments:
        rate = most / build if build else 0.0
        flat = whole - 2.0 * build
        # Duration, and acceleration and jerk at its begin.
        pieces = [
            (build, 0.0, rate),
            (flat, most, 0.0),
            (build, most, -rate),
            (cruise, 0.0, 0.0),
            (build, 0.0, -rate),
            (flat, -most, 0.0),
            (build, -most, rate),
        ]
        begins, states = [], []
        t = x = v = 0.0
        if not whole and math.isfinite(top):
            v = top
        for duration, a, j in pieces:
            if duration <= 0.0:
                continue
            begins.append(t)
            states.append((sign * x, sign * v, sign * a, sign * j))
            x += duration * (v + duration * (a / 2.0 + duration * j / 6.0))
            v += duration * (a + duration * j / 2.0)
            t += duration
        begins.append(t)
        states.append((sign * size, 0.0, 0.0, 0.0))
        return cls(tuple(begins), tuple(states))

    def __call__(self, t: Array) -> tuple[Array, Array, Array]:
        """Return displacement, velocity and acceleration at the times `t`."""
        place = np.searchsorted(self.begins, t, side="right")
        x, v, a, j = np.array([(0.0, 0.0, 0.0, 0.0), *self.states]).T[:, place]
        since = t - np.array([0.0, *self.begins])[place]
        return (
            x + since * (v + since * (a / 2.0 + since * j / 6.0)),
            v + since * (a + since * j / 2.0),
            a + since * j,
        )
