"""The built-in references: sine, triangle, staircase, chirp and multisine."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from .. import _core
from .._support.arguments import (
    bounds,
    check_reach,
    finite,
    hertz,
    in_range,
    not_negative,
    numbers,
    positive,
)
from ..errors import ParameterError, ShapeError
from .motions import Chirp, Cosines, Steps, Triangle, common_period, extremes, schroeder_phases
from .reference import Reference

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]

__all__ = ["chirp", "multisine", "sine", "staircase", "triangle"]

# The longest start, as a share of a period, with which a sine from one of its ends never goes
# faster than later on.
START = 1.0 / 6.0
# Amplitude in m, or ratio of amplitudes, that only a wrong unit explains.
MOST_AMPLITUDE = 1e9
# The longest rise, as a share of the time at a level.
RISE = 0.2
# Longest of them [s]: the square of more leaves float64 soon.
LONGEST_RISE = 1e9


def sine(
    *,
    frequency: float,
    low: float,
    high: float,
    duration: float,
    phase: float = 0.0,
    ramp: float | None = None,
) -> Reference:
    r"""Go up and down as a sine, from `low` at rest.

    .. math::

        x(t) = \tfrac12 (high + low) - \tfrac12 (high - low) \cos(2 \pi f t + \varphi)

    Parameters
    ----------
    frequency : float
        f [Hz], above 0.
    low, high : float
        Lowest and highest displacement [m].
    duration : float
        Length [s], above 0.
    phase : float, optional
        Where in its period it begins [rad]: 0 at `low`, pi at `high`.
    ramp : float, optional
        Length of the smooth start [s], see `Reference`; 0 for none, when the acceleration (and
        with a `phase` the velocity) jumps at time 0. A sixth of a period where it is not given;
        from `low` or `high` it is then never faster than the sine itself.

    Returns
    -------
    Reference
        With its exact derivatives.

    Raises
    ------
    ParameterError
        A number is not finite or out of its range, or `low` is not below `high`.

    Examples
    --------
    >>> import piezotrack as pt
    >>> pt.sine(frequency=0.2, low=0.0, high=110e-6, duration=20.0)
    Reference(sine 0.2 Hz, 0 to 110 um, 20 s)
    """
    frequency = hertz("frequency", frequency)
    low, high = bounds(low, high)
    duration = positive("duration", duration, "s")
    turn = finite("phase", phase, "rad")
    return Reference(
        name=f"sine {frequency:g} Hz",
        duration=duration,
        low=low,
        high=high,
        motion=Cosines(0.5 * (low + high), (0.5 * (low - high),), (frequency,), (turn,)),
        period=1.0 / frequency,
        ramp=_ramp(ramp, 1.0 / frequency, duration),
        shortest=1.0 / frequency,
    )


def triangle(
    *,
    frequency: float,
    low: float,
    high: float,
    duration: float,
    rounding: float = 0.1,
    ramp: float | None = None,
) -> Reference:
    r"""Go up and down at one speed, with rounded corners, from the corner at `low`.

    Parameters
    ----------
    frequency : float
        f [Hz], above 0.
    low, high : float
        Lowest and highest displacement [m]; the rounded corners reach them.
    duration : float
        Length [s], above 0.
    rounding : float, optional
        Share of a period that is spent in its two corners, from 0 to 1. In a corner of the
        length 2 c the velocity goes as ``1.5 u - 0.5 u^3`` from one speed to the other, u = t / c
        from -1 to 1, so that the acceleration has no jump; between the corners the speed is
        ``(high - low) / (1 / (2 f) - 0.75 c)``. With 0 the corners are sharp; there the velocity
        is that after the corner, and the acceleration is 0 everywhere.
    ramp : float, optional
        Length of the smooth start [s], see `Reference`; 0 for none. A sixth of a period where
        it is not given.

    Returns
    -------
    Reference
        With its exact derivatives.

    Raises
    ------
    ParameterError
        A number is not finite or out of its range, or `low` is not below `high`.

    Examples
    --------
    >>> import piezotrack as pt
    >>> pt.triangle(frequency=1.0, low=0.0, high=50e-6, duration=4.0, rounding=0.2)
    Reference(triangle 1 Hz, 0 to 50 um, 4 s)
    """
    frequency = hertz("frequency", frequency)
    low, high = bounds(low, high)
    duration = positive("duration", duration, "s")
    share = in_range("rounding", rounding, 1.0, "parts of a period")
    return Reference(
        name=f"triangle {frequency:g} Hz",
        duration=duration,
        low=low,
        high=high,
        motion=Triangle(low, high, 1.0 / frequency, share),
        period=1.0 / frequency,
        ramp=_ramp(ramp, 1.0 / frequency, duration),
        shortest=1.0 / frequency,
    )


def staircase(
    *,
    dwell: float,
    steps: int | None = None,
    low: float | None = None,
    high: float | None = None,
    levels: ArrayLike | None = None,
    rise: float | None = None,
    duration: float | None = None,
) -> Reference:
    r"""Make a staircase: levels held in sequence, with S-curves between them.

    Give either `steps` with `low` and `high`, for a staircase of equal steps up and down again,
    or `levels`.

    Parameters
    ----------
    dwell : float
        Hold time of each level [s], 0 or above.
    steps : int, optional
        Number of steps from `low` to `high`, 1 or more, and as many back.
    low, high : float, optional
        Lowest and highest level [m].
    levels : array_like, shape (n,), optional
        Levels in their order [m], 2 or more. The last one is held to the end.
    rise : float, optional
        Time from one level to the next [s], above 0: along ``10 u^3 - 15 u^4 + 6 u^5``, at rest
        and without acceleration at both ends. A fifth of `dwell` where it is not given.
    duration : float, optional
        Length [s]; one period of a staircase up and down, or all `levels`, where it is not given.

    Returns
    -------
    Reference
        With its exact derivatives. Up and down it repeats, with the period
        ``2 steps (dwell + rise)``; `levels` do not.

    Raises
    ------
    ParameterError
        A number is not finite or out of its range, or both or neither of `steps` and `levels`
        are given.

    Examples
    --------
    >>> import piezotrack as pt
    >>> pt.staircase(steps=5, low=0.0, high=100e-6, dwell=1.0, rise=0.1)
    Reference(staircase of 5 steps up and down, 0 to 100 um, 11 s)
    >>> pt.staircase(levels=[0.0, 30e-6, 10e-6], dwell=1.0)
    Reference(staircase of 3 levels, 0 to 30 um, 3.4 s)
    """
    dwell = not_negative("dwell", dwell, "s")
    rise = in_range("rise", RISE * dwell if rise is None else rise, LONGEST_RISE, "s")
    rise = positive("rise", rise, "s")
    if (steps is None) == (levels is None):
        raise ParameterError(
            "steps and levels: expected exactly one of them, "
            f"{'neither is' if steps is None else 'both are'} given",
            argument="steps",
        )
    if levels is None:
        count = _core.as_count("steps", steps)
        if not 1 <= count <= 10**6:
            raise ParameterError("steps", count, "a whole number from 1 to 1000000")
        low, high = bounds(low, high)
        up = np.linspace(low, high, count + 1)
        places = np.concatenate([up, up[-2:0:-1]])
        name = f"staircase of {count} step{'s' if count > 1 else ''} up and down"
        period, record = 2 * count * (dwell + rise), 2 * count * (dwell + rise)
    else:
        if low is not None or high is not None:
            raise ParameterError("low or high", "given", "levels without them")
        places = numbers("levels", levels, "m", least=2)
        low, high = float(places.min()), float(places.max())
        check_reach(low, high)
        name = f"staircase of {places.size} levels"
        period, record = None, places.size * (dwell + rise) - rise
    return Reference(
        name=name,
        duration=record if duration is None else positive("duration", duration, "s"),
        low=low,
        high=high,
        motion=Steps(tuple(places.tolist()), dwell, rise, cyclic=period is not None),
        period=period,
        shortest=dwell + rise,
    )


def chirp(
    *,
    start_frequency: float,
    stop_frequency: float,
    low: float,
    high: float,
    duration: float,
    ramp: float | None = None,
) -> Reference:
    r"""Make a chirp: a sine whose frequency changes linearly with time, from `low` at rest.

    .. math::

        x(t) = \tfrac12 (high + low)
            - \tfrac12 (high - low) \cos\left(2 \pi f_0 t + \pi (f_1 - f_0) t^2 / T\right)

    Parameters
    ----------
    start_frequency, stop_frequency : float
        Frequencies f0 at the beginning and f1 at the end [Hz], above 0.
    low, high : float
        Lowest and highest displacement [m].
    duration : float
        Length T [s], above 0.
    ramp : float, optional
        Length of the smooth start [s], see `Reference`; 0 for none. A sixth of the first period
        where it is not given.

    Returns
    -------
    Reference
        With its exact derivatives.

    Raises
    ------
    ParameterError
        A number is not finite or out of its range, or `low` is not below `high`.

    Examples
    --------
    >>> import piezotrack as pt
    >>> pt.chirp(start_frequency=0.1, stop_frequency=5.0, low=0.0, high=50e-6, duration=20.0)
    Reference(chirp 0.1 to 5 Hz, 0 to 50 um, 20 s)
    """
    first = hertz("start_frequency", start_frequency)
    last = hertz("stop_frequency", stop_frequency)
    low, high = bounds(low, high)
    duration = positive("duration", duration, "s")
    return Reference(
        name=f"chirp {first:g} to {last:g} Hz",
        duration=duration,
        low=low,
        high=high,
        motion=Chirp(0.5 * (low + high), 0.5 * (high - low), first, last, duration),
        ramp=_ramp(ramp, 1.0 / first, duration),
        shortest=1.0 / max(first, last),
    )


def multisine(
    *,
    frequencies: ArrayLike,
    duration: float,
    low: float | None = None,
    high: float | None = None,
    amplitudes: ArrayLike | None = None,
    offset: float | None = None,
    seed: int | None = None,
    ramp: float | None = None,
) -> Reference:
    r"""Make a sum of cosines, ``offset + sum of A_k cos(2 pi f_k t + phi_k)``.

    Give either `low` and `high`, between which the sum is fitted, or `offset` and `amplitudes`.

    Parameters
    ----------
    frequencies : array_like, shape (n,)
        f_k [Hz], above 0 and all different.
    duration : float
        Length [s], above 0.
    low, high : float, optional
        Lowest and highest displacement [m]. The sum reaches both within `duration`, before the
        smooth start is applied.
    amplitudes : float or array_like, shape (n,), optional
        A_k, above 0: with `offset` in m, and with `low` and `high` as ratios, equal where they
        are not given.
    offset : float, optional
        Mean displacement [m].
    seed : int, optional
        For random phases; the same seed gives the same. Where it is not given the phases are
        Schroeder's, doi 10.1109/TIT.1970.1054411, which keep the peaks of neighbouring
        harmonics low.
    ramp : float, optional
        Length of the smooth start [s], see `Reference`; 0 for none. A sixth of the longest
        period of a cosine where it is not given.

    Returns
    -------
    Reference
        With its exact derivatives. Its period is the shortest time in which all cosines make
        whole turns, and None where `duration` is shorter than one.

    Raises
    ------
    ParameterError
        A number is not finite or out of its range, or the range is given twice or not at all, or
        a period holds too many oscillations to find the range.
    ShapeError
        There are not as many amplitudes as frequencies.

    Examples
    --------
    >>> import piezotrack as pt
    >>> lines = pt.multisine(frequencies=[0.5, 1.0, 1.5], low=0.0, high=50e-6, duration=8.0)
    >>> lines, lines.period
    (Reference(multisine 0.5, 1, 1.5 Hz, 0 to 50 um, 8 s), 2.0)
    """
    given_lines = numbers("frequencies", frequencies, "Hz", above=0.0)
    lines = np.array([hertz("frequencies", one) for one in given_lines])
    order = np.argsort(lines)
    lines = lines[order]
    if (np.diff(lines) == 0.0).any():
        twice = lines[:-1][np.diff(lines) == 0.0][0]
        raise ParameterError("frequencies", f"{twice:g} Hz twice", "different ones", verb="has")
    duration = positive("duration", duration, "s")
    is_fitted = low is not None and high is not None and offset is None
    is_given = low is None and high is None and offset is not None and amplitudes is not None
    if not (is_fitted or is_given):
        raise ParameterError(
            "expected either low and high (with amplitudes as ratios, if they differ) or offset "
            "and amplitudes",
            argument="amplitudes",
        )
    sizes = np.ones(lines.size)
    if amplitudes is not None:
        given = numbers("amplitudes", amplitudes, "m, or ratios", above=0.0)
        if given.size not in (1, lines.size):
            raise ShapeError(
                "amplitudes", f"{given.size} entries", f"one, or {lines.size} like frequencies"
            )
        if not (given < MOST_AMPLITUDE).all():
            raise ParameterError(
                "amplitudes",
                f"{given.max():g}",
                f"m, or ratios, below {MOST_AMPLITUDE:g}",
                verb="has",
            )
        sizes = np.broadcast_to(given, lines.shape)[order]
    phases = schroeder_phases(sizes)
    if seed is not None:
        random = np.random.default_rng(_core.as_count("seed", seed))
        phases = random.uniform(0.0, math.tau, sizes.size)
    period = common_period(tuple(lines.tolist()))
    motion = Cosines(0.0, *(tuple(values.tolist()) for values in (sizes, lines, phases)))
    bottom, top = extremes(motion, min(duration, period), 1.0 / lines[-1], cosines=lines.size)
    if is_fitted:
        low, high = bounds(low, high)
        if not top > bottom:
            raise ParameterError("duration", f"{duration:g} s", "a time in which it moves")
        scale = (high - low) / (top - bottom)
        offset = low - scale * bottom
    else:
        scale, offset = 1.0, finite("offset", offset, "m")
        low, high = offset + bottom, offset + top
        check_reach(low, high)
    names = ", ".join(f"{line:g}" for line in lines[:3])
    return Reference(
        name=f"multisine {names} Hz" if lines.size <= 3 else f"multisine of {lines.size} lines",
        duration=duration,
        low=low,
        high=high,
        motion=Cosines(offset, tuple((scale * sizes).tolist()), motion.frequencies, motion.phases),
        period=period if period <= duration * (1.0 + 1e-9) else None,
        ramp=_ramp(ramp, 1.0 / lines[0], duration),
        shortest=1.0 / lines[-1],
    )


def _ramp(ramp: float | None, first_period: float, duration: float) -> float:
    if ramp is None:
        return min(START * first_period, duration)
    return in_range("ramp", ramp, duration, "s, within the reference")
