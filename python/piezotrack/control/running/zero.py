"""`zero`: where displacements count from, read on the stage at rest."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..._support.arguments import positive
from ...hardware.device import Device
from ...hardware.measuring import filled, obtained_rate, play_table, rest_of
from ...hardware.safe_end import led_back, to_rest
from ..plant import initial_displacement, plant_of, simulated_rest

if TYPE_CHECKING:
    from ...identification.fitted.identified_model import IdentifiedModel
    from ..plant import Plant

__all__ = ["zero"]

# Readings that the median is of, at least.
READINGS = 16


def zero(
    stage: Plant | IdentifiedModel | Device, *, rest: float | None = None, duration: float = 0.2
) -> float:
    """Read where a stage is at rest, for `offset` of `track` and `play`.

    A sensor has a zero of its own, which may be another than that of the log of which a model was
    identified. A device is led to `rest`, from the voltage that it says is there, and the median of
    its readings is taken. With hysteresis a stage rests where its last motion has left it: drive it
    once slowly to the upper limit and back before.

    Parameters
    ----------
    stage : Device, Stage, VirtualStage or IdentifiedModel
        The device; or a stage that is simulated, as it rests at 0 V or nearest to it.
    rest : float, optional
        Voltage at which a device rests [V]; default 0 V, or the limit nearest to it.
    duration : float, optional
        How long a device is read [s].

    Returns
    -------
    float
        The reading [m].

    Raises
    ------
    ParameterError
        A number is out of its range.
    DeviceError
        The device does not do what it was asked.
    DataError
        More than 1 % of the samples have no reading.

    Examples
    --------
    >>> import piezotrack as pt
    >>> plays = pt.PrandtlIshlinskiiStage(linear=1e-6, thresholds=(5.0,), weights=(5e-7,))
    >>> sensor = pt.stages.Sensor(offset=-112e-6, noise=5e-9)
    >>> stage = pt.VirtualStage(stage=plays, sensor=sensor)
    >>> device = pt.hardware.VirtualDevice(stage, limits=(0.0, 75.0))
    >>> print(f"{1e6 * pt.zero(device):.1f} um")
    -112.0 um
    >>> reference = pt.sine(frequency=5.0, low=10e-6, high=60e-6, duration=1.0)
    >>> run = pt.play(device, plays.inverse(), reference, rate=20e3, offset=pt.zero(device))
    >>> run.metrics.max_error < 0.2e-6
    True
    """
    if not isinstance(stage, Device):
        plant = plant_of(stage)
        begins = simulated_rest(plant)
        return initial_displacement(plant, (begins, begins))
    home, time = rest_of(stage, rest), positive("duration", duration, "s")
    rates = stage.rates
    rate, _ = obtained_rate(stage, min(max(READINGS / time, rates.lowest, 1.0), rates.highest))
    count = min(max(READINGS, round(time * rate)), stage.memory)
    with led_back(stage, home):
        to_rest(stage, home)
        record = play_table(stage, np.full(count, home), rate)
    return float(np.median(filled(record)[0]))
