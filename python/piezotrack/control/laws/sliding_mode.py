"""Sliding mode control with a boundary layer."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..parts.part import FeedbackLaw, part

__all__ = ["SlidingMode"]


@part("sliding-mode")
@dataclass(frozen=True, kw_only=True)
class SlidingMode(FeedbackLaw):
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
