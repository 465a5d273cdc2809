"""The asymmetric Prandtl-Ishlinskii stage: plays of the drive and of functions of it."""

from __future__ import annotations

from dataclasses import dataclass

from ..base import Stage, stage
from .prandtl_ishlinskii import PrandtlIshlinskiiState

__all__ = ["AsymmetricPrandtlIshlinskiiStage"]


@stage("asymmetric-prandtl-ishlinskii", state=PrandtlIshlinskiiState)
@dataclass(frozen=True, kw_only=True)
class AsymmetricPrandtlIshlinskiiStage(Stage):
    r"""A stage with plays of the drive, of a concave and of a convex function of it at its input.

    .. math::

        H = w_0 u + \sum_i w_i P_{r_i}[u] + \sum_j v_j P_{s_j}[f(u)] + \sum_k c_k P_{t_k}[g(u)],
        \qquad h = H(u) - H(0)

        P_r[e]: \quad z = \max(e - r, \min(e + r, z))

        f(u) = L (1 - (1 - s)^3), \qquad g(u) = L s^3, \qquad
        s = (u - u_a)/L, \qquad L = u_b - u_a

    each function less its value at 0 V. Beyond the range they go on straight, with slope 3 where
    they are steep and level where they are not. Loops of plays of u have point symmetry; those of
    f(u) are wider at the lower end of the range, those of g(u) at the upper end. In a
    `PrandtlIshlinskiiStage`, whose creep and dynamics these are, dead zones without memory
    bend both branches of a loop alike.

    Each sum is a generalised Prandtl-Ishlinskii operator: M. Al Janaideh, S. Rakheja, C.-Y. Su,
    IEEE/ASME Transactions on Mechatronics 16(4), 734-744, 2011, doi 10.1109/TMECH.2010.2052366.
    All are Preisach operators, and so is their sum: M. Brokate, J. Sprekels, Hysteresis and Phase
    Transitions, Springer 1996, chapter 2, doi 10.1007/978-1-4612-4048-8.

    Parameters
    ----------
    linear : float
        w0 [m/V], not 0: gain without hysteresis, and the slope just after a reversal. Below 0 the
        displacement falls as the drive rises.
    low, high : float
        u_a and u_b [V], the range in which f and g bend.
    thresholds : sequence of float
        r [V] of the plays of the drive, 0 or above and ascending; 32 at most.
    weights : sequence of float
        w [m/V], as many, each 0 or of the sign of `linear`.
    concave_thresholds, concave_weights : sequence of float, optional
        s [V] and v [m/V] of the plays of f(u), as those of the drive.
    convex_thresholds, convex_weights : sequence of float, optional
        t [V] and c [m/V] of the plays of g(u), as those of the drive.

    Raises
    ------
    ParameterError, ShapeError
        A parameter is out of its range, or entries are missing.

    Notes
    -----
    The state has the plays of the drive, of f, and of g, one after the other.

    From any state the output rises with the drive at least as steeply as `linear` says: the
    inverse finds the drive by Newton's method between two places, with 100 steps at most.

    With creep, a lag or a mode, an interval in which a play starts to move is split there, and
    bent parts are followed by chords as close as the accuracy asks.

    Examples
    --------
    >>> import piezotrack as pt
    >>> stage = pt.AsymmetricPrandtlIshlinskiiStage(
    ...     linear=1e-6, low=0.0, high=100.0, thresholds=[], weights=[],
    ...     concave_thresholds=[7.5], concave_weights=[0.1e-6],
    ... )
    >>> x = stage.simulate([0.0, 50.0, 0.0], 0.01).x
    >>> print(", ".join(f"{1e6 * y:.2f} um" for y in x))
    0.00 um, 58.00 um, 0.75 um
    """

    linear: float
    low: float
    high: float
    thresholds: tuple[float, ...]
    weights: tuple[float, ...]
    concave_thresholds: tuple[float, ...] = ()
    concave_weights: tuple[float, ...] = ()
    convex_thresholds: tuple[float, ...] = ()
    convex_weights: tuple[float, ...] = ()
    creep_weights: tuple[float, ...] = ()
    creep_times: tuple[float, ...] = ()
    time_constant: float | None = None
    frequency: float | None = None
    damping_ratio: float | None = None
    mode_weights: tuple[float, ...] = ()
    mode_frequencies: tuple[float, ...] = ()
    mode_damping_ratios: tuple[float, ...] = ()
