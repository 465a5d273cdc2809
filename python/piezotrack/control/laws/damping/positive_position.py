"""Positive position feedback around a PID."""

from __future__ import annotations

from dataclasses import dataclass

from ...parts.part import part
from .damping_law import DampingLaw

__all__ = ["PositivePositionFeedback"]


@part("positive-position")
@dataclass(frozen=True, kw_only=True)
class PositivePositionFeedback(DampingLaw):
    r"""Positive position feedback, which damps the first mode, around a PID that tracks.

    .. math::

        u_{FB} = C_{PID}\,(r - y) + K\,(y - y_0), \qquad
        K(s) = \frac{g\,\omega_c^2}{s^2 + 2 \zeta_c \omega_c s + \omega_c^2}

    Fanson and Caughey 1990, doi 10.2514/3.10451. K is sampled by Tustin's rule, counts from the
    first reading, or from r beside a feedforward, and rolls off above the mode. Start, antiwindup,
    `check_loop` and `to_control` are those of `IntegralResonantControl`.

    Parameters
    ----------
    pid : Pid
        The controller that tracks; ``pt.Pid(kp=0.0, ti=math.inf)`` for damping alone.
    gain : float
        Static gain g [V/m]: times that of the stage below 1, or the loop is unstable.
    frequency : float
        Natural frequency of the filter [Hz], above 0: that of the mode, or somewhat more.
    damping_ratio : float
        Damping ratio of the filter, above 0.

    Raises
    ------
    ParameterError
        A number is out of its range, or `pid` is no `Pid`.

    Examples
    --------
    >>> import piezotrack as pt
    >>> law = pt.control.PositivePositionFeedback(
    ...     pid=pt.Pid(kp=2e4, ti=2e-4), gain=0.4e6, frequency=200.0, damping_ratio=0.5
    ... )
    >>> stage = pt.stages.PrandtlIshlinskiiStage(
    ...     linear=1e-6, thresholds=(), weights=(), frequency=160.0, damping_ratio=0.02
    ... )
    >>> loop = pt.Controller(dt=2e-4, limits=(0.0, 100.0), feedback=law)
    >>> pt.check_loop(stage, loop, delay=1e-4).stable
    True
    """

    gain: float
    frequency: float
    damping_ratio: float
