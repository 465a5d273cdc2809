"""Following a reference without real time: a table of voltages on the clock of a device."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ... import _core
from ..._support.arguments import expect, finite, not_negative
from ...errors import ParameterError
from ...hardware.measuring import (
    RAMP,
    check_device,
    check_table,
    filled,
    obtained_rate,
    play_table,
    ramped,
    rest_of,
)
from ...hardware.safe_end import led_back
from ...references.parse import reference_of
from ...stages.inverse import Inverse
from ..controller.controller import Controller
from ..loop.run import Run
from ..loop.tracking import Tracking
from ..plant import initial_displacement, plant_of_inverse

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...hardware.device import Device
    from ...references.reference import Reference

    Array = NDArray[np.float64]

__all__ = ["check_limits", "check_playable", "play", "played_on", "shift_of", "shift_words"]


# Farthest reading from 0 [m], as of a session.
FARTHEST = 0.01


def check_limits(device: Device, controller: Controller) -> None:
    """Raise ParameterError where a controller may ask for what a device must not put out."""
    low, high = device.limits
    least, most = controller.limits
    if not low <= least < most <= high:
        raise ParameterError(
            "limits of the controller",
            f"{least:g} to {most:g} V",
            f"a range within {low:g} to {high:g} V, the limits of {device.channels[0]}",
            verb="are",
        )


def check_playable(device: Device, controller: Controller) -> None:
    """Raise ParameterError unless a controller is a feedforward that a device can play."""
    check_device(device)
    expect("controller", controller, Controller, "pt.Controller")
    if controller.drive_unit != "V":
        raise ParameterError(
            "controller",
            f"in {controller.drive_unit}",
            "V, which a device puts out",
            verb="commands",
        )
    given = {"feedback": controller.feedback, "repetitive": controller.repetitive}
    if present := [name for name, part in given.items() if part is not None]:
        raise ParameterError(
            "controller",
            f"{' and '.join(present)}, which a table cannot have",
            "feedforward alone; pt.track closes the loop on a device",
            verb="has",
        )
    check_limits(device, controller)
    near, notes = obtained_rate(device, 1.0 / controller.dt)
    if notes and abs(near * controller.dt - 1.0) > 1e-6:
        raise ParameterError(
            "dt of the controller",
            f"{controller.dt:.9g} s",
            f"{1.0 / near:.9g} s, an interval that {device.channels[0]} plays at",
        )


def shift_of(controller: Controller, offset: float | None, rest: float) -> float:
    """Return what is subtracted from readings [m] where a stage reads `offset` [m] at rest.

    That is `offset` less the displacement at which the model of the feedforward rests at `rest`
    [V]; 0 where no offset is given.
    """
    if offset is None:
        return 0.0
    read = finite("offset", offset, "m")
    if abs(read) > FARTHEST:
        raise ParameterError(
            "offset",
            f"{read:g} m",
            f"a reading within {1e3 * FARTHEST:g} mm of 0, as of pt.zero; 110 um is 110e-6 m",
        )
    inverse = controller.feedforward
    begun = 0.0
    if inverse is not None:
        begun = initial_displacement(plant_of_inverse(inverse), (rest, rest))
    return read - begun


def shift_words(shift: float) -> str:
    """Write what is subtracted from readings, where something is."""
    return f", its readings less {1e6 * shift:.4g} um" if shift else ""


def played_on(
    device: Device,
    run: Run,
    volts: Array,
    note: str,
    *,
    rest: float | None = None,
    ramp: float = RAMP,
    shift: float = 0.0,
) -> Tracking:
    """Play voltages along a reference on a device [V], and return its record less `shift` [m]."""
    controller, samples = run.controller, run.samples
    rate = device.rates.nearest(1.0 / controller.dt)
    check_table(device, "voltage", volts)
    home = rest_of(device, rest)
    table, first = ramped(device, "voltage", volts, home, rate, ramp)
    with led_back(device, home):
        record = play_table(device, table, rate)
    y, notes = filled(record)
    part = slice(first, first + volts.size)
    measured, applied = y[part] - shift, record.volts[part]
    low, high = controller.limits
    nothing = np.zeros(volts.size)
    return Tracking(
        reference=run.reference,
        controller=controller,
        t=samples.t,
        desired=samples.x,
        measured=measured,
        displacement=measured,
        loop_error=samples.x - measured,
        voltage=applied,
        feedforward=volts,
        feedback=nothing,
        repetitive=nothing,
        saturated=(applied <= low) | (applied >= high),
        fine_t=samples.t,
        fine_displacement=measured,
        fine_voltage=applied,
        note="; ".join([f"{note}, played on {device.channels[0]}{shift_words(shift)}", *notes]),
    )


def play(
    device: Device,
    controller: Controller | Inverse,
    reference: Reference | str,
    *,
    rate: float | None = None,
    rest: float | None = None,
    ramp: float = RAMP,
    offset: float | None = None,
) -> Tracking:
    """Follow a reference with a feedforward that a device plays as a table.

    The whole run is computed before, goes out on the clock of the device, and comes back with it:
    no real time is needed. The output is led smoothly from `rest` and back to it. A voltage shows
    in the reading of the next sample: at a low rate that interval is most of the error, and
    `learn` removes it.

    Parameters
    ----------
    device : Device
        The device.
    controller : Controller or Inverse
        A controller with feedforward alone, or an inverse, as ``fit.inverse()``.
    reference : Reference or str
        The reference, or its text as of `track`.
    rate : float, optional
        Sampling rate of an inverse [Hz]; a controller has its own.
    rest : float, optional
        Voltage before and after [V]; default 0 V, or the limit nearest to it.
    ramp : float, optional
        Length of the way from rest and back [s].
    offset : float, optional
        Reading of the device at rest [m], as of `zero`: readings then count from where the model of
        the feedforward is at rest. By default they are as they come.

    Returns
    -------
    Tracking
        The motion as it was measured, and its metrics; the true displacement is the measured one.

    Raises
    ------
    ParameterError
        The controller has feedback, its limits or its interval do not suit the device, or a number
        is out of its range.
    DeviceError
        The device does not do what it was asked.
    DataError
        More than 1 % of the samples have no reading.

    Examples
    --------
    >>> import piezotrack as pt
    >>> plays = pt.PrandtlIshlinskiiStage(linear=1e-6, thresholds=(5.0,), weights=(5e-7,))
    >>> stage = pt.VirtualStage.of(plays, noise=5e-9, limits=(0.0, 75.0))
    >>> device = pt.hardware.VirtualDevice(stage)
    >>> reference = pt.sine(frequency=5.0, low=10e-6, high=60e-6, duration=1.0)
    >>> run = pt.play(device, plays.inverse(), reference, rate=20e3)
    >>> print(f"{1e9 * run.score(true=True).rms_error:.0f} nm")
    28 nm
    """
    check_device(device)
    reference = reference_of(reference)
    if isinstance(controller, Inverse):
        if rate is None:
            raise ParameterError("rate", "not given", "the sampling rate of an inverse, Hz")
        obtained, _ = obtained_rate(device, _core.as_number("rate", rate))
        controller = Controller(dt=1.0 / obtained, limits=device.limits, feedforward=controller)
    elif rate is not None:
        raise ParameterError("rate", f"{rate!r}", "none, as the controller has an interval")
    check_playable(device, controller)
    if controller.feedforward is None:
        raise ParameterError(
            "controller", "no feedforward", "one, as fit.inverse() gives", verb="has"
        )
    run = Run(controller, reference)
    volts, note = run.feedforward
    volts = np.clip(volts, *controller.limits)
    ways = None if rest is None else finite("rest", rest, "V")
    return played_on(
        device,
        run,
        volts,
        note,
        rest=ways,
        ramp=not_negative("ramp", ramp, "s"),
        shift=shift_of(controller, offset, rest_of(device, rest)),
    )
