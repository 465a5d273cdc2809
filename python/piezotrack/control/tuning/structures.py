"""Feedback laws whose gains are sought: their settings, and the law of some settings."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from ..parts.part import part_class

if TYPE_CHECKING:
    from collections.abc import Mapping

    from ... import _core
    from ..laws.pid import Pid
    from ..parts.part import FeedbackLaw

__all__ = [
    "SOUGHT",
    "Gains",
    "LawName",
    "Nominal",
    "damps",
    "gains_of",
    "law_of",
    "law_ranges",
    "nominal_of",
]

# Largest share of a part of a PID law that vanishes.
VANISHING = 0.01

LawName = Literal[
    "pid",
    "pi",
    "pd",
    "lead-lag",
    "sliding-mode",
    "disturbance-observer",
    "perturbation-estimator",
    "integral-resonant",
    "positive-position",
    "positive-velocity-position",
]
# The settings of each law that are sought; PI and PD laws are a PID without the other gain.
SOUGHT = {
    "pid": ("kp", "ki", "kd"),
    "pi": ("kp", "ki"),
    "pd": ("kp", "kd"),
    "lead-lag": ("static", "lead_time", "lag_time"),
    "sliding-mode": ("kp", "ki", "kd", "switching"),
    "disturbance-observer": ("kp", "ki", "kd", "observer"),
    "perturbation-estimator": ("kp", "ki", "kd", "switching", "observer"),
    "integral-resonant": ("kp", "ki", "damping", "damping_frequency"),
    "positive-position": ("kp", "ki", "damping", "damping_frequency", "damping_ratio"),
    "positive-velocity-position": (
        "kp",
        "ki",
        "damping_velocity",
        "damping_either",
        "damping_frequency",
        "damping_ratio",
    ),
}


class Nominal(NamedTuple):
    """The plant that an observer expects: static gain [m/V] and time constant [s]."""

    gain: float
    time: float


class Gains(NamedTuple):
    """Gains of a PID law without the parts that vanish, and without times below an interval.

    Attributes
    ----------
    name : str
        Its parts, as ``"PI"``.
    kp, ti, ki, td, kd : float or None
        Proportional gain [V/m], integral time [s] and gain [V/(m s)], derivative time [s] and gain
        [V s/m]; None where there is none. A law without a proportional gain has no times.
    """

    name: str
    kp: float | None
    ti: float | None
    ki: float | None
    td: float | None
    kd: float | None


def gains_of(pid: Pid, dt: float) -> Gains:
    """Return the gains of a PID law sampled every `dt` seconds, as they are entered.

    With ``q = 1 - 1/z`` the law is ``(p q + i + d q^2) / q``, of the gains a sample ``p = Kp``,
    ``i = Kp Ts/Ti`` and ``d = Kp Td/Ts``. The proportional part vanishes where at no frequency, at
    which ``|q|`` is 0 to 2, it makes 1 % of the sum of the others; the derivative part likewise.

    Examples
    --------
    >>> import piezotrack as pt
    >>> from piezotrack.control.tuning.structures import gains_of
    >>> gains = gains_of(pt.Pid(kp=10.0, ti=1e-6), 1e-3)
    >>> gains.name, gains.kp, f"{gains.ki:.4g}"
    ('I', None, '1e+07')
    """
    kp, ki, kd = pid.kp, pid.kp / pid.ti, pid.kp * pid.td
    p, i, d = abs(kp), abs(ki) * dt, abs(kd) / dt
    # Where |q| is `least`, the sum of the others in units of p |q| is smallest.
    least = min(math.sqrt(i / d), 2.0) if d > 0.0 else 2.0
    if i > 0.0 and p < VANISHING * (i / least + d * least):
        has_p, has_d = False, 4.0 * d >= VANISHING * i
    else:
        has_p, has_d = True, 4.0 * d >= VANISHING * (2.0 * p + i)
    letters = zip("PID", (has_p, ki != 0.0, has_d), strict=True)
    return Gains(
        name="".join(letter for letter, present in letters if present),
        kp=kp if has_p else None,
        ti=pid.ti if has_p and dt <= pid.ti < math.inf else None,
        ki=ki if ki != 0.0 else None,
        td=pid.td if has_p and has_d else None,
        kd=kd if has_d else None,
    )


def damps(law: str) -> bool:
    """Whether a law has a filter that damps."""
    return "damping_frequency" in SOUGHT[law]


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
    ranges = {
        "kp": ("kp", least, 10.0 / largest, True),
        "ki": ("ki", 1e-4 / largest, 3.0 / largest, True),
        "kd": ("kd", 1e-4 / largest, 100.0 / largest, True),
        # The static gain of a lead-lag law is all that stands for an integral part.
        "static": ("kp", least, 1e4 / largest, True),
        "lead_time": ("lead_time", 0.1 * dt, 1e6 * dt, True),
        "lag_time": ("lag_time", 0.1 * dt, 1e6 * dt, True),
        "switching": ("switching", 1e-3 * span, 0.3 * span, True),
        # At the lower end it is not there.
        "observer": ("observer", 1e-7 / dt, 0.45 / dt, True),
        # The static gain of a damping filter, up to a tenth below that at which it is unstable by
        # itself; almost none at the lower end.
        "damping": ("damping", 1e-4 / largest, 0.9 / largest, False),
        "damping_either": ("damping", -0.9 / largest, 0.9 / largest, False),
        "damping_velocity": ("damping_velocity", -10.0 / largest, 10.0 / largest, False),
        "damping_frequency": ("damping_frequency", 1e-3 / dt, 1.0 / dt, True),
        "damping_ratio": ("damping_ratio", 0.05, 5.0, True),
    }
    return [ranges[name] for name in SOUGHT[law]]


def law_of(
    law: str, settings: Mapping[str, float], dt: float, sign: float, nominal: Nominal
) -> FeedbackLaw:
    """Make the law that the core has evaluated."""
    kp = settings["kp"]
    ti = kp * dt / settings["ki"] if "ki" in settings else math.inf
    td = settings.get("kd", 0.0) * dt / kp
    values = {
        "kp": sign * kp,
        "ti": ti,
        "td": td,
        "tt": max(math.sqrt(ti * td), dt) if math.isfinite(ti) else None,
        "tf": dt,
        "plant_gain": nominal.gain,
        "plant_time": nominal.time,
    }
    if "lead_time" in settings:
        values |= {"lead": settings["lead_time"], "lag": settings["lag_time"]}
    if "switching" in settings:
        values |= {"switching": settings["switching"], "layer": settings["switching"] / kp}
    if "observer" in settings:
        values["cutoff"] = settings["observer"]
    if "damping" in settings:
        values |= _damping(law, settings, sign)
    made: FeedbackLaw = _made("pid" if law in ("pi", "pd") else law, values)
    return made


def _damping(law: str, settings: Mapping[str, float], sign: float) -> dict[str, float]:
    """Return the numbers of a damping filter."""
    gain, frequency = sign * settings["damping"], settings["damping_frequency"]
    if law == "integral-resonant":
        return {"gain": gain * 2.0 * math.pi * frequency, "feedthrough": 1.0 / gain}
    return {
        "gain": gain,
        "position_gain": gain,
        "velocity_gain": sign * settings.get("damping_velocity", 0.0),
        "frequency": frequency,
        "damping_ratio": settings["damping_ratio"],
    }


def _made(name: str, values: Mapping[str, Any]) -> Any:
    """Make a part, and those in it, of all values that are numbers of it."""
    made = part_class(name)
    inside = {one.name: one.choices[0] for one in made.info.numbers if one.form == "part"}
    given = {one.name: values[one.name] for one in made.info.numbers if one.name in values}
    return made(**given, **{place: _made(part, values) for place, part in inside.items()})
