"""Feedforward: the voltage with which an identified stage follows a reference."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, Protocol

import numpy as np

from .. import _core
from .._support.arguments import expect, finite, not_negative, number_pair, one_of
from .._support.arrays import check_dt
from .._support.messages import quoted
from ..errors import ParameterError
from ..references.motions import Spline
from ..references.reference import Reference, SampledReference

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from .model_info import ModelInfo
    from .motion import Named, Response, StageState

    Array = NDArray[np.float64]

__all__ = ["Inverse", "InverseSession", "InvertibleStage", "PlayedVoltage"]

Playback = Literal["table", "online"]
Limits = tuple[float, float] | None
# Periods that the smooth start of a reference with a table may have.
MOST_TURNS = 1_000_000


class InvertibleStage(Protocol):
    """A stage as its inverse needs it: the stages make inverses, and are not known here."""

    @property
    def info(self) -> ModelInfo:
        """Description of the model."""

    @property
    def _core(self) -> _core.Stage: ...

    @property
    def _named(self) -> Named: ...

    def _checked(self, initial: object) -> StageState: ...

    def __hash__(self) -> int: ...

    def simulate(self, u: ArrayLike, dt: float) -> Response:
        """Simulate the motion for a drive."""


class PlayedVoltage(NamedTuple):
    """Feedforward of a run.

    Attributes
    ----------
    voltage : ndarray, shape (n,)
        At the samples of the reference [V].
    note : str
        How it was computed, in words.
    """

    voltage: Array
    note: str


@dataclass(frozen=True, kw_only=True)
class Inverse:
    r"""Inverse of a stage, with the offset and the delay of its sensor.

    .. math:: u_{FF} = (M \ddot x_d + D \dot x_d + K x_d + F_h(x_d)) / T

    Xu and Li 2010, equation (21), doi 10.1115/1.4001712. The hysteresis force depends only on
    the path of the reference, so the inverse is explicit, and exact along it. For a
    `BoucWenStage` the hysteresis depends on the voltage, and

    .. math:: d u - h(u) = (m \ddot x_d + b \dot x_d + k x_d) / k

    is solved for the voltage sample by sample, assuming that it is monotone between samples. For
    Prandtl-Ishlinskii models it is the inverse of each part in turn.

    Parameters
    ----------
    stage : Stage
        The model, as a `DahlStage`.
    offset : float, optional
        Reading of the sensor at rest without drive [m].
    delay : float, optional
        Delay of the displacement in addition to the model [s]; the voltage is computed for the
        reference this much ahead.
    playback : {"table", "online"}, optional
        ``"table"``, as in the paper: one settled period of a periodic reference is computed and
        repeated. ``"online"``: the whole run is computed. The printed model drifts from period
        to period, its table does not.
    settle : int, optional
        Periods before the one that is repeated, 1 or more; at least those of the smooth start.
    initial : StageState, optional
        State of the stage before the reference begins, such as the `final` of a response; by
        default at rest, never driven. Only models with the hysteresis at the input accept a state.

    Raises
    ------
    ParameterError, ShapeError
        An argument cannot be used, or `initial` is the state of another stage.

    Examples
    --------
    >>> import numpy as np
    >>> import piezotrack as pt
    >>> stage = pt.DahlStage.xu_li_2010()
    >>> reference = pt.sine(frequency=0.2, low=0.0, high=110e-6, duration=2.0)
    >>> volts = stage.inverse().voltage(reference, 2e-4)
    >>> error = stage.simulate(volts, 2e-4).x - reference.sample(2e-4).x
    >>> bool(np.abs(error).max() < 1e-10)
    True
    """

    stage: InvertibleStage
    offset: float = 0.0
    delay: float = 0.0
    playback: Playback = "table"
    settle: int = 1
    initial: StageState | None = None

    def __post_init__(self) -> None:
        if not isinstance(getattr(self.stage, "_core", None), _core.Stage):
            raise ParameterError("stage", quoted(self.stage), "a stage, as a pt.DahlStage")
        finite("offset", self.offset, "m")
        not_negative("delay", self.delay, "s")
        one_of("playback", self.playback, ("table", "online"))
        if not 1 <= _core.as_count("settle", self.settle) <= 1000:
            raise ParameterError("settle", self.settle, "1 period or more, up to 1000")
        # The core refuses a stage without an inverse, and a state of another model.
        self._begun(1.0)

    def _begun(self, dt: float, limits: Limits = None) -> _core.Inverse:
        """Return the inverse in the core, before its first sample."""
        core = self._inverse(dt)
        if limits is not None:
            core.limit(*number_pair("limits", limits, "V"))
        return core

    def _inverse(self, dt: float) -> _core.Inverse:
        initial = None if self.initial is None else self.stage._checked(self.initial)._named
        return self.stage._core.inverse(dt, offset=self.offset, delay=self.delay, initial=initial)

    def voltage(
        self,
        reference: Reference,
        dt: float,
        *,
        samples: SampledReference | None = None,
        limits: Limits = None,
    ) -> Array:
        """Voltage for a whole reference that begins at rest.

        Parameters
        ----------
        reference : Reference
            The reference.
        dt : float
            Sampling interval [s].
        samples : SampledReference, optional
            ``reference.sample(dt)``, if already computed.
        limits : tuple of (float, float), optional
            Range of the voltages that reach the stage [V]. The voltage is not clipped, but what is
            beyond does not enter the memory of the inverse: after it, the inverse is exact again.

        Returns
        -------
        ndarray, shape (n,)
            Voltage at the samples ``reference.sample(dt).t`` [V].

        Raises
        ------
        ParameterError
            `dt` is out of its range.
        NumericalError
            The voltage for the reference is not finite.
        """
        _check(reference)
        samples = reference.sample(dt) if samples is None else samples
        expect("samples", samples, SampledReference, "reference.sample(dt)")
        t = samples.t + self.delay
        if self.delay == 0.0:
            x, v, a = samples.x, samples.v, samples.a
        elif not _continues(reference):
            x, v, a = reference.at(np.minimum(t, reference.duration))
        else:
            longer = replace(reference, duration=reference.duration + self.delay + samples.dt)
            x, v, a = longer.at(t)
        return self._begun(samples.dt, limits).along(x - self.offset, v, a)

    def table(self, reference: Reference, dt: float, *, limits: Limits = None) -> Array:
        """One settled period, as a table of the voltages at the sampling instants.

        Parameters
        ----------
        reference : Reference
            A reference whose period is a whole number of samples.
        dt : float
            Sampling interval [s].
        limits : tuple of (float, float), optional
            As of `voltage`.

        Returns
        -------
        ndarray, shape (period / dt,)
            Voltage [V], the first at the beginning of a period.

        Raises
        ------
        ParameterError
            The reference has no period, or one that is not a whole number of samples, or is a
            record that ends before a period has settled.
        """
        _check(reference)
        if reference.period is None:
            raise ParameterError(f"reference ({reference.name})", "one motion", "one that repeats")
        turn = reference.period / check_dt(dt)
        if not (turn > 0.5 and abs(turn - np.round(turn)) <= 1e-6):
            raise ParameterError(
                "dt",
                f"{dt:g} s",
                f"a whole number of samples in the period, {reference.period:g} s; online "
                "playback takes any period",
            )
        count = round(turn)
        length = (self._settled(reference, reference.period) + 1) * reference.period
        if not _continues(reference) and length > reference.duration + 1e-3 * dt:
            raise ParameterError(
                f"reference ({reference.name})",
                f"{reference.duration:g} s",
                f"{length:g} s, until a period has settled",
                verb="lasts",
            )
        return self.voltage(replace(reference, duration=length), dt, limits=limits)[-count:]

    def played(
        self,
        reference: Reference,
        dt: float,
        *,
        samples: SampledReference | None = None,
        limits: Limits = None,
    ) -> PlayedVoltage:
        """Feedforward of a run, from a table or online as `playback` says.

        Parameters
        ----------
        reference : Reference
            The reference.
        dt : float
            Sampling interval [s].
        samples : SampledReference, optional
            ``reference.sample(dt)``, if already computed.
        limits : tuple of (float, float), optional
            As of `voltage`.

        Returns
        -------
        PlayedVoltage
            Voltage at the samples [V], and how it was computed.
        """
        dt = check_dt(dt)
        volts = self.voltage(reference, dt, samples=samples, limits=limits)
        period = reference.period
        before = 0 if period is None else self._settled(reference, period)
        head = 0 if period is None else round((before + 1) * period / dt)
        if self.playback == "online" or period is None or volts.size <= head:
            return PlayedVoltage(volts, "feedforward computed for the whole run")
        # Linear interpolation if a period is not a whole number of samples.
        after = np.arange(head, volts.size, dtype=np.float64)
        turns = np.floor((after - head) * dt / period) + 1.0
        volts[head:] = np.interp(
            after - turns * period / dt, np.arange(head + 1), volts[: head + 1]
        )
        return PlayedVoltage(volts, f"feedforward: voltages of period {before + 1}, repeated")

    def _settled(self, reference: Reference, period: float) -> int:
        """Periods before the one of the table: `settle`, or those of the smooth start if more."""
        turns = reference.ramp / period
        if not turns <= MOST_TURNS:
            raise ParameterError(
                f"reference ({reference.name})",
                f"after {period:g} s",
                f"{MOST_TURNS} periods at most in its smooth start, {reference.ramp:g} s",
                verb="repeats",
            )
        return max(self.settle, math.ceil(turns - 1e-9))

    def start(self, dt: float, *, limits: Limits = None) -> InverseSession:
        """Start a session that computes the voltage sample by sample.

        Parameters
        ----------
        dt : float
            Sampling interval [s].
        limits : tuple of (float, float), optional
            As of `voltage`.

        Returns
        -------
        InverseSession
            With a state of its own; several sessions are independent.
        """
        return InverseSession(self, dt, limits)


def _check(reference: object) -> None:
    expect("reference", reference, Reference, "a Reference, as pt.sine(...)")


def _continues(reference: Reference) -> bool:
    """Whether the motion continues after the end: it repeats, and is not a finite record."""
    motion = reference.motion
    stops = isinstance(motion, Spline) and not motion.cyclic
    return reference.period is not None and not stops


class InverseSession:
    """An inverse that is evaluated sample by sample; it can be copied and pickled with its state.

    Parameters
    ----------
    inverse : Inverse
        The model with offset and delay.
    dt : float
        Sampling interval [s].
    limits : tuple of (float, float), optional
        Range of the voltages that reach the stage [V]; see `Inverse.voltage`.

    Examples
    --------
    >>> import piezotrack as pt
    >>> session = pt.DahlStage.xu_li_2010().inverse().start(0.02)
    >>> print(f"{session.step(10e-6, velocity=50e-6, acceleration=0.0):.2f} V")
    8.40 V
    """

    def __init__(self, inverse: Inverse, dt: float, limits: Limits = None) -> None:
        expect("inverse", inverse, Inverse, "pt.Inverse")
        self._inverse, self._dt, self._limits = inverse, check_dt(dt), limits
        self._core = inverse._begun(self._dt, limits)

    def __reduce__(self) -> tuple[Any, ...]:
        return _resumed, (self._inverse, self._dt, self._limits, self._core.save())

    def step(
        self,
        reference: float,
        *,
        velocity: float | None = None,
        acceleration: float | None = None,
        preview: float | None = None,
    ) -> float:
        """Voltage for the next sample of a reference.

        Parameters
        ----------
        reference : float
            Reference displacement [m].
        velocity, acceleration : float, optional
            Its derivatives [m/s, m/s^2]. By default finite differences: central ones with the
            previous sample and `preview`, or backward ones, which are delayed by half a sample.
        preview : float, optional
            The reference one sample ahead [m].

        Returns
        -------
        float
            Voltage [V]; NaN, with the state unchanged, if an input is not finite or beyond what the
            model reaches. The differences then continue as if the reference had kept its velocity.

        Raises
        ------
        ParameterError
            `reference` is a metre or more.
        """
        try:
            return self._core.step(reference, velocity, acceleration, preview)
        except (TypeError, OverflowError):
            given = {"reference": reference, "velocity": velocity}
            given |= {"acceleration": acceleration, "preview": preview}
            for name, value in given.items():
                if value is not None or name == "reference":
                    _core.as_number(name, value)
            raise

    def applied(self, voltage: float) -> None:
        """Report the voltage that reached the stage in place of that of the last step.

        The inverse remembers it instead, and is exact again where the voltage is what it asks for.
        Within `limits` it does that by itself; a `Session` of a controller does it as well.

        Parameters
        ----------
        voltage : float
            Voltage [V]. Where no displacement explains it, nothing changes.

        Raises
        ------
        ParameterError
            It is not a finite number.

        Examples
        --------
        >>> import piezotrack as pt
        >>> plays = pt.PrandtlIshlinskiiStage(linear=1e-6, thresholds=(5.0,), weights=(5e-7,))
        >>> session = plays.inverse().start(0.001)
        >>> for reference in (20e-6, 40e-6, 20e-6):
        ...     asked = session.step(reference)
        ...     session.applied(min(asked, 15.0))
        >>> print(f"{asked:.3f} V")
        15.000 V
        """
        self._core.applied(finite("voltage", voltage, "V"))

    def _limit(self, limits: tuple[float, float]) -> None:
        self._limits = limits
        self._core.limit(*limits)

    def reset(self) -> None:
        """Return to the initial state."""
        self._core.reset()


def _resumed(inverse: Inverse, dt: float, limits: Limits, state: bytes) -> InverseSession:
    session = inverse.start(dt, limits=limits)
    session._core.load(state)
    return session
