"""What stages have in common that the core simulates from their kind and a state."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar

import numpy as np

from .. import _core
from ..errors import ParameterError
from .base import LumpedStage
from .base import Response

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from ..data.dataset import Hold

__all__ = ["DrivenStage", "FeedbackState"]

State = TypeVar("State")


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


class DrivenStage(LumpedStage, Generic[State]):
    """Base of such stages. A subclass says what a state of it is."""

    _state: ClassVar[type[Any]]

    def simulate(
        self,
        u: ArrayLike,
        dt: float,
        *,
        hold: Hold = "foh",
        initial: State | None = None,
        accuracy: float = 1e-10,
    ) -> Response:
        """Displacement under a sampled drive.

        The linear part is exact, the hysteresis is exact along its input, and the force between
        two steps is the cubic through its values and slopes; where the displacement leads the
        hysteresis, a predictor and a corrector find them. The number of steps in a sampling
        interval is doubled until no sample moves by more than `accuracy`.

        Parameters
        ----------
        u : array_like, shape (n,)
            Drive [V], or [N] for `BoucWenOscillator`.
        dt : float
            Sampling interval [s].
        hold : {"foh", "zoh"}, optional
            Between two samples the drive goes straight from one to the next (``"foh"``), or
            stays where it is until the next (``"zoh"``).
        initial : FeedbackState or BoucWenState, optional
            State at the first sample. Where it is not given, at rest; a `BoucWenStage` at 0 V,
            from where the drive jumps to its first sample.
        accuracy : float, optional
            Largest error of the displacement [m] that is accepted.

        Returns
        -------
        Response
            Motion at the n samples; its `hysteresis` is a force, k h of a `BoucWenStage`, and its
            `final` a state to carry on from.

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
        start: Any = self._state() if initial is None else initial
        if not isinstance(start, self._state):
            raise ParameterError(f"initial is {start!r}: expected a pt.{self._state.__name__}")
        dt = _core.as_number("dt", dt)
        accuracy = _core.as_number("accuracy", accuracy)
        run = _core.stage_simulate(self._kind, self.theta, u, dt, hold, start.values, accuracy)
        names = [field.name for field in fields(self._state)]
        return Response(
            t=np.arange(run.x.size, dtype=np.float64) * dt,
            u=np.array(u, dtype=np.float64),
            x=run.x,
            v=run.v,
            hysteresis=run.hysteresis,
            final=self._state(**dict(zip(names, run.last, strict=False))),
            substeps=run.substeps,
            difference=run.difference,
        )
