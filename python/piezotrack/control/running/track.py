"""`track`: a reference in closed loop, on a simulated stage or on a device."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ... import _core
from ...errors import ParameterError
from ...hardware.device import Device
from ...hardware.measuring import rest_of
from ...references.parse import reference_of
from ..controller.controller import Controller
from ..loop.preconditions import check_drive_unit
from ..loop.run import Run
from ..on_device.closed_loop import track_on
from ..on_device.playing import shift_of
from ..plant import plant_of, shifted, simulated_rest, timing_on

if TYPE_CHECKING:
    from ...identification.fitted.identified_model import IdentifiedModel
    from ...references.reference import Reference
    from ..loop.tracking import Tracking
    from ..plant import Plant
    from ..timing import Timing

__all__ = ["track"]


def track(
    stage: Plant | IdentifiedModel | Device,
    controller: Controller,
    reference: Reference | str,
    *,
    timing: Timing | None = None,
    substeps: int = 10,
    beyond_reach: bool = False,
    unstable: bool = False,
    safe: float | None = None,
    offset: float | None = None,
) -> Tracking:
    """Track a reference in closed loop, on a simulated stage or on a device.

    A simulated stage moves in continuous time; at each sampling instant the sensor is read, and the
    voltage computed from the reading is applied and held until the next. On a device this computer
    closes the loop, in real time: see `control.DeviceTracking`.

    Parameters
    ----------
    stage : Stage, VirtualStage, IdentifiedModel or Device
        The plant: any stage of ``pt.stages``, a `VirtualStage` or an `IdentifiedModel`, or a
        `hardware.Device` with `exchange`. A stage
        model has no noise and no amplifier (``VirtualStage.of`` gives it both), and starts at rest;
        offset and delay of an `IdentifiedModel` are included in the displacement.
    controller : Controller
        The controller.
    reference : Reference or str
        The reference, as ``pt.sine(...)``; or a text or a file, as the command line takes it:
        ``"sine:0.2Hz,0..100um,10s"``.
    timing : Timing, optional
        Delay and jitter of the loop, and the voltages before the run.
    substeps : int, optional
        Instants kept in each sampling interval, for plots; up to 100000.
    beyond_reach : bool, optional
        Whether the reference may exceed the reach of the stage within the voltage limits, as to
        study saturation.
    unstable : bool, optional
        Whether a loop may be unstable for small motions.
    safe : float, optional
        Of a device: voltage before and after [V]; default 0 V, or the limit nearest to it. `timing`
        and `substeps` are those of a simulation.
    offset : float, optional
        Reading of the stage at rest [m], as of `zero`: readings then count from where the model of
        the feedforward is at rest, without one from 0, so that a log and a stage with different
        zeros meet. By default they are as they come.

    Returns
    -------
    Tracking
        The motion and its metrics; of a device a `control.DeviceTracking`.

    Raises
    ------
    ParameterError
        A number is out of its range, the reference exceeds the reach of the stage, the loop is
        unstable, or a device is too slow for the interval.
    NumericalError
        The loop diverges.
    DeviceError, Interrupted
        A device failed, or the loop was interrupted: the output is at `safe`, and `partial` is the
        run up to then.

    Examples
    --------
    >>> import piezotrack as pt
    >>> loop = pt.Controller(dt=0.02, limits=(0.0, 75.0), feedback=pt.Pid.xu_li_2010())
    >>> reference = pt.sine(frequency=0.2, low=0.0, high=100e-6, duration=10.0)
    >>> run = pt.track(pt.VirtualStage.xu_li_2010(seed=1), loop, reference)
    >>> print(f"{run.metrics.phase_lag:.2f} rad")
    0.06 rad
    """
    if not isinstance(controller, Controller):
        raise ParameterError("controller", type(controller).__name__, "pt.Controller")
    reference = reference_of(reference)
    if isinstance(stage, Device):
        if timing is not None or substeps != 10:
            raise ParameterError(
                "timing or substeps", "given", "neither on a device, which has its own"
            )
        return track_on(
            stage,
            controller,
            reference,
            safe=safe,
            shift=shift_of(controller, offset, rest_of(stage, safe)),
            beyond_reach=beyond_reach,
            unstable=unstable,
        )
    if safe is not None:
        raise ParameterError("safe", f"{safe!r}", "none, as the stage is simulated")
    plant = plant_of(stage)
    if shift := shift_of(controller, offset, simulated_rest(plant)):
        plant = shifted(plant, shift)
    check_drive_unit(stage, controller)
    timing = timing_on(plant, timing, controller.limits)
    substeps = _core.as_count("substeps", substeps)
    free = {
        "unstable": _core.as_truth("unstable", unstable),
        "beyond_reach": _core.as_truth("beyond_reach", beyond_reach),
    }
    run = Run(controller, reference)
    run.check(plant, timing.delay, **free)
    return run.simulate(plant, run.feedforward, timing, substeps)
