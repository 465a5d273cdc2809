"""Controllers of feedforward, feedback and repetitive control, and their sessions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from .. import _core
from .._support.arguments import finite, positive
from ..errors import ParameterError
from ..stages.inverse import Inverse, InverseSession
from .components import LowPass, Notch, Pid, Repetitive, StateSpace

__all__ = ["Command", "Controller", "Session"]


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
        False where the measurement was not finite: feedback and learning pause.
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


@dataclass(frozen=True, kw_only=True)
class Controller:
    """Feedforward, feedback and repetitive part, clipped to the limits of the amplifier.

    ``u = uFB + uFF + uRC``, and the command is ``v = clip(u)``.

    Parameters
    ----------
    dt : float
        Sampling interval [s].
    limits : (float, float)
        Lowest and highest voltage [V].
    feedforward : Inverse, optional
        From ``fit.inverse()`` or ``stage.inverse()``.
    feedback : Pid or StateSpace, optional
        The feedback law.
    repetitive : Repetitive, optional
        Repetitive control, for a reference that repeats.
    filters : sequence of LowPass or Notch, optional
        Up to two, on the measurement, one after the other.

    Raises
    ------
    ParameterError
        A number is out of its range; `kp` or `kq` is so large or small that its unit must be wrong.

    Examples
    --------
    >>> import piezotrack as pt
    >>> loop = pt.Controller(
    ...     dt=0.02, limits=(0.0, 75.0), feedback=pt.Pid.from_um(kp=0.120, ti=0.009, td=0.044)
    ... )
    >>> session = loop.start()
    >>> print(f"{session.step(1e-6, 0.0):.3f} V")
    0.267 V
    """

    dt: float
    limits: tuple[float, float]
    feedforward: Inverse | None = None
    feedback: Pid | StateSpace | None = None
    repetitive: Repetitive | None = None
    filters: Sequence[LowPass | Notch] = ()
    _core: _core.Controller = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        dt = positive("dt", self.dt, "s")
        low, high = _limits(self.limits)
        _check_part("feedforward", self.feedforward, Inverse, "pt.Inverse")
        _check_part("feedback", self.feedback, (Pid, StateSpace), "pt.Pid or pt.control.StateSpace")
        _check_part("repetitive", self.repetitive, Repetitive, "pt.Repetitive")
        if not isinstance(self.filters, Sequence):
            raise ParameterError(f"filters is {self.filters!r}: expected a list of filters")
        for one in self.filters:
            if not isinstance(one, (LowPass, Notch)):
                raise ParameterError(f"filters has {one!r}: expected pt.LowPass or pt.Notch")
        if isinstance(self.feedback, Pid):
            _check_unit("kp", self.feedback.kp, high - low, "Pid")
        if isinstance(self.repetitive, Repetitive):
            _check_unit("kq", self.repetitive.kq, high - low, "Repetitive")
        pid, law = self.feedback, self.feedback
        core = _core.Controller(
            dt=dt,
            limits=(low, high),
            pid=(pid.kp, pid.ti, pid.td, pid.tt) if isinstance(pid, Pid) else None,
            state_space=law._matrices if isinstance(law, StateSpace) else None,
            repetitive=None if self.repetitive is None else self.repetitive._settings,
            filters=[one._settings for one in self.filters],
        )
        object.__setattr__(self, "_core", core)

    def start(self, *, present: float | None = None) -> Session:
        """Start a session with its own state.

        Parameters
        ----------
        present : float, optional
            Voltage at the stage now [V], for a bumpless start. By default the feedback part begins
            at 0 V.

        Returns
        -------
        Session
            To be stepped once in each sampling interval.
        """
        return Session(self, present)


def _check_part(name: str, part: object, kinds: type | tuple[type, ...], expected: str) -> None:
    if part is not None and not isinstance(part, kinds):
        raise ParameterError(f"{name} is {type(part).__name__}: expected {expected}")


def _limits(limits: object) -> tuple[float, float]:
    # An array is accepted too.
    listed = limits.tolist() if hasattr(limits, "tolist") else limits
    pair = list(listed) if isinstance(listed, Sequence) and not isinstance(listed, str) else []
    if len(pair) != 2:
        raise ParameterError(f"limits are {limits!r}: expected (low, high) in V")
    low, high = (finite(f"limits[{i}]", value, "V") for i, value in enumerate(pair))
    if not low < high:
        raise ParameterError(f"limits are ({low:g}, {high:g}) V: expected the lower one first")
    return low, high


def _check_unit(name: str, gain: float, span: float, owner: str) -> None:
    """Refuse a gain that no nanopositioner can have: full span for 10 nm, or a trace for 1 mm."""
    if abs(gain) * 1e-8 > span:
        raise ParameterError(
            f"{name} is {gain:g} V/m: expected a gain with which 10 nm of error asks for less "
            f"than the whole range of {span:g} V; {1e-6 * gain:g} V/m is {1e-12 * gain:g} V/um"
        )
    if 0.0 < abs(gain) * 1e-3 < 1e-3 * span:
        raise ParameterError(
            f"{name} is {gain:g} V/m: expected a gain with which 1 mm of error asks for more than "
            "a thousandth of the range; if it is in V/um, write "
            f"pt.{owner}.from_um({name}={gain:g}, ...)"
        )


class Session:
    """A running controller: one call of `step` in each sampling interval.

    Parameters
    ----------
    controller : Controller
        The configuration.
    present : float or None
        Voltage for a bumpless start [V].
    """

    def __init__(self, controller: Controller, present: float | None = None) -> None:
        self._controller = controller
        self._core = controller._core.start(
            None if present is None else _core.as_number("present", present)
        )
        inverse = controller.feedforward
        self._inverse: InverseSession | None = (
            None if inverse is None else inverse.start(controller.dt)
        )

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
            Measured displacement [m]. Feedback and learning pause where it is NaN.
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
            `reference` is a metre or more: it must be in another unit.
        """
        if isinstance(reference, float) and 1.0 <= abs(reference) < math.inf:
            raise ParameterError(
                f"reference is {reference:g} m: expected metres, and no piezo stage goes so far"
            )
        voltage = 0.0 if feedforward is None else feedforward
        if feedforward is None and self._inverse is not None:
            voltage = self._inverse.step(
                reference, velocity=velocity, acceleration=acceleration, preview=preview
            )
        try:
            return self._core.step(reference, measured, voltage)
        except TypeError:
            given = {"reference": reference, "measured": measured, "feedforward": voltage}
            for name, value in given.items():
                _core.as_number(name, value)
            raise

    @property
    def last(self) -> Command:
        """The last command with its parts."""
        return Command(*self._core.last())

    def applied(self, voltage: float) -> None:
        """Report the voltage that the amplifier applied, where it differs from the last command.

        Parameters
        ----------
        voltage : float
            Voltage [V], which the antiwindup uses in place of the command.

        Raises
        ------
        ParameterError
            It is not a finite number.
        """
        self._core.applied(finite("voltage", voltage, "V"))

    def retune(self, controller: Controller) -> None:
        """Change the gains without a bump.

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
        if not isinstance(controller, Controller):
            raise ParameterError(
                f"controller is {type(controller).__name__}: expected pt.Controller"
            )
        if not math.isclose(controller.dt, self._controller.dt, rel_tol=1e-12):
            raise ParameterError(
                f"dt is {controller.dt:g} s: expected that of the session, "
                f"{self._controller.dt:g} s"
            )
        if controller.feedforward != self._controller.feedforward:
            raise ParameterError("feedforward is another: expected that of the session")
        self._core.retune(controller._core)
        self._controller = controller

    def reset(self) -> None:
        """Reset the state: errors, learnt signal and hysteresis."""
        self._core.reset()
        if self._inverse is not None:
            self._inverse.reset()
