"""Feedback laws whose gains are sought: their settings, and the law of some settings."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal, NamedTuple, TypeAlias

import numpy as np

from ..laws.disturbance_observer import DisturbanceObserver
from ..laws.lead_lag import LeadLag
from ..laws.perturbation_estimator import PerturbationEstimator
from ..laws.pid import Pid
from ..laws.sliding_mode import SlidingMode

if TYPE_CHECKING:
    from collections.abc import Mapping

    from ... import _core

__all__ = [
    "LAWS",
    "SLIDING",
    "LawName",
    "Nominal",
    "SoughtLaw",
    "law_of",
    "law_ranges",
    "nominal_of",
]

LawName = Literal[
    "pid",
    "pd",
    "lead-lag",
    "sliding mode",
    "disturbance observer",
    "perturbation estimation",
]
LAWS = (
    "pid",
    "pd",
    "lead-lag",
    "sliding mode",
    "disturbance observer",
    "perturbation estimation",
)
SoughtLaw: TypeAlias = Pid | LeadLag | SlidingMode | DisturbanceObserver | PerturbationEstimator
# Laws that need a stage that rises with the voltage.
SLIDING = ("sliding mode", "perturbation estimation")
OBSERVED = ("disturbance observer", "perturbation estimation")


class Nominal(NamedTuple):
    """The plant that an observer expects: static gain [m/V] and time constant [s]."""

    gain: float
    time: float


def nominal_of(plant: _core.LoopPlant) -> Nominal:
    """Reduce a plant to its static gain and the slope of its phase at low frequencies."""
    rows, b, c, d, delay = plant.matrices()
    if not b:
        return Nominal(d, delay)
    a = np.reshape(rows, (len(b), len(b)))
    once = np.linalg.solve(a, np.array(b))
    slope = float(np.dot(c, np.linalg.solve(a, once)))
    gain = plant.static_gain
    return Nominal(gain, max(0.0, slope / gain) + delay)


def law_ranges(
    law: str, largest: float, dt: float, limits: tuple[float, float]
) -> list[tuple[str, float, float, bool]]:
    """Set the ranges of a law for plants of at most a static gain [m/V]."""
    span = limits[1] - limits[0]
    # A controller refuses gains with which 1 mm asks for less than a thousandth of the range.
    least = max(1e-4 / largest, 1.001 * span)
    kp = ("kp", least, 10.0 / largest, True)
    ki = ("ki", 1e-4 / largest, 3.0 / largest, True)
    kd = ("kd", 1e-4 / largest, 100.0 / largest, True)
    switching = ("switching", 1e-3 * span, 0.3 * span, True)
    observer = ("observer", 1e-3 / dt, 0.45 / dt, True)
    match law:
        case "pd":
            return [kp, kd]
        case "lead-lag":
            # Its static gain is the only thing that stands for an integral part.
            static = ("kp", least, 1e4 / largest, True)
            times = [(f"{one}_time", 0.1 * dt, 1e6 * dt, True) for one in ("lead", "lag")]
            return [static, *times]
        case "sliding mode":
            return [kp, ki, kd, switching]
        case "disturbance observer":
            return [kp, ki, kd, observer]
        case "perturbation estimation":
            return [kp, ki, kd, switching, observer]
    return [kp, ki, kd]


def law_of(
    law: str, settings: Mapping[str, float], dt: float, sign: float, nominal: Nominal
) -> SoughtLaw:
    """Make the law that the core has looked at."""
    kp = settings["kp"]
    ti = kp * dt / settings["ki"] if "ki" in settings else math.inf
    td = settings.get("kd", 0.0) * dt / kp
    if law == "lead-lag":
        return LeadLag(kp=sign * kp, lead=settings["lead_time"], lag=settings["lag_time"])
    if law in SLIDING:
        switching = settings["switching"]
        sliding = SlidingMode(switching=switching, layer=switching / kp, ti=ti, td=td, tf=dt)
        if law == "sliding mode":
            return sliding
        return PerturbationEstimator(
            sliding=sliding,
            plant_gain=nominal.gain,
            plant_time=nominal.time,
            cutoff=settings["observer"],
        )
    tt = max(math.sqrt(ti * td), dt) if math.isfinite(ti) else None
    pid = Pid(kp=sign * kp, ti=ti, td=td, tt=tt)
    if law == "disturbance observer":
        return DisturbanceObserver(
            pid=pid, plant_gain=nominal.gain, plant_time=nominal.time, cutoff=settings["observer"]
        )
    return pid
