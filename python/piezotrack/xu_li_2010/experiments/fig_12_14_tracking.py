"""Figs. 12 to 14: feedforward, PID, antiwindup and repetitive control on one axis."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from ...control.laws.pid import Pid
from ...control.loop.tracking import Tracking
from ...control.parts.repetitive import Repetitive
from ...control.running.track import track
from ..apparatus import loop
from .references import SHRUNK, fast, shrunk, slow

if TYPE_CHECKING:
    from ...stages.inverse import Inverse
    from ..apparatus import Apparatus

__all__ = ["antiwindup", "compensation", "observe", "observe_compensation", "repetitive"]

Runs = dict[str, Tracking]
PID = Pid.xu_li_2010()
# Without antiwindup.
UNGUARDED = Pid.from_um(kp=0.120, ti=0.009, td=0.044, tt=math.inf)
# In the paper the error settles after three periods.
LEARNT = 3


def compensation(apparatus: Apparatus, inverse: Inverse) -> Runs:
    """Fig. 12: feedforward alone, PID alone, both."""
    loops = {
        "forward": loop(inverse),
        "back": loop(feedback=PID),
        "both": loop(inverse, feedback=PID),
    }
    return {
        name: track(apparatus.x, one, slow(), timing=apparatus.timing, unstable=True)
        for name, one in loops.items()
    }


def antiwindup(apparatus: Apparatus, inverse: Inverse, part: float = 1.0) -> Runs:
    """Fig. 13: within the limits, and with shrunk limits without and with antiwindup."""
    loops = {
        "free": loop(inverse, feedback=PID),
        "without": loop(inverse, limits=SHRUNK, feedback=UNGUARDED),
        "with": loop(inverse, limits=SHRUNK, feedback=PID),
    }
    return {
        name: track(
            apparatus.x,
            loop,
            shrunk(part),
            timing=apparatus.timing,
            beyond_reach=True,
            unstable=True,
        )
        for name, loop in loops.items()
    }


def repetitive(apparatus: Apparatus, inverse: Inverse, part: float = 1.0) -> Runs:
    """Fig. 14: 0.5 Hz without and with repetitive control, the paper's form of it."""
    reference = fast(part)
    assert reference.period is not None
    learning = Repetitive.xu_li_2010(reference.period)
    loops = {
        "without": loop(inverse, feedback=PID),
        "with": loop(inverse, feedback=PID, repetitive=learning),
    }
    return {
        name: track(apparatus.x, one, reference, timing=apparatus.timing, unstable=True)
        for name, one in loops.items()
    }


def observe_compensation(twelve: Runs, *, true: bool = False) -> dict[str, float]:
    """Compute the published quantities of Fig. 12, SI; `true` as for `observe`."""
    values = {f"{name}.max": run.score(true=true).max_error for name, run in twelve.items()}
    for name in ("back", "both"):
        metrics = twelve[name].score(true=true)
        values[f"{name}.lag"] = metrics.phase_lag or 0.0
        values[f"{name}.loop"] = metrics.widest_loop or 0.0
    return values


def observe(
    twelve: Runs, thirteen: Runs, fourteen: Runs, *, true: bool = False
) -> dict[str, float]:
    """Compute the published quantities, SI, and those of its conclusions.

    From the samples of the controller, as in the paper; with `true`, from the true displacement
    at the same instants.
    """
    values = observe_compensation(twelve, true=true)
    for name, run in thirteen.items():
        values[f"windup.{name}"] = run.score(true=true).max_error
    values["repetitive.without"] = fourteen["without"].score(true=true).max_error
    learning = fourteen["with"]
    period = learning.reference.period or math.inf
    learnt = LEARNT * period
    values["repetitive.with"] = learning.score(learnt, true=true).max_error
    parts = {"second": period, "fourth": learnt, "last": learning.reference.duration - period}
    for name, start in parts.items():
        part = learning.score(start, start + period, true=true)
        values[f"repetitive.{name}"] = part.max_error
    for name, run in fourteen.items():
        values[f"repetitive.rms_{name}"] = run.score(parts["last"], true=true).rms_error
    return values
