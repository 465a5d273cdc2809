"""Preconditions of a closed-loop run, checked before it is simulated.

The drive has the unit of the controller, a repetitive part the period of the reference, the loop is
stable, and the reference is within the reach of the stage.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..._support.arguments import not_negative
from ..._support.units import shown_unit
from ...errors import ParameterError
from ...identification.fitted.identified_model import IdentifiedModel
from ..plant import (
    displacement_range,
    initial_displacement,
    lowest_settled_displacement,
    plant_of_inverse,
)
from .stability import check_loop

if TYPE_CHECKING:
    from ...references.reference import Reference, SampledReference
    from ...stages.inverse import Inverse
    from ...stages.virtual import VirtualStage
    from ..controller.controller import Controller

__all__ = ["check_delay", "check_drive_unit", "check_period", "check_stable", "check_within_reach"]


# Control intervals that a loop of a search keeps on their way to the stage.
MOST_INTERVALS = 100_000


def check_delay(stage: VirtualStage, delay: float, dt: float) -> None:
    """Refuse a delay [s] below 0, or with that of the sensor beyond the memory of a search."""
    whole, most = not_negative("delay", delay, "s") + stage.sensor.delay, MOST_INTERVALS * dt
    if whole > most:
        raise ParameterError(
            "delay",
            f"{whole:.6g} s in all",
            f"{most:.6g} s at most, {MOST_INTERVALS} control intervals",
        )


def check_drive_unit(stage: object, controller: Controller) -> None:
    """Refuse a model that is driven by a position under a controller of volts, or the reverse."""
    if not isinstance(stage, IdentifiedModel):
        return
    unit, other = stage.drive_unit, controller.drive_unit
    if "m" in (unit, other) and unit != other:
        raise ParameterError(
            "controller",
            f"the drive_unit {other!r}",
            f"that of the model, {unit!r}, as pt.Controller.of gives it",
            verb="has",
        )


def check_period(controller: Controller, reference: Reference) -> None:
    """Refuse a repetitive part whose period is not that of the reference."""
    if controller.repetitive is None:
        return
    if reference.period is None:
        raise ParameterError(
            "reference",
            f"({reference.name}), which does not repeat",
            "one that does, for the repetitive part",
        )
    check_turns(controller, reference.period, f"reference ({reference.name})")


def check_turns(controller: Controller, period: float, whose: str) -> None:
    """Refuse a repetitive part whose period [s] is not that of something, or a multiple."""
    if controller.repetitive is None:
        return
    turns = controller.repetitive.period / period
    if abs(turns - max(1, round(turns))) > 1e-6 * turns:
        raise ParameterError(
            "repetitive",
            f"a period of {controller.repetitive.period:g} s",
            f"that of the {whose}, {period:g} s, or a multiple",
            verb="has",
        )


def check_stable(stage: VirtualStage, controller: Controller, delay: float) -> None:
    """Refuse a loop that is unstable at the middle gain of the stage."""
    if controller.feedback is None and controller.repetitive is None:
        return
    report = check_loop(stage, controller, delay=delay)
    if report.stable:
        return
    middle = report.middle
    problem = f"the loop is unstable on this stage, {middle.gain_text}"
    law = controller.feedback
    without = middle.gain_margin is not None and middle.gain_margin < 1.0
    if without and middle.stable_gains is not None and middle.stable_gains[1] < 1.0:
        low, share = middle.stable_gains
        if law is not None and law.info.name == "pid":
            unit, scale = shown_unit(controller.drive_unit)
            kp = 1e-6 * scale * law._pid.kp
            gains = f"{share * kp:.3g} {unit}/um in place of {kp:.3g}"
            problem += f"; at the limit kp would be {gains}"
            problem += ", and half of that has a gain margin of 6 dB" if low < 0.5 * share else ""
        else:
            problem += f"; at the limit the gain would be {share:.3g} times as large"
    elif without:
        problem += (
            f"; at the limit the feedback's gain would be {middle.gain_margin:.3g} times as large"
        )
    elif controller.repetitive is not None:
        problem += "; without the repetitive part it is stable, so lower kq or take another filter"
    hint = f" ({middle.hint})" if middle.hint else ""
    words = f"{problem}{hint}: expected a stable one, or unstable=True"
    raise ParameterError(words, argument="controller")


def check_within_reach(
    stage: VirtualStage,
    limits: tuple[float, float],
    samples: SampledReference,
    drive_unit: str = "V",
    *,
    model: Inverse | None = None,
) -> None:
    """Refuse a reference that exceeds the reach of the stage between two voltages [V].

    Where it is beyond only because the stage and the model of the feedforward rest at different
    readings, that is said with both.
    """
    low, high = limits
    unit, scale = shown_unit(drive_unit)
    bottom, top = displacement_range(stage, (low, high), 1e-3)
    slack = 0.01 * (top - bottom)
    for value, past, edge in (
        (samples.x.max(), samples.x.max() - top, top),
        (samples.x.min(), bottom - samples.x.min(), bottom),
    ):
        if past > slack:
            _check_zeros(stage, limits, samples, model, (bottom - slack, top + slack))
            k = int(np.flatnonzero(samples.x == value)[0])
            # What would be within reach from another zero.
            shifted = float(np.ptp(samples.x)) <= top - bottom + slack and stage.sensor.offset
            raise ParameterError(
                "reference",
                f"{1e6 * value:.4g} um at {samples.t[k]:.4g} s, {1e6 * past:.3g} um beyond "
                f"{1e6 * edge:.4g} um",
                f"{1e6 * bottom:.4g} to {1e6 * top:.4g} um on the sensor, which this stage "
                f"reaches from {scale * low:g} to {scale * high:g} {unit}, or beyond_reach=True"
                + ("; fit.zeroed() takes the beginning of its record as 0" if shifted else ""),
            )
    # The loop stays above the curve from rest: once up, the stage no longer comes all the way down.
    k = int(np.argmax(samples.x))
    k += int(np.argmin(samples.x[k:]))
    lowest = lowest_settled_displacement(stage, (low, high), float(samples.x.max()), 1e-3)
    if (past := lowest - samples.x[k]) > slack:
        raise ParameterError(
            "reference",
            f"{1e6 * samples.x[k]:.4g} um at {samples.t[k]:.4g} s, {1e6 * past:.3g} um below "
            f"{1e6 * lowest:.4g} um",
            f"displacements that the stage reaches at {scale * low:g} {unit} on the settled loop, "
            f"from {1e6 * samples.x.max():.4g} um down, or beyond_reach=True",
        )


def _check_zeros(
    stage: VirtualStage,
    limits: tuple[float, float],
    samples: SampledReference,
    model: Inverse | None,
    reach: tuple[float, float],
) -> None:
    """Refuse a reference that would be within reach [m] if stage and model had one zero."""
    if model is None:
        return
    there, known = (initial_displacement(one, limits) for one in (stage, plant_of_inverse(model)))
    low, high = samples.x.min() + there - known, samples.x.max() + there - known
    apart = abs(there - known) > 0.01 * (reach[1] - reach[0])
    if apart and reach[0] <= low and high <= reach[1]:
        raise ParameterError(
            "reference",
            f"{1e6 * samples.x.min():.4g} to {1e6 * samples.x.max():.4g} um, beyond reach only "
            f"because the zeros differ: the stage rests at {1e6 * there:.4g} um, the model of the "
            f"feedforward at {1e6 * known:.4g} um",
            "offset=pt.zero(stage), with which readings count as in the model",
        )
