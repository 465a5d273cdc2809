"""The classic Dahl stage: first-order Dahl friction in feedback on the displacement."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..base import Stage, mechanical_ratios, stage
from ..motion import ForceState

if TYPE_CHECKING:
    from ..base import Ratio

__all__ = ["FirstOrderDahlStage"]


@stage("first-order-dahl", state=ForceState)
@dataclass(frozen=True, kw_only=True)
class FirstOrderDahlStage(Stage):
    r"""A stage with first-order Dahl friction in feedback on its displacement.

    .. math::

        M \ddot x + D \dot x + K x = T u - F

        \frac{dF}{dx} = \sigma \left|1 - \frac{F}{F_c} \operatorname{sgn} \dot x\right|^i
        \operatorname{sgn}\left(1 - \frac{F}{F_c} \operatorname{sgn} \dot x\right)

    Dahl 1968, Aerospace Corporation TOR-0158(3107-18)-1, and Dahl 1976, doi 10.2514/3.61511.

    Parameters
    ----------
    rest_stiffness : float
        sigma [N/m], 0 or above: slope of the force at F = 0.
    coulomb_force : float
        Fc [N], above 0: limit of the force on a long path in one direction.
    exponent : float, optional
        i, from 0 to 20: shape of the approach to Fc; linear up to sliding for 0, exponential for 1.

    Raises
    ------
    ParameterError
        A parameter is out of its range.

    Notes
    -----
    The force stays within the Coulomb force and dissipates; under a periodic drive its loops
    close after a few cycles. The second-order form of Xu and Li 2010, `DahlStage`, does neither:
    docs/models.md shows the two over a hundred cycles.

    Examples
    --------
    >>> import numpy as np
    >>> import piezotrack as pt
    >>> stage = pt.FirstOrderDahlStage(
    ...     mass=0.18, damping=50.0, stiffness=2.6e4, piezo_coefficient=0.0468,
    ...     rest_stiffness=1e4, coulomb_force=0.3,
    ... )
    >>> u = 37.5 * (1 - np.cos(2 * np.pi * 0.25 * np.arange(40001) / 1000.0))
    >>> low = stage.simulate(u, 1e-3).x[4000::4000]
    >>> print(np.round(1e6 * low[:3], 4), f"{1e9 * np.ptp(low[1:]):.2f} nm")
    [11.0023 11.0157 11.0157] 0.02 nm
    """

    mass: float
    damping: float
    stiffness: float
    piezo_coefficient: float
    rest_stiffness: float
    coulomb_force: float
    exponent: float = 1.0
    creep_weights: tuple[float, ...] = ()
    creep_times: tuple[float, ...] = ()

    def force_ratios(self) -> list[Ratio]:
        """Return all but the exponent, which is held, forces over the stiffness."""
        gain = 1e6 * self.piezo_coefficient / self.stiffness
        reach = 1e6 * self.coulomb_force / self.stiffness
        return [
            ("piezo_coefficient", "T/K", gain, "um/V"),
            *mechanical_ratios(self, "D/K", "M/K"),
            ("rest_stiffness", "sigma/K", self.rest_stiffness / self.stiffness, ""),
            ("coulomb_force", "Fc/K", reach, "um"),
        ]
