"""The generalised Prandtl-Ishlinskii stage: play operators between envelopes at the input."""

from __future__ import annotations

from dataclasses import dataclass

from ..base import Stage, stage
from .prandtl_ishlinskii import PrandtlIshlinskiiState

__all__ = ["GeneralisedPrandtlIshlinskiiStage"]


@stage("generalised-prandtl-ishlinskii", state=PrandtlIshlinskiiState)
@dataclass(frozen=True, kw_only=True)
class GeneralisedPrandtlIshlinskiiStage(Stage):
    r"""A stage with play operators between envelopes at its input.

    .. math::

        z_r = \max(\gamma_l(u) - r, \min(\gamma_r(u) + r, z_r)), \qquad
        \gamma(u) = c_0 \tanh(c_1 u + c_2) + c_3

        H = w_0 z_0 + \sum_i w_i z_{r_i}, \qquad h = H(u) - H(0)

    with four numbers for the envelope :math:`\gamma_l`, which moves the plays up as the drive
    rises, and four for :math:`\gamma_r`, which moves them down as it falls. Creep and dynamics
    are those of a `PrandtlIshlinskiiStage`; in place of its dead zones, the envelopes make loops
    asymmetric and can saturate.

    M. Al Janaideh, S. Rakheja, C.-Y. Su, IEEE/ASME Transactions on Mechatronics 16(4), 734-744,
    2011, doi 10.1109/TMECH.2010.2052366.

    Parameters
    ----------
    linear : float
        w0 [m/V], not 0: weight of the play of threshold 0, which with one envelope for both
        directions has no memory. Below 0 the displacement falls as the drive rises.
    thresholds : sequence of float
        r [V], half the width of each play's backlash, 0 or above and ascending; 32 at most.
    weights : sequence of float
        w [m/V], as many, each 0 or of the sign of `linear`.
    scale, slope, shift, level : float
        c0 [V] and c1 [1/V], above 0, c2 and c3 [V] of the envelope of a rising drive.
    falling_scale, falling_slope, falling_shift, falling_level : float, optional
        The same for the envelope of a falling drive; by default those of a rising one.

    Raises
    ------
    ParameterError, ShapeError
        A parameter is out of its range, or entries are missing.

    Notes
    -----
    In the state, the play of threshold 0 comes first.

    Where creep or dynamics follow, a sampling interval is split where a play starts to move, and
    along the bent envelopes into chords so short that `accuracy` holds; `Response.error_estimate`
    is a bound of the error, for a mode with a damping ratio of 0.01 or more.

    An identification finds one envelope for both directions, which is 0 at 0 V and whose range over
    the drive is that of the drive, so that thresholds are in volts. It searches the ratio of the
    slopes at the two ends, and how much the envelope bends beyond that. A number
    that lowers the RMS by less than a tenth stays at the middle of its range: in a record of one
    amplitude, an envelope that bends to both sides cannot be distinguished from other weights.

    The inverse is in closed form: on a rising stretch all plays follow :math:`\gamma_l(u)`, on a
    falling one :math:`\gamma_r(u)`. With two different envelopes the drive jumps where the
    reference reverses. Displacements beyond the reach of the envelopes have no drive, nor those
    for which :math:`\gamma_l(u) > \gamma_r(u)`.

    Examples
    --------
    >>> import piezotrack as pt
    >>> stage = pt.GeneralisedPrandtlIshlinskiiStage(
    ...     linear=1e-6, thresholds=[10.0, 20.0], weights=[0.2e-6, 0.1e-6],
    ...     scale=100.0, slope=0.01, shift=0.0, level=0.0,
    ... )
    >>> x = stage.simulate([0.0, 50.0, 0.0], 0.01).x
    >>> print(", ".join(f"{1e6 * y:.2f} um" for y in x))
    0.00 um, 56.08 um, 4.00 um
    """

    linear: float
    thresholds: tuple[float, ...]
    weights: tuple[float, ...]
    scale: float
    slope: float
    shift: float
    level: float
    falling_scale: float | None = None
    falling_slope: float | None = None
    falling_shift: float | None = None
    falling_level: float | None = None
    creep_weights: tuple[float, ...] = ()
    creep_times: tuple[float, ...] = ()
    time_constant: float | None = None
    frequency: float | None = None
    damping_ratio: float | None = None
    mode_weights: tuple[float, ...] = ()
    mode_frequencies: tuple[float, ...] = ()
    mode_damping_ratios: tuple[float, ...] = ()
