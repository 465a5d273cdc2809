"""The Bouc-Wen oscillator: Bouc-Wen hysteresis in feedback on the displacement."""

from __future__ import annotations

from dataclasses import dataclass

from ..base import Stage, stage
from ..motion import ForceState

__all__ = ["BoucWenOscillator"]


@stage("bouc-wen-oscillator", state=ForceState)
@dataclass(frozen=True, kw_only=True)
class BoucWenOscillator(Stage):
    r"""A mass on a spring with Bouc-Wen hysteresis, driven by a force.

    .. math::

        m \ddot y + c \dot y + k y + z = u

        \dot z = \alpha \dot y
        - \beta \left(\gamma |\dot y| |z|^{\nu-1} z + \delta \dot y |z|^\nu\right)

    Noel and Schoukens 2016, "Hysteretic benchmark with a dynamic nonlinearity", equations (1)
    and (3), doi 10.4121/12967592.

    Parameters
    ----------
    alpha : float
        Stiffness of the hysteresis for small motions [N/m].
    beta : float
        Factor of gamma and delta, not 0. The data determine only the two products, so `identify`
        holds it: at 1, or at a value given in ``parameters=``.
    gamma, delta : float
        Coefficients of the decay with abs(y'), which dissipates, and with y', which does not
        [1/m; for another exponent 1/(m N^(nu-1))]. `BoucWenStage` has its hysteresis at the
        input, driven by the voltage: its beta is beta gamma here, and its gamma is beta delta
        here.
    exponent : float, optional
        nu, from 1 to 20: the sharpness of the bend.

    Raises
    ------
    ParameterError
        A parameter is out of its range.

    Examples
    --------
    >>> import numpy as np
    >>> import piezotrack as pt
    >>> oscillator = pt.BoucWenOscillator.benchmark()
    >>> t = np.arange(15000) / 15000.0
    >>> y = oscillator.simulate(40 * np.sin(2 * np.pi * (18 + t / 12) * t), 1 / 15000).x
    >>> print(f"{1e3 * np.abs(y).max():.2f} mm")
    0.67 mm
    """

    mass: float
    damping: float
    stiffness: float
    alpha: float
    beta: float
    gamma: float
    delta: float
    exponent: float = 1.0
    creep_weights: tuple[float, ...] = ()
    creep_times: tuple[float, ...] = ()

    @classmethod
    def benchmark(cls) -> BoucWenOscillator:
        """Table 1 of Noel and Schoukens 2016, doi 10.4121/12967592.

        Returns
        -------
        BoucWenOscillator
            The system of the benchmark.
        """
        return cls._published("benchmark")
