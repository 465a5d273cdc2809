"""Base classes of the stage models with scalar parameters, and what they return."""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, ClassVar, Generic, Literal, TypeVar

import numpy as np

from .. import _core
from ..errors import ParameterError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from ..data.dataset import Hold
    from .inverse import Inverse

    Array = NDArray[np.float64]

__all__ = [
    "MODEL_STEP",
    "DrivenStage",
    "FeedbackState",
    "LumpedStage",
    "Ratio",
    "Response",
    "mechanical_ratios",
]

# Longest step in which a model's mechanics are followed under a jumping voltage [s].
MODEL_STEP = 5e-5
# Parameter, symbol, value and unit.
Ratio = tuple[str, str, float, str]

State = TypeVar("State")


@dataclass(frozen=True, kw_only=True, eq=False)
class Response:
    """Motion of a stage at the samples of its drive.

    Attributes
    ----------
    t : ndarray, shape (n,)
        Time [s], from 0 on.
    u : ndarray, shape (n,)
        Drive [V].
    x : ndarray, shape (n,)
        Displacement [m].
    v : ndarray, shape (n,)
        Velocity [m/s].
    hysteresis : ndarray, shape (n,)
        Hysteresis force [N].
    final : StageState or BoucWenState
        State at the last sample; ``initial=final`` carries on from there.
    substeps : int
        Steps of the integrator in each sampling interval.
    difference : float
        Largest change of `x` from a coarser simulation [m]; the error of `x` is a third of it,
        and a fifteenth where the drive asked for the scheme's fourth order.
    well_posed : bool
        Whether each rest was unique. False where a stage with `b0` other than 0 came to rest
        with the friction term along the motion and too little force to decide: the same drive
        then has another motion too.
    """

    t: Array
    u: Array
    x: Array
    v: Array
    hysteresis: Array
    final: Any
    substeps: int
    difference: float
    well_posed: bool = True


class LumpedStage:
    """Base of the stages that a swarm can search: a dataclass of floats.

    A subclass says its name in the core and which parameters the core has for it.
    """

    _kind: ClassVar[str]
    _parameters: ClassVar[list[tuple[str, str, str]]]

    def __post_init__(self) -> None:
        for name in self.parameter_names():
            object.__setattr__(self, name, _core.as_number(name, getattr(self, name)))
        _core.stage_check(self._kind, self.theta)

    @property
    def theta(self) -> tuple[float, ...]:
        """The parameters in their order."""
        # Not dataclasses.astuple, which copies deeply and takes longer than a short simulation.
        return tuple(getattr(self, name) for name, _, _ in self._parameters)

    @classmethod
    def parameter_names(cls) -> tuple[str, ...]:
        """Names of the parameters, in their order.

        Returns
        -------
        tuple of str
            As the constructor takes them.
        """
        return tuple(name for name, _, _ in cls._parameters)

    @abstractmethod
    def force_ratios(self) -> list[Ratio]:
        """Return what a record fixes without a force known, as ratios to the stiffness.

        Returns
        -------
        list of (str, str, float, str)
            Parameter, symbol, value and unit.
        """

    def inverse(
        self, *, playback: Literal["table", "online"] = "table", settle: int = 1
    ) -> Inverse:
        """Feedforward of the bare stage, as `Inverse` describes.

        Parameters
        ----------
        playback : {"table", "online"}, optional
            Whether one settled period is played again and again, or all is computed.
        settle : int, optional
            Periods before the one of the table.

        Returns
        -------
        Inverse
            For `Controller` or on its own.
        """
        from .inverse import Inverse

        # Which stages have an inverse is known there.
        return Inverse(stage=self, playback=playback, settle=settle)  # type: ignore[arg-type]


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
            raise ParameterError(
                f"initial is {start!r}: expected a pt.stages.{self._state.__name__}"
            )
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


def mechanical_ratios(stage: Any, damping: str, mass: str) -> list[Ratio]:
    """Viscous time and mass over stiffness, with the natural frequency that they mean."""
    frequency = math.sqrt(stage.stiffness / stage.mass) / (2 * math.pi)
    hertz = f"s^2, a natural frequency of {frequency:.4g} Hz"
    return [
        ("damping", damping, 1e3 * stage.damping / stage.stiffness, "ms"),
        ("mass", mass, stage.mass / stage.stiffness, hertz),
    ]
