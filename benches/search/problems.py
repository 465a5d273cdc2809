"""The six problems on which methods of search are compared."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

import piezotrack as pt
from piezotrack.xu_li_2010.experiments.procedure import SEARCH_BOX

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Array = NDArray[np.float64]


@dataclass(frozen=True)
class Problem:
    """A record, a kind of stage, and what is searched.

    Attributes
    ----------
    title : str
        In table and picture.
    record : callable
        Makes the record.
    model : str
        Kind of stage.
    arguments : dict
        Of `piezotrack.identify`.
    """

    title: str
    record: Callable[[], pt.Dataset]
    model: str
    arguments: dict[str, Any] = field(default_factory=dict)


def plays(u: Array, widths: Array) -> Array:
    """Sum of play operators, one a width: hysteresis that Dahl's operator only approximates."""
    total = np.zeros(u.size)
    for width in widths:
        place = 0.0
        for i, v in enumerate(u):
            place = min(max(place, v - width), v + width)
            total[i] += place
    return total


def paper() -> pt.Dataset:
    """4 s of Table 1 under the paper's drive, with the published noise and steps of the sensor."""
    t = np.arange(60001) / 5000.0
    u = 37.5 * (1.0 - np.cos(2.0 * np.pi * 0.25 * t))
    x = pt.DahlStage.xu_li_2010().simulate(u, 1 / 5000.0).x
    noisy = x + np.random.default_rng(1).normal(0.0, 0.097e-6, t.size)
    step = 2.5e-3 / 2**16
    return pt.Dataset(u=u, y=step * np.round(noisy / step), dt=1 / 5000.0)[:4.0]


def measured() -> pt.Dataset:
    """20 s of the measured log of the package."""
    return pt.datasets.dbo_training()[3.0:23.0]


def swelling() -> pt.Dataset:
    """1 Hz, 200 samples a second, swelling from 1 to 5 V and back in 10 s: loops of many sizes."""
    t = np.arange(4601) / 200.0
    u = 5.0 * np.sin(2.0 * np.pi * t) * (0.6 + 0.4 * np.cos(0.2 * np.pi * t))
    x = 0.9e-6 * u + 0.03e-6 * plays(u, np.linspace(0.3, 3.0, 10))
    noise = np.random.default_rng(1).normal(0.0, 5e-9, t.size)
    return pt.Dataset(u=u, y=x + noise, dt=1 / 200.0)[3.0:]


def late() -> pt.Dataset:
    """Dry friction, read 7 ms late: 1 and 7 Hz at 1 kHz, 5 nm of noise."""
    t = np.arange(4001) / 1000.0
    u = 40.0 - 25.0 * np.cos(2 * np.pi * t) - 12.0 * np.cos(14 * np.pi * t)
    stage = pt.FirstOrderDahlStage(
        mass=0.1828,
        damping=50.0,
        stiffness=26065.0,
        piezo_coefficient=0.0468,
        rest_stiffness=2e4,
        coulomb_force=0.3,
    )
    x = np.interp(t - 7e-3, t, stage.simulate(u, 1e-3).x)
    noise = np.random.default_rng(1).normal(0.0, 5e-9, t.size)
    return pt.Dataset(u=u, y=x + noise, dt=1e-3)[1.0:]


def oscillator() -> pt.Dataset:
    """8192 samples of the oscillator's benchmark, with 7 um of noise."""
    dt, count = 1 / 750.0, 8192
    random = np.random.default_rng(1)
    t = np.arange(count) * dt
    lines = np.arange(5.0, 150.0, 0.5)
    phases = random.uniform(0.0, 2 * np.pi, lines.size)
    u = np.sin(2 * np.pi * np.outer(t, lines) + phases).sum(axis=1)
    u *= 50.0 / u.std()
    x = pt.BoucWenOscillator.benchmark().simulate(u, dt).x
    return pt.Dataset(u=u, y=x + random.normal(0.0, 7e-6, count), dt=dt, drive_unit="N")


_STAGE = pt.DahlStage.xu_li_2010()
_HELD = {"a1": _STAGE.a1, "a2": _STAGE.a2, "b1": _STAGE.b1}

PROBLEMS = {
    "paper": Problem(
        "Dahl, the paper's four parameters",
        paper,
        "dahl",
        {"parameters": {**SEARCH_BOX, **_HELD}, "offset": False},
    ),
    "measured": Problem("Dahl, all, measured log", measured, "dahl"),
    "swelling": Problem("Dahl, all, swelling sine on plays", swelling, "dahl"),
    "late": Problem("dry friction and delay", late, "first-order-dahl", {"delay": True}),
    "bouc-wen": Problem("Bouc-Wen, all, measured log", measured, "bouc-wen"),
    "oscillator": Problem("Bouc-Wen oscillator, benchmark", oscillator, "bouc-wen-oscillator"),
}
