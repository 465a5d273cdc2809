"""The virtual stage: a simulated piezo stage, richer than the models that are fitted to it."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import _core
from .._core import VirtualStage as CoreStage
from .._support.arguments import one_or_more_numbers
from ..data.dataset import Dataset
from ..errors import ParameterError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from ..data.dataset import Hold

    Array = NDArray[np.float64]

__all__ = ["VirtualResponse", "VirtualStage"]

# Fields that are several numbers.
LISTS = frozenset(
    {
        "limits",
        "thresholds",
        "weights",
        "dead_zone_thresholds",
        "dead_zone_weights",
        "creep_weights",
        "creep_times",
    }
)


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
    r"""A simulated stage with amplifier, creep and sensor, for experiments.

    In series: amplifier, hysteresis of weighted play operators with dead zones, creep, an
    underdamped mode, sensor:

    .. math::

        \ddot x + 2 \zeta \omega \dot x + \omega^2 x = \omega^2 (h + \sum_j c_j q_j), \qquad
        \tau_j \dot q_j = h - q_j

    Plays after Kuhnen 2003, doi 10.3166/ejc.9.407-418. `xu_li_2010` is the stage of the paper as
    far as it is published; ``dataclasses.replace(stage, noise=0.0)`` changes a parameter.

    Parameters
    ----------
    bandwidth : float
        Bandwidth of the amplifier, a first-order lag [Hz]; infinity for no lag.
    slew : float
        Slew rate of the amplifier [V/s]; infinity for no limit.
    limits : (float, float)
        Lowest and highest voltage of the amplifier [V].
    linear : float
        Weight of the voltage without hysteresis.
    thresholds, weights : tuple of float
        Thresholds and weights of up to 10 play operators [V, 1].
    dead_zone_thresholds, dead_zone_weights : tuple of float
        Of up to 2 dead zones: above each threshold [V] the slope grows by the weight.
    gain : float
        Displacement per volt at the output of the hysteresis [m/V].
    creep_weights, creep_times : tuple of float
        Up to 3 relaxations: final contribution of each as a share, and time constant [s].
    frequency, damping_ratio : float
        Undamped frequency of the mode [Hz] and its zeta.
    noise, noise_bandwidth : float
        Noise of the sensor: rms [m] of white noise through a first-order low-pass [Hz].
    resolution, sensor_range : float
        Quantisation step [m], and range to either side of 0 [m].
    seed : int
        Seed of the noise.
    preconditioned : bool
        Whether an experiment begins on the settled loop, with the sensor at 0 there.
    swing, rest : float
        Preconditioning: cycles between 0 V and `swing` [V], then a rest at 0 V [s].
    step : float
        Longest step of the simulation [s].

    Raises
    ------
    ParameterError, ShapeError
        A number is out of its range, or two of a pair differ in length.

    Examples
    --------
    >>> import piezotrack as pt
    >>> stage = pt.VirtualStage.xu_li_2010(seed=1)
    >>> run = stage.simulate([75.0] * 1500, 1 / 5000.0, hold="zoh")
    >>> print(f"{1e6 * run.x[-1]:.1f} um")
    117.8 um
    """

    bandwidth: float
    slew: float
    limits: tuple[float, float]
    linear: float
    thresholds: tuple[float, ...]
    weights: tuple[float, ...]
    dead_zone_thresholds: tuple[float, ...]
    dead_zone_weights: tuple[float, ...]
    gain: float
    creep_weights: tuple[float, ...]
    creep_times: tuple[float, ...]
    frequency: float
    damping_ratio: float
    noise: float
    noise_bandwidth: float
    resolution: float
    sensor_range: float
    seed: int
    preconditioned: bool
    swing: float
    rest: float
    step: float

    def __post_init__(self) -> None:
        for one in fields(self):
            value: Any = getattr(self, one.name)
            if one.name in LISTS:
                value = one_or_more_numbers(one.name, value)
            elif one.name not in ("preconditioned", "seed"):
                value = _core.as_number(one.name, value)
            object.__setattr__(self, one.name, value)
        if len(self.limits) != 2:
            raise ParameterError(f"limits are {self.limits}: expected (low, high) in V")
        _core.as_truth("preconditioned", self.preconditioned)
        object.__setattr__(self, "seed", _core.as_count("seed", self.seed))
        _ = self._core

    @property
    def _core(self) -> CoreStage:
        """The stage in the core, which checks every number."""
        return CoreStage(asdict(self))

    @classmethod
    def xu_li_2010(cls, *, seed: int = 0) -> VirtualStage:
        """Make a stage like that of Xu and Li 2010, doi 10.1115/1.4001712.

        Published: 75 V end at 117.76 um in a mode of 160 Hz with zeta = 0.065; noise of 0.097 um
        rms in steps of 0.038 um; 0 to 75 V. Chosen: 10 % hysteresis with a mild asymmetry, creep
        of 0.4 % with each of 0.1, 1 and 10 s, an amplifier of 225 Hz (which gives the step its
        published first peak), noise up to 200 Hz.

        Parameters
        ----------
        seed : int, optional
            Seed of the sensor's noise.

        Returns
        -------
        VirtualStage
            Preconditioned, its sensor set to 0 on the settled loop.
        """
        return cls(**_core.VirtualStage.xu_li_2010(_core.as_count("seed", seed)))

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
