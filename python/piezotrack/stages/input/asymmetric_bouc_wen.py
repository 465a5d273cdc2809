"""The asymmetric Bouc-Wen stage: rising and falling branches of the hysteresis differ."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..base import Stage, mechanical_ratios, stage
from .bouc_wen import BoucWenState

if TYPE_CHECKING:
    from ..base import Ratio

__all__ = ["AsymmetricBoucWenStage"]


@stage("asymmetric-bouc-wen", state=BoucWenState)
@dataclass(frozen=True, kw_only=True)
class AsymmetricBoucWenStage(Stage):
    r"""A stage with Bouc-Wen hysteresis at its input whose rising and falling branches differ.

    .. math::

        m \ddot x + b \dot x + k x = k (d u - h)

        \dot h = \alpha d \dot u - |h| \psi \dot u, \qquad
        \psi = \beta \operatorname{sgn}(\dot u h) + \gamma
        + \delta \operatorname{sgn} h + \epsilon \operatorname{sgn} \dot u

    Xu and Li 2010, equations (19) and (20), doi 10.1115/1.4001712, with the generalised shape
    function of Song and Der Kiureghian 2006, J. Eng. Mech. 132(6), 610-618,
    doi 10.1061/(ASCE)0733-9399(2006)132:6(610). Its three terms in the sign of the input are left
    out: for a drive of one sign they are constant or repeat the others.

    Parameters
    ----------
    stiffness : float
        k [N/m], above 0. The displacement depends on m/k and b/k only.
    piezo_coefficient : float
        d [m/V], not 0. In `DahlStage` it is a force per volt.
    alpha : float
        Initial slope of h over d u.
    beta, gamma : float
        Decay of the hysteresis along the path of the drive [1/V], as in `BoucWenStage` with
        exponent 1.
    asymmetry : float
        delta [1/V]: the hysteresis decays faster by delta while the drive rises, and more slowly by
        delta while it falls.
    sign_asymmetry : float, optional
        epsilon [1/V]: it decays faster by epsilon where h is above 0, and more slowly by epsilon
        where it is below 0. A search holds it at 0 unless something is said of it.

    Raises
    ------
    ParameterError
        A parameter is out of its range.

    Notes
    -----
    Along a path p of the drive in the direction s, z = s h follows

    .. math::

        \frac{dz}{dp} = \alpha d
        - z (\beta + s \delta + (\gamma + s \epsilon) \operatorname{sgn} z)

    so each of the four combinations of direction and sign of h has its own rate, of which
    :math:`(\beta, \gamma, \delta, \epsilon)` are the coordinates. Without asymmetries the stage is
    `BoucWenStage`, to the last bit. One asymmetry is enough for branches that differ. Delta is the
    one that is searched: on the measured record of `piezotrack.data.datasets` epsilon fits the
    loops of one amplitude more closely, but predicts loops of other amplitudes worse.

    The hysteresis is passive only for ``abs(gamma + delta) <= beta + epsilon`` and
    ``abs(gamma - delta) <= beta - epsilon``, and bounded for
    ``beta + gamma > abs(delta + epsilon)``. The inverse exists where it is passive and
    ``2 alpha beta / (beta + gamma)`` is below 1, both with ``beta + epsilon`` and ``gamma + delta``
    and with ``beta - epsilon`` and ``gamma - delta``.

    Examples
    --------
    >>> import numpy as np
    >>> import piezotrack as pt
    >>> stage = pt.AsymmetricBoucWenStage(
    ...     mass=0.1283, damping=1580.0, stiffness=19567.0, piezo_coefficient=1.7339e-6,
    ...     alpha=0.3575, beta=0.0364, gamma=0.0272, asymmetry=0.02,
    ... )
    >>> up, down = (stage.simulate([0.0, u, u], 10.0).final.h for u in (500.0, -500.0))
    >>> print(f"{1e6 * up:.2f} um, {1e6 * down:.2f} um")
    7.41 um, -14.22 um
    """

    mass: float
    damping: float
    stiffness: float
    piezo_coefficient: float
    alpha: float
    beta: float
    gamma: float
    asymmetry: float
    sign_asymmetry: float = 0.0
    creep_weights: tuple[float, ...] = ()
    creep_times: tuple[float, ...] = ()

    def force_ratios(self) -> list[Ratio]:
        """Return the parameters, forces over the stiffness."""
        ratios: list[Ratio] = [
            ("piezo_coefficient", "d", 1e6 * self.piezo_coefficient, "um/V"),
            *mechanical_ratios(self, "b/k", "m/k"),
            ("alpha", "alpha", self.alpha, ""),
            ("beta", "beta", self.beta, "1/V"),
            ("gamma", "gamma", self.gamma, "1/V"),
            ("asymmetry", "delta", self.asymmetry, "1/V"),
        ]
        if self.sign_asymmetry:
            ratios.append(("sign_asymmetry", "epsilon", self.sign_asymmetry, "1/V"))
        return ratios
