"""What stages with hysteresis in feedback that kinks at reversals have in common."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from . import _core
from .errors import ParameterError
from .lumped import LumpedStage
from .models import Response

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from .dataset import Hold

__all__ = ["FeedbackState", "KinkedStage"]


@dataclass(frozen=True, kw_only=True)
class FeedbackState:
    """Where a stage with hysteresis in feedback is, at one instant.

    Parameters
    ----------
    x : float
        Displacement [m].
    v : float
        Velocity [m/s].
    force : float
        Hysteresis force [N].
    """

    x: float = 0.0
    v: float = 0.0
    force: float = 0.0

    @property
    def values(self) -> tuple[float, float, float]:
        """The three values in their order."""
        return self.x, self.v, self.force


class KinkedStage(LumpedStage):
    """Base of such stages."""

    def simulate(
        self,
        u: ArrayLike,
        dt: float,
        *,
        hold: Hold = "foh",
        initial: FeedbackState | None = None,
        accuracy: float = 1e-10,
    ) -> Response:
        """Displacement under a sampled drive.

        The linear part is exact, the hysteresis is exact in the displacement, and the two are
        coupled by a predictor and a corrector that locate reversals. The number of steps in a
        sampling interval is doubled until no sample moves by more than `accuracy`.

        Parameters
        ----------
        u : array_like, shape (n,)
            Drive [V], or [N] for `BoucWenOscillator`.
        dt : float
            Sampling interval [s].
        hold : {"foh", "zoh"}, optional
            Between two samples the drive goes straight from one to the next (``"foh"``), or
            stays where it is until the next (``"zoh"``).
        initial : FeedbackState, optional
            State at the first sample; at rest where it is not given.
        accuracy : float, optional
            Largest error of the displacement [m] that is accepted.

        Returns
        -------
        Response
            Motion at the n samples; its `final` is a `FeedbackState`.

        Raises
        ------
        ParameterError
            `dt` or `accuracy` is not above 0, or `hold` is unknown.
        ShapeError, DataError
            `u` is not one-dimensional, is empty, or holds NaN or infinity.
        NumericalError
            The motion does not stay finite, or the accuracy is out of reach.

        Examples
        --------
        >>> import piezotrack as pt
        >>> stage = pt.BoucWenOscillator.benchmark()
        >>> u = [0.0, 10.0, 20.0, 10.0, 0.0]
        >>> whole = stage.simulate(u, 0.001)
        >>> first = stage.simulate(u[:3], 0.001)
        >>> second = stage.simulate(u[2:], 0.001, initial=first.final)
        >>> bool(abs(second.x[-1] - whole.x[-1]) < 1e-10)
        True
        """
        start = FeedbackState() if initial is None else initial
        if not isinstance(start, FeedbackState):
            raise ParameterError(f"initial is {start!r}: expected a pt.FeedbackState")
        dt = _core.as_number("dt", dt)
        accuracy = _core.as_number("accuracy", accuracy)
        run = _core.kinked_simulate(self._kind, self.theta, u, dt, hold, start.values, accuracy)
        x, v, force, _ = run.last
        return Response(
            t=np.arange(run.x.size, dtype=np.float64) * dt,
            u=np.array(u, dtype=np.float64),
            x=run.x,
            v=run.v,
            hysteresis=run.hysteresis,
            final=FeedbackState(x=x, v=v, force=force),
            substeps=run.substeps,
            difference=run.difference,
        )
