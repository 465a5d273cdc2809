"""The Dahl stage: second-order Dahl hysteresis in feedback on the displacement."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from ..base import Stage, mechanical_ratios, stage
from ..motion import Response, StageState

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike

    from ...data.dataset import Hold
    from ..base import Ratio

__all__ = ["DahlStage", "DahlState"]


@dataclass(frozen=True, kw_only=True)
class DahlState(StageState):
    """State of a Dahl stage at one instant.

    Parameters
    ----------
    q1 : float
        First state of the hysteresis operator.
    q2 : float
        Second state, its slope along the path [1/m]. Both are 0 where b1 and b0 are 0.
    """

    q1: float = 0.0
    q2: float = 0.0


@stage("dahl", state=DahlState)
@dataclass(frozen=True, kw_only=True)
class DahlStage(Stage):
    r"""A stage with second-order Dahl hysteresis in feedback on its displacement.

    .. math::

        M \ddot x + D \dot x + K x = T u - F_h

        F_h = b_1 q_1 + \operatorname{sgn}(\dot x)\, b_0 q_2

        \dot q_1 = q_2 \dot x, \qquad
        \dot q_2 = (u_p - a_2 q_1 - \operatorname{sgn}(\dot x) a_1 q_2)\, \dot x

    Xu and Li 2010, equations (2), (7) and (8), doi 10.1115/1.4001712.

    Parameters
    ----------
    a1, a2 : float
        Decay along the path [1/m] and squared spatial frequency [1/m^2], 0 or above.
    b1 : float
        Gain of the hysteresis force [N/m^2].
    b0 : float, optional
        Gain of the friction force [N/m]. With any value but 0 the hysteresis force jumps by
        2 b0 q2 at a reversal: the stage sticks while the other forces are smaller than b0 q2.
        Where b0 q2 is below 0 the motion from rest is not unique: see ``Response.unique``.
    up : float, optional
        Constant input of the operator. The motion depends only on the products of `up` with `b1`
        and `b0`.

    Raises
    ------
    ParameterError
        A parameter is out of its range.

    Notes
    -----
    The operator is neither stationary nor dissipative: under a periodic drive its loops drift
    instead of closing, and the work of Fh over a cycle can be negative. It describes a record of a
    few cycles well; over hundreds of cycles its mean drifts.

    For x < 0 the force is a softening spring, so a large voltage of the sign opposite to the
    piezo coefficient can leave the stage without an equilibrium.

    Examples
    --------
    >>> import numpy as np
    >>> import piezotrack as pt
    >>> stage = pt.DahlStage.xu_li_2010()
    >>> t = np.arange(20001) / 5000.0
    >>> u = 37.5 * (1 - np.cos(2 * np.pi * 0.25 * t))
    >>> x = stage.simulate(u, 1 / 5000.0).x
    >>> print(f"{1e6 * x.max():.1f} um")
    119.1 um
    """

    mass: float
    damping: float
    stiffness: float
    piezo_coefficient: float
    a1: float
    a2: float
    b1: float
    b0: float = 0.0
    up: float = 30.0
    creep_weights: tuple[float, ...] = ()
    creep_times: tuple[float, ...] = ()

    @classmethod
    def xu_li_2010(cls) -> DahlStage:
        """Table 1 of Xu and Li 2010, doi 10.1115/1.4001712.

        Returns
        -------
        DahlStage
            The stage of the paper's x axis.
        """
        return cls._published("xu_li_2010")

    def simulate(
        self,
        u: ArrayLike,
        dt: float,
        *,
        hold: Hold = "foh",
        initial: StageState | None = None,
        method: Literal["exponential", "rk4", "rk45"] = "exponential",
        accuracy: float = 1e-10,
    ) -> Response:
        """Simulate the response to a sampled drive.

        The linear part is exact, the hysteresis is exact in the displacement, and the two are
        coupled by a predictor-corrector of fourth order (of second order where that is
        sufficient). The number of steps in a sampling interval is doubled until no sample moves by
        more than `accuracy`.

        Parameters
        ----------
        u : array_like, shape (n,)
            Drive [V].
        dt : float
            Sampling interval [s].
        hold : {"foh", "zoh"}, optional
            Between two samples the drive goes straight from one to the next (``"foh"``), or
            stays constant until the next (``"zoh"``).
        initial : DahlState, optional
            State at the first sample; at rest where it is not given. To continue a simulation,
            begin the new drive with the last sample of the one before.
        method : {"exponential", "rk4", "rk45"}, optional
            The scheme above, or for comparison the classical Runge-Kutta methods: fourth order
            in equal steps, or the adaptive Dormand-Prince pair, doi
            10.1016/0771-050X(80)90013-3. They need far more steps for the same accuracy.
        accuracy : float, optional
            Largest acceptable error of the displacement [m].

        Returns
        -------
        Response
            Motion at the n samples.

        Raises
        ------
        ParameterError
            `dt` or `accuracy` is not above 0, `hold` or `method` is unknown, or a Runge-Kutta
            method is asked for with `b0` other than 0.
        ShapeError, DataError
            `u` is not one-dimensional, is empty, or holds NaN or infinity.
        NumericalError
            The motion does not stay finite, or the accuracy is out of reach.

        Examples
        --------
        >>> import piezotrack as pt
        >>> stage = pt.DahlStage.xu_li_2010()
        >>> u = [0.0, 10.0, 20.0, 10.0, 0.0]
        >>> whole = stage.simulate(u, 0.02)
        >>> first = stage.simulate(u[:3], 0.02)
        >>> second = stage.simulate(u[2:], 0.02, initial=first.final)
        >>> bool(abs(second.x[-1] - whole.x[-1]) < 1e-10)
        True
        """
        return self._simulate(u, dt, hold, initial, method, accuracy)

    def force_ratios(self) -> list[Ratio]:
        """Return forces over the stiffness; `up` only in the products that the data determine."""
        gain = 1e6 * self.piezo_coefficient / self.stiffness
        return [
            ("piezo_coefficient", "T/K", gain, "um/V"),
            *mechanical_ratios(self, "D/K", "M/K"),
            ("b1", "b1 up/K", self.b1 * self.up / self.stiffness, "1/m"),
            ("a1", "a1", self.a1, "1/m"),
            ("a2", "a2", self.a2, "1/m^2"),
            ("b0", "b0 up/K", self.b0 * self.up / self.stiffness, ""),
        ]

    def _notes(self, response: Callable[[], Response]) -> list[str]:
        if self.b0 == 0.0 or response().unique:
            return []
        return [
            "b0 q2 is below 0 at rest: the solution is not unique, another motion satisfies the "
            "same drive"
        ]
