"""Positive velocity and position feedback around a PID."""

from __future__ import annotations

from dataclasses import dataclass

from ...parts.part import part
from .damping_law import DampingLaw

__all__ = ["PositiveVelocityPositionFeedback"]


@part("positive-velocity-position")
@dataclass(frozen=True, kw_only=True)
class PositiveVelocityPositionFeedback(DampingLaw):
    r"""Positive velocity and position feedback, which damps the first mode, around a PID.

    .. math::

        u_{FB} = C_{PID}\,(r - y) + K\,(y - y_0), \qquad
        K(s) = \frac{g_1\,\omega_c s + g_2\,\omega_c^2}{s^2 + 2 \zeta_c \omega_c s + \omega_c^2}

    Bhikkaji, Ratnam, Fleming and Moheimani 2007, High-performance control of piezoelectric tube
    scanners, IEEE Transactions on Control Systems Technology 15, whose gains are ``g1 wc`` and
    ``g2 wc^2``. The four numbers of K put the four poles of a mode with the filter anywhere.
    Without the velocity it is `PositivePositionFeedback`. K is sampled by Tustin's rule, and counts
    from the first reading, or from r beside a feedforward. Start, antiwindup, `check_loop` and
    `to_control` are those of `IntegralResonantControl`.

    Parameters
    ----------
    pid : Pid
        The controller that tracks; ``pt.Pid(kp=0.0, ti=math.inf)`` for damping alone.
    velocity_gain : float
        Gain g1 of the velocity, at the frequency of the filter [V/m].
    position_gain : float
        Static gain g2 [V/m]: times that of the stage below 1, or the loop is unstable.
    frequency : float
        Natural frequency of the filter [Hz], above 0.
    damping_ratio : float
        Damping ratio of the filter, above 0.

    Raises
    ------
    ParameterError
        A number is out of its range, or `pid` is no `Pid`.

    Examples
    --------
    >>> import piezotrack as pt
    >>> law = pt.control.PositiveVelocityPositionFeedback(
    ...     pid=pt.Pid(kp=2e4, ti=2e-4),
    ...     velocity_gain=-0.1e6,
    ...     position_gain=0.4e6,
    ...     frequency=250.0,
    ...     damping_ratio=0.6,
    ... )
    >>> stage = pt.stages.PrandtlIshlinskiiStage(
    ...     linear=1e-6, thresholds=(), weights=(), frequency=160.0, damping_ratio=0.02
    ... )
    >>> loop = pt.Controller(dt=2e-4, limits=(0.0, 100.0), feedback=law)
    >>> pt.check_loop(stage, loop, delay=1e-4).stable
    True
    """

    velocity_gain: float
    position_gain: float
    frequency: float
    damping_ratio: float
