"""References as functions of time with exact derivatives."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .._support.arguments import check_reach, finite, in_range, not_negative, plain, positive
from .._support.arrays import check_dt, real_array, signal_of
from .._support.messages import quoted
from .._support.units import best_length_unit
from ..errors import DataError, ParameterError, ShapeError
from .motions import Spline, blended, extremes

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping

    from numpy.typing import ArrayLike, NDArray

    from .motions import Motion

    Array = NDArray[np.float64]

__all__ = ["Reference", "SampledReference", "read_reference"]

MIN_SAMPLES = 6
MOST_SAMPLES = 10**7
# Rounding error of a quotient of two decimal numbers, in samples.
ROUNDING = 1e-3


@dataclass(frozen=True, kw_only=True, eq=False)
class SampledReference:
    """A reference at the sampling instants of a controller.

    Attributes
    ----------
    t : ndarray, shape (n,)
        Time [s], from 0 on.
    x : ndarray, shape (n,)
        Displacement [m].
    v : ndarray, shape (n,)
        Velocity [m/s].
    a : ndarray, shape (n,)
        Acceleration [m/s^2].
    dt : float
        Sampling interval [s].
    period : float or None
        Time after which the motion repeats [s]; None where it does not.
    """

    t: Array
    x: Array
    v: Array
    a: Array
    dt: float
    period: float | None

    def __len__(self) -> int:
        return int(self.t.size)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Reference:
    r"""Reference: displacement, velocity and acceleration as functions of time.

    `sine`, `triangle`, `staircase`, `chirp`, `multisine`, `read_reference` and
    `Reference.from_samples` make them; so can your own function as `motion`.

    Parameters
    ----------
    name : str
        Name for titles.
    duration : float
        Length [s], above 0.
    low, high : float
        Lowest and highest displacement of `motion` [m].
    motion : callable
        Takes times [s], an array, and returns displacement [m], velocity [m/s] and acceleration
        [m/s^2], arrays of the same shape.
    period : float, optional
        Time after which `motion` repeats [s].
    ramp : float, optional
        Length of the smooth start [s]; 0 for none.
    shortest : float, optional
        The shortest period in `motion` [s]; a sampling interval above half of it is refused.
    origin : float, optional
        Displacement from which the smooth start begins [m]; default the first displacement of
        `motion`. Used with a smooth start only.
    interval : float, optional
        Sampling interval of the samples that it goes through [s], if it does.

    Raises
    ------
    ParameterError
        A number is not finite or out of its range.

    Notes
    -----
    The smooth start begins at the first displacement at rest, and is identical to the motion,
    in phase, from `ramp` on:

    .. math::

        x(t) = o + s(t / r) \, (m(t) - o), \qquad s(u) = 10 u^3 - 15 u^4 + 6 u^5

    for t < r, with o = `origin`, or else m(0). Displacement, velocity and acceleration have no
    jump, velocity and acceleration are 0 at the start, and the range is not
    left. A motion that begins at full velocity is up to 1.8 times as fast meanwhile.

    Examples
    --------
    >>> import numpy as np
    >>> import piezotrack as pt
    >>> def fall(t):
    ...     e = 5e-6 * np.exp(-t)
    ...     return e, -e, e
    >>> pt.Reference(name="fall", duration=3.0, low=0.0, high=5e-6, motion=fall)
    Reference(fall, 0 to 5 um, 3 s)
    """

    name: str
    duration: float
    low: float
    high: float
    motion: Motion
    period: float | None = None
    ramp: float = 0.0
    shortest: float = 0.0
    origin: float | None = None
    interval: float | None = None

    def __post_init__(self) -> None:
        if not callable(self.motion):
            raise ParameterError("motion", quoted(self.motion), "a function of times")
        duration = positive("duration", self.duration, "s")
        numbers = {
            "duration": duration,
            "low": finite("low", self.low, "m"),
            "high": finite("high", self.high, "m"),
            "period": None if self.period is None else positive("period", self.period, "s"),
            "ramp": in_range("ramp", self.ramp, duration, "s"),
            "shortest": not_negative("shortest", self.shortest, "s"),
            "origin": None if self.origin is None else finite("origin", self.origin, "m"),
            "interval": None if self.interval is None else check_dt(self.interval, "interval"),
        }
        for name, number in numbers.items():
            object.__setattr__(self, name, number)
        if self.low > self.high:
            raise ParameterError("low", f"{self.low:g}", f"at most high, {self.high:g} m")

    def at(self, t: ArrayLike) -> tuple[Array, Array, Array]:
        """Return the motion at any times.

        Parameters
        ----------
        t : array_like
            Times from 0 to `duration` [s], of any shape.

        Returns
        -------
        x : ndarray
            Displacement [m], of the same shape.
        v : ndarray
            Velocity [m/s].
        a : ndarray
            Acceleration [m/s^2].

        Raises
        ------
        ParameterError
            A time is outside of the reference, or `motion` returns something else than three
            arrays of finite numbers there.

        Examples
        --------
        >>> import piezotrack as pt
        >>> x, v, a = pt.sine(frequency=0.2, low=0.0, high=110e-6, duration=20.0).at([0.0, 7.5])
        >>> x
        array([0.     , 0.00011])
        >>> print(f"{1e6 * a[1]:.1f} um/s^2")
        -86.9 um/s^2
        """
        try:
            times = real_array("t", t)
        except (DataError, ShapeError):
            raise ParameterError("t", quoted(t), "times in s") from None
        slack = 1e-12 * self.duration
        outside = ~((times >= -slack) & (times <= self.duration + slack))
        if outside.any():
            raise ParameterError(
                "t",
                f"{float(times[outside][0]):.10g} s",
                f"times within the reference, from 0 to {self.duration:.10g} s",
            )
        inside = np.clip(np.atleast_1d(times), 0.0, self.duration)
        x, v, a = self._finite(inside, self.ramp)
        return x.reshape(times.shape), v.reshape(times.shape), a.reshape(times.shape)

    def _finite(self, t: Array, ramp: float) -> tuple[Array, Array, Array]:
        """Evaluate the motion with a start of this length, and refuse what is not finite."""
        # What overflows is found below.
        with np.errstate(all="ignore"):
            x, v, a = blended(self._motion_at, t, ramp, self.origin)
        good = np.isfinite(x) & np.isfinite(v) & np.isfinite(a)
        if not good.all():
            k = int(np.argmin(good))
            raise ParameterError(
                f"motion of {self.name}",
                f"{x.flat[k]:g} m, {v.flat[k]:g} m/s, {a.flat[k]:g} m/s^2 at {t.flat[k]:.10g} s",
                "finite numbers",
            )
        return x, v, a

    def _motion_at(self, t: Array) -> tuple[Array, Array, Array]:
        """Evaluate `motion`, which may be a function of the caller's."""
        parts = self.motion(t)
        try:
            x, v, a = (np.asarray(part, dtype=np.float64) for part in parts)
        except (TypeError, ValueError, OverflowError):
            x = v = a = np.zeros(0)
        if not (x.shape == v.shape == a.shape == t.shape):
            raise ParameterError(
                f"motion of {self.name}",
                f"{quoted(parts)} for times of the shape {t.shape}",
                "displacement, velocity and acceleration, each of that shape",
                verb="returns",
            )
        return x, v, a

    def sample(self, dt: float) -> SampledReference:
        """Return the motion at even sampling instants, those with 0 <= t < `duration`.

        Parameters
        ----------
        dt : float
            Sampling interval [s].

        Returns
        -------
        SampledReference
            Read-only arrays.

        Raises
        ------
        ParameterError
            `dt` is not above 0, longer than the reference, or leaves fewer than two samples in
            its shortest period.

        Examples
        --------
        >>> import piezotrack as pt
        >>> samples = pt.sine(frequency=0.2, low=0.0, high=110e-6, duration=20.0).sample(0.02)
        >>> len(samples), samples.period
        (1000, 5.0)
        """
        interval = check_dt(dt)
        if self.shortest > 0.0 and 2.0 * interval > self.shortest * (1.0 + 1e-9):
            raise ParameterError(
                "dt",
                f"{interval:g} s",
                f"at most {0.5 * self.shortest:g} s, two samples in the shortest period of the "
                f"reference ({self.name}), {self.shortest:g} s",
            )
        count = math.ceil(min(self.duration / interval, 2.0 * MOST_SAMPLES) - ROUNDING)
        if count > MOST_SAMPLES:
            raise ParameterError(
                "dt",
                f"{interval:g} s",
                f"at most {MOST_SAMPLES} samples in the reference's {self.duration:g} s",
            )
        if count < 2:
            raise ParameterError(
                "dt", f"{interval:g} s", f"less than the reference's {self.duration:g} s"
            )
        t: Array = interval * np.arange(count, dtype=np.float64)
        x, v, a = self.at(t)
        for array in (t, x, v, a):
            array.setflags(write=False)
        return SampledReference(t=t, x=x, v=v, a=a, dt=interval, period=self.period)

    @classmethod
    def from_samples(
        cls,
        x: ArrayLike,
        dt: float,
        *,
        period: float | None = None,
        duration: float | None = None,
        ramp: float = 0.0,
        name: str = "samples",
    ) -> Reference:
        """Make a reference through samples, with derivatives of a quintic spline.

        Parameters
        ----------
        x : array_like, shape (n,)
            Displacement [m], 6 samples or more.
        dt : float
            Sampling interval [s].
        period : float, optional
            Time after which the samples repeat [s]. Where they are one period (``n dt``, or one
            interval less and the last sample closes the loop), the spline is periodic and goes
            on for as long as `duration` says. A longer record is followed as it is.
        duration : float, optional
            Length [s]; that of the record, ``n dt``, where it is not given.
        ramp : float, optional
            Length of the smooth start [s], see `Reference`. By default the samples are followed
            from the first on, even if that asks for a jump of the velocity.
        name : str, optional
            Name for titles.

        Returns
        -------
        Reference
            After the last sample of a record that does not repeat, its acceleration lasts for
            one more interval.

        Raises
        ------
        DataError
            There are fewer than 6 samples, or one is not a finite number.
        ShapeError
            `x` is not one-dimensional.
        ParameterError
            A number is out of its range, or `duration` or `period` is longer than the record.

        Notes
        -----
        A spline goes through every sample. White noise of e rms in x is some 5 e / dt^2 rms in the
        acceleration, so a measured displacement needs smoothing first.

        Examples
        --------
        >>> import numpy as np
        >>> import piezotrack as pt
        >>> x = 1e-5 * np.sin(2 * np.pi * np.arange(100) / 100)
        >>> pt.Reference.from_samples(x, 0.02, period=2.0, duration=8.0)
        Reference(samples, -10 to 10 um, 8 s)
        """
        values = signal_of("x", x)
        dt = check_dt(dt)
        if values.size < MIN_SAMPLES:
            raise DataError(f"x has {values.size} samples: expected at least {MIN_SAMPLES}")
        record = values.size * dt
        cyclic = False
        if period is not None:
            period = positive("period", period, "s")
            turn = period / dt
            if not 2.0 - ROUNDING <= turn <= values.size + ROUNDING:
                raise ParameterError(
                    "period",
                    f"{period:g} s",
                    f"at least two samples, {2.0 * dt:g} s, and at most the length of the "
                    f"record, {record:g} s",
                )
            closing = abs(values[-1] - values[0]) <= 1e-6 * np.ptp(values)
            if closing and abs(turn - (values.size - 1)) <= ROUNDING:
                values, record = values[:-1], period
            cyclic = abs(turn - values.size) <= ROUNDING and values.size >= MIN_SAMPLES
            if cyclic:
                dt, record = period / values.size, period
        length = record if duration is None else positive("duration", duration, "s")
        if not cyclic and length > record + ROUNDING * dt:
            raise ParameterError(
                "duration",
                f"{length:g} s",
                f"at most the length of the record, {record:g} s; only samples of one period, "
                "with period=, go on",
            )
        motion = Spline(values, dt, cyclic)
        low, high = extremes(motion, min(length, record), 8.0 * dt)
        check_reach(low, high)
        return cls(
            name=name,
            duration=length,
            low=low,
            high=high,
            motion=motion,
            period=period,
            ramp=ramp,
            shortest=0.0 if period is None else period,
            interval=dt,
        )

    def __repr__(self) -> str:
        unit, scale = best_length_unit(max(abs(self.low), abs(self.high)))
        low, high = (plain(scale * value) for value in (self.low, self.high))
        return f"Reference({self.name}, {low} to {high} {unit}, {self.duration:.6g} s)"


def read_reference(
    path: str | os.PathLike[str],
    *,
    time: str | int | None = None,
    displacement: str | int | None = None,
    units: Mapping[str | int, str] | None = None,
    dt: float | None = None,
    period: float | None = None,
    duration: float | None = None,
    ramp: float = 0.0,
) -> Reference:
    r"""Read a reference from a text file with a time and a displacement.

    Parameters
    ----------
    path, time, units, dt
        As in `read`. The first sample is at time 0 of the reference, whatever its time in the
        file.
    displacement : str or int, optional
        The column to follow. Where it is not given, that is the one called reference, desired,
        target or setpoint, or else the displacement as `read` finds it.
    period, duration, ramp
        As in `Reference.from_samples`.

    Returns
    -------
    Reference
        Through all samples, as `Reference.from_samples` makes it; called like the file.

    Raises
    ------
    DataError
        The file cannot be read or used, or its times are not even. The message begins with the
        file's name and the line.
    ParameterError
        An argument names a column that is not there or has a value that cannot be used.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import piezotrack as pt
    >>> folder = tempfile.TemporaryDirectory()
    >>> path = pathlib.Path(folder.name, "target.csv")
    >>> lines = [f"{k / 50},{k * k / 100}" for k in range(101)]
    >>> _ = path.write_text("\n".join(["time_s,displacement_um", *lines]))
    >>> pt.references.read_reference(path)
    Reference(target.csv, 0 to 102.01 um, 2.02 s)
    >>> folder.cleanup()
    """
    from ..data.reader import read_displacement

    record = read_displacement(path, time=time, displacement=displacement, units=units, dt=dt)
    name = record.source or "samples"
    try:
        return Reference.from_samples(
            record.y, record.dt, period=period, duration=duration, ramp=ramp, name=name
        )
    except (DataError, ParameterError) as error:
        raise error.of(name) from None
