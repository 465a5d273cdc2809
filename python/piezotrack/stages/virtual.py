"""The virtual stage: a stage of any model between an amplifier and a sensor."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np

from .. import _core
from .._core import VirtualStage as CoreStage
from .._support.arguments import expect, hertz, one_or_more_numbers
from .._support.messages import quoted
from ..data.dataset import Dataset
from ..errors import ParameterError
from .apparatus import Amplifier, Preconditioning, Sensor
from .base import MODEL_STEP, Stage
from .registry import model_named, stage_class

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike, NDArray

    from ..data.dataset import Hold
    from .inverse import InvertibleStage

    Array = NDArray[np.float64]

__all__ = ["VirtualResponse", "VirtualStage"]


@runtime_checkable
class _Identified(Protocol):
    """A stage with the offset [m] and the delay [s] of its sensor."""

    @property
    def model(self) -> Any: ...
    @property
    def offset(self) -> float: ...
    @property
    def delay(self) -> float: ...


@dataclass(frozen=True, kw_only=True, eq=False)
class VirtualResponse:
    """Motion of a virtual stage at the samples of its drive.

    Attributes
    ----------
    t : ndarray, shape (n,)
        Time [s], from 0 on.
    u : ndarray, shape (n,)
        Command to the amplifier [V].
    applied : ndarray, shape (n,)
        Output voltage of the amplifier [V].
    x : ndarray, shape (n,)
        True displacement [m].
    y : ndarray, shape (n,)
        Reading of the sensor [m].
    """

    t: Array
    u: Array
    applied: Array
    x: Array
    y: Array


@dataclass(frozen=True, kw_only=True)
class VirtualStage:
    r"""A stage of any model between an amplifier and a sensor, for experiments.

    `of` makes one of an identified model; `xu_li_2010` is the stage of the paper as far as it is
    published. ``dataclasses.replace`` changes a part.

    Parameters
    ----------
    stage : Stage
        What moves: a stage of any model, with its hysteresis, creep and dynamics.
    amplifier : Amplifier, optional
        Between command and stage; by default it gives what it is asked for.
    sensor : Sensor, optional
        What reads the displacement; by default as it is.
    preconditioning : Preconditioning, optional
        Cycles before an experiment. By default the stage has never moved.
    step : float, optional
        Longest step of the simulation [s].

    Raises
    ------
    ParameterError
        A number is out of its range.

    Examples
    --------
    >>> import piezotrack as pt
    >>> stage = pt.VirtualStage.xu_li_2010(seed=1)
    >>> run = stage.simulate([75.0] * 1500, 1 / 5000.0, hold="zoh")
    >>> print(f"{1e6 * run.x[-1]:.1f} um")
    117.8 um
    """

    # A stage of any model: each has its own parameters.
    stage: Any
    amplifier: Amplifier = field(default_factory=Amplifier)
    sensor: Sensor = field(default_factory=Sensor)
    preconditioning: Preconditioning | None = None
    step: float = MODEL_STEP

    def __post_init__(self) -> None:
        for name, kind, words in (
            (
                "stage",
                Stage,
                "a stage of a model, as a pt.DahlStage; of(...) takes identified ones",
            ),
            ("amplifier", Amplifier, "pt.stages.Amplifier"),
            ("sensor", Sensor, "pt.stages.Sensor"),
            ("preconditioning", (Preconditioning, type(None)), "pt.stages.Preconditioning"),
        ):
            value = getattr(self, name)
            expect(name, value, kind, words)
        object.__setattr__(self, "step", _core.as_number("step", self.step))
        # The core checks the ranges.
        _ = self._core

    def __getstate__(self) -> dict[str, Any]:
        # Without the cache: the core's stage cannot be pickled.
        return {name: value for name, value in vars(self).items() if name != "_core"}

    def __repr__(self) -> str:
        around = []
        if math.isfinite(self.amplifier.bandwidth):
            around.append(f"amplifier {self.amplifier.bandwidth:g} Hz")
        if self.sensor.noise:
            around.append(f"noise {1e9 * self.sensor.noise:.3g} nm rms")
        if self.sensor.delay:
            around.append(f"delay {1e3 * self.sensor.delay:.3g} ms")
        if self.preconditioning is not None:
            around.append("preconditioned")
        return f"<VirtualStage, {', '.join([self.stage.info.title, *around])}>"

    @cached_property
    def _core(self) -> CoreStage:
        """The stage in the core."""
        cycles = self.preconditioning
        return CoreStage(
            self.stage._core,
            self.amplifier._numbers,
            self.sensor._numbers,
            None if cycles is None else cycles._numbers,
            self.step,
        )

    @classmethod
    def of(
        cls,
        stage: InvertibleStage | _Identified,
        *,
        noise: float = 0.0,
        noise_bandwidth: float = math.inf,
        resolution: float = 0.0,
        delay: float | None = None,
        bandwidth: float = math.inf,
        slew: float = math.inf,
        limits: tuple[float, float] = (-math.inf, math.inf),
        creep: Mapping[float, float] | None = None,
        mode: tuple[float, float] | None = None,
        seed: int = 0,
    ) -> VirtualStage:
        """Make a virtual stage of an identified model, or of a stage of any model.

        Parameters
        ----------
        stage : IdentifiedModel or Stage
            What ``pt.identify`` or ``pt.load`` returns, or a stage. The offset of an identified
            model is in the readings.
        noise, noise_bandwidth, resolution : float, optional
            Of the sensor: rms [m], bandwidth of the noise [Hz], quantisation step [m].
        delay : float, optional
            Of the sensor [s]; where it is not given that of the identified model.
        bandwidth, slew : float, optional
            Of the amplifier [Hz], [V/s]. What the record identified was measured with is in the
            model's own dynamics already.
        limits : (float, float), optional
            Of the amplifier [V].
        creep : mapping of float to float, optional
            Creep in place of the model's own: the share of each time constant [s].
        mode : (float, float), optional
            Undamped frequency [Hz] and damping ratio of a mode in place of the model's dynamics.
            Of a stage with mass, damping and stiffness, the stiffness stays.
        seed : int, optional
            Seed of the noise.

        Returns
        -------
        VirtualStage
            It has never moved before an experiment.

        Raises
        ------
        ParameterError
            A number is out of its range, or the model can have no such mode.

        Examples
        --------
        >>> import piezotrack as pt
        >>> stage = pt.stages.PrandtlIshlinskiiStage(
        ...     linear=1e-6, thresholds=[10.0, 20.0], weights=[0.2e-6, 0.1e-6]
        ... )
        >>> pt.VirtualStage.of(stage, noise=5e-9, bandwidth=500.0, mode=(160.0, 0.065))
        <VirtualStage, Prandtl-Ishlinskii, amplifier 500 Hz, noise 5 nm rms>
        """
        model, offset, known_delay = stage, 0.0, 0.0
        if not isinstance(stage, Stage):
            if not (isinstance(stage, _Identified) and isinstance(stage.model, Stage)):
                raise ParameterError(
                    "stage",
                    type(stage).__name__,
                    "an identified model, or a stage of a model, as a pt.DahlStage",
                )
            model, offset, known_delay = stage.model, stage.offset, stage.delay
        assert isinstance(model, Stage)
        if creep is not None:
            model = _creeping(model, creep)
        if mode is not None:
            model = _ringing(model, mode)
        return cls(
            stage=model,
            amplifier=Amplifier(bandwidth=bandwidth, slew=slew, limits=limits),
            sensor=Sensor(
                noise=noise,
                noise_bandwidth=noise_bandwidth,
                resolution=resolution,
                delay=known_delay if delay is None else delay,
                offset=offset,
                seed=seed,
            ),
        )

    @classmethod
    def xu_li_2010(cls, *, seed: int = 0) -> VirtualStage:
        """Make a stage like that of Xu and Li 2010, doi 10.1115/1.4001712.

        Published: 75 V end at 117.76 um in a mode of 160 Hz with zeta = 0.065; noise of 0.097 um
        rms in steps of 0.038 um; 0 to 75 V. Chosen: play operators with 10 % hysteresis and a mild
        asymmetry (dead zones), creep of 0.4 % with each of 0.1, 1 and 10 s, an amplifier of 225 Hz
        (which gives the step its published first peak), noise up to 200 Hz.

        Parameters
        ----------
        seed : int, optional
            Seed of the sensor's noise.

        Returns
        -------
        VirtualStage
            Preconditioned, its sensor set to 0 on the settled loop.
        """
        return cls._from(CoreStage.xu_li_2010(_core.as_count("seed", seed)))

    @classmethod
    def _xu_li_2010_y(cls, seed: int) -> VirtualStage:
        """Make the other axis of that stage, as far as it is known."""
        return cls._from(CoreStage.xu_li_2010_y(_core.as_count("seed", seed)))

    @classmethod
    def _from(cls, parts: Any) -> VirtualStage:
        """Make a stage from the parts that the core gives."""
        model, parameters, (bandwidth, slew, *limits), of_sensor, cycles, step = parts
        noise, noise_bandwidth, resolution, reach, delay, offset, seed = of_sensor
        return cls(
            stage=stage_class(model_named(model))._from(parameters),
            amplifier=Amplifier(bandwidth=bandwidth, slew=slew, limits=tuple(limits)),
            sensor=Sensor(
                noise=noise,
                noise_bandwidth=noise_bandwidth,
                resolution=resolution,
                range=reach,
                delay=delay,
                offset=offset,
                seed=seed,
            ),
            preconditioning=Preconditioning(swing=cycles[0], rest=cycles[1]),
            step=step,
        )

    def simulate(self, u: ArrayLike, dt: float, *, hold: Hold = "foh") -> VirtualResponse:
        """Motion under a sampled drive.

        Parameters
        ----------
        u : array_like, shape (n,)
            Command to the amplifier [V], from the first sample on.
        dt : float
            Sampling interval [s].
        hold : {"foh", "zoh"}, optional
            As for `DahlStage.simulate`.

        Returns
        -------
        VirtualResponse
            Motion at the n samples.
        """
        dt = _core.as_number("dt", dt)
        x, y, applied = self._core.simulate(u, dt, str(hold))
        t = np.arange(x.size, dtype=np.float64) * dt
        return VirtualResponse(t=t, u=np.array(u, dtype=np.float64), applied=applied, x=x, y=y)

    def record(self, u: ArrayLike, dt: float, *, hold: Hold = "foh") -> Dataset:
        """Record a log of the stage, to identify a model from.

        Parameters
        ----------
        u : array_like, shape (n,)
            Command to the amplifier [V].
        dt : float
            Sampling interval [s].
        hold : {"foh", "zoh"}, optional
            As for `simulate`.

        Returns
        -------
        Dataset
            Command and measured displacement.
        """
        run = self.simulate(u, dt, hold=hold)
        return Dataset(u=run.u, y=run.y, dt=dt, hold=hold, source="virtual stage")


def _creeping(stage: Stage, creep: Mapping[float, float]) -> Stage:
    """Give a stage other creep."""
    if not hasattr(creep, "items"):
        raise ParameterError(
            "creep",
            quoted(creep),
            "the share of each time constant in s, as {0.1: 0.004, 1.0: 0.004}",
        )
    changes: dict[str, Any] = {
        "creep_times": tuple(creep.keys()),
        "creep_weights": tuple(creep.values()),
    }
    return _with(stage, changes)


def _ringing(stage: Stage, mode: tuple[float, float]) -> Stage:
    """Give a stage one mode of a frequency [Hz] and a damping ratio."""
    given = one_or_more_numbers("mode", mode)
    if len(given) != 2:
        raise ParameterError("mode", given, "(frequency in Hz, damping ratio)")
    frequency, damping_ratio = given
    names = stage.parameter_names()
    changes: dict[str, Any]
    if "frequency" in names:
        alone = dict.fromkeys((name for name in names if name.startswith("mode_")), ())
        changes = {"time_constant": None, **alone}
        changes |= {"frequency": frequency, "damping_ratio": damping_ratio}
    elif {"mass", "damping", "stiffness"} <= set(names):
        natural = 2.0 * math.pi * hertz("mode[0]", frequency)
        stiffness: float = getattr(stage, "stiffness")  # noqa: B009
        changes = {
            "mass": stiffness / natural**2,
            "damping": 2.0 * damping_ratio * stiffness / natural,
        }
    else:
        raise ParameterError("mode", "given", f"none, as {stage.info.title} has no linear dynamics")
    return _with(stage, changes)


def _with(stage: Stage, changes: Mapping[str, Any]) -> Stage:
    """Make the stage of the same model with other parameters."""
    same = {name: getattr(stage, name) for name in stage.parameter_names()}
    return type(stage)(**{**same, **changes})
