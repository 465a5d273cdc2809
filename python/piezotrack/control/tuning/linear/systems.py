"""Linear systems of python-control, which is not needed for anything else."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from ...._support.arguments import expect, not_negative, number_pair, one_of
from ...._support.arrays import check_dt
from ....errors import ParameterError
from ....identification.fitted.identified_model import IdentifiedModel
from ....stages.base import Stage
from ....stages.virtual import VirtualStage
from ...controller.controller import Controller
from ...laws.damping.damping_law import DampingLaw
from ...parts.part import FeedbackLaw
from ...plant import linearised_plants, plant_of

if TYPE_CHECKING:
    from ...plant import Plant

__all__ = ["sampled", "to_control"]

CASES = ("low", "middle", "high")


def to_control(
    part: Plant | IdentifiedModel | Controller | FeedbackLaw,
    *,
    limits: tuple[float, float] | None = None,
    gain: Literal["low", "middle", "high"] = "middle",
    dt: float | None = None,
    delay: float = 0.0,
) -> Any:
    r"""Make a linear system of python-control, of a stage or of a feedback law.

    A stage is linearised for small motions as `check_loop` does: at its lowest gain, just after a
    reversal, in the middle, the mean over its settled loop between `limits`, or at its highest.
    Hysteresis and creep are not in it. Of a `Controller` only the feedback law is taken, from the
    error to the voltage: no feedforward, no repetitive part, no filters, no limits. A law that
    damps has the measurement as a second input, but for that of a controller with a feedforward.

    Parameters
    ----------
    part : Stage, VirtualStage, IdentifiedModel, Controller, Pid or StateSpace
        A stage of any kind, or a feedback law.
    limits : (float, float), optional
        Voltages of a stage [V] between which it is linearised; of an identified model by default
        the range of the drive of its record.
    gain : {"low", "middle", "high"}, optional
        Which of the three gains of a stage.
    dt : float, optional
        Sampling interval [s] of a discrete system, whose input is held between samples; needed for
        a stage with a delay and for a `Pid` or `StateSpace`. A `Controller` has its own.
    delay : float, optional
        Delay of a stage in addition to its own [s].

    Returns
    -------
    control.StateSpace
        From volts to metres, or from metres to volts; its `name` says what it is.

    Raises
    ------
    ParameterError
        python-control is not installed, an argument is missing or has no effect, or a stage with a
        delay is asked for without `dt`.

    Examples
    --------
    >>> import piezotrack as pt
    >>> stage = pt.VirtualStage.xu_li_2010()
    >>> plant = pt.to_control(stage, limits=(0.0, 75.0))
    >>> print(f"{plant.name}: {1e6 * plant.dcgain().real:.2f} um/V, {plant.nstates} states")
    Prandtl-Ishlinskii linearised, middle gain, 0 to 75 V: 1.56 um/V, 3 states
    """
    if isinstance(part, (Controller, FeedbackLaw)):
        if limits is not None or delay != 0.0 or gain != "middle":
            raise ParameterError(
                "limits, gain or delay", "given", "none, as they have no effect on a feedback law"
            )
        return _feedback_law(part, dt)
    expect("part", part, (VirtualStage, Stage, IdentifiedModel), "a stage or a controller")
    return _stage(part, limits, gain, dt, not_negative("delay", delay, "s"))


def _control() -> Any:
    try:
        import control
    except ImportError:
        raise ParameterError("to_control needs python-control: expected it installed") from None
    return control


def _stage(
    stage: Plant | IdentifiedModel,
    limits: tuple[float, float] | None,
    gain: str,
    dt: float | None,
    delay: float,
) -> Any:
    if limits is None and isinstance(stage, IdentifiedModel):
        limits = stage.drive_range
    if limits is None:
        raise ParameterError("limits", "missing", "(low, high) in V", verb="are")
    low, high = number_pair("limits", limits, "V")
    one_of("gain", gain, CASES)
    plant = plant_of(stage)
    linear = linearised_plants(plant, (low, high), delay)[CASES.index(gain)]
    rows, b, c, d, late = linear.matrices()
    a = np.array(rows, dtype=np.float64).reshape(len(b), len(b))
    between = f"{low:g} to {high:g} V"
    if "." in between:
        # A name may have no point.
        between = f"{1e3 * low:.0f} to {1e3 * high:.0f} mV"
    name = f"{plant.stage.info.title} linearised, {gain} gain, {between}"
    if dt is None:
        if late > 0.0:
            raise ParameterError(
                "dt",
                "missing",
                f"a sampling interval, as the stage has a delay of {late:g} s, which no continuous "
                "system of a finite number of states has",
            )
        system = (a, np.reshape(b, (-1, 1)), np.reshape(c, (1, -1)), [[d]])
        return _control().ss(*system, name=name, inputs=["voltage_V"], outputs=["displacement_m"])
    dt = check_dt(dt)
    system = sampled(a, np.array(b), np.array(c), d, late, dt)
    return _control().ss(*system, dt, name=name, inputs=["voltage_V"], outputs=["displacement_m"])


def sampled(
    a: np.ndarray[Any, np.dtype[np.float64]],
    b: np.ndarray[Any, np.dtype[np.float64]],
    c: np.ndarray[Any, np.dtype[np.float64]],
    d: float,
    delay: float,
    dt: float,
) -> tuple[Any, Any, Any, Any]:
    """Sample a system whose input is held and late, exactly.

    Franklin, Powell and Workman, Digital Control of Dynamic Systems, 3rd edition, section 4.3. The
    states after those of the plant are the earlier inputs, the oldest last.
    """
    whole = int(np.floor(delay / dt + 1e-9))
    part = max(0.0, delay / dt - whole)
    part = 0.0 if part < 1e-9 else part
    change, now = _held(a, b, (1.0 - part) * dt)
    before, early = _held(a, b, part * dt)
    # A reading is taken before the command of its sample acts, which the direct part shows.
    older = whole + (part > 0.0 or d != 0.0)
    n, size = b.size, b.size + older
    big, drive = np.zeros((size, size)), np.zeros((size, 1))
    big[:n, :n] = change @ before
    out = np.concatenate([c, np.zeros(older)])
    for k, gain in ((whole, now), (whole + 1, change @ early)):
        if k == 0:
            drive[:n, 0] += gain
        elif k <= older:
            big[:n, n + k - 1] += gain
    if older:
        drive[n, 0] = 1.0
        big[n + 1 :, n:-1] += np.eye(older - 1)
    if d != 0.0:
        out[n + whole] += d
    return big, drive, out.reshape(1, -1), [[0.0]]


def _held(
    a: np.ndarray[Any, np.dtype[np.float64]],
    b: np.ndarray[Any, np.dtype[np.float64]],
    time: float,
) -> tuple[Any, Any]:
    """Matrix of the free motion over a time [s], and what a constant input of 1 does in it."""
    from scipy.linalg import expm

    n = b.size
    block = np.zeros((n + 1, n + 1))
    block[:n, :n], block[:n, n] = a, b
    whole = expm(block * time)
    return whole[:n, :n], whole[:n, n]


def _feedback_law(part: Controller | FeedbackLaw, dt: float | None) -> Any:
    law: Any = part
    follows = isinstance(part, Controller) and part.feedforward is not None
    if isinstance(part, Controller):
        if dt is not None:
            raise ParameterError("dt", dt, "none, the controller has its own")
        law, dt = part.feedback, part.dt
        if law is None:
            raise ParameterError("part", "a controller without feedback", "one with it")
    if dt is None:
        raise ParameterError("dt", "missing", "the sampling interval of the loop in s")
    dt = check_dt(dt)
    control = _control()
    of_deviation = follows and isinstance(law, DampingLaw)
    system = FeedbackLaw._linear(law, dt) if of_deviation else law._linear(dt)
    made = (control.ss if len(system) == 4 else control.tf)(*system, dt)
    inputs = ["error_m", "measured_m"][: made.ninputs]
    return control.ss(made, name=law.info.title, inputs=inputs, outputs=["voltage_V"])
