"""Feedback laws besides PID and state space."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, Literal

from ... import _core
from ..._support.arguments import finite, not_negative, positive
from ...errors import ParameterError
from .components import Pid
from .hysteresis_observer import HysteresisObserver
from .scheduled_pid import ScheduledPid

__all__ = [
    "NAMED_LAWS",
    "DisturbanceObserver",
    "LeadLag",
    "PerturbationEstimator",
    "SlidingMode",
]


@dataclass(frozen=True, kw_only=True)
class LeadLag:
    r"""Lead-lag compensator, sampled as a law in state space.

    .. math:: C(s) = K_p \frac{1 + s T_{lead}}{1 + s T_{lag}}

    Franklin, Powell and Emami-Naeini, Feedback Control of Dynamic Systems. Without an integral
    part an error remains at rest, which a feedforward makes small.

    Parameters
    ----------
    kp : float
        Static gain [V/m].
    lead : float
        Time constant of the zero [s], 0 or above.
    lag : float
        Time constant of the pole [s], 0 or above; for Tustin's rule a hundredth of a sampling
        interval or more.
    method : {"tustin", "matched"}, optional
        How it is sampled: Tustin's rule, or matched pole and zero.

    Raises
    ------
    ParameterError
        A number is out of its range.

    Examples
    --------
    >>> import piezotrack as pt
    >>> law = pt.control.LeadLag(kp=1e5, lead=0.01, lag=0.1)
    >>> pt.Controller(dt=0.001, limits=(0.0, 75.0), feedback=law)
    Controller(lead-lag, 1000 Hz, 0 to 75 V)
    """

    kp: float
    lead: float
    lag: float
    method: Literal["tustin", "matched"] = "tustin"
    title: ClassVar[str] = "lead-lag"

    def __post_init__(self) -> None:
        finite("kp", self.kp, "V/m")
        not_negative("lead", self.lead, "s")
        not_negative("lag", self.lag, "s")
        if self.method not in ("tustin", "matched"):
            raise ParameterError(f"method is {self.method!r}: expected 'tustin' or 'matched'")

    @property
    def _settings(self) -> tuple[str, list[float]]:
        """The name and the numbers as the core takes them."""
        matched = float(self.method == "matched")
        return "lead-lag", [float(self.kp), float(self.lead), float(self.lag), matched]


@dataclass(frozen=True, kw_only=True)
class SlidingMode:
    r"""Sliding mode control with a boundary layer, around a feedforward.

    .. math::

        s = e + T_d \dot e + \frac{1}{T_i} \int e\, dt, \qquad
        u_{FB} = \eta\, \mathrm{sat}(s/\varphi)

    Slotine and Li 1991, Applied Nonlinear Control, chapter 7. The feedforward is the equivalent
    control; eta has to exceed what it leaves. The surface is in metres, so inside the boundary
    layer the law is linear: a PID of gain eta/phi with filtered derivative. `check_loop` and
    `to_control` take it there, where its gain is highest; outside, its output is constant.

    Parameters
    ----------
    switching : float
        Switching gain eta [V], above 0.
    layer : float
        Boundary layer phi [m], above 0.
    ti : float, optional
        Integral time [s], above 0; infinity for no integral.
    td : float, optional
        Derivative time [s].
    tf : float, optional
        Time constant of the filter of the derivative [s].

    Raises
    ------
    ParameterError
        A number is out of its range.

    Examples
    --------
    >>> import piezotrack as pt
    >>> law = pt.control.SlidingMode(switching=3.0, layer=20e-6, ti=0.05)
    >>> loop = pt.Controller(dt=0.02, limits=(0.0, 75.0), feedback=law)
    >>> print(f"{loop.start().step(10e-6, 0.0):.2f} V")
    2.10 V
    """

    switching: float
    layer: float
    ti: float = math.inf
    td: float = 0.0
    tf: float = 0.0
    title: ClassVar[str] = "sliding mode"

    def __post_init__(self) -> None:
        positive("switching", self.switching, "V")
        positive("layer", self.layer, "m")
        if not (_core.as_number("ti", self.ti) > 0.0):
            raise ParameterError(
                f"ti is {self.ti} s: expected a time above 0, or infinity for no integral"
            )
        not_negative("td", self.td, "s")
        not_negative("tf", self.tf, "s")

    @property
    def _settings(self) -> tuple[str, list[float]]:
        """The name and the numbers as the core takes them."""
        numbers = self.switching, self.layer, self.ti, self.td, self.tf
        return "sliding mode", [float(number) for number in numbers]


@dataclass(frozen=True, kw_only=True)
class DisturbanceObserver:
    r"""Disturbance observer around a PID.

    .. math::

        \hat d = Q\,(G_n^{-1} (y - r) - (u - u_{FF})), \qquad u_{FB} = u_{PID} - \hat d, \qquad
        G_n = \frac{g}{1 + s T}, \quad Q = \frac{1}{1 + s/\omega_c}

    After Ohnishi, and Yi, Chang and Shen 2009 for piezo hysteresis, which is the disturbance of a
    linear plant. Here plant and voltage are counted from reference and feedforward, so that what
    an inverse compensates is not compensated twice. The voltage is the one that was applied, and
    while it is clipped the estimate takes no step further out. `check_loop` and `to_control` take
    the law exactly: the observer adds an integrator of bandwidth omega_c.

    Parameters
    ----------
    pid : Pid
        The controller inside, with a finite integral time.
    plant_gain : float
        Static gain g of the nominal plant [m/V], not 0.
    plant_time : float, optional
        Its time constant T [s].
    cutoff : float
        Cutoff of Q [Hz], above 0; infinity for no filter.

    Raises
    ------
    ParameterError
        A number is out of its range, or `pid` is no `Pid`.

    Examples
    --------
    >>> import piezotrack as pt
    >>> law = pt.control.DisturbanceObserver(
    ...     pid=pt.Pid.from_um(kp=0.05, ti=0.1), plant_gain=1.5e-6, cutoff=1.0
    ... )
    >>> loop = pt.Controller(dt=0.02, limits=(0.0, 75.0), feedback=law)
    >>> pt.check_loop(pt.VirtualStage.xu_li_2010(), loop).stable
    True
    """

    pid: Pid
    plant_gain: float
    cutoff: float
    plant_time: float = 0.0
    title: ClassVar[str] = "PID with disturbance observer"

    def __post_init__(self) -> None:
        if not isinstance(self.pid, Pid):
            raise ParameterError(f"pid is {type(self.pid).__name__}: expected pt.Pid")
        if math.isinf(self.pid.ti):
            raise ParameterError(
                "pid has ti = inf: expected a finite integral time, since the observer would keep "
                "the constant that an incremental PID starts with"
            )
        _check_nominal(self.plant_gain, self.plant_time, self.cutoff)

    @property
    def _settings(self) -> tuple[str, list[float]]:
        """The name and the numbers as the core takes them; NaN for the default of tt."""
        pid = self.pid
        tt = math.nan if pid.tt is None else pid.tt
        numbers = pid.kp, pid.ti, pid.td, tt, self.plant_gain, self.plant_time, self.cutoff
        return "disturbance observer", [float(number) for number in numbers]


@dataclass(frozen=True, kw_only=True)
class PerturbationEstimator:
    r"""Sliding mode control with perturbation estimation.

    The disturbance observer of `DisturbanceObserver` around a `SlidingMode`: the estimate takes the
    place of most of the switching gain, so less of it is needed, and less chatter remains. After
    Elmali and Olgac 1992. `check_loop` and `to_control` take it inside the boundary layer, exactly.

    Parameters
    ----------
    sliding : SlidingMode
        The law inside.
    plant_gain : float
        Static gain g of the nominal plant [m/V], not 0.
    plant_time : float, optional
        Its time constant T [s].
    cutoff : float, optional
        Cutoff of the filter of the estimate [Hz], above 0; by default none, as in the source.

    Raises
    ------
    ParameterError
        A number is out of its range, or `sliding` is no `SlidingMode`.

    Examples
    --------
    >>> import piezotrack as pt
    >>> sliding = pt.control.SlidingMode(switching=1.0, layer=20e-6)
    >>> law = pt.control.PerturbationEstimator(sliding=sliding, plant_gain=1.5e-6, cutoff=1.0)
    >>> loop = pt.Controller(dt=0.02, limits=(0.0, 75.0), feedback=law)
    >>> pt.check_loop(pt.VirtualStage.xu_li_2010(), loop).stable
    True
    """

    sliding: SlidingMode
    plant_gain: float
    plant_time: float = 0.0
    cutoff: float = math.inf
    title: ClassVar[str] = "sliding mode with perturbation estimation"

    def __post_init__(self) -> None:
        if not isinstance(self.sliding, SlidingMode):
            raise ParameterError(
                f"sliding is {type(self.sliding).__name__}: expected pt.control.SlidingMode"
            )
        _check_nominal(self.plant_gain, self.plant_time, self.cutoff)

    @property
    def _settings(self) -> tuple[str, list[float]]:
        """The name and the numbers as the core takes them."""
        _, inside = self.sliding._settings
        nominal = self.plant_gain, self.plant_time, self.cutoff
        return "perturbation", [*inside, *(float(number) for number in nominal)]


NAMED_LAWS = (
    LeadLag,
    SlidingMode,
    DisturbanceObserver,
    PerturbationEstimator,
    ScheduledPid,
    HysteresisObserver,
)


def _check_nominal(gain: float, time: float, cutoff: float) -> None:
    """Refuse a nominal plant or a cutoff that is out of its range."""
    if finite("plant_gain", gain, "m/V") == 0.0:
        raise ParameterError("plant_gain is 0 m/V: expected a gain other than 0")
    not_negative("plant_time", time, "s")
    if not (_core.as_number("cutoff", cutoff) > 0.0):
        raise ParameterError(
            f"cutoff is {cutoff} Hz: expected a frequency above 0, or infinity for no filter"
        )
