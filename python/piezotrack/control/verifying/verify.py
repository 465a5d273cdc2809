"""`verify`: the sensitivity of a loop, measured on the stage."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ... import _core
from ..._support.arguments import expect, finite, plain
from ...errors import DataError, ParameterError
from ...hardware.device import Device
from ...references.reference import Reference
from ...response.best_linear_approximation import approximate, spectra
from ...response.excitation import RandomPhaseMultisine
from ...response.modal_fit import fit_modes
from ...response.response_data import FrequencyResponse
from ..controller.controller import Controller
from ..loop.preconditions import check_drive_unit
from ..loop.run import Run
from ..loop.stability import check_loop
from ..on_device.closed_loop import track_on
from ..plant import plant_of, plant_of_inverse, timing_on
from ..running.zero import zero
from ..tuning.margins import Margins
from .verification import Verification

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...identification.fitted.identified_model import IdentifiedModel
    from ..loop.tracking import Tracking
    from ..plant import Plant
    from ..timing import Timing

    Array = NDArray[np.float64]
    Complex = NDArray[np.complex128]

__all__ = ["verify"]

# Way from rest to the level [s], and samples of it at least.
WAY, FEWEST = 1.0, 20
# Largest share of ticks that are late or left out, which add noise.
MOST_LATE = 0.02


def verify(
    stage: Plant | IdentifiedModel | Device,
    controller: Controller,
    excitation: RandomPhaseMultisine,
    *,
    level: float,
    model: Plant | IdentifiedModel | FrequencyResponse | None = None,
    margins: Margins | None = None,
    timing: Timing | None = None,
    safe: float | None = None,
) -> Verification:
    """Measure the sensitivity of a loop on the stage, and compare it with its bound.

    The loop holds a displacement while a random-phase multisine is added to its command. Of one
    run follow the response of the stage, the sensitivity and the open loop, each with its band
    (Pintelon and Schoukens, System Identification, 2nd ed., 2012, section 4.3.4). The repetitive
    part is left out.

    Parameters
    ----------
    stage : Stage, VirtualStage, IdentifiedModel or Device
        What the loop is closed on; a device with `exchange`.
    controller : Controller
        The controller.
    excitation : RandomPhaseMultisine
        What is added to the command, a range about 0 V.
    level : float
        Displacement that is held [m].
    model : Stage, VirtualStage, IdentifiedModel or FrequencyResponse, optional
        Of which the sensitivity is predicted; default the model of the feedforward.
    margins : Margins, optional
        Whose sensitivity is the bound.
    timing : Timing, optional
        Of a simulation.
    safe : float, optional
        Of a device: voltage before and after [V]; default 0 V, or the limit nearest to it.

    Returns
    -------
    Verification
        Measured beside predicted, with the verdict.

    Raises
    ------
    ParameterError
        An argument is missing or out of its range, or the loop is unstable on the model.
    DataError
        The command was clipped, or more than 2 % of the ticks were late or left out.
    DeviceError, Interrupted
        A device failed, the loop diverged, or was interrupted: the output is at `safe`.

    Examples
    --------
    >>> import piezotrack as pt
    >>> plays = pt.PrandtlIshlinskiiStage(
    ...     linear=1e-6, thresholds=(0.5,), weights=(2e-7,), frequency=160.0, damping_ratio=0.1
    ... )
    >>> stage = pt.VirtualStage.of(plays, noise=2e-9, limits=(0.0, 75.0))
    >>> loop = pt.tune(stage, dt=5e-4, limits=(0.0, 75.0), parts="pid").controller
    >>> lines = pt.RandomPhaseMultisine(band=(4.0, 800.0), low=-1.0, high=1.0, realisations=12)
    >>> pt.verify(stage, loop, lines, level=30e-6, margins=pt.Margins(sensitivity=2.3)).verdict
    'holds'
    """
    expect("controller", controller, Controller, "pt.Controller")
    expect("excitation", excitation, RandomPhaseMultisine, "pt.RandomPhaseMultisine")
    if controller.feedback is None:
        raise ParameterError("controller", "without feedback", "one that closes a loop", verb="is")
    if not excitation.low < 0.0 < excitation.high:
        raise ParameterError(
            "excitation",
            f"{plain(excitation.low)} to {plain(excitation.high)} V",
            "a range about 0 V, which is added to the command",
        )
    bound = (Margins() if margins is None else margins).sensitivity
    loop, dt = replace(controller, repetitive=None), controller.dt
    signals, count = excitation.signals(1.0 / dt), excitation.samples(1.0 / dt)
    total = excitation.settle + excitation.periods
    way = max(FEWEST, round(WAY / dt))
    lines = np.tile(signals, (1, total)).ravel()
    injected = np.concatenate([np.zeros(way), lines])
    level = finite("level", level, "m")
    start = _rest(stage, safe)
    run = _tracked(stage, loop, _held(start, level, way, lines.size, dt), injected, timing, safe)
    _check(run, way)
    shape = (excitation.realisations, total, count)
    drive, output = (
        signal[way : way + lines.size].reshape(shape)[:, excitation.settle :]
        for signal in (run.voltage, run.measured)
    )
    numbers = excitation.numbers(1.0 / dt)
    added = np.broadcast_to(signals[:, np.newaxis], drive.shape)
    u, y, d = (spectra(one, numbers) for one in (drive, output, added))
    about: dict[str, Any] = {
        "frequency": numbers / (count * dt),
        "dt": dt,
        "amplitude": float(drive.std()),
        "offset": float(drive.mean()),
        "drive_unit": controller.drive_unit,
        "excitation": f"{excitation.realisations} realisations of {excitation.periods} periods of "
        f"{plain(count * dt)} s, in closed loop",
        "source": run.note,
    }
    plant = FrequencyResponse(**about, **approximate(y, u, d[:, 0])._asdict())
    sensitivity = FrequencyResponse(
        **{**about, "output_unit": controller.drive_unit}, **approximate(u, d, d[:, 0])._asdict()
    )
    known = _model(stage, controller, model)
    late = 0.0 if timing is None else timing.delay
    return Verification(
        controller=controller,
        plant=plant,
        sensitivity=sensitivity,
        predicted=None if known is None else _predicted(known, loop, late, sensitivity.frequency),
        bound=bound,
        run=run,
    )


def _rest(stage: Plant | IdentifiedModel | Device, safe: float | None) -> float:
    """Read where the stage is before the run [m]."""
    return zero(stage, rest=safe) if isinstance(stage, Device) else zero(stage)


def _held(start: float, level: float, way: int, count: int, dt: float) -> Reference:
    """Return a reference that goes smoothly from a displacement to another and holds it [m]."""
    s = np.minimum(np.arange(way + count) / way, 1.0)
    x = start + (level - start) * s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    return Reference.from_samples(x, dt, name=f"{1e6 * level:.4g} um held")


def _tracked(
    stage: Plant | IdentifiedModel | Device,
    loop: Controller,
    reference: Reference,
    injected: Array,
    timing: Timing | None,
    safe: float | None,
) -> Tracking:
    """Close the loop with a voltage added to its command [V]."""
    if isinstance(stage, Device):
        if timing is not None:
            raise ParameterError("timing", "given", "none on a device, which has its own")
        return track_on(stage, loop, reference, safe=safe, injected=injected)
    plant = plant_of(stage)
    check_drive_unit(stage, loop)
    timing = timing_on(plant, timing, loop.limits)
    run = Run(loop, reference, injected)
    run.check(plant, timing.delay, beyond_reach=False)
    return run.simulate(plant, run.feedforward, timing, 1)


def _check(run: Tracking, way: int) -> None:
    """Refuse a run whose command was clipped after the way to the level, or that has gaps."""
    if clipped := int(run.saturated[way:].sum()):
        low, high = run.controller.limits
        raise DataError(
            f"the command was clipped at {clipped} of {run.t.size} samples: expected one within "
            f"{low:g} to {high:g} {run.controller.drive_unit}; a smaller excitation or another "
            "level"
        )
    if lost := int((~np.isfinite(run.measured)).sum()):
        raise DataError(f"{lost} of {run.t.size} samples have no reading: expected all of them")
    if (overruns := getattr(run, "overruns", 0)) > MOST_LATE * run.t.size:
        raise DataError(
            f"{overruns} of {run.t.size} ticks were late or left out: expected at most "
            f"{100.0 * MOST_LATE:g} %; a longer sampling interval"
        )


def _model(
    stage: Plant | IdentifiedModel | Device,
    controller: Controller,
    model: Plant | IdentifiedModel | FrequencyResponse | None,
) -> Plant | IdentifiedModel | None:
    """Return what the sensitivity is predicted of: what is given, or the feedforward's model."""
    if isinstance(model, FrequencyResponse):
        return fit_modes(model).stage
    if model is not None:
        return model
    if controller.feedforward is not None:
        return plant_of_inverse(controller.feedforward)
    return None if isinstance(stage, Device) else stage


def _predicted(
    model: Plant | IdentifiedModel, loop: Controller, delay: float, frequency: Array
) -> Complex:
    """Return the sensitivity at the three gains of a stage, at some frequencies [Hz]."""
    plants = check_loop(model, loop, delay=delay).plants
    found = [_core.loop_response(loop._core, plant, frequency.tolist())[1] for plant in plants]
    return np.asarray(np.asarray(found) @ np.array([1.0, 1.0j]))
