"""The Maxwell-slip stage: elasto-slide elements in parallel with a spring."""

from __future__ import annotations

from dataclasses import dataclass

from ... import _core
from ..base import Stage, stage
from .prandtl_ishlinskii import PrandtlIshlinskiiState

__all__ = ["MaxwellSlipStage"]


@stage("maxwell-slip", state=PrandtlIshlinskiiState)
@dataclass(frozen=True, kw_only=True)
class MaxwellSlipStage(Stage):
    r"""A stage with elasto-slide elements in parallel with its spring.

    .. math::

        k h + \sum_i k_i e_i = T u, \qquad
        e_i = \min(r_i, \max(-r_i, e_i + dh)), \qquad r_i = f_i / k_i

        d = h + \sum_k c_k q_k, \qquad \tau_k \dot q_k = h - q_k

    and the displacement follows `d` at once, with a lag, or through one or several modes, as in
    `PrandtlIshlinskiiStage`. Element i is a spring :math:`k_i` that slips at the force :math:`f_i`:
    M. Goldfarb, N. Celanovic, "Modeling piezoelectric stack actuators for control of
    micromanipulation", IEEE Control Systems 17(3), 69-79, 1997, doi 10.1109/37.588158.

    Parameters
    ----------
    piezo_coefficient : float
        T/k [m/V], not 0: displacement for one volt where all elements slip.
    stiffness_ratios : sequence of float
        k_i/k, 0 or above; 32 at most. Voltage and displacement determine stiffnesses and forces
        relative to the spring's stiffness k only, so these are given over k: see `stiffnesses` and
        `slip_forces` for those in N/m and N.
    slip_displacements : sequence of float
        r_i = f_i/k_i [m], as many, 0 or above and ascending: how far an element is strained when it
        slips.

    Raises
    ------
    ParameterError, ShapeError
        A parameter is out of its range, or entries are missing.

    Notes
    -----
    The equation of the elements gives the drive as a weighted sum of stops of h. Its inverse is a
    weighted sum of plays of the drive, in closed form: P. Krejci, K. Kuhnen, "Inverse control of
    systems with hysteresis and creep", IEE Proc. Control Theory Appl. 148(3), 185-192, 2001,
    doi 10.1049/ip-cta:20010375. The stage is therefore a `PrandtlIshlinskiiStage` without dead
    zones, and is simulated, inverted and identified as one: least squares find the plays, which are
    converted to elements. What it adds are the parameters of the elements. A state has the plays.

    Mass and damping are behind the hysteresis, not inside the sum of forces: the elements respond
    to the slow displacement h, so that an oscillation of the stage makes no hysteresis. Where it
    does, use `ParallelDahlStage`, whose elements are in feedback on the displacement.

    Examples
    --------
    A spring of 1 N/um with one element of 0.5 N/um that slips at 2 N, driven by 1 N/V:

    >>> import piezotrack as pt
    >>> stage = pt.MaxwellSlipStage(
    ...     piezo_coefficient=1e-6, stiffness_ratios=[0.5], slip_displacements=[4e-6]
    ... )
    >>> x = stage.simulate([0.0, 12.0, 9.0], 0.01).x
    >>> print(", ".join(f"{1e6 * y:.0f} um" for y in x))
    0 um, 10 um, 8 um
    >>> print([f"{force:.1f} N" for force in stage.slip_forces(1e6)])
    ['2.0 N']
    """

    piezo_coefficient: float
    stiffness_ratios: tuple[float, ...]
    slip_displacements: tuple[float, ...]
    creep_weights: tuple[float, ...] = ()
    creep_times: tuple[float, ...] = ()
    time_constant: float | None = None
    frequency: float | None = None
    damping_ratio: float | None = None
    mode_weights: tuple[float, ...] = ()
    mode_frequencies: tuple[float, ...] = ()
    mode_damping_ratios: tuple[float, ...] = ()

    def stiffnesses(self, stiffness: float) -> tuple[float, ...]:
        """Return the stiffness of each element.

        Parameters
        ----------
        stiffness : float
            k [N/m], that of the spring.

        Returns
        -------
        tuple of float
            k_i [N/m].

        Raises
        ------
        ParameterError
            `stiffness` is no number.
        """
        spring = _core.as_number("stiffness", stiffness)
        return tuple(ratio * spring for ratio in self.stiffness_ratios)

    def slip_forces(self, stiffness: float) -> tuple[float, ...]:
        """Return the force at which each element slips.

        Parameters
        ----------
        stiffness : float
            k [N/m], that of the spring.

        Returns
        -------
        tuple of float
            f_i [N].

        Raises
        ------
        ParameterError
            `stiffness` is no number.
        """
        pairs = zip(self.stiffnesses(stiffness), self.slip_displacements, strict=True)
        return tuple(element * slip for element, slip in pairs)
