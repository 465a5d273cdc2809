"""Incremental PID."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ... import _core
from ..parts.part import FeedbackLaw, part

__all__ = ["Pid"]


@part("pid")
@dataclass(frozen=True, kw_only=True)
class Pid(FeedbackLaw):
    r"""Incremental PID controller with back-calculation antiwindup.

    .. math::

        u_k = u_{k-1} + K_p (e_k - e_{k-1}) + \frac{K_p T_s}{T_i} e_k
        + \frac{K_p T_d}{T_s} (e_k - 2 e_{k-1} + e_{k-2}) + \frac{T_s}{T_t} (v - u)_{k-1}

    Xu and Li 2010, equations (22) to (25), doi 10.1115/1.4001712, corrected: the recursion is
    that of the feedback part only, while `v - u` is the voltage of the amplifier less the sum of
    all parts of the command.

    Parameters
    ----------
    kp : float
        Proportional gain [V/m]. `from_um` takes it in V/um.
    ti : float
        Integral time [s], above 0; infinity for no integral part.
    td : float, optional
        Derivative time [s], 0 or above.
    tt : float, optional
        Tracking time of the antiwindup [s], above half a sampling interval; ``sqrt(ti td)``
        where it is not given, and `ti` where `td` is 0.

    Examples
    --------
    >>> import piezotrack as pt
    >>> pt.Pid.from_um(kp=0.120, ti=0.009, td=0.044).kp
    120000.0
    """

    kp: float
    ti: float
    td: float = 0.0
    tt: float | None = None

    @property
    def _pid(self) -> Pid:
        return self

    def _linear(self, dt: float) -> tuple[Any, ...]:
        ki = 0.0 if math.isinf(self.ti) else dt / self.ti
        kd = self.td / dt
        above = self.kp * np.array([1.0 + ki + kd, -(1.0 + 2.0 * kd), kd])
        return above, [1.0, -1.0, 0.0]

    @classmethod
    def from_um(cls, *, kp: float, ti: float, td: float = 0.0, tt: float | None = None) -> Pid:
        """Make a controller from a proportional gain in V/um.

        Parameters
        ----------
        kp : float
            Proportional gain [V/um].
        ti, td, tt : float
            Times [s], as in the class.

        Returns
        -------
        Pid
            The controller.
        """
        return cls(kp=1e6 * _core.as_number("kp", kp), ti=ti, td=td, tt=tt)

    @classmethod
    def xu_li_2010(cls) -> Pid:
        """Gains of Xu and Li 2010: 0.120 V/um, 0.009 s, 0.044 s, for a loop at 50 Hz.

        Returns
        -------
        Pid
            The controller.
        """
        return cls.from_um(kp=0.120, ti=0.009, td=0.044)
