"""Published numbers: name, unit, value or bound, and how each is obtained here."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from .._support.files.json_text import parse_json
from ..identification.experiments.step_readings import StepReadings
from ..stages.feedback.dahl import DahlStage
from .experiments.table_2 import PUBLISHED, Published

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["SI", "Observable", "Obtained", "Use", "gathered", "observables"]

# The units in SI.
SI = {
    "um": 1e-6,
    "um/V": 1e-6,
    "ms": 1e-3,
    "Hz": 1.0,
    "rad": 1.0,
    "%": 0.01,
    "": 1.0,
} | dict.fromkeys(("kg", "N s/m", "N/m", "N/V"), 1.0)
# What a number has to do with the stage's free parameters.
Use = Literal["put in", "calibrated", "left out", "derived"]
# Tolerances: a share of the published value, or a length [m] if that is more.
CALIBRATED, LEFT_OUT = (0.15, 0.04e-6), (0.30, 0.08e-6)


@dataclass(frozen=True, kw_only=True)
class Observable:
    """One published number.

    Attributes
    ----------
    key : str
        Its key in files.
    figure : str
        Figure or table of the paper.
    name : str
        Description.
    unit : str
        Unit for display.
    published : float
        Published value, SI.
    kind : {"value", "about", "bound"}
        ``"about"``: printed as such, or derived; ``"bound"``: the obtained value must be below.
    use : {"put in", "calibrated", "left out", "derived"}
        ``"put in"``: a setting of the stage, or one that its gain follows from;
        ``"calibrated"``: the free parameters were chosen to agree with it; ``"derived"``: follows
        from other published numbers, shown but not counted.
    how : str
        How it is obtained here.
    """

    key: str
    figure: str
    name: str
    unit: str
    published: float
    kind: Literal["value", "about", "bound"]
    use: Use
    how: str

    @property
    def calibrated(self) -> bool:
        """Whether the stage was made to agree with it."""
        return self.use in ("calibrated", "put in")

    @property
    def circle(self) -> bool:
        """Whether it is of a circle: those of 40 um scale from the calibrated ones."""
        return self.key.startswith("circle.")

    @property
    def label(self) -> str:
        """Its use, and whether what was left out is of a circle."""
        return "left out, circle" if self.use == "left out" and self.circle else self.use

    @property
    def slack(self) -> float:
        """Tolerance, SI."""
        share, length = LEFT_OUT if self.use == "left out" else CALIBRATED
        part = share * abs(self.published)
        return max(part, length) if self.unit == "um" else part

    def agrees(self, value: float) -> bool:
        """Whether a value [SI] is within the tolerance."""
        off = value - self.published
        return bool(off <= 0.0 if self.kind == "bound" else abs(off) <= self.slack)


@dataclass(frozen=True, kw_only=True)
class Obtained:
    """A published number and the obtained values, over several seeds of the sensor.

    Attributes
    ----------
    observable : Observable
        The published number.
    values : tuple of float
        One for each seed, SI.
    """

    observable: Observable
    values: tuple[float, ...]

    @property
    def median(self) -> float:
        """Median of the values, SI."""
        return float(np.median(self.values))

    @property
    def quartiles(self) -> tuple[float, float]:
        """Quartiles of the values, SI."""
        low, high = np.quantile(self.values, (0.25, 0.75))
        return float(low), float(high)

    @property
    def ratio(self) -> float:
        """Median divided by the published value."""
        return self.median / self.observable.published

    @property
    def reached(self) -> bool:
        """Whether the median agrees."""
        return self.observable.agrees(self.median)

    def document(self) -> dict[str, Any]:
        """Content of the JSON file, in the unit of the observable."""
        observable, unit = self.observable, SI[self.observable.unit]
        low, high = self.quartiles
        return {
            "key": observable.key,
            "figure": observable.figure,
            "name": observable.name,
            "unit": observable.unit or "1",
            "published": observable.published / unit,
            "kind": observable.kind,
            "calibrated": observable.calibrated,
            "use": observable.use,
            "how": observable.how,
            "median": self.median / unit,
            "quartiles": [low / unit, high / unit],
            "ratio": self.ratio,
            "slack": observable.slack / unit,
            "reached": self.reached,
            "values": [value / unit for value in self.values],
        }


@cache
def observables() -> tuple[Observable, ...]:
    """Return the published numbers, in the order of the paper."""
    name = "published.json"
    document = parse_json(name, files(__package__).joinpath(name).read_bytes())
    read = [
        Observable(**{**entry, "published": entry["published"] * SI[entry["unit"]]})
        for entry in document["observables"]
    ]
    return (*read[:2], *_of_the_step(), *_of_table_1(), *read[2:], *_of_table_2())


def _of_the_step() -> list[Observable]:
    """Fig. 4, from the readings of the step response."""
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
            use="put in" if key == "steady" else "calibrated",
            how=how,
        )
        for key, name, unit, value in rows
    ]


def _of_table_1() -> list[Observable]:
    """Dynamic parameters of Table 1; its mass is only within the bounds of the search."""
    stage = DahlStage.xu_li_2010()
    fitted = "swarm on the first 4 s of Fig. 7a, hysteresis parameters held fixed"
    rows = [
        (
            "mass",
            "mass M",
            "kg",
            stage.mass,
            "not determined by the record: at 0.25 Hz the inertia has no effect",
        ),
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
            use="left out" if key == "mass" else "calibrated",
            how=how,
        )
        for key, name, unit, value, how in rows
    ]


def _of_table_2() -> list[Observable]:
    """Table 2; the row of 40 um was left out of the calibration."""
    return [
        Observable(
            key=f"{case.key}.{key}",
            figure="Table 2",
            name=f"{1e6 * case.radius:g} um, {case.frequency:g} Hz: {name}",
            unit=unit,
            published=value,
            kind="value",
            use=use,
            how=how,
        )
        for case in PUBLISHED
        for key, name, unit, value, use, how in _of_a_circle(case)
    ]


def _of_a_circle(case: Published) -> list[tuple[str, str, str, float, Use, str]]:
    """Key, name, unit, value, use and way of the numbers of a circle."""
    use: Use = "calibrated" if case.radius < 30e-6 else "left out"
    how = "radial error R - r at 50 Hz, two turns after the one with the start"
    ratio = "2.83 for a pure angle between the axes, whose error is a second harmonic"
    return [
        ("max", "peak to peak", "um", case.peak_to_peak, use, how),
        ("mean", "mean", "um", case.mean, use, how),
        ("sd", "SD", "um", case.sd, use, how),
        ("ratio", "peak to peak by SD", "", case.ratio, "derived", ratio),
    ]


def gathered(runs: Sequence[dict[str, float]]) -> tuple[Obtained, ...]:
    """Combine the published numbers with the values of several seeds.

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
