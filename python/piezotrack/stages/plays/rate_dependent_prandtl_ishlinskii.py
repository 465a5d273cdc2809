"""The rate-dependent Prandtl-Ishlinskii stage: plays that the rate of the drive dilates."""

from __future__ import annotations

from dataclasses import dataclass

from ..base import Stage, stage
from .prandtl_ishlinskii import PrandtlIshlinskiiState

__all__ = ["RateDependentPrandtlIshlinskiiStage"]


@stage("rate-dependent-prandtl-ishlinskii", state=PrandtlIshlinskiiState)
@dataclass(frozen=True, kw_only=True)
class RateDependentPrandtlIshlinskiiStage(Stage):
    r"""A stage with play operators at its input that the rate of the drive dilates.

    .. math::

        p = w_0 u + \sum_i w_i z_i, \qquad
        z_i = \max(u - r_i(t), \min(u + r_i(t), z_i)), \qquad
        r_i(t) = r_i + \lambda |\dot u(t)|

        h = S(p) - S(0), \qquad S(p) = p + \sum_j s_j \max(p - d_j, 0)

    Plays with thresholds that are functions of time, after M. Al Janaideh, P. Krejci, IEEE/ASME
    Transactions on Mechatronics 18(5), 1498-1507, 2013, doi 10.1109/TMECH.2012.2205265; here all
    are dilated alike, in proportion to the rate of the drive. Creep and dynamics are those of a
    `PrandtlIshlinskiiStage`, which it is where `dilation` is 0.

    Parameters
    ----------
    linear : float
        w0 [m/V], not 0: gain without hysteresis. Below 0 the displacement falls as the drive rises.
    thresholds : sequence of float
        r [V] at rest, 0 or above and ascending; 32 at most.
    weights : sequence of float
        w [m/V], as many, each 0 or of the sign of `linear`.
    dilation : float
        lambda [s], 0 or above: growth of each threshold with the rate. A play that moves is late
        by this time.
    dead_zone_thresholds, dead_zone_weights : sequence of float, optional
        d [m] and s of the one-sided dead zones; 8 at most.

    Raises
    ------
    ParameterError, ShapeError
        A parameter is out of its range, or entries are missing.

    Notes
    -----
    The drive is linear between samples, so its rate and the thresholds are constant there and jump
    at the samples. Under a drive that is held between samples (``"zoh"``) there is no rate.

    One record at one rate does not tell the dilation from a lag: identify from several, as
    ``pt.identify([slow, quick], "rate-dependent-prandtl-ishlinskii")``.

    The inverse solves for the voltage, whose rate is that from the sample before: a contraction
    with the bound :math:`q = \tfrac{\lambda}{dt} \sum_i w_i / (w_0 + \sum_i w_i)`. Where q is 1 or
    more, plays would go back where the drive goes on, and the inverse is refused.

    Examples
    --------
    Twice as fast, the plays of 10 and 20 V are later by 0.01 s of a drive of 1000 V/s:

    >>> import piezotrack as pt
    >>> stage = pt.RateDependentPrandtlIshlinskiiStage(
    ...     linear=1e-6, thresholds=[10.0, 20.0], weights=[0.2e-6, 0.1e-6], dilation=0.01
    ... )
    >>> [f"{1e6 * stage.simulate([0.0, 50.0], dt).x[1]:.1f} um" for dt in (1e3, 0.1, 0.05)]
    ['61.0 um', '59.5 um', '58.0 um']
    """

    linear: float
    thresholds: tuple[float, ...]
    weights: tuple[float, ...]
    dilation: float
    dead_zone_thresholds: tuple[float, ...] = ()
    dead_zone_weights: tuple[float, ...] = ()
    creep_weights: tuple[float, ...] = ()
    creep_times: tuple[float, ...] = ()
    time_constant: float | None = None
    frequency: float | None = None
    damping_ratio: float | None = None
    mode_weights: tuple[float, ...] = ()
    mode_frequencies: tuple[float, ...] = ()
    mode_damping_ratios: tuple[float, ...] = ()
