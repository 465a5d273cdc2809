"""Integral resonant control around a PID."""

from __future__ import annotations

from dataclasses import dataclass

from ...parts.part import part
from .damping_law import DampingLaw

__all__ = ["IntegralResonantControl"]


@part("integral-resonant")
@dataclass(frozen=True, kw_only=True)
class IntegralResonantControl(DampingLaw):
    r"""Integral resonant control, which damps the first mode, around a PID that tracks.

    .. math::

        u_{FB} = C_{PID}\,(r - y) + K\,(y - y_0), \qquad K(s) = \frac{k}{s + k d}

    Aphale, Fleming and Moheimani 2007, doi 10.1088/0964-1726/16/2/023: a feedthrough of -d added to
    the displacement, and an integrator around both; seen from the stage alone, positive feedback of
    the low-passed displacement, of static gain 1/d and cutoff k d. K is sampled by Tustin's rule,
    and counts from the first reading y0, so that a start has no bump. The antiwindup of the PID is
    for the whole command, and K, which sees readings only, does not wind up. Beside a feedforward,
    which makes the stage follow as it is without K, r takes the place of y0: K acts on the
    deviation, and is 0 V where there is none.

    `check_loop` opens the loop at the command, where it is P (C - K); its bandwidth is of
    P C/(1 + P (C - K)), from the reference to the displacement without feedforward. `to_control`
    gives both inputs.

    Parameters
    ----------
    pid : Pid
        The controller that tracks; ``pt.Pid(kp=0.0, ti=math.inf)`` for damping alone.
    gain : float
        Gain k of the integrator [V/(m s)], of the sign of `feedthrough`; 0 for no damping.
    feedthrough : float
        d [m/V], not 0: above the static gain of the stage, twice of it is usual.

    Raises
    ------
    ParameterError
        A number is out of its range, or `pid` is no `Pid`.

    Examples
    --------
    Twice the static gain of 1 um/V, and the cutoff k d at 1.19 times the mode of 160 Hz:

    >>> import math
    >>> import piezotrack as pt
    >>> d, cutoff = 2e-6, 2.0 * math.pi * 1.19 * 160.0
    >>> law = pt.control.IntegralResonantControl(
    ...     pid=pt.Pid(kp=2e4, ti=2e-4), gain=cutoff / d, feedthrough=d
    ... )
    >>> stage = pt.stages.PrandtlIshlinskiiStage(
    ...     linear=1e-6, thresholds=(), weights=(), frequency=160.0, damping_ratio=0.02
    ... )
    >>> loop = pt.Controller(dt=2e-4, limits=(0.0, 100.0), feedback=law)
    >>> pt.check_loop(stage, loop, delay=1e-4).stable
    True
    """

    gain: float
    feedthrough: float
