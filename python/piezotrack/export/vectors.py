"""Test vectors of an export: inputs, and what the Rust controller makes of them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..control.plant import displacement_range
from ..errors import NumericalError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ..control.controller.controller import Controller
    from ..references.reference import Reference

__all__ = ["HEADER", "STEPS", "Lag", "Row", "range_of", "rows_of", "stage_of", "vectors_text"]

STEPS = 2000
# A longer period is gone through twice, up to this many steps.
MOST_STEPS = 20_000
# Share of the way that the stage goes in a sample.
FRESH = 0.3
HEADER = (
    "step,reference_m,next_m,measured_m,feedforward_{unit},reset_before,applied_{unit},"
    "command_{unit},unclipped_{unit},feedback_{unit},repetitive_{unit},error_m,"
    "saturated,measurement_ok,reference_ok"
)


class Lag(NamedTuple):
    """The stage of the vectors: a lag without hysteresis, over the range of the limits.

    Around an observer it is the plant that the observer knows.

    Attributes
    ----------
    bottom, gain : float
        Displacement at the lower limit [m], and its rise with the drive [m/V].
    fresh : float
        Share of the way that is gone in a sample.
    """

    bottom: float
    gain: float
    fresh: float


class Row(NamedTuple):
    """One step: inputs, what is reported after it, and what comes out.

    Attributes
    ----------
    reference, next, measured, feedforward : float
        Inputs [m, m, m, V]; `next` is NaN where it is not known.
    reset : bool
        Whether the controller was reset before the step.
    applied : float
        Voltage reported after the step [V]; NaN where none is.
    command, unclipped, feedback, repetitive, error : float
        What comes out [V, V, V, V, m].
    saturated, measurement_ok, reference_ok : bool
        Flags of the command.
    """

    reference: float
    next: float
    measured: float
    feedforward: float
    reset: bool
    applied: float
    command: float
    unclipped: float
    feedback: float
    repetitive: float
    error: float
    saturated: bool
    measurement_ok: bool
    reference_ok: bool


def rows_of(
    controller: Controller,
    table: Sequence[float] | None = None,
    reference: Reference | None = None,
) -> list[Row]:
    """Run the Rust controller over saturation, bad readings, a report, a reset and periods.

    The stage is a lag without hysteresis, so that the readings are near the reference.

    Parameters
    ----------
    controller : Controller
        The controller.
    table : sequence of float, optional
        One period of the feedforward.
    reference : Reference, optional
        What the table is for.

    Returns
    -------
    list of Row
        2000, or more where two periods are longer.
    """
    steps = _steps(controller, table)
    bottom, top = _reach(controller)
    low, high = controller.limits
    begin, gain, fresh = stage_of(controller)
    motion = _motion(controller, steps, bottom, top, reference)
    session, rows, x = controller.start(), [], begin + gain * (0.0 - low)
    online = controller.feedforward is not None and table is None
    for k in range(steps):
        reset = k == steps * 4 // 5
        if reset:
            session.reset()
        desired, ahead = float(motion[k]), float(motion[k + 1])
        if k % 97 == 5 or not math.isfinite(ahead):
            ahead = math.nan
        given = table[k % len(table)] if table is not None else _given(k, low, high)
        measured = _reading(k, x, bottom, top)
        out = session.step(
            desired,
            measured,
            preview=None if math.isnan(ahead) or not online else ahead,
            feedforward=None if online else given,
        )
        last = session.last
        applied = _applied(k, steps, out, low, high)
        if not math.isnan(applied):
            session.applied(applied)
        there = out if math.isnan(applied) else applied
        if low <= there <= high:
            x += fresh * (begin + gain * (there - low) - x)
        rows.append(
            Row(
                desired, ahead, measured, math.nan if online else given, reset, applied,
                out, last.unclipped, last.feedback, last.repetitive, last.error,
                last.saturated, last.measurement_valid, last.reference_valid,
            )
        )  # fmt: skip
    return rows


def stage_of(controller: Controller) -> Lag:
    """Return the stage of the vectors."""
    bottom, top = _reach(controller)
    low, high = controller.limits
    if (plant := _plant(controller)) is None:
        return Lag(bottom, (top - bottom) / (high - low), FRESH)
    gain, fresh = plant
    return Lag(bottom if gain > 0.0 else top, gain, fresh)


def _plant(controller: Controller) -> tuple[float, float] | None:
    """Gain [m/V] and share of the way in a sample of the plant that an observer knows."""
    numbers = dict(controller._core.coefficients())
    if "disturbance-observer" in numbers:
        _, pole, inverse = numbers["disturbance-observer"]
        rise = 1.0 / inverse
    elif "dahl-observer" in numbers:
        pole, rise, *_ = numbers["dahl-observer"]
    else:
        return None
    return rise / (1.0 - pole), (1.0 - pole if pole > 0.0 else FRESH)


def _steps(controller: Controller, table: Sequence[float] | None) -> int:
    period = 0.0 if controller.repetitive is None else controller.repetitive.period / controller.dt
    longest = max(period, 0.0 if table is None else len(table))
    return min(max(STEPS, math.ceil(2.5 * longest)), MOST_STEPS)


def _reach(controller: Controller) -> tuple[float, float]:
    """Displacements between which the test moves [m]."""
    bottom, top = range_of(controller)
    if (plant := _plant(controller)) is not None:
        low, high = controller.limits
        top = min(top, bottom + abs(plant[0]) * (high - low))
    return bottom, top


def range_of(controller: Controller) -> tuple[float, float]:
    """Return the displacements that the stage can have [m]."""
    low, high = controller._valid
    if controller.feedforward is None:
        if controller.span is None:
            return 0.0, 1e-4
    else:
        try:
            bottom, top = displacement_range(controller.feedforward.stage, controller.limits, 0.05)
        except NumericalError:
            bottom, top = low, high
        bottom, top = (
            min(max(one + controller.feedforward.offset, low), high) for one in (bottom, top)
        )
        if top > bottom:
            return bottom, top
    wide = high - low
    return low + 0.3 * wide, high - 0.3 * wide


def _motion(
    controller: Controller, steps: int, bottom: float, top: float, reference: Reference | None
) -> NDArray[np.float64]:
    """Make the reference [m]: a sine, larger than the reach for a while; two are missing."""
    low, high = controller._valid
    k = np.arange(steps + 1, dtype=np.float64)
    period = 250.0
    if controller.repetitive is not None:
        period = controller.repetitive.period / controller.dt
    if reference is not None and reference.period is not None:
        places = reference.at((k * controller.dt) % reference.period + reference.ramp)[0]
    else:
        half = 0.4 * (top - bottom)
        larger = (k >= 0.4 * steps) & (k < 0.55 * steps)
        sine = np.sin(2.0 * np.pi * k / period + np.where(k % 7 == 3, 1e-3, 0.0))
        places = 0.5 * (bottom + top) + half * sine * np.where(larger, 1.8, 1.0)
    places = np.clip(places, low, high)
    places[[steps // 4, steps // 4 + 1]] = math.nan
    return np.asarray(places, dtype=np.float64)


def _reading(k: int, x: float, bottom: float, top: float) -> float:
    """Read the sensor: noise, and now and then what is no measurement."""
    bad = {311: math.inf, 312: 9.91e37, 313: -9.91e37}
    if k in bad:
        return bad[k]
    if k % 401 in (150, 151, 152):
        return math.nan
    noise = 1e-4 * (top - bottom) * math.sin(12.9898 * k)
    jump = 0.3 * (top - bottom) if k % 503 == 400 else 0.0
    return x + noise + jump


def _given(k: int, low: float, high: float) -> float:
    """Feedforward of the caller [V]: now and then too large, or missing."""
    bad = {420: math.nan, 421: math.inf, 430: high + 3.0 * (high - low)}
    return bad.get(k, low + 0.1 * (high - low) * (1.0 + math.sin(0.01 * k)))


def _applied(k: int, steps: int, out: float, low: float, high: float) -> float:
    """Report of the amplifier [V]: mostly none, then less than asked for, then overload."""
    begin = steps * 3 // 5
    if begin <= k < begin + 40:
        return low + 0.9 * (out - low)
    if k == begin + 50:
        return 9.91e37
    return out + 1e-4 * (high - low) if k == begin + 60 else math.nan


def vectors_text(rows: Sequence[Row], unit: str) -> str:
    """Write the vectors as CSV, every number with all its digits.

    Parameters
    ----------
    rows : sequence of Row
        The steps.
    unit : str
        Unit of the drive.

    Returns
    -------
    str
        The file.
    """
    lines = [HEADER.format(unit=unit)]
    for k, row in enumerate(rows):
        fields = (str(int(one)) if isinstance(one, bool) else repr(float(one)) for one in row)
        lines.append(f"{k},{','.join(fields)}")
    return "\n".join(lines) + "\n"
