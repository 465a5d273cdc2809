"""Stages whose records are made, and the calls that identify them.

Of least squares a call has the structure of its stage: thresholds, creep and dynamics; a drift is
one that the record shows, but for creep, with which it could be confused. Of a search
the stiffness is given, for the scale of the forces. The searches of LuGre and parallel Dahl get
what a user may know: bounds of half to twice each value of the hysteresis; that of LuGre has few
descents.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

import piezotrack as pt

THRESHOLDS, WEIGHTS = (5.0, 15.0, 30.0), (0.1e-6, 0.08e-6, 0.06e-6)
STIFFNESS = 1e6
FORCES: dict[str, Any] = {
    "mass": 0.01,
    "damping": 1e3,
    "stiffness": STIFFNESS,
    "piezo_coefficient": 1.0,
}
CREEP: dict[str, Any] = {"creep_weights": (0.02, 0.02), "creep_times": (0.07, 0.7)}
SECONDS = 8.0


def nested(seconds: float, dt: float, rate: float = 1.0, times: int = 1) -> np.ndarray:
    """Sines of falling amplitude [V], so many times."""
    t = np.arange(0.0, seconds, dt) % (seconds / times) * times / seconds
    return 40.0 + 38.0 * (1.0 - t) * np.sin(2.0 * np.pi * rate * seconds / times * t)


def chirp(seconds: float, dt: float, last: float, size: float = 3.0, times: int = 1) -> np.ndarray:
    """Nested sines with a sine up to a frequency [Hz] on top [V], so many times."""
    block = seconds / times
    t = np.arange(0.0, seconds, dt) % block
    return nested(seconds, dt, float(times), times) + size * np.sin(np.pi * last / block * t**2)


@dataclass(frozen=True)
class Case:
    """A stage, its drive, and the call that identifies it.

    `fitted`: the stage is the model that the call fits to a record of `stage` without noise, whose
    values depend on the record, as levels and envelopes do. `last` is the frequency of a chirp on
    the drive. `foreign`: the stage has other values than the model. `irregular`: intervals are not
    those of the cell's goal, as the fit ends on a bound.
    """

    model: str
    stage: Any
    options: dict[str, Any] = field(default_factory=dict)
    dt: float = 4e-3
    noise: float = 50e-9
    last: float = 0.0
    fitted: bool = False
    foreign: bool = False
    irregular: bool = False

    def drive(self, times: int = 1) -> np.ndarray:
        """Drive [V], of so many equal parts."""
        if self.last:
            return chirp(SECONDS, self.dt, self.last, times=times)
        return nested(SECONDS, self.dt, float(times), times)

    def truth(self, drive: np.ndarray) -> Any:
        """The stage whose records are made."""
        if not self.fitted:
            return self.stage
        return self.fit(drive, motion(self.stage, drive, self.dt)).model

    def fit(self, drive: np.ndarray, y: np.ndarray) -> Any:
        """Identify the stage from a record."""
        log = pt.Dataset(u=drive, y=y, dt=self.dt)
        return pt.identify(log, self.model, history="virgin", progress=False, **self.options)


def motion(stage: Any, drive: np.ndarray, dt: float) -> np.ndarray:
    """Displacement of a stage that is in equilibrium at the first sample [m]."""
    return np.asarray(stage.simulate(drive, dt, initial=stage.equilibrium(float(drive[0]))).x)


def with_creep(stage: Any) -> Any:
    """A stage that creeps by 4 %."""
    return replace(stage, **CREEP)


def squares(**structure: Any) -> dict[str, Any]:
    """Options of a fit by least squares, of which a structure is given."""
    known: dict[str, Any] = {
        "thresholds": THRESHOLDS,
        "creep": False,
        "dynamics": None,
        "dead_zones": 0,
    } | structure
    return {"method": pt.LeastSquares(**known)}


def held(*near: str, stage: Any = None, **more: Any) -> dict[str, Any]:
    """Options of a search: the stiffness, and bounds of half to twice each value."""
    bounds = {name: (0.5 * getattr(stage, name), 2.0 * getattr(stage, name)) for name in near}
    return {"parameters": {"stiffness": STIFFNESS, **bounds, **more}}


def plays(**more: Any) -> Any:
    """A stage of three plays."""
    return pt.PrandtlIshlinskiiStage(linear=0.8e-6, thresholds=THRESHOLDS, weights=WEIGHTS, **more)


def squared() -> dict[str, Case]:
    """Cases of least squares."""
    shape: dict[str, Any] = {"thresholds": THRESHOLDS, "weights": WEIGHTS}
    ends: dict[str, Any] = {"low": 0.0, "high": 80.0}
    levels = (0.0, 26.0, 52.0, 78.0)
    unstructured = squares(thresholds=None)
    creeping = plays(creep_weights=(0.06, 0.1), creep_times=(0.1, 1.0))
    creep = squares(creep=(0.1, 1.0))
    return {
        "plays": Case("prandtl-ishlinskii", plays(), squares()),
        "plays, lag": Case(
            "prandtl-ishlinskii", plays(time_constant=8e-3), squares(dynamics="first")
        ),
        "plays, mode": Case(
            "prandtl-ishlinskii",
            plays(frequency=30.0, damping_ratio=0.05),
            squares(dynamics="second"),
            dt=2e-3,
            last=60.0,
        ),
        "plays, creep": Case("prandtl-ishlinskii", creeping, creep | {"drift": False}),
        "plays, creep, drift by chance": Case("prandtl-ishlinskii", creeping, creep),
        "Maxwell slip": Case(
            "maxwell-slip",
            pt.MaxwellSlipStage(
                piezo_coefficient=1e-6,
                stiffness_ratios=(0.1, 0.1, 0.1),
                slip_displacements=(5e-6, 15e-6, 30e-6),
            ),
            squares(),
            fitted=True,
        ),
        "generalised plays": Case(
            "generalised-prandtl-ishlinskii",
            pt.GeneralisedPrandtlIshlinskiiStage(
                linear=0.8e-6, **shape, scale=100.0, slope=0.01, shift=0.0, level=0.0
            ),
            squares(),
            fitted=True,
        ),
        "rate-dependent plays": Case(
            "rate-dependent-prandtl-ishlinskii",
            pt.RateDependentPrandtlIshlinskiiStage(linear=0.8e-6, **shape, dilation=0.01),
            squares(),
            last=10.0,
        ),
        "polynomial plays": Case(
            "polynomial-prandtl-ishlinskii",
            pt.PolynomialPrandtlIshlinskiiStage(a1=0.8e-6, a2=2e-9, a3=-1e-11, **ends, **shape),
            squares(),
        ),
        "asymmetric plays": Case(
            "asymmetric-prandtl-ishlinskii",
            pt.AsymmetricPrandtlIshlinskiiStage(
                linear=0.8e-6,
                low=2.0,
                high=78.0,
                **shape,
                concave_thresholds=THRESHOLDS,
                concave_weights=WEIGHTS,
            ),
            squares(),
            fitted=True,
        ),
        "Preisach": Case(
            "preisach",
            pt.PreisachStage(
                linear=0.8e-6, levels=levels, masses=(3e-6, 2e-6, 4e-6, 1e-6, 2e-6, 5e-6)
            ),
            squares(thresholds=None, levels=levels),
            fitted=True,
        ),
        "Duhem": Case(
            "duhem",
            pt.DuhemStage(
                alpha=0.05, f1=1e-6, f2=1e-9, f3=1e-12, g0=0.7e-6, g1=1e-10, g2=1e-12, **ends
            ),
            unstructured,
            fitted=True,
        ),
    }


def searched() -> dict[str, Case]:
    """Cases of a search."""
    first = pt.FirstOrderDahlStage(**FORCES, rest_stiffness=2e5, coulomb_force=5.0)
    parallel = pt.ParallelDahlStage(
        **FORCES,
        rest_stiffness_1=1e5,
        rest_stiffness_2=8e4,
        rest_stiffness_3=6e4,
        yield_path=3e-6,
        path_ratio=4.0,
    )
    dahl = replace(pt.DahlStage.xu_li_2010(), a1=5e3, a2=5e7, b1=1.5e7)
    loop: dict[str, Any] = {"alpha": 0.3, "beta": 0.1, "gamma": 0.05}
    bouc_wen: dict[str, Any] = {**FORCES, "piezo_coefficient": 1e-6} | loop
    lugre = pt.LuGreStage(
        **FORCES,
        rest_stiffness=2e5,
        micro_damping=2e3,
        coulomb_force=3.0,
        static_ratio=1.5,
        stribeck_velocity=1e-4,
        viscous_friction=0.0,
    )
    strands = ("rest_stiffness_1", "rest_stiffness_2", "rest_stiffness_3")
    bristles = ("rest_stiffness", "micro_damping", "coulomb_force", "static_ratio")
    few = pt.Descents(samples=4, starts=4, rounds=1)
    known = held(*bristles, "stribeck_velocity", stage=lugre, viscous_friction=0.0)
    paper = pt.DahlStage.xu_li_2010()
    forces = held(stiffness=paper.stiffness, mass=paper.mass)
    return {
        "Dahl": Case("dahl", dahl, held(stiffness=dahl.stiffness, mass=dahl.mass)),
        "Dahl, mass not shown": Case("dahl", dahl, held(stiffness=dahl.stiffness)),
        "Dahl, a2 not shown": Case("dahl", replace(paper, a2=8e6), forces),
        "Dahl of the paper": Case("dahl", paper, forces, irregular=True),
        "first-order Dahl": Case("first-order-dahl", first, held()),
        "parallel Dahl": Case(
            "parallel-dahl", parallel, held(*strands, "yield_path", "path_ratio", stage=parallel)
        ),
        "Bouc-Wen": Case("bouc-wen", pt.BoucWenStage(**bouc_wen), held()),
        "Bouc-Wen, exponent 2": Case(
            "bouc-wen",
            pt.BoucWenStage(**{**bouc_wen, "beta": 1.5e4, "gamma": 7e3}, exponent=2.0),
            held(),
        ),
        "asymmetric Bouc-Wen": Case(
            "asymmetric-bouc-wen",
            pt.AsymmetricBoucWenStage(**bouc_wen, asymmetry=0.002, sign_asymmetry=0.0),
            held(),
        ),
        "LuGre": Case("lugre", lugre, {**known, "method": few}, last=20.0),
        "oscillator": oscillator(),
    }


def oscillator() -> Case:
    """The oscillator of the benchmark, driven by a force that is slow and fast."""
    stage = pt.BoucWenOscillator.benchmark()
    options = {"parameters": {"beta": stage.beta}}
    return Case("bouc-wen-oscillator", stage, options, dt=1e-3, noise=5e-6, last=60.0)


def foreign() -> dict[str, Case]:
    """Cases whose stage is of another kind than the model."""
    stage = plays(**CREEP, frequency=60.0, damping_ratio=0.05)
    return {
        "Dahl of plays, creep, mode": Case("dahl", stage, held(), dt=2e-3, foreign=True),
        "plays of Bouc-Wen, creep": Case(
            "prandtl-ishlinskii",
            with_creep(searched()["Bouc-Wen"].stage),
            squares(),
            foreign=True,
        ),
    }


CASES: dict[str, Case] = squared() | searched() | foreign()
