"""The polynomial Prandtl-Ishlinskii stage: play operators beside a polynomial at the input."""

from __future__ import annotations

from dataclasses import dataclass

from ..base import Stage, stage
from .prandtl_ishlinskii import PrandtlIshlinskiiState

__all__ = ["PolynomialPrandtlIshlinskiiStage"]


@stage("polynomial-prandtl-ishlinskii", state=PrandtlIshlinskiiState)
@dataclass(frozen=True, kw_only=True)
class PolynomialPrandtlIshlinskiiStage(Stage):
    r"""A stage with play operators beside a polynomial at its input, after Gu, Yang and Zhu.

    .. math::

        H = a_1 u + a_2 u^2 + a_3 u^3 + \sum_i w_i z_i, \qquad
        z_i = \max(u - r_i, \min(u + r_i, z_i)), \qquad h = H(u) - H(0)

    for drives from `low` to `high`; beyond them the polynomial goes on straight. Without memory
    itself, it makes the loops of plays asymmetric, as dead zones do in a
    `PrandtlIshlinskiiStage`, whose creep and dynamics these are.

    G.-Y. Gu, M.-J. Yang, L.-M. Zhu, IEEE Transactions on Industrial Electronics 61(3), 1583-1595,
    2014, doi 10.1109/TIE.2013.2257153, whose plays are one-sided.

    Parameters
    ----------
    a1, a2, a3 : float
        Coefficients of the polynomial [m/V, m/V^2, m/V^3], which rises all along the range, or
        falls all along it.
    low, high : float
        Range of the drive [V] that the coefficients are for.
    thresholds : sequence of float
        r [V], half the width of each play's backlash, 0 or above and ascending; 32 at most.
    weights : sequence of float
        w [m/V], as many, each 0 or of the sign of the polynomial's slope.

    Raises
    ------
    ParameterError, ShapeError
        A parameter is out of its range, or entries are missing. Where the polynomial turns back,
        the error names `a1`.

    Notes
    -----
    Where creep or dynamics follow, a sampling interval is split where a play starts to move, and
    along the polynomial into chords so short that `accuracy` holds; `Response.error_estimate` is a
    bound of the error. The inverse goes from corner to corner of the plays and finds the
    drive between two of them by Newton's method, to rounding.

    An identification finds the polynomial and the weights by least squares; the range of the drive
    becomes `low` and `high`. The polynomial is a sum, with weights of one sign, of polynomials
    whose slopes are Bernstein polynomials of the range: it cannot turn back.

    Examples
    --------
    >>> import piezotrack as pt
    >>> stage = pt.PolynomialPrandtlIshlinskiiStage(
    ...     a1=1e-6, a2=2e-9, a3=0.0, low=0.0, high=100.0,
    ...     thresholds=[10.0, 20.0], weights=[0.2e-6, 0.1e-6],
    ... )
    >>> x = stage.simulate([0.0, 50.0, 0.0], 0.01).x
    >>> print(", ".join(f"{1e6 * y:.0f} um" for y in x))
    0 um, 66 um, 4 um
    """

    a1: float
    a2: float
    a3: float
    low: float
    high: float
    thresholds: tuple[float, ...]
    weights: tuple[float, ...]
    creep_weights: tuple[float, ...] = ()
    creep_times: tuple[float, ...] = ()
    time_constant: float | None = None
    frequency: float | None = None
    damping_ratio: float | None = None
    mode_weights: tuple[float, ...] = ()
    mode_frequencies: tuple[float, ...] = ()
    mode_damping_ratios: tuple[float, ...] = ()
