"""Running controllers: commands, sample by sample."""

from __future__ import annotations

import copy
import math
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, runtime_checkable

from ... import _core
from ..._support.arguments import expect, finite
from ..._support.units import shown_unit
from ...errors import ParameterError

if TYPE_CHECKING:
    from ...stages.inverse import Inverse, InverseSession

__all__ = ["Command", "RefusedReadings", "Session"]


class Command(NamedTuple):
    """Command of a controller at one sample, with its parts.

    Attributes
    ----------
    voltage : float
        Command to the amplifier, within the limits [V].
    unclipped : float
        The same before it was clipped [V].
    feedforward, feedback, repetitive : float
        Its parts [V].
    error : float
        Tracking error of the sample [m].
    saturated : bool
        Whether it was clipped.
    measurement_valid : bool
        False where the reading was not finite, outside of the span, or a jump too far: feedback and
        learning pause.
    reference_valid : bool
        False where the reference or the feedforward was not finite: the last one is held.
    """

    voltage: float
    unclipped: float
    feedforward: float
    feedback: float
    repetitive: float
    error: float
    saturated: bool
    measurement_valid: bool
    reference_valid: bool


class RefusedReadings(NamedTuple):
    """Number of readings that were no measurements, since the start or the last reset.

    Attributes
    ----------
    not_finite : int
        NaN or infinite.
    outside : int
        Outside of the span of the controller.
    jumps : int
        Further from the last valid reading than `max_jump` allows.
    """

    not_finite: int
    outside: int
    jumps: int


# A feedforward is refused that is this many ranges of the limits beyond them: it is in mV.
FAR = 10.0


@runtime_checkable
class Configuration(Protocol):
    """Parts of a `Controller` that a session steps.

    Attributes
    ----------
    dt : float
        Sampling interval [s].
    limits : (float, float)
        Lowest and highest voltage [V].
    feedforward : Inverse or None
        The inverse.
    drive_unit : str
        Unit of the commands, for what is printed.
    """

    @property
    def dt(self) -> float: ...
    @property
    def limits(self) -> tuple[float, float]: ...
    @property
    def feedforward(self) -> Inverse | None: ...
    @property
    def drive_unit(self) -> str: ...
    @property
    def _valid(self) -> tuple[float, float]: ...
    @property
    def _core(self) -> _core.Controller: ...


class Session:
    """A running controller: one call of `step` in each sampling interval.

    It can be copied and pickled with its state, and then continues independently, bit for bit.

    Parameters
    ----------
    controller : Controller
        The configuration.
    present : float or None
        Voltage for a bumpless start [V].
    """

    def __init__(self, controller: Configuration, present: float | None = None) -> None:
        expect("controller", controller, Configuration, "pt.Controller")
        self._controller = controller
        self._core = controller._core.start(
            None if present is None else _core.as_number("present", present)
        )
        inverse = controller.feedforward
        self._inverse: InverseSession | None = (
            None if inverse is None else inverse.start(controller.dt, limits=controller.limits)
        )

    def __reduce__(self) -> tuple[Any, ...]:
        return _resumed, (type(self), self._controller, self._core.save(), self._inverse)

    def step(
        self,
        reference: float,
        measured: float,
        *,
        velocity: float | None = None,
        acceleration: float | None = None,
        preview: float | None = None,
        feedforward: float | None = None,
    ) -> float:
        """Voltage for this sample.

        Parameters
        ----------
        reference : float
            Desired displacement [m].
        measured : float
            Measured displacement [m]. Feedback and learning pause where it is NaN or outside of the
            span of the controller, such as 9.91e37.
        velocity, acceleration, preview : float, optional
            For the inverse, as in `InverseSession.step`.
        feedforward : float, optional
            Voltage of your own table [V], in place of the inverse.

        Returns
        -------
        float
            Voltage within the limits [V].

        Raises
        ------
        ParameterError
            `reference` or `preview` is outside of the span, or `measured` is at the first sample
            where another unit explains it; `velocity` or `feedforward` is far beyond what the stage
            can have. Nothing has changed then.
        """
        voltage = 0.0 if feedforward is None else feedforward
        if velocity is not None or preview is not None or feedforward is not None:
            self._check_ahead(velocity, preview, feedforward)
        try:
            if feedforward is None and self._inverse is not None:
                self._core.check(reference, measured)
                voltage = self._inverse.step(
                    reference, velocity=velocity, acceleration=acceleration, preview=preview
                )
            return self._core.step(reference, measured, voltage)
        except (TypeError, OverflowError):
            given = {"reference": reference, "measured": measured, "feedforward": voltage}
            for name, value in given.items():
                _core.as_number(name, value)
            raise

    def _check_ahead(
        self, velocity: float | None, preview: float | None, feedforward: float | None
    ) -> None:
        """Refuse what only another unit explains, before it reaches the stage."""
        low, high = self._controller._valid
        if (
            preview is not None
            and not low <= (place := _core.as_number("preview", preview)) <= high
        ):
            raise ParameterError(
                "preview",
                f"{place:g} m",
                f"{low:.4g} to {high:.4g} m, what the sensor of this controller can show",
            )
        fastest = (high - low) / self._controller.dt
        if velocity is not None and abs(speed := _core.as_number("velocity", velocity)) > fastest:
            raise ParameterError(
                "velocity",
                f"{speed:g} m/s",
                f"{fastest:.3g} m/s at most, the span of the sensor in one sampling interval",
            )
        least, most = self._controller.limits
        far, unit = FAR * (most - least), self._controller.drive_unit
        if feedforward is not None:
            volts = _core.as_number("feedforward", feedforward)
            # One that is not finite is held back by the core.
            if math.isfinite(volts) and not least - far <= volts <= most + far:
                raise ParameterError(
                    "feedforward",
                    f"{volts:g} {unit}",
                    f"one near the limits, {least:g} to {most:g} {unit}",
                )

    def step_um(
        self,
        reference: float,
        measured: float,
        *,
        velocity: float | None = None,
        acceleration: float | None = None,
        preview: float | None = None,
        feedforward: float | None = None,
    ) -> float:
        """Voltage for this sample, from displacements in um.

        Parameters
        ----------
        reference, measured : float
            Desired and measured displacement [um].
        velocity, acceleration, preview : float, optional
            For the inverse, as in `InverseSession.step` [um/s, um/s^2, um].
        feedforward : float, optional
            Voltage of your own table [V], in place of the inverse.

        Returns
        -------
        float
            Voltage within the limits [V].

        Raises
        ------
        ParameterError
            As of `step`.

        Examples
        --------
        >>> import piezotrack as pt
        >>> loop = pt.Controller(dt=0.02, limits=(0.0, 75.0), feedback=pt.Pid.xu_li_2010())
        >>> print(f"{loop.start().step_um(1.0, 0.0):.3f} V")
        0.267 V
        """
        return self.step(
            _metres("reference", reference),
            _metres("measured", measured),
            velocity=None if velocity is None else _metres("velocity", velocity),
            acceleration=None if acceleration is None else _metres("acceleration", acceleration),
            preview=None if preview is None else _metres("preview", preview),
            feedforward=feedforward,
        )

    def __repr__(self) -> str:
        last, controller = self.last, self._controller
        low, high = controller.limits
        unit, scale = shown_unit(controller.drive_unit)
        return (
            f"<Session, {1.0 / controller.dt:.6g} Hz, {scale * low:g} to {scale * high:g} {unit}: "
            f"last {scale * last.voltage:.4g} {unit}, error {1e6 * last.error:.4g} um>"
        )

    @property
    def last(self) -> Command:
        """The last command with its parts."""
        return Command(*self._core.last())

    @property
    def refused(self) -> RefusedReadings:
        """Number of readings that were no measurements."""
        return RefusedReadings(*self._core.refused())

    def applied(self, voltage: float) -> None:
        """Report the voltage that the amplifier applied, where it differs from the last command.

        Parameters
        ----------
        voltage : float
            Voltage [V], which the antiwindup uses in place of the command. Where it differs from
            the command by more than 1 % of the range of the limits, the sample counts as saturated:
            learning pauses, and the feedforward remembers no more than that. Further outside the
            limits than their range it is no reading, such as 9.91e37, and is ignored.

        Raises
        ------
        ParameterError
            It is not a finite number.
        """
        self._core.applied(finite("voltage", voltage, "V"))
        if self._inverse is not None and (reached := self._core.reached()) is not None:
            self._inverse.applied(reached)

    def retune(self, controller: Configuration) -> None:
        """Change gains, filters, limits and span without a bump.

        Where only the gains of a `Pid` change, its state is kept. Otherwise the feedback starts
        anew from the voltage that is there, and changed filters from the next measurement. What was
        learnt is kept. New limits hold at once.

        Parameters
        ----------
        controller : Controller
            With the same interval, feedforward, kind of feedback and period of the repetitive
            part.

        Raises
        ------
        ParameterError
            It differs in more than its gains.
        """
        expect("controller", controller, type(self._controller), "pt.Controller")
        if not math.isclose(controller.dt, self._controller.dt, rel_tol=1e-12):
            raise ParameterError(
                "dt", f"{controller.dt:g} s", f"that of the session, {self._controller.dt:g} s"
            )
        if controller.feedforward != self._controller.feedforward:
            raise ParameterError("feedforward", "another", "that of the session")
        self._core.retune(controller._core)
        self._controller = controller
        if self._inverse is not None:
            self._inverse._limit(controller.limits)

    def reset(self) -> None:
        """Forget errors, readings, hysteresis and what was learnt, and go on without a bump.

        The feedback starts anew from the voltage that is there: the last command, or what was
        reported by `applied`. Without feedback the next command is the feedforward; a law without
        an integrator keeps the voltage as a constant part of its output. For a start at 0 V use
        ``controller.start()``.
        """
        self._core.reset()
        if self._inverse is not None:
            self._inverse.reset()


def _metres(name: str, value: float) -> float:
    return 1e-6 * _core.as_number(name, value)


def _resumed(
    kind: type[Session], controller: Configuration, state: bytes, inverse: InverseSession | None
) -> Session:
    session = kind(controller)
    session._core.load(state)
    # A shallow copy brings the inverse of the original.
    session._inverse = copy.copy(inverse)
    return session
