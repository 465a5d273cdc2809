"""The Prandtl-Ishlinskii stage: play operators at the input."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..base import Stage, stage
from ..motion import Response, StageState

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["PrandtlIshlinskiiStage", "PrandtlIshlinskiiState"]


@dataclass(frozen=True, kw_only=True)
class PrandtlIshlinskiiState(StageState):
    """State of a Prandtl-Ishlinskii stage at one instant; its velocity is 0 without a mode.

    Parameters
    ----------
    u : float
        Drive [V].
    plays : tuple of float
        State of each play [V].
    creep : tuple of float
        State of each relaxation of the creep [m].
    mode_x, mode_v : tuple of float
        Displacement [m] and velocity [m/s] of each mode beside the main one.
    """

    u: float
    plays: tuple[float, ...]
    creep: tuple[float, ...] = ()
    mode_x: tuple[float, ...] = ()
    mode_v: tuple[float, ...] = ()


@stage("prandtl-ishlinskii", state=PrandtlIshlinskiiState)
@dataclass(frozen=True, kw_only=True)
class PrandtlIshlinskiiStage(Stage):
    r"""A stage with play operators at its input, after Kuhnen 2003.

    .. math::

        p = w_0 u + \sum_i w_i z_i, \qquad z_i = \max(u - r_i, \min(u + r_i, z_i))

        h = S(p) - S(0), \qquad S(p) = p + \sum_j s_j \max(p - d_j, 0)

        d = h + \sum_k c_k q_k, \qquad \tau_k \dot q_k = h - q_k

    and the displacement follows `d` at once, with a first-order lag
    :math:`T \dot x + x = d`, or through a mode
    :math:`\ddot x + 2 \zeta \omega_n \dot x + \omega_n^2 x = \omega_n^2 d`. Several modes act
    in parallel: :math:`x = (1 - \sum_k g_k) x_1 + \sum_k g_k x_k`, each :math:`x_k` the answer of
    one mode to `d`.

    K. Kuhnen, European Journal of Control 9(4), 407-418, 2003, doi 10.3166/ejc.9.407-418.

    Parameters
    ----------
    linear : float
        w0 [m/V], not 0: gain without hysteresis, and the slope just after a reversal. Below 0 the
        displacement falls as the drive rises.
    thresholds : sequence of float
        r [V], half the width of each play's backlash, 0 or above and ascending; 32 at most.
    weights : sequence of float
        w [m/V], as many, each 0 or of the sign of `linear`.
    dead_zone_thresholds : sequence of float, optional
        d [m], thresholds of the one-sided dead zones, ascending; 8 at most.
    dead_zone_weights : sequence of float, optional
        s, change of the slope there; partial sums stay above -1. The loops of plays have point
        symmetry, dead zones make them asymmetric.

    Raises
    ------
    ParameterError, ShapeError
        A parameter is out of its range, or entries are missing.

    Notes
    -----
    With the signs of `linear` and all `weights` turned, the stage does under -u what it did under
    u: dead zones act on `p`, and keep their thresholds.

    The simulation is exact for a drive that is held, or linear between samples: an interval in
    which a play starts to move, or `p` passes a dead zone's threshold, is split there. With
    creep and a lag or mode behind it, the creep is taken as linear over each part: an error of up
    to c H dt/(8 tau) where `h` rises by H in an interval of dt.

    The inverse inverts each part in turn: the dynamics with the derivatives of the reference, creep
    exactly for an `h` that is linear between samples, dead zones and plays in Kuhnen's closed form.
    Several modes are inverted by a filter, exact for derivatives that are linear between samples.
    It exists where all zeros of their sum are in the left half plane; elsewhere the inverse is
    refused.

    Examples
    --------
    >>> import piezotrack as pt
    >>> stage = pt.PrandtlIshlinskiiStage(
    ...     linear=1e-6, thresholds=[10.0, 20.0], weights=[0.2e-6, 0.1e-6]
    ... )
    >>> x = stage.simulate([0.0, 50.0, 0.0], 0.01).x
    >>> print(", ".join(f"{1e6 * y:.0f} um" for y in x))
    0 um, 61 um, 4 um
    """

    linear: float
    thresholds: tuple[float, ...]
    weights: tuple[float, ...]
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

    def _notes(self, response: Callable[[], Response]) -> list[str]:
        del response
        if abs(self.linear + sum(self.weights)) <= 100.0 * abs(self.linear):
            return []
        return ["the gain just after a reversal is close to 0: the inverse is ill-conditioned"]
