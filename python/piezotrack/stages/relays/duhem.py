"""The Duhem stage of Coleman and Hodgdon: hysteresis by a differential equation at the input."""

from __future__ import annotations

from dataclasses import dataclass

from ..base import Stage, stage
from ..motion import StageState

__all__ = ["DuhemStage", "DuhemState"]


@dataclass(frozen=True, kw_only=True)
class DuhemState(StageState):
    """State of a Duhem stage at one instant; its velocity is 0 without a mode.

    Parameters
    ----------
    u : float
        Drive [V].
    output : float
        What comes out of the hysteresis, h [m].
    creep : tuple of float
        State of each relaxation of the creep [m].
    mode_x, mode_v : tuple of float
        Displacement [m] and velocity [m/s] of each mode beside the main one.
    """

    u: float
    output: float
    creep: tuple[float, ...] = ()
    mode_x: tuple[float, ...] = ()
    mode_v: tuple[float, ...] = ()


@stage("duhem", state=DuhemState)
@dataclass(frozen=True, kw_only=True)
class DuhemStage(Stage):
    r"""A stage with the hysteresis of Coleman and Hodgdon at its input, a model of Duhem's kind.

    .. math::

        \dot h = \alpha |\dot u| (f(u) - h) + g(u)\, \dot u

        f(u) = f_1 u + f_2 u^2 + f_3 u^3, \qquad g(u) = g_0 + g_1 u + g_2 u^2

    for drives from `low` to `high`; beyond them f goes on straight and g stays as it is. Every
    branch approaches a curve beside f within a drive of a few :math:`1/\alpha`, and has
    the slope g just after the drive has been on f. Creep and dynamics are those of a
    `PrandtlIshlinskiiStage`.

    B. D. Coleman, M. L. Hodgdon, International Journal of Engineering Science 24(6), 897-919, 1986;
    M. L. Hodgdon, IEEE Transactions on Magnetics 24(6), 3120-3122, 1988. With f straight and g
    constant it is the model of piezo actuators of H. J. M. T. A. Adriaens, W. L. de Koning, R.
    Banning, IEEE/ASME Transactions on Mechatronics 5(4), 331-341, 2000, doi 10.1109/3516.891044.

    Parameters
    ----------
    alpha : float
        alpha [1/V], above 0.
    f1, f2, f3 : float
        Coefficients of f [m/V, m/V^2, m/V^3].
    g0, g1, g2 : float
        Coefficients of g [m/V, m/V^2, m/V^3].
    low, high : float
        Range of the drive [V] that the coefficients are for.

    Raises
    ------
    ParameterError, ShapeError
        A parameter is out of its range, or entries are missing.

    Notes
    -----
    Every branch rises where, on the range, :math:`|g'| < \alpha f'` and
    :math:`|g'| < \alpha (2 g - f')`, and every branch falls where -f and -g meet that. Other
    parameters are refused, or there would be no inverse. The error then names `f1` or `g0`.

    Loops within a loop do not close at once: there is no memory but the present output. After a few
    cycles they settle.

    Each branch is a polynomial and an exponential, exact in a step of any length. Where creep or
    dynamics follow, a sampling interval is split into chords so short that `accuracy` holds;
    `Response.error_estimate` is a bound of the error. The inverse is found by Newton's method along
    each branch, to rounding.

    An identification finds f and g by least squares and searches `alpha` from 0.3 to 60 over the
    range of the drive, which becomes `low` and `high`.

    Examples
    --------
    >>> import piezotrack as pt
    >>> stage = pt.DuhemStage(
    ...     alpha=0.05, f1=1e-6, f2=0.0, f3=0.0, g0=0.7e-6, g1=0.0, g2=0.0, low=0.0, high=100.0
    ... )
    >>> x = stage.simulate([0.0, 100.0, 0.0], 0.01).x
    >>> print(", ".join(f"{1e6 * y:.2f} um" for y in x))
    0.00 um, 94.04 um, 5.92 um
    """

    alpha: float
    f1: float
    f2: float
    f3: float
    g0: float
    g1: float
    g2: float
    low: float
    high: float
    creep_weights: tuple[float, ...] = ()
    creep_times: tuple[float, ...] = ()
    time_constant: float | None = None
    frequency: float | None = None
    damping_ratio: float | None = None
    mode_weights: tuple[float, ...] = ()
    mode_frequencies: tuple[float, ...] = ()
    mode_damping_ratios: tuple[float, ...] = ()
