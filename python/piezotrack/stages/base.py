"""Base class of the stage models, their states and their response."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self, TypeVar

import numpy as np

from .. import _core
from .._core import Stage as CoreStage
from .._support.arguments import as_numbers, one_or_more_numbers
from ..errors import ParameterError
from .inverse import Inverse
from .model_info import LISTED, ModelInfo, Parameter
from .stage_text import stage_text

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from numpy.typing import ArrayLike, NDArray

    from ..data.dataset import Hold

    Array = NDArray[np.float64]

__all__ = [
    "MODEL_STEP",
    "ForceState",
    "Ratio",
    "Response",
    "Stage",
    "StageState",
    "mechanical_ratios",
    "stage",
]

# Longest simulation step of a model's mechanics between the steps of a held voltage [s].
MODEL_STEP = 5e-5
# Parameter, symbol, value and unit.
Ratio = tuple[str, str, float, str]
# Names and numbers, as the core takes and gives them.
Named = list[tuple[str, list[float]]]
Method = Literal["exponential", "rk4", "rk45"]


@dataclass(frozen=True, kw_only=True)
class StageState:
    """State of a stage at one instant; each model adds the memory of its hysteresis.

    Parameters
    ----------
    x : float
        Displacement [m].
    v : float
        Velocity [m/s].
    creep : tuple of float
        State q of each relaxation of the creep [m].
    """

    x: float = 0.0
    v: float = 0.0
    creep: tuple[float, ...] = ()

    @property
    def _named(self) -> Named:
        """Names and numbers of the state."""
        return [(one.name, _entries(one.name, getattr(self, one.name))) for one in fields(self)]

    @classmethod
    def _from(cls, named: Iterable[tuple[str, list[float]]], parts: Iterable[Parameter]) -> Self:
        lists = {part.name for part in parts if part.is_list}
        given: dict[str, Any] = {
            name: tuple(numbers) if name in lists else numbers[0] for name, numbers in named
        }
        return cls(**given)


@dataclass(frozen=True, kw_only=True)
class ForceState(StageState):
    """State of a stage whose hysteresis is a force in feedback on the displacement.

    Parameters
    ----------
    force : float
        Hysteresis force [N].
    """

    force: float = 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Response:
    """Motion of a stage at the samples of its drive.

    Attributes
    ----------
    t : ndarray, shape (n,)
        Time [s], from 0 on.
    u : ndarray, shape (n,)
        Drive [V], or [N] for a model that is driven by a force.
    x : ndarray, shape (n,)
        Displacement [m].
    v : ndarray, shape (n,)
        Velocity [m/s]; 0 where the model has no mechanics.
    hysteresis : ndarray, shape (n,)
        Hysteresis force [N]; where the hysteresis is at the input its output, before creep and
        dynamics [m].
    final : StageState
        State of the model at the last sample; ``initial=final`` continues from there.
    substeps : int
        Steps of the integrator in each sampling interval.
    error_estimate : float
        Largest change of `x` from a simulation with half the steps [m]; the error of `x` is about
        a third of it with the scheme of second order, a fifteenth with that of fourth. With
        plays at the input 0 where the model is exact, and a bound of the error where its envelopes
        bend.
    unique : bool
        Whether the solution is unique. False if a `DahlStage` with `b0` other than 0 was at rest
        with b0 q2 < 0 and a force smaller than that term: another motion then satisfies the same
        drive.
    """

    t: Array
    u: Array
    x: Array
    v: Array
    hysteresis: Array
    final: Any
    substeps: int
    error_estimate: float
    unique: bool


class Stage:
    r"""Base class of the stage models.

    A model is a frozen dataclass with one field for each parameter that the core lists for it,
    registered with the decorator `stage`.

    Notes
    -----
    The displacement of every model may creep. Where x_m is that of hysteresis and mechanics,

    .. math:: x = x_m + \sum_j c_j q_j, \qquad \tau_j \dot q_j = x_m - q_j

    with weights c and times tau. Times a decade apart with equal weights make a creep that grows
    with the logarithm of time, as that of piezoceramics does: Krejci and Kuhnen 2001, doi
    10.1049/ip-cta:20010375. Without weights there is no creep. Between samples x_m is the cubic
    through its values and velocities (in a closed loop, whose steps are short, a straight line).
    The model begins in equilibrium: every q_j is x_m. The inverse takes off the creep first; a
    loop is analysed without it, because it is slower. Models with play operators have their creep
    before their dynamics.
    """

    info: ClassVar[ModelInfo]
    _state: ClassVar[type[StageState]]

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        # Else the decorator of the dataclass would write a repr of every number.
        cls.__repr__ = Stage.__repr__  # type: ignore[method-assign]

    def __repr__(self) -> str:
        return stage_text(self)

    def __post_init__(self) -> None:
        for one in self.info.parameters:
            value = getattr(self, one.name)
            if one.is_list:
                value = as_numbers(one.name, value)
            elif not (one.is_optional and value is None):
                value = _core.as_number(one.name, value)
            object.__setattr__(self, one.name, value)
        # The core checks the ranges.
        _ = self._core

    def __getstate__(self) -> dict[str, Any]:
        # Without the cache: the core's stage cannot be pickled.
        return {one.name: getattr(self, one.name) for one in self.info.parameters}

    @classmethod
    def parameter_names(cls) -> tuple[str, ...]:
        """Names of the parameters, in their order.

        Returns
        -------
        tuple of str
            As the constructor takes them.
        """
        return tuple(one.name for one in cls.info.parameters)

    @classmethod
    def _from(cls, named: Iterable[tuple[str, list[float]]]) -> Self:
        """Make a stage from names and numbers of the core."""
        parameters = {one.name: one for one in cls.info.parameters}
        given: dict[str, Any] = {}
        for name, numbers in named:
            if parameters[name].is_list:
                given[name] = tuple(numbers)
            else:
                given[name] = numbers[0] if numbers else None
        return cls(**given)

    @classmethod
    def _published(cls, name: str) -> Self:
        """Make the stage with published parameters."""
        return cls._from(_core.published(cls.info.name, name))

    @cached_property
    def _core(self) -> CoreStage:
        """The stage in the core."""
        return CoreStage(self.info.name, self._named)

    @property
    def _named(self) -> Named:
        """Names and numbers of the parameters."""
        return [(name, _entries(name, getattr(self, name))) for name in self.parameter_names()]

    def simulate(
        self,
        u: ArrayLike,
        dt: float,
        *,
        hold: Hold = "foh",
        initial: StageState | None = None,
        accuracy: float = 1e-10,
    ) -> Response:
        """Simulate the response to a sampled drive.

        The linear part is exact, the hysteresis is exact along its input, and the force over a step
        is the cubic through its values and slopes at both ends; where the hysteresis depends on the
        displacement, a predictor and a corrector compute them. The number of steps in a sampling
        interval is doubled until no sample moves by more than `accuracy`. A model with play
        operators is stepped exactly from corner to corner of its hysteresis; where envelopes bend,
        along chords that are as short as `accuracy` asks.

        Parameters
        ----------
        u : array_like, shape (n,)
            Drive [V], or [N] for `BoucWenOscillator`.
        dt : float
            Sampling interval [s].
        hold : {"foh", "zoh"}, optional
            Between two samples the drive goes straight from one to the next (``"foh"``), or
            stays constant until the next (``"zoh"``). With play operators, a sample under
            ``"zoh"`` is the displacement just before the step of the drive at that instant.
        initial : StageState, optional
            State of this model at the first sample; at rest, never driven, where it is not given.
            To continue a simulation, begin the new drive with the last sample of the one before.
            If the hysteresis is at the input, the drive steps from the state's `u` to the first
            sample.
        accuracy : float, optional
            Largest acceptable error of the displacement [m].

        Returns
        -------
        Response
            Motion at the n samples, with a `final` state to continue from.

        Raises
        ------
        ParameterError
            `dt` or `accuracy` is not above 0, or `hold` is unknown.
        ShapeError, DataError
            `u` is not one-dimensional, is empty, or holds NaN or infinity; `initial` is the state
            of a stage with another number of plays or relaxations.
        NumericalError
            The motion does not stay finite, or the accuracy is out of reach.
        MemoryError
            There is no room for the motion.

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
        return self._simulate(u, dt, hold, initial, "exponential", accuracy)

    def equilibrium(self, voltages: float | Sequence[float]) -> Any:
        """State in equilibrium after a slow visit to each voltage in turn, from never moved.

        Parameters
        ----------
        voltages : float or sequence of float
            Voltages [V], in turn; the state is that at the last. Between two of them the drive goes
            straight and slowly; creep is complete.

        Returns
        -------
        StageState
            For the `initial` of `simulate`.

        Raises
        ------
        NumericalError
            The stage has no equilibrium there.

        Examples
        --------
        >>> import piezotrack as pt
        >>> stage = pt.PrandtlIshlinskiiStage(linear=1e-6, thresholds=[10.0], weights=[0.5e-6])
        >>> up, down = stage.equilibrium(40.0), stage.equilibrium([80.0, 40.0])
        >>> print(f"{1e6 * up.x:.0f} um on the way up, {1e6 * down.x:.0f} um on the way down")
        55 um on the way up, 65 um on the way down
        """
        visited = one_or_more_numbers("voltages", voltages)
        return self._state._from(self._core.equilibrium(visited), self.info.state)

    def _simulate(
        self,
        u: ArrayLike,
        dt: float,
        hold: Hold,
        initial: StageState | None,
        method: Method,
        accuracy: float,
    ) -> Response:
        dt = _core.as_number("dt", dt)
        accuracy = _core.as_number("accuracy", accuracy)
        start = None if initial is None else self._checked(initial)._named
        run = self._core.simulate(
            u, dt, str(hold), initial=start, method=str(method), accuracy=accuracy
        )
        return Response(
            t=np.arange(run.x.size, dtype=np.float64) * dt,
            u=np.array(u, dtype=np.float64),
            x=run.x,
            v=run.v,
            hysteresis=run.hysteresis,
            final=self._state._from(run.last, self.info.state),
            substeps=run.substeps,
            error_estimate=run.error_estimate,
            unique=run.unique,
        )

    def _checked(self, initial: object) -> StageState:
        """Return `initial` if it is a state of this model; raise otherwise."""
        if isinstance(initial, self._state):
            return initial
        raise ParameterError(
            f"initial is {type(initial).__name__}: expected a "
            f"pt.stages.{self._state.__name__}, as the final of a response"
        )

    def inverse(
        self,
        *,
        playback: Literal["table", "online"] = "table",
        settle: int = 1,
        initial: StageState | None = None,
    ) -> Inverse:
        """Feedforward of the stage without sensor offset and delay, as `Inverse` describes.

        Parameters
        ----------
        playback : {"table", "online"}, optional
            Whether one settled period is repeated from a table, or the whole run is computed.
        settle : int, optional
            Periods before the one of the table.
        initial : StageState, optional
            State of the stage before the reference begins, such as the `final` of a response to
            the drive that settled it; by default at rest, never driven. Only models with the
            hysteresis at the input accept a state.

        Returns
        -------
        Inverse
            For `Controller` or on its own.

        Examples
        --------
        >>> import numpy as np
        >>> import piezotrack as pt
        >>> stage = pt.PrandtlIshlinskiiStage(
        ...     linear=1e-6, thresholds=[10.0, 20.0], weights=[0.2e-6, 0.1e-6]
        ... )
        >>> reference = pt.sine(frequency=1.0, low=0.0, high=50e-6, duration=3.0)
        >>> volts = stage.inverse().voltage(reference, 1e-3)
        >>> error = stage.simulate(volts, 1e-3).x - reference.sample(1e-3).x
        >>> bool(np.abs(error).max() < 1e-15)
        True
        """
        return Inverse(stage=self, playback=playback, settle=settle, initial=initial)

    def force_ratios(self) -> list[Ratio]:
        """Return the quantities that a record determines: forces as ratios to the stiffness.

        Returns
        -------
        list of (str, str, float, str)
            Parameter, symbol, value and unit; by default the parameters themselves.
        """
        return [
            (one.name, one.symbol, getattr(self, one.name), one.unit)
            for one in self.info.parameters
            if not (one.is_list or one.is_optional)
        ]

    def _notes(self, response: Callable[[], Response]) -> list[str]:
        """Remarks on an identified stage; `response` is its motion on the record."""
        del response
        return []


# The classes of the models that have been imported, by their names.
REGISTERED: dict[str, type[Stage]] = {}

S = TypeVar("S", bound=Stage)


def stage(name: str, *, state: type[StageState]) -> Callable[[type[S]], type[S]]:
    """Register the class of a model that the core lists under a name.

    Parameters
    ----------
    name : str
        Name of the model. The module of the class has the same name, with underscores.
    state : type
        Its state: a subclass of `StageState` with the fields that the core lists.

    Returns
    -------
    callable
        Decorator of the class.
    """

    def register(cls: type[S]) -> type[S]:
        cls.info, cls._state = LISTED[name], state
        REGISTERED[name] = cls
        return cls

    return register


def mechanical_ratios(stage: Any, damping: str, mass: str) -> list[Ratio]:
    """Return damping and mass over stiffness, with the natural frequency."""
    frequency = math.sqrt(stage.stiffness / stage.mass) / (2 * math.pi)
    hertz = f"s^2, a natural frequency of {frequency:.4g} Hz"
    return [
        ("damping", damping, 1e3 * stage.damping / stage.stiffness, "ms"),
        ("mass", mass, stage.mass / stage.stiffness, hertz),
    ]


def _entries(name: str, value: object) -> list[float]:
    """Return the numbers of a parameter as a list: one, none or several."""
    if value is None:
        return []
    if isinstance(value, (tuple, list)):
        return list(as_numbers(name, value))
    return [_core.as_number(name, value)]
