"""The built-in paths: circle, Lissajous figure, raster scan and spiral."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .. import _core
from .._support.arguments import check_length, check_reach, finite, hertz, in_range, positive
from .._support.messages import quoted
from ..errors import ParameterError
from .motions import Cosines, common_period, extremes, s_curve
from .reference import Reference
from .xy_reference import HOME, START, XYReference

if TYPE_CHECKING:
    from collections.abc import Sequence

    from .motions import Array, Motion

__all__ = ["circle", "lissajous", "raster", "spiral"]

# The middle of the workspace of Xu and Li 2010, 117 um by 117 um [m].
MIDDLE = (58.5e-6, 58.5e-6)
# Default number of turns of a closed path: the first includes the smooth start.
PERIODS = 3.0
# Most turns of a spiral.
MOST_TURNS = 10000


def circle(
    *,
    frequency: float,
    radius: float,
    centre: Sequence[float] = MIDDLE,
    duration: float | None = None,
    phase: float = 0.0,
    ramp: float | None = None,
    origin: Sequence[float] | None = HOME,
) -> XYReference:
    r"""Make a circle, counter-clockwise.

    .. math:: x = c_x + R \cos(2 \pi f t + \varphi), \quad y = c_y + R \sin(2 \pi f t + \varphi)

    Parameters
    ----------
    frequency : float
        f [Hz], above 0.
    radius : float
        R [m], above 0.
    centre : (float, float), optional
        Centre [m]; default the middle of the workspace of Xu and Li 2010.
    duration : float, optional
        Length [s]; default three turns.
    phase : float, optional
        Phase at time 0 [rad].
    ramp : float, optional
        Length of the smooth start [s], see `Reference`; default 2 s, 0 for none.
    origin : (float, float) or None, optional
        Position from which the smooth start begins [m]; None for the first point of the path.

    Returns
    -------
    XYReference
        With its exact derivatives.

    Raises
    ------
    ParameterError
        A number is not finite or out of its range.

    Examples
    --------
    >>> import piezotrack as pt
    >>> path = pt.circle(frequency=0.1, radius=40e-6)
    >>> path.period, path.duration
    (10.0, 30.0)
    """
    frequency = hertz("frequency", frequency)
    radius = _size("radius", radius)
    cx, cy = _pair("centre", centre)
    turn = finite("phase", phase, "rad")
    motions = (
        Cosines(cx, (radius,), (frequency,), (turn,)),
        Cosines(cy, (radius,), (frequency,), (turn - 0.5 * math.pi,)),
    )
    period = 1.0 / frequency
    name = f"circle {1e6 * radius:g} um, {frequency:g} Hz"
    made = _path(name, motions, period, duration, ramp, origin, (period, period))
    return XYReference(name=name, x=made.x, y=made.y, radius=radius, centre=(cx, cy))


def lissajous(
    *,
    frequencies: Sequence[float],
    sizes: Sequence[float],
    centre: Sequence[float] = MIDDLE,
    phase: float = 0.5 * math.pi,
    duration: float | None = None,
    ramp: float | None = None,
    origin: Sequence[float] | None = HOME,
) -> XYReference:
    r"""Make a Lissajous figure, as for a scan without reversals at constant speed.

    .. math:: x = c_x + A \sin(2 \pi f_x t + \varphi), \quad y = c_y + B \sin(2 \pi f_y t)

    Parameters
    ----------
    frequencies : (float, float)
        f of x and y [Hz], above 0, with a common period.
    sizes : (float, float)
        Amplitudes A and B [m], above 0.
    centre, duration, ramp, origin
        As in `circle`; the default duration is three common periods.
    phase : float, optional
        Phase of x ahead of y [rad].

    Returns
    -------
    XYReference
        With its exact derivatives.

    Raises
    ------
    ParameterError
        A number is not finite or out of its range, or the frequencies have no common period.

    Examples
    --------
    >>> import piezotrack as pt
    >>> pt.lissajous(frequencies=(0.2, 0.3), sizes=(20e-6, 20e-6)).period
    10.0
    """
    fx, fy = (hertz("frequencies", one) for one in _pair("frequencies", frequencies))
    a, b = (_size("sizes", one) for one in _pair("sizes", sizes))
    cx, cy = _pair("centre", centre)
    period = common_period((fx, fy))
    if period == math.inf:
        raise ParameterError("frequencies", f"{fx:g} and {fy:g} Hz", "a common period", verb="are")
    quarter = 0.5 * math.pi
    motions = (
        Cosines(cx, (a,), (fx,), (finite("phase", phase, "rad") - quarter,)),
        Cosines(cy, (b,), (fy,), (-quarter,)),
    )
    name = f"Lissajous figure {fx:g} to {fy:g} Hz"
    return _path(name, motions, period, duration, ramp, origin, (1.0 / fx, 1.0 / fy))


def raster(
    *,
    line_rate: float,
    sizes: Sequence[float],
    lines: int,
    centre: Sequence[float] = MIDDLE,
    flyback: float = 0.25,
    duration: float | None = None,
    ramp: float | None = None,
    origin: Sequence[float] | None = HOME,
) -> XYReference:
    r"""Make a raster scan, line by line, as in a scanning probe microscope.

    x traces each line at constant speed and returns (flyback) along a quintic with continuous
    speed and acceleration, which overshoots both ends of the line; y is constant along a line,
    moves to the next during the flyback and returns to the first during one further line, along
    S-curves.

    Parameters
    ----------
    line_rate : float
        Lines in a second [Hz], above 0.
    sizes : (float, float)
        Length of a line and distance of the first from the last [m], above 0.
    lines : int
        Lines in a frame, 2 or more.
    centre, ramp, origin
        As in `circle`.
    flyback : float, optional
        Flyback as a share of the line's time, from 0.05 to 0.9.
    duration : float, optional
        Length [s]; default two frames.

    Returns
    -------
    XYReference
        With its exact derivatives; its period is that of a frame, ``(lines + 1) / line_rate``.

    Raises
    ------
    ParameterError
        A number is not finite or out of its range.

    Examples
    --------
    >>> import piezotrack as pt
    >>> scan = pt.raster(line_rate=1.0, sizes=(20e-6, 20e-6), lines=9)
    >>> print(f"{scan.period:g} s a frame, x from {1e6 * scan.x.low:.1f} um")
    10 s a frame, x from 48.1 um
    """
    rate = hertz("line_rate", line_rate)
    width, height = (_size("sizes", one) for one in _pair("sizes", sizes))
    cx, cy = _pair("centre", centre)
    count = _core.as_count("lines", lines)
    if not 2 <= count <= 100_000:
        raise ParameterError("lines", count, "a whole number from 2 to 100000")
    share = in_range("flyback", flyback, 0.9, "parts of a line's time")
    if share < 0.05:
        raise ParameterError("flyback", f"{share:g}", "0.05 of a line's time or more")
    line = 1.0 / rate
    motions = (
        _Trace(cx - 0.5 * width, width, line, share * line),
        _Lines(cy - 0.5 * height, height, count, line, share * line),
    )
    period = (count + 1) * line
    name = f"raster of {count} lines at {rate:g} Hz"
    length = 2.0 * period if duration is None else duration
    # Two samples in each half of a flyback resolve it.
    shortest = (share * line, share * line)
    return _path(name, motions, period, length, ramp, origin, shortest)


def spiral(
    *,
    frequency: float,
    radius: float,
    pitch: float,
    centre: Sequence[float] = MIDDLE,
    ramp: float | None = None,
    origin: Sequence[float] | None = HOME,
) -> XYReference:
    r"""Make an Archimedean spiral from its centre at constant angular speed.

    .. math:: r = p f t, \quad x = c_x + r \cos(2 \pi f t), \quad y = c_y + r \sin(2 \pi f t)

    Mahmood and Moheimani 2009, doi 10.1088/0957-4484/20/36/365503: a scan with a single
    frequency on each axis.

    Parameters
    ----------
    frequency : float
        Turns in a second f [Hz], above 0.
    radius : float
        Final radius [m], above 0.
    pitch : float
        Distance p between turns [m], above 0 and below `radius`.
    centre, ramp, origin
        As in `circle`. The smooth start replaces a part of the inner turns.

    Returns
    -------
    XYReference
        With its exact derivatives; it does not repeat.

    Raises
    ------
    ParameterError
        A number is not finite or out of its range.

    Examples
    --------
    >>> import piezotrack as pt
    >>> pt.spiral(frequency=0.5, radius=20e-6, pitch=2e-6).duration
    20.0
    """
    frequency = hertz("frequency", frequency)
    radius, pitch = _size("radius", radius), _size("pitch", pitch)
    if pitch >= radius:
        raise ParameterError("pitch", f"{pitch:g}", f"less than the radius, {radius:g} m")
    if radius > MOST_TURNS * pitch:
        raise ParameterError(
            "pitch", f"{pitch:g} m, for {radius / pitch:g} turns", f"at most {MOST_TURNS}"
        )
    cx, cy = _pair("centre", centre)
    motions = (
        _Spiral(cx, pitch, frequency, 0.0),
        _Spiral(cy, pitch, frequency, -0.5 * math.pi),
    )
    name = f"spiral of {radius / pitch:g} turns at {frequency:g} Hz"
    shortest = (1.0 / frequency, 1.0 / frequency)
    length = round(radius / (pitch * frequency), 9)
    return _path(name, motions, None, length, ramp, origin, shortest)


@dataclass(frozen=True)
class _Trace:
    """Fast axis: a line of length `width` at constant speed, back within `back` of each `line`."""

    low: float
    width: float
    line: float
    back: float

    def __call__(self, t: Array) -> tuple[Array, Array, Array]:
        along = np.mod(t, self.line)
        forth = self.line - self.back
        speed = self.width / forth
        # The flyback is an S-curve added to the constant speed.
        travel = self.width + speed * self.back
        s, slope, curvature = s_curve((along - forth) / self.back)
        return (
            self.low + speed * along - travel * s,
            speed - travel * slope / self.back,
            -travel * curvature / self.back**2,
        )


@dataclass(frozen=True)
class _Lines:
    """Slow axis: to the next line within `back`, to the first within `back` and one `line`."""

    low: float
    height: float
    count: int
    line: float
    back: float

    def __call__(self, t: Array) -> tuple[Array, Array, Array]:
        along = np.mod(t, (self.count + 1) * self.line)
        last = self.count - 1
        number = np.minimum(np.floor(along / self.line), last)
        step = self.height / last
        returns = number == last
        travel = np.where(returns, -self.height, step)
        time = np.where(returns, self.back + self.line, self.back)
        s, slope, curvature = s_curve((along - (number + 1.0) * self.line + self.back) / time)
        return (
            self.low + number * step + travel * s,
            travel * slope / time,
            travel * curvature / time**2,
        )


@dataclass(frozen=True)
class _Spiral:
    """``middle + pitch f t cos(2 pi f t + phase)``."""

    middle: float
    pitch: float
    frequency: float
    phase: float

    def __call__(self, t: Array) -> tuple[Array, Array, Array]:
        rate, growth = math.tau * self.frequency, self.pitch * self.frequency
        angle = rate * t + self.phase
        cosine, sine = np.cos(angle), np.sin(angle)
        return (
            self.middle + growth * t * cosine,
            growth * (cosine - rate * t * sine),
            -growth * rate * (2.0 * sine + rate * t * cosine),
        )


def _path(
    name: str,
    motions: tuple[Motion, Motion],
    period: float | None,
    duration: float | None,
    ramp: float | None,
    origin: Sequence[float] | None,
    shortest: tuple[float, float],
) -> XYReference:
    """Make the references of both axes."""
    length = positive("duration", PERIODS * (period or 1.0) if duration is None else duration, "s")
    start = min(START, length) if ramp is None else in_range("ramp", ramp, length, "s")
    home = (None, None) if origin is None else _pair("origin", origin)
    axes = []
    for axis, motion, least, place in zip("xy", motions, shortest, home, strict=True):
        low, high = extremes(motion, min(length, period or length), least)
        check_reach(low, high)
        axes.append(
            Reference(
                name=f"{axis} of {name}",
                duration=length,
                low=low,
                high=high,
                motion=motion,
                period=period,
                ramp=start,
                shortest=least,
                origin=place,
            )
        )
    return XYReference(name=name, x=axes[0], y=axes[1])


def _pair(name: str, values: Sequence[float]) -> tuple[float, float]:
    """Return two finite numbers, or raise ParameterError."""
    try:
        first, second = values
    except (TypeError, ValueError):
        raise ParameterError(name, quoted(values), "two numbers, for x and y") from None
    return finite(f"{name}[0]", first, "SI units"), finite(f"{name}[1]", second, "SI units")


def _size(name: str, value: float) -> float:
    """Return a length above 0 that is plausible in metres."""
    size = positive(name, value, "m")
    check_length(name, size)
    return size
