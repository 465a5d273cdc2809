"""Controllers: feedforward, feedback and repetitive part together, and sessions of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from .. import _core
from .._support.arguments import finite, positive
from ..errors import ParameterError
from ..stages.inverse import Inverse, InverseSession
from .components import LowPass, Notch, Pid, Repetitive, StateSpace

if TYPE_CHECKING:
    from ..identification.identified import IdentifiedModel
    from .plant import Plant
    from .stability import LoopReport

__all__ = ["Command", "Controller", "Session"]


class Command(NamedTuple):
    """What a controller asked for at one sample.

    Attributes
    ----------
    volts : float
        The voltage for the amplifier, within the limits [V].
    unclipped : float
        The same before it was clipped [V].
    feedforward, feedback, repetitive : float
        Its parts [V].
    error : float
        The tracking error that was used [m].
    saturated : bool
        Whether it was clipped.
    measured_well : bool
        False where the measurement was not a number, and feedback and learning paused.
    reference_well : bool
        False where the reference or the feedforward was not a number; the last one is kept.
    """

    volts: float
    unclipped: float
    feedforward: float
    feedback: float
    repetitive: float
    error: float
    saturated: bool
    measured_well: bool
    reference_well: bool


@dataclass(frozen=True, kw_only=True)
class Controller:
    """Feedforward, feedback and repetitive part, clipped to the limits of the amplifier.

    ``u = uFB + uFF + uRC``, and ``v = clip(u)`` goes out.

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
    addon : Repetitive, optional
        For a reference that repeats.
    filters : sequence of LowPass or Notch, optional
        Up to two, on the measurement, one after the other.

    Raises
    ------
    ParameterError
        A number is out of its range; `kp` is so large or so small that its unit must be wrong.

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
    addon: Repetitive | None = None
    filters: Sequence[LowPass | Notch] = ()
    core: _core.Controller = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        dt = positive("dt", self.dt, "s")
        low, high = _limits(self.limits)
        kinds: dict[str, tuple[object, tuple[type, ...]]] = {
            "feedforward": (self.feedforward, (Inverse,)),
            "feedback": (self.feedback, (Pid, StateSpace)),
            "addon": (self.addon, (Repetitive,)),
        }
        for name, (part, kind) in kinds.items():
            if part is not None and not isinstance(part, kind):
                expected = " or ".join(f"pt.{one.__name__}" for one in kind)
                raise ParameterError(f"{name} is {type(part).__name__}: expected {expected}")
        if not isinstance(self.filters, Sequence):
            raise ParameterError(f"filters is {self.filters!r}: expected a list of filters")
        for one in self.filters:
            if not isinstance(one, (LowPass, Notch)):
                raise ParameterError(f"filters has {one!r}: expected pt.LowPass or pt.Notch")
        if isinstance(self.feedback, Pid):
            _check_unit(self.feedback.kp, high - low)
        pid, law = self.feedback, self.feedback
        core = _core.Controller(
            dt=dt,
            limits=(low, high),
            pid=(pid.kp, pid.ti, pid.td, pid.tt) if isinstance(pid, Pid) else None,
            state_space=law.matrices if isinstance(law, StateSpace) else None,
            repetitive=None if self.addon is None else self.addon.settings,
            filters=[one.settings for one in self.filters],
        )
        object.__setattr__(self, "core", core)

    def check(self, stage: Plant | IdentifiedModel, *, delay: float = 0.0) -> LoopReport:
        """Gain and phase margins on a stage, and whether the loop is stable: see `check_loop`.

        Parameters
        ----------
        stage : VirtualStage, DahlStage, BoucWenStage or PrandtlIshlinskiiStage
            The stage, or an identified one.
        delay : float, optional
            Delay in the loop besides the hold [s].

        Returns
        -------
        LoopReport
            At the lowest, a middle and the highest gain of the stage.
        """
        from .stability import check_loop

        return check_loop(self, stage, delay=delay)

    def start(self, *, present: float | None = None) -> Session:
        """Begin to control, with a memory of its own.

        Parameters
        ----------
        present : float, optional
            Voltage that the stage has now [V], to go on from without a bump. Where it is not
            given the feedback part begins at 0 V.

        Returns
        -------
        Session
            To be asked once a sampling interval.
        """
        return Session(self, present)


def _limits(limits: object) -> tuple[float, float]:
    # An array counts as well.
    listed = limits.tolist() if hasattr(limits, "tolist") else limits
    pair = list(listed) if isinstance(listed, Sequence) and not isinstance(listed, str) else []
    if len(pair) != 2:
        raise ParameterError(f"limits are {limits!r}: expected (low, high) in V")
    low, high = (finite(f"limits[{i}]", value, "V") for i, value in enumerate(pair))
    if not low < high:
        raise ParameterError(f"limits are ({low:g}, {high:g}) V: expected the lower one first")
    return low, high


def _check_unit(kp: float, span: float) -> None:
    """Refuse a gain that no nanopositioner can have: full span for 10 nm, or a trace for 1 mm."""
    if abs(kp) * 1e-8 > span:
        raise ParameterError(
            f"kp is {kp:g} V/m: expected a gain with which 10 nm of error does not ask for the "
            f"whole range of {span:g} V; {1e-6 * kp:g} V/m is {1e-12 * kp:g} V/um"
        )
    if 0.0 < abs(kp) * 1e-3 < 1e-3 * span:
        raise ParameterError(
            f"kp is {kp:g} V/m: expected a gain with which 1 mm of error asks for more than a "
            f"thousandth of the range; if it is in V/um, write pt.Pid.from_um(kp={kp:g}, ...)"
        )


class Session:
    """A controller at work: one call in each sampling interval.

    Parameters
    ----------
    controller : Controller
        The configuration.
    present : float or None
        Voltage to go on from [V].
    """

    def __init__(self, controller: Controller, present: float | None = None) -> None:
        self._controller = controller
        self._core = controller.core.start(
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
            Displacement to be followed [m].
        measured : float
            Displacement measured [m]. NaN is not passed on: feedback and learning hold.
        velocity, acceleration, preview : float, optional
            For the inverse, as in `InverseSession.step`.
        feedforward : float, optional
            Voltage of a table of one's own [V], in place of the inverse's.

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
        volts = 0.0 if feedforward is None else feedforward
        if feedforward is None and self._inverse is not None:
            volts = self._inverse.step(
                reference, velocity=velocity, acceleration=acceleration, preview=preview
            )
        try:
            return self._core.step(reference, measured, volts)
        except TypeError:
            given = {"reference": reference, "measured": measured, "feedforward": volts}
            for name, value in given.items():
                _core.as_number(name, value)
            raise

    @property
    def last(self) -> Command:
        """The last command with its parts."""
        return Command(*self._core.last())

    def applied(self, volts: float) -> None:
        """Tell what the amplifier really gave for the last command, where it was something else.

        Parameters
        ----------
        volts : float
            Voltage [V]. The antiwindup goes by it.
        """
        self._core.applied(_core.as_number("volts", volts))

    def retune(self, controller: Controller) -> None:
        """Go on with other gains, without a bump.

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
        self._core.retune(controller.core)
        self._controller = controller

    def reset(self) -> None:
        """Forget errors, learning and path."""
        self._core.reset()
        if self._inverse is not None:
            self._inverse.reset()
