"""The stage with first-order Dahl elements in parallel in feedback on the displacement."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..base import Stage, mechanical_ratios, stage
from ..motion import StageState

if TYPE_CHECKING:
    from ..base import Ratio

__all__ = ["ParallelDahlStage", "ParallelDahlState"]


@dataclass(frozen=True, kw_only=True)
class ParallelDahlState(StageState):
    """State of a stage with Dahl elements in parallel at one instant.

    Parameters
    ----------
    force_1, force_2, force_3 : float
        Force of each element [N].
    """

    force_1: float = 0.0
    force_2: float = 0.0
    force_3: float = 0.0


@stage("parallel-dahl", state=ParallelDahlState)
@dataclass(frozen=True, kw_only=True)
class ParallelDahlStage(Stage):
    r"""A stage with three first-order Dahl elements in parallel in feedback on its displacement.

    .. math::

        M \ddot x + D \dot x + K x = T u - \sum_{j=1}^3 F_j

        \frac{dF_j}{dx} = \sigma_j - \frac{F_j}{l_j} \operatorname{sgn} \dot x, \qquad
        l_j = l \rho^{j-1}

    The elements are those of `FirstOrderDahlStage` with exponent 1 and Coulomb forces
    sigma_j l_j: Dahl 1976, doi 10.2514/3.61511. That they yield one after the other is the
    generalised Maxwell-slip arrangement: Al-Bender, Lampaert and Swevers 2005,
    doi 10.1109/TAC.2005.858676, with elements that stick or slide.

    Parameters
    ----------
    rest_stiffness_1, rest_stiffness_2, rest_stiffness_3 : float
        sigma_j [N/m], 0 or above: slope of the force of each element where it is 0.
    yield_path : float
        l [m], above 0: path of the first element. Along a path of this length in one direction
        63 % of the way from its force to its Coulomb force is covered.
    path_ratio : float
        rho, from 1 to 1000: path of each element over that of the one before.

    Raises
    ------
    ParameterError
        A parameter is out of its range.

    Notes
    -----
    One element has one curvature at the tips of its loops; here small loops are bent by the first
    element and large ones by the last. The force stays within the sum of the Coulomb forces and
    dissipates; under a periodic drive the loops close. With a ratio of 1 the elements are one,
    whose rest stiffness is the sum.

    Examples
    --------
    >>> import numpy as np
    >>> import piezotrack as pt
    >>> stage = pt.ParallelDahlStage(
    ...     mass=0.18, damping=50.0, stiffness=2.6e4, piezo_coefficient=0.0468,
    ...     rest_stiffness_1=4e3, rest_stiffness_2=3e3, rest_stiffness_3=2e3,
    ...     yield_path=2e-6, path_ratio=5.0,
    ... )
    >>> print(np.round([1e6 * path for path in stage.yield_paths], 6))
    [ 2. 10. 50.]
    >>> print(np.round(stage.coulomb_forces, 6))
    [0.008 0.03  0.1  ]
    >>> u = 37.5 * (1 - np.cos(2 * np.pi * 0.25 * np.arange(40001) / 1000.0))
    >>> low = stage.simulate(u, 1e-3).x[4000::4000]
    >>> bool(np.ptp(low[2:]) < 1e-10)
    True
    """

    mass: float
    damping: float
    stiffness: float
    piezo_coefficient: float
    rest_stiffness_1: float
    rest_stiffness_2: float
    rest_stiffness_3: float
    yield_path: float
    path_ratio: float
    creep_weights: tuple[float, ...] = ()
    creep_times: tuple[float, ...] = ()

    @property
    def rest_stiffnesses(self) -> tuple[float, float, float]:
        """Slope of the force of each element where it is 0 [N/m]."""
        return self.rest_stiffness_1, self.rest_stiffness_2, self.rest_stiffness_3

    @property
    def yield_paths(self) -> tuple[float, ...]:
        """Path of each element [m]."""
        return tuple(self.yield_path * self.path_ratio**j for j in range(3))

    @property
    def coulomb_forces(self) -> tuple[float, ...]:
        """Limit of the force of each element on a long path in one direction [N]."""
        pairs = zip(self.rest_stiffnesses, self.yield_paths, strict=True)
        return tuple(stiffness * path for stiffness, path in pairs)

    def force_ratios(self) -> list[Ratio]:
        """Return forces over the stiffness, and the paths."""
        gain = 1e6 * self.piezo_coefficient / self.stiffness
        return [
            ("piezo_coefficient", "T/K", gain, "um/V"),
            *mechanical_ratios(self, "D/K", "M/K"),
            *(
                (f"rest_stiffness_{j}", f"sigma{j}/K", value / self.stiffness, "")
                for j, value in enumerate(self.rest_stiffnesses, start=1)
            ),
            ("yield_path", "l", 1e6 * self.yield_path, "um"),
            ("path_ratio", "rho", self.path_ratio, ""),
        ]
