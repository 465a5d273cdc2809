"""Base class of the stage models."""

from __future__ import annotations

import math
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self, TypeVar

import numpy as np

from .. import _core
from .._core import Stage as CoreStage
from .._support.arguments import as_numbers, finite, one_or_more_numbers, positive
from ..errors import ParameterError
from .inverse import Inverse
from .model_info import LISTED, ModelInfo
from .motion import Response, numbers_of
from .parameter_text import with_shared_parameters

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from numpy.typing import ArrayLike, NDArray

    from ..data.dataset import Hold
    from .motion import Named, StageState

    Array = NDArray[np.float64]

__all__ = [
    "MODEL_STEP",
    "Ratio",
    "Stage",
    "mechanical_ratios",
    "stage",
]

# Longest simulation step of a model's mechanics between the steps of a held voltage [s].
MODEL_STEP = 5e-5
# Samples of a period of a describing function.
SINE_SAMPLES = 2000
# Parameter, symbol, value and unit.
Ratio = tuple[str, str, float, str]
Method = Literal["exponential", "rk4", "rk45"]


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
        return _stage_text(self)

    def __post_init__(self) -> None:
        for parameter in self.info.parameters:
            value = getattr(self, parameter.name)
            if parameter.is_list:
                value = as_numbers(parameter.name, value)
            elif not (parameter.is_optional and value is None):
                value = _core.as_number(parameter.name, value)
            object.__setattr__(self, parameter.name, value)
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
        return [(name, numbers_of(name, getattr(self, name))) for name in self.parameter_names()]

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

    def describing_function(
        self, amplitude: ArrayLike, frequency: float, *, offset: float = 0.0
    ) -> NDArray[np.complex128]:
        r"""Return the gain and the phase of the fundamental of a driven sine.

        .. math:: N(A) = \frac{2 i}{A T} \int_0^T x(t) \, e^{-i \omega t} \, dt
            \quad \text{for} \quad u = u_0 + A \sin \omega t

        in the third period, by simulation. Hysteresis makes both depend on the amplitude; Gelb and
        Vander Velde, Multiple-Input Describing Functions, 1968, section 2.2.

        Parameters
        ----------
        amplitude : float or array_like, shape (n,)
            A [V].
        frequency : float
            Of the sine [Hz].
        offset : float, optional
            u0 [V], where the stage has gone slowly from rest.

        Returns
        -------
        ndarray of complex, of the shape of `amplitude`
            Displacement over drive [m/V].

        Raises
        ------
        ParameterError
            An amplitude or the frequency is not above 0.

        Examples
        --------
        >>> import piezotrack as pt
        >>> stage = pt.PrandtlIshlinskiiStage(linear=1e-6, thresholds=(5.0,), weights=(1e-6,))
        >>> gains = stage.describing_function([1.0, 50.0], 1.0, offset=30.0)
        >>> [f"{1e6 * abs(gain):.2f} um/V" for gain in gains]
        ['1.00 um/V', '1.95 um/V']
        """
        w = 2.0 * np.pi * positive("frequency", frequency, "Hz")
        start = self.equilibrium((0.0, finite("offset", offset, "V")))
        t = np.arange(3 * SINE_SAMPLES + 1) * (2.0 * np.pi / w / SINE_SAMPLES)
        turn = np.exp(-1j * w * t[-SINE_SAMPLES:])

        def at(size: float) -> complex:
            volts = positive("amplitude", size, "V") * np.sin(w * t)
            moved = self.simulate(offset + volts, float(t[1]), initial=start).x
            return complex(2j * (moved[-SINE_SAMPLES:] @ turn) / SINE_SAMPLES / size)

        sizes = np.asarray(amplitude, dtype=np.float64)
        found = np.array([at(float(size)) for size in sizes.ravel()], dtype=np.complex128)
        return found.reshape(sizes.shape)

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
            "initial",
            type(initial).__name__,
            f"a pt.stages.{self._state.__name__}, as the final of a response",
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

    Its docstring needs no entries of creep, dynamics and mechanics: they come from the core's list.

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
        cls.__doc__ = with_shared_parameters(cls.__doc__ or "", cls.info)
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


def _stage_text(stage: Stage) -> str:
    """Write the gain, the hysteresis and the dynamics of a stage, in um and ms.

    Parameters
    ----------
    stage : Stage
        The stage.

    Returns
    -------
    str
        Such as ``PrandtlIshlinskiiStage(12.6 um/V, 10 plays, lag 1.2 ms)``. All parameters are
        attributes of the stage, and ``dataclasses.asdict(stage)`` has them in a dict.
    """
    parts = _with_mass(stage) if hasattr(stage, "stiffness") else _at_the_input(stage)
    if creep := int(np.count_nonzero(stage.creep_weights)):  # type: ignore[attr-defined]
        parts.append(_count(creep, "creep time"))
    return f"{type(stage).__name__}({', '.join(parts)})"


def _at_the_input(stage: Any) -> list[str]:
    parts = []
    thresholds = getattr(stage, "thresholds", None)
    if thresholds is not None:
        # With an envelope or a polynomial the slope depends on the voltage.
        if hasattr(stage, "linear") and not hasattr(stage, "scale"):
            parts.append(f"{1e6 * _mean_slope(stage):.3g} um/V")
        parts.append(_count(len(thresholds), "play"))
    for name, thing in (("dead_zone_weights", "dead zone"), ("levels", "level")):
        if count := len(getattr(stage, name, ())):
            parts.append(_count(count, thing))
    if hasattr(stage, "low"):
        parts.append(f"{stage.low:.4g} V to {stage.high:.4g} V")
    if stage.time_constant is not None:
        parts.append(f"lag {1e3 * stage.time_constant:.3g} ms")
    if stage.frequency is not None:
        parts.append(f"mode {stage.frequency:.4g} Hz")
    if modes := len(stage.mode_frequencies):
        parts.append(_count(modes, "further mode"))
    return parts


def _mean_slope(stage: Any) -> float:
    """Travel per volt of the settled loop over a drive for which all plays are meant [m/V]."""
    widest = 2.0 * max(stage.thresholds, default=0.0)
    # A play follows the drive but for twice its threshold.
    plays = zip(stage.thresholds, stage.weights, strict=True)
    moved = (weight * (1.0 - 2.0 * r / widest if widest else 1.0) for r, weight in plays)
    return float(stage.linear + math.fsum(moved))


def _with_mass(stage: Any) -> list[str]:
    parts = []
    if stage.info.drive_unit == "V":
        per_volt = stage.piezo_coefficient
        in_metres = next(one.unit == "m/V" for one in stage.info.parameters
                         if one.name == "piezo_coefficient")  # fmt: skip
        parts.append(f"{1e6 * (per_volt if in_metres else per_volt / stage.stiffness):.3g} um/V")
    else:
        parts.append(f"{1e6 / stage.stiffness:.3g} um/N")
    frequency = math.sqrt(stage.stiffness / stage.mass) / (2.0 * math.pi)
    parts.append(f"natural frequency {frequency:.4g} Hz")
    parts.append(f"lag {1e3 * stage.damping / stage.stiffness:.3g} ms")
    return parts


def _count(number: int, thing: str) -> str:
    return f"{number} {thing}{'' if number == 1 else 's'}"
