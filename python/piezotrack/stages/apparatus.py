"""Surroundings of a virtual stage: amplifier, sensor, and the cycles before an experiment."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any

from .. import _core
from .._support.arguments import one_or_more_numbers
from ..errors import ParameterError

__all__ = ["Amplifier", "Preconditioning", "Sensor"]


# Noise that is in another unit [m rms].
NOT_A_SENSOR = 1e-3


def _as_numbers(part: object) -> None:
    """Take the fields of a part as numbers, `limits` as two and `seed` as a count."""
    for field in fields(part):  # type: ignore[arg-type]
        value: Any = getattr(part, field.name)
        if field.name == "limits":
            value = one_or_more_numbers(field.name, value)
            if len(value) != 2:
                raise ParameterError("limits", value, "(low, high) in V", verb="are")
        elif field.name == "seed":
            value = _core.as_count(field.name, value)
        else:
            value = _core.as_number(field.name, value)
        object.__setattr__(part, field.name, value)


@dataclass(frozen=True, kw_only=True)
class Amplifier:
    """Voltage amplifier: a first-order lag with a slew limit and output limits.

    Parameters
    ----------
    bandwidth : float, optional
        Frequency at which a small signal has lost 3 dB [Hz]; infinity for no lag.
    slew : float, optional
        Slew rate [V/s]; infinity for no limit.
    limits : (float, float), optional
        Lowest and highest output [V].

    Raises
    ------
    ParameterError
        A number is out of its range; raised by the `VirtualStage` that it is given to.

    Examples
    --------
    >>> import piezotrack as pt
    >>> pt.stages.Amplifier(bandwidth=500.0, limits=(-20.0, 130.0)).limits
    (-20.0, 130.0)
    """

    bandwidth: float = math.inf
    slew: float = math.inf
    limits: tuple[float, float] = (-math.inf, math.inf)

    def __post_init__(self) -> None:
        _as_numbers(self)

    @property
    def _numbers(self) -> tuple[float, float, float, float]:
        return self.bandwidth, self.slew, *self.limits


@dataclass(frozen=True, kw_only=True)
class Sensor:
    """Displacement sensor: noise, resolution, range, delay and offset.

    Parameters
    ----------
    noise : float, optional
        Noise [m rms], before quantisation.
    noise_bandwidth : float, optional
        Bandwidth of the noise [Hz]: white noise through a first-order low-pass; infinity for white
        noise.
    resolution : float, optional
        Quantisation step [m]; 0 for none.
    range : float, optional
        Displacement that can be read, to either side of 0 [m].
    delay : float, optional
        Time by which the displacement read is older than the reading [s].
    offset : float, optional
        Reading before the first motion [m].
    seed : int, optional
        Seed of the noise, and of sampling jitter.

    Raises
    ------
    ParameterError
        A number is out of its range; raised by the `VirtualStage` that it is given to.

    Examples
    --------
    >>> import piezotrack as pt
    >>> sensor = pt.stages.Sensor(noise=2e-9, delay=1e-3)
    >>> f"{1e9 * sensor.noise:.0f} nm rms, late by {1e3 * sensor.delay:.0f} ms"
    '2 nm rms, late by 1 ms'
    """

    noise: float = 0.0
    noise_bandwidth: float = math.inf
    resolution: float = 0.0
    range: float = math.inf
    delay: float = 0.0
    offset: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        _as_numbers(self)
        if self.noise >= NOT_A_SENSOR:
            raise ParameterError(
                "noise",
                f"{self.noise:g} m rms",
                f"metres, and no sensor of a piezo stage is so noisy; {self.noise:g} nm is "
                f"{self.noise:g}e-9",
            )

    @property
    def _numbers(self) -> tuple[float, float, float, float, float, float, int]:
        noise = self.noise, self.noise_bandwidth, self.resolution
        return *noise, self.range, self.delay, self.offset, self.seed


@dataclass(frozen=True, kw_only=True)
class Preconditioning:
    """Cycles before an experiment, which then begins on the settled loop.

    Eight full cycles of 0.25 Hz between 0 V and `swing`, then a rest at 0 V, where the reading is
    set to the sensor's offset.

    Parameters
    ----------
    swing : float
        Highest voltage of the cycles [V].
    rest : float, optional
        Time at 0 V after them, in which creep goes back [s]; up to an hour.

    Raises
    ------
    ParameterError
        A number is out of its range; raised by the `VirtualStage` that it is given to.

    Examples
    --------
    >>> import piezotrack as pt
    >>> pt.stages.Preconditioning(swing=75.0, rest=60.0)
    Preconditioning(swing=75.0, rest=60.0)
    """

    swing: float
    rest: float = 0.0

    def __post_init__(self) -> None:
        _as_numbers(self)

    @property
    def _numbers(self) -> tuple[float, float]:
        return self.swing, self.rest
