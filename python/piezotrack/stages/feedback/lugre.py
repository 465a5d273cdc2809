"""The LuGre stage: friction that depends on the speed, in feedback on the displacement."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..base import Stage, mechanical_ratios, stage
from ..motion import StageState

if TYPE_CHECKING:
    from ..base import Ratio

__all__ = ["LuGreStage", "LuGreState"]


@dataclass(frozen=True, kw_only=True)
class LuGreState(StageState):
    """State of a stage with LuGre friction at one instant.

    Parameters
    ----------
    deflection : float
        Mean deflection of the bristles z [m].
    """

    deflection: float = 0.0


@stage("lugre", state=LuGreState)
@dataclass(frozen=True, kw_only=True)
class LuGreStage(Stage):
    r"""A stage with LuGre friction in feedback on its displacement.

    .. math::

        M \ddot x + D \dot x + K x = T u - F, \qquad
        F = \sigma_0 z + \sigma_1 \dot z + \sigma_2 \dot x

        \dot z = \dot x - \sigma_0 \frac{|\dot x|}{g(\dot x)} z, \qquad
        g(v) = F_c + (F_s - F_c) e^{-(v/v_s)^2}

    C. Canudas de Wit, H. Olsson, K. J. Astrom, P. Lischinsky, "A new model for control of systems
    with friction", IEEE Trans. Autom. Control 40(3), 419-425, 1995, doi 10.1109/9.376053.

    Parameters
    ----------
    rest_stiffness : float
        sigma0 [N/m], above 0: stiffness of the bristles, the slope of the force where it is 0.
    micro_damping : float, optional
        sigma1 [N s/m], 0 or above: damping of the bristles. Together with `viscous_friction` at
        most 500000 times the damping, or ``sqrt(stiffness * mass)`` where that is larger.
    coulomb_force : float
        Fc [N], above 0: force of sliding at high speed.
    static_ratio : float, optional
        Fs/Fc, above 0: force of sliding at low speed over that at high speed. Of dry friction it is
        above 1 (the Stribeck effect); below 1 the friction grows with the speed.
    stribeck_velocity : float, optional
        vs [m/s], above 0: the speed at which 63 % of the change from Fs to Fc is done.
    viscous_friction : float, optional
        sigma2 [N s/m], 0 or above. A record determines only its sum with the damping.

    Raises
    ------
    ParameterError
        A parameter is out of its range.

    Notes
    -----
    With Fs = Fc and without sigma1 and sigma2 the stage is `FirstOrderDahlStage` with exponent 1.
    Unlike all other models here its hysteresis depends on the speed: a record at one rate does not
    determine how, and the equilibria that an experiment begins with are those of motions so slow
    that the force of sliding is Fs.

    For the same reason a search holds `micro_damping`, `static_ratio` and `stribeck_velocity`
    unless they are named in ``parameters=``. Where the force of sliding falls faster with the speed
    than the damping grows, the stage sticks and slips, and a search among such motions finds
    nothing of use. A micro damping far above the damping needs thousands of steps a sample, and one
    beside a mass that is too small to show needs more steps than a search takes: free it for a
    record that shows the resonance, with ``constraints=["micro_damping < damping"]``.

    Examples
    --------
    >>> import numpy as np
    >>> import piezotrack as pt
    >>> stage = pt.LuGreStage(
    ...     mass=0.18, damping=50.0, stiffness=2.6e4, piezo_coefficient=0.0468,
    ...     rest_stiffness=2e4, micro_damping=20.0,
    ...     coulomb_force=0.1, static_ratio=2.0, stribeck_velocity=2e-4,
    ... )
    >>> for frequency in (0.1, 10.0):
    ...     t = np.linspace(0.0, 3.0 / frequency, 6001)
    ...     u = 37.5 * (1 - np.cos(2 * np.pi * frequency * t))
    ...     force = stage.simulate(u, t[1]).hysteresis
    ...     print(f"{force.max():.2f} N at {frequency:g} Hz")
    0.20 N at 0.1 Hz
    0.10 N at 10 Hz
    """

    mass: float
    damping: float
    stiffness: float
    piezo_coefficient: float
    rest_stiffness: float
    micro_damping: float = 0.0
    coulomb_force: float
    static_ratio: float = 1.0
    stribeck_velocity: float = 1e-3
    viscous_friction: float = 0.0
    creep_weights: tuple[float, ...] = ()
    creep_times: tuple[float, ...] = ()

    @property
    def static_force(self) -> float:
        """Force of sliding at low speed, Fs [N]."""
        return self.static_ratio * self.coulomb_force

    def force_ratios(self) -> list[Ratio]:
        """Return forces over the stiffness, and the velocity."""
        gain = 1e6 * self.piezo_coefficient / self.stiffness
        return [
            ("piezo_coefficient", "T/K", gain, "um/V"),
            *mechanical_ratios(self, "D/K", "M/K"),
            ("rest_stiffness", "sigma0/K", self.rest_stiffness / self.stiffness, ""),
            ("micro_damping", "sigma1/K", 1e3 * self.micro_damping / self.stiffness, "ms"),
            ("coulomb_force", "Fc/K", 1e6 * self.coulomb_force / self.stiffness, "um"),
            ("static_ratio", "Fs/Fc", self.static_ratio, ""),
            ("stribeck_velocity", "vs", 1e6 * self.stribeck_velocity, "um/s"),
        ]
