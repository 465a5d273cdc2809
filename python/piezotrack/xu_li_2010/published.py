"""What the paper publishes as numbers: name, unit, value or bound, how it is obtained."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from ..identification.step_readings import StepReadings
from ..stages.dahl import DahlStage
from .table_2 import PUBLISHED

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["SI", "Observable", "Obtained", "gathered", "observables"]

# What one of the unit is in SI.
SI = {
    "um": 1e-6,
    "um/V": 1e-6,
    "ms": 1e-3,
    "Hz": 1.0,
    "rad": 1.0,
    "%": 0.01,
    "": 1.0,
} | dict.fromkeys(("kg", "N s/m", "N/m", "N/V"), 1.0)
# Where agreement ends: a share of the published value, or a length if that is more.
CALIBRATED, LEFT_OUT = (0.15, 0.04e-6), (0.30, 0.08e-6)


@dataclass(frozen=True, kw_only=True)
class Observable:
    """One published number.

    Attributes
    ----------
    key : str
        By which it is found in files.
    figure : str
        Where the paper has it.
    name : str
        In words.
    unit : str
        In which a person reads it.
    published : float
        The number, SI.
    kind : {"value", "about", "bound"}
        ``"about"``: printed as such, or derived; ``"bound"``: what is obtained must be below.
    calibrated : bool
        Whether the stage's free parameters were chosen to agree with it.
    how : str
        How it is obtained here.
    """

    key: str
    figure: str
    name: str
    unit: str
    published: float
    kind: Literal["value", "about", "bound"]
    calibrated: bool
    how: str

    @property
    def slack(self) -> float:
        """How far off still counts as agreement, SI."""
        share, length = CALIBRATED if self.calibrated else LEFT_OUT
        part = share * abs(self.published)
        return max(part, length) if self.unit == "um" else part

    def agrees(self, value: float) -> bool:
        """Tell whether a value reaches the goal, SI."""
        off = value - self.published
        return bool(off <= 0.0 if self.kind == "bound" else abs(off) <= self.slack)


@dataclass(frozen=True, kw_only=True)
class Obtained:
    """A published number and what was obtained, over several seeds of the sensor.

    Attributes
    ----------
    observable : Observable
        What was published.
    values : tuple of float
        One a seed, SI.
    """

    observable: Observable
    values: tuple[float, ...]

    @property
    def median(self) -> float:
        """Middle of the values, SI."""
        return float(np.median(self.values))

    @property
    def quartiles(self) -> tuple[float, float]:
        """Between them lie half of the values, SI."""
        low, high = np.quantile(self.values, (0.25, 0.75))
        return float(low), float(high)

    @property
    def ratio(self) -> float:
        """Median over published."""
        return self.median / self.observable.published

    @property
    def reached(self) -> bool:
        """Whether the median agrees."""
        return self.observable.agrees(self.median)

    def document(self) -> dict[str, Any]:
        """Content of the JSON file, in the unit that the name tells."""
        one, unit = self.observable, SI[self.observable.unit]
        low, high = self.quartiles
        return {
            "key": one.key,
            "figure": one.figure,
            "name": one.name,
            "unit": one.unit or "1",
            "published": one.published / unit,
            "kind": one.kind,
            "calibrated": one.calibrated,
            "how": one.how,
            "median": self.median / unit,
            "quartiles": [low / unit, high / unit],
            "ratio": self.ratio,
            "slack": one.slack / unit,
            "reached": self.reached,
            "values": [value / unit for value in self.values],
        }


@cache
def observables() -> tuple[Observable, ...]:
    """List what is published, in the order of the paper."""
    text = files(__package__).joinpath("published.json").read_text(encoding="utf-8")
    read = [
        Observable(**{**entry, "published": entry["published"] * SI[entry["unit"]]})
        for entry in json.loads(text)["observables"]
    ]
    return (*read[:2], *_of_the_step(), *_of_table_1(), *read[2:], *_of_table_2())


def _of_the_step() -> list[Observable]:
    """Take Fig. 4 from where the step response has it."""
    step = StepReadings.xu_li_2010()
    first, second = step.peaks
    zeta = step._core.mode()[2]
    rows = [
        ("steady", "steady state under 75 V", "um", step.steady_state),
        ("peak_1", "first overshoot peak", "um", first),
        ("peak_2", "second overshoot peak", "um", second),
        ("period", "period of the ringing", "ms", step.period),
        ("frequency", "resonance in the spectrum", "Hz", step.frequency),
        ("zeta", "damping ratio by the gains, (4)", "", zeta),
    ]
    how = "step of 75 V, 5 kHz, 0.3 s"
    return [
        Observable(
            key=f"step.{key}",
            figure="4",
            name=name,
            unit=unit,
            published=value,
            kind="value",
            calibrated=True,
            how=how,
        )
        for key, name, unit, value in rows
    ]


def _of_table_1() -> list[Observable]:
    """Take the dynamic parameters of Table 1; its mass is in the box of the search, and no more."""
    stage = DahlStage.xu_li_2010()
    fitted = "swarm on the first 4 s of Fig. 7a, the hysteresis parameters held"
    rows = [
        ("mass", "mass M", "kg", stage.mass, "the record does not fix it: at 0.25 Hz it is idle"),
        ("damping", "damping D", "N s/m", stage.damping, fitted),
        ("stiffness", "stiffness K", "N/m", stage.stiffness, fitted),
        ("piezo", "piezo coefficient T", "N/V", stage.piezo_coefficient, fitted),
    ]
    return [
        Observable(
            key=f"table_1.{key}",
            figure="Table 1",
            name=name,
            unit=unit,
            published=value,
            kind="value",
            calibrated=key != "mass",
            how=how,
        )
        for key, name, unit, value, how in rows
    ]


def _of_table_2() -> list[Observable]:
    """Take Table 2 from where it is; the row of 40 um was left out of the calibration."""
    return [
        Observable(
            key=f"circle.{1e6 * case.radius:g}um.{case.frequency:g}Hz.{key}",
            figure="Table 2",
            name=f"{1e6 * case.radius:g} um, {case.frequency:g} Hz: {name}",
            unit="um",
            published=value,
            kind="value",
            calibrated=case.radius < 30e-6,
            how="radial error R - r at 50 Hz, two turns after the one with the start",
        )
        for case in PUBLISHED
        for key, name, value in (
            ("max", "peak to peak", case.peak_to_peak),
            ("mean", "mean", case.mean),
            ("sd", "SD", case.sd),
        )
    ]


def gathered(runs: Sequence[dict[str, float]]) -> tuple[Obtained, ...]:
    """Put what several seeds gave beside what is published.

    Parameters
    ----------
    runs : sequence of dict
        For each seed the values by key, SI.

    Returns
    -------
    tuple of Obtained
        In the order of the paper.
    """
    return tuple(
        Obtained(observable=one, values=tuple(run[one.key] for run in runs))
        for one in observables()
    )
