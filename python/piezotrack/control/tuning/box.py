"""Settings that a search for gains may change, and their ranges."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..._support.messages import quoted
from ..._support.units import shown_unit
from ...errors import ParameterError
from ..parts.filters import LowPass, Notch
from ..parts.repetitive import Repetitive, ZeroPhase
from .structures import SOUGHT, Nominal, gains_of, law_of, law_ranges, nominal_of

if TYPE_CHECKING:
    from ... import _core
    from ..parts.part import FeedbackLaw

__all__ = ["PARTS", "Box", "Parts", "box_of", "parts_named", "resonance"]

PARTS = ("pid", "low-pass", "notch", "repetitive")
# Beyond this damping ratio a mode does not ring.
RINGING = 0.4
# A low-pass with a cutoff above so many sampling rates is left out, as in the core.
FASTEST = 2.0
# A sampled filter has no room nearer to half the sampling rate.
NYQUIST = 0.475


class Parts(NamedTuple):
    """The parts of a controller with their settings."""

    feedback: FeedbackLaw
    filters: tuple[LowPass | Notch, ...]
    repetitive: Repetitive | None


class Box(NamedTuple):
    """Ranges: name, lower and upper end, whether on a logarithmic scale."""

    ranges: list[tuple[str, float, float, bool]]
    dt: float
    period: float | None
    sign: float
    law: str
    nominal: Nominal

    def parts(self, settings: dict[str, float]) -> Parts:
        """Make the parts of a controller from the settings that were found."""
        law = law_of(self.law, settings, self.dt, self.sign, self.nominal)
        filters: list[LowPass | Notch] = []
        if settings.get("cutoff", math.inf) * self.dt <= FASTEST:
            filters.append(LowPass(settings["cutoff"]))
        if "notch_frequency" in settings:
            names = ("notch_frequency", "notch_width", "notch_depth")
            filters.append(Notch(*(settings[name] for name in names)))
        repetitive = None
        if self.period is not None:
            order = _whole(settings["order"])
            repetitive = Repetitive(
                period=self.period,
                kq=1e6 * settings["kq"],
                smoothing=ZeroPhase(order=order) if order else None,
                lead=_whole(settings["lead"]),
                forgetting_factor=settings["forgetting_factor"],
            )
        return Parts(law, tuple(filters), repetitive)

    def cutoffs_beside(self, settings: dict[str, float]) -> tuple[float, float] | None:
        """Range of cutoffs for one above half the sampling rate [Hz]; None where it is not.

        What is nearer: below that, or where the low-pass is left out.
        """
        share = settings.get("cutoff", 0.0) * self.dt
        if not 0.5 < share <= FASTEST:
            return None
        low, high = next((low, high) for name, low, high, _ in self.ranges if name == "cutoff")
        left_out = share * share > 0.5 * FASTEST
        return (1.01 * FASTEST / self.dt, high) if left_out else (low, NYQUIST / self.dt)

    def edges(self, settings: dict[str, float], drive_unit: str) -> list[str]:
        """Name the settings that are at an end of their range, with the drive's unit of a gain."""
        notes = []
        law = self.parts(settings).feedback
        absent = ["kd", "order", "lead", "notch_depth", "damping"]
        if law._pid is not None and gains_of(law._pid, self.dt).kp is None:
            absent.append("kp")
        for name, low, high, logarithmic in self.ranges:
            ends = (math.log(low), math.log(high)) if logarithmic else (low, high)
            value = math.log(settings[name]) if logarithmic else settings[name]
            place = (value - ends[0]) / (ends[1] - ends[0])
            if place > 0.999 and name != "cutoff":
                notes.append(
                    f"{name} at the upper end of its range, {self._shown(name, high, drive_unit)}"
                )
            elif place < 0.001 and name not in absent:
                notes.append(
                    f"{name} at the lower end of its range, {self._shown(name, low, drive_unit)}"
                )
        return notes

    def _shown(self, name: str, value: float, drive_unit: str) -> str:
        """Write a setting with its unit; gains a sample as gains."""
        unit, scale = shown_unit(drive_unit)
        shown = {
            "kp": (1e-6 * scale, f"{unit}/um"),
            "ki": (1e-6 * scale / self.dt, f"{unit}/(um s)"),
            "kd": (1e-6 * scale * self.dt, f"{unit} s/um"),
            "lead_time": (1e3, "ms"),
            "lag_time": (1e3, "ms"),
            "switching": (scale, unit),
            "observer": (1.0, "Hz"),
            "damping": (1e-6 * scale, f"{unit}/um"),
            "damping_velocity": (1e-6 * scale, f"{unit}/um"),
            "damping_frequency": (1.0, "Hz"),
            "cutoff": (1.0, "Hz"),
            "notch_frequency": (1.0, "Hz"),
            "kq": (scale, f"{unit}/um"),
        }
        factor, text = shown.get(name, (1.0, ""))
        return f"{factor * value:.4g} {text}".rstrip()


def _whole(value: float) -> int:
    # As the core rounds: halves away from 0.
    return math.floor(value + 0.5)


def parts_named(parts: object) -> tuple[str, ...] | None:
    """Check the names of parts."""
    if parts is None:
        return None
    named = (parts,) if isinstance(parts, str) else parts
    if not isinstance(named, Sequence) or any(one not in PARTS for one in named):
        raise ParameterError("parts", quoted(parts), f"some of {', '.join(map(repr, PARTS))}")
    return ("pid", *(one for one in PARTS[1:] if one in named))


def resonance(plants: Sequence[_core.LoopPlant], dt: float) -> tuple[float, float] | None:
    """Lowest and highest frequency [Hz] of the modes that ring below half the sampling rate."""
    frequencies = []
    for plant in plants:
        a, b, *_ = plant.matrices()
        for root in np.linalg.eigvals(np.reshape(a, (len(b), len(b)))) if b else ():
            size = abs(root)
            if root.imag > 0.0 and -root.real < RINGING * size:
                frequencies.append(size / (2.0 * math.pi))
    frequencies = [one for one in frequencies if one * dt < NYQUIST]
    return (min(frequencies), max(frequencies)) if frequencies else None


def box_of(
    parts: Sequence[str],
    plants: Sequence[_core.LoopPlant],
    dt: float,
    period: float | None,
    limits: tuple[float, float],
    law: str = "pid",
    lag: float = 0.0,
) -> Box:
    """Set the ranges for plants sampled every `dt` seconds, of axes with a `lag` [s]."""
    gains = [plant.static_gain for plant in plants]
    largest = max((abs(gain) for gain in gains if math.isfinite(gain)), default=0.0)
    if largest == 0.0 or min(gains) * max(gains) <= 0.0:
        raise ParameterError(
            "models",
            f"static gains of {min(gains):.4g} to {max(gains):.4g} m/V",
            "finite ones, all of one sign",
            verb="have",
        )
    sign = math.copysign(1.0, gains[0])
    if sign < 0.0 and "switching" in SOUGHT[law]:
        raise ParameterError(
            "law", f"{law!r}, but the stage falls as the voltage rises", "one that rises"
        )
    ranges = law_ranges(law, largest, dt, limits)
    if "low-pass" in parts:
        # An axis whose reading is late moves ahead: so it can make up for its lag.
        slow = min(0.02 / dt, 0.06 / lag) if lag > 0.0 else 0.02 / dt
        ranges.append(("cutoff", slow, 1.25 * FASTEST / dt, True))
    if "notch" in parts:
        ranges += _notch(plants, dt)
    if "repetitive" in parts:
        if period is None:
            raise ParameterError("parts", "'repetitive'", "references that repeat", verb="has")
        if sign < 0.0:
            raise ParameterError(
                "parts",
                "'repetitive', but the stage falls as the voltage rises",
                "one that rises, for its learning gain is above 0",
                verb="has",
            )
        longest = min(24.0, math.floor(period / dt / 4.0))
        ranges += [
            ("kq", 0.005, min(1.99, 2e-6 / largest), True),
            ("order", -0.49, 4.49, False),
            ("lead", -0.49, longest + 0.49, False),
            ("forgetting_factor", 0.9, 1.0, False),
        ]
    nominal = nominal_of(plants[len(plants) // 2])
    return Box(ranges, dt, period if "repetitive" in parts else None, sign, law, nominal)


def _notch(plants: Sequence[_core.LoopPlant], dt: float) -> list[tuple[str, float, float, bool]]:
    modes = resonance(plants, dt)
    if modes is None:
        raise ParameterError(
            "parts",
            "'notch'",
            f"a mode that rings below half the sampling rate, {0.5 / dt:.4g} Hz",
            verb="has",
        )
    low, high = 0.7 * modes[0], min(1.3 * modes[1], NYQUIST / dt)
    return [
        ("notch_frequency", low, high, True),
        ("notch_width", 0.02, 2.0, True),
        ("notch_depth", 0.0, 1.0, False),
    ]
