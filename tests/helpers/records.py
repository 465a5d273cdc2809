"""Records to identify: noisy ones that SciPy alone has simulated, and a small quick one."""

from __future__ import annotations

from dataclasses import asdict, replace
from functools import cache
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from scipy.integrate import solve_ivp

import piezotrack as pt
from reference import DahlParameters

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

TABLE_1 = DahlParameters()
# What the paper holds, and the box that it searches: section 3.3, SI.
HELD = {"a1": TABLE_1.a1, "a2": TABLE_1.a2, "b1": TABLE_1.b1}
BOX = {
    "mass": (0.1, 0.2),
    "damping": (1000.0, 5000.0),
    "stiffness": (1e4, 5e4),
    "piezo_coefficient": (0.01, 0.1),
}
NOISE = 0.1e-6


def slow_sine(t: Any) -> Any:
    """The paper's drive: 0.25 Hz between 0 and 75 V."""
    return 37.5 - 37.5 * np.cos(0.5 * np.pi * t)


def two_tones(t: Any) -> Any:
    """0.25 Hz and 1 Hz together, with small loops inside the large one."""
    return 37.5 - 25.0 * np.cos(0.5 * np.pi * t) - 12.5 * np.cos(2.0 * np.pi * t)


DRIVES: dict[str, Callable[[Any], Any]] = {"slow sine": slow_sine, "two tones": two_tones}


@cache
def displacement(drive: str, method: Literal["LSODA", "Radau"] = "LSODA") -> Array:
    """Table 1 under a drive, 4 s at 5 kHz, by a stiff solver of SciPy [m]."""
    p, u = TABLE_1, DRIVES[drive]

    def rhs(t: float, y: Array) -> list[float]:
        x, v, q1, q2 = y.tolist()
        force = p.piezo_coefficient * float(u(t)) - p.b1 * q1
        friction = np.sign(v) * p.a1 * q2
        return [
            v,
            (force - p.damping * v - p.stiffness * x) / p.mass,
            q2 * v,
            (p.up - p.a2 * q1 - friction) * v,
        ]

    solution = solve_ivp(
        rhs,
        (0.0, 4.0),
        [0.0, 0.0, 0.0, 0.0],
        method=method,
        t_eval=np.arange(20001) / 5000.0,
        rtol=1e-9,
        atol=[1e-14, 1e-13, 1e-16, 1e-11],
        # A fiftieth of the shortest period.
        max_step=0.02,
    )
    if not solution.success:
        raise ArithmeticError(solution.message)
    x: Array = solution.y[0]
    return x


@cache
def noisy(drive: str) -> pt.Dataset:
    """The displacement with 0.1 um of noise from a sensor."""
    x = displacement(drive)
    noise = np.random.default_rng(2010).normal(0.0, NOISE, x.size)
    return pt.Dataset(u=DRIVES[drive](np.arange(x.size) / 5000.0), y=x + noise, dt=1 / 5000.0)


@cache
def quick(seed: int = 0) -> pt.Dataset:
    """The slow sine at 250 Hz, by the core itself: for tests of everything but the physics."""
    t = np.arange(1001) / 250.0
    u = slow_sine(t)
    x = pt.DahlStage.xu_li_2010().simulate(u, 1 / 250.0).x
    noise = np.random.default_rng(seed).normal(0.0, NOISE, t.size)
    return pt.Dataset(u=u, y=x + noise, dt=1 / 250.0, source="quick.csv")


QUICK = pt.ParticleSwarm(particles=12, iterations=30)


def of_relays(
    seed: int,
    *,
    intervals: int = 6,
    mass: float = 0.2e-6,
    damping_ratio: float = 0.1,
    steps: int = 24,
    share: float = 1e-3,
) -> tuple[pt.Dataset, float]:
    """Steps of a stage of relays with a mode, and its noise [m]: a share of the stroke."""
    random = np.random.default_rng(seed)
    stage = pt.PreisachStage(
        linear=0.05e-6,
        levels=tuple(np.linspace(-100.0, 100.0, intervals + 1)),
        masses=tuple(mass * random.uniform(size=intervals * (intervals + 1) // 2) ** 2),
        frequency=120.0,
        damping_ratio=damping_ratio,
    )
    u = np.repeat(random.uniform(-100.0, 100.0, steps), 60)
    x = stage.simulate(u, 1e-3, hold="zoh").x
    noise = share * float(np.ptp(x))
    return pt.Dataset(u=u, y=x + noise * random.normal(size=u.size), dt=1e-3, hold="zoh"), noise


def entries(
    *,
    fixed: Mapping[str, Any] | None = None,
    bounds: Mapping[str, Any] | None = None,
    scales: Mapping[str, Any] | None = None,
    ties: Mapping[str, Any] | None = None,
    priors: Mapping[str, Any] | None = None,
) -> dict[str, pt.Parameter]:
    """Parameters of which one or several things are said, each in a mapping of its own."""
    values_of: dict[str, dict[str, Any]] = {}
    for what, mapping in (
        ("prior", priors),
        ("value", fixed),
        ("bounds", bounds),
        ("scale", scales),
        ("tie", ties),
    ):
        for name, value in (mapping or {}).items():
            values_of.setdefault(name, {})[what] = value
    return {name: pt.Parameter(**values) for name, values in values_of.items()}


def quick_fit(
    data: pt.Dataset | None = None,
    *,
    fixed: Mapping[str, Any] = HELD,
    bounds: Mapping[str, Any] = BOX,
    swarm: pt.ParticleSwarm | None = QUICK,
    seed: int = 1,
    runs: int | None = None,
    **arguments: Any,
) -> pt.identification.Identification:
    """Search the paper's box on the quick record with a small swarm; by descents without one."""
    given = {name: arguments.pop(name, None) for name in ("scales", "ties", "priors")}
    return pt.identify(
        quick() if data is None else data,
        arguments.pop("model", "dahl"),
        # As it was made: what came before is not what these searches are about.
        history=arguments.pop("history", "virgin"),
        parameters=entries(fixed=fixed, bounds=bounds, **given),
        method=pt.Descents(seed=seed, runs=runs or 1)
        if swarm is None
        else replace(swarm, seed=seed, runs=runs),
        **arguments,
    )


def search_of(fit: pt.identification.Identification) -> pt.identification.SearchRun:
    """The course of the search, which there has to be."""
    assert fit.search is not None
    return fit.search


def selection_of(fit: pt.identification.Identification) -> pt.identification.Selection:
    """The choice between models, which there has to be."""
    assert fit.selection is not None
    return fit.selection


def bits(fit: pt.identification.Identification) -> dict[str, Any]:
    """All numbers of a result, down to the last bit."""
    search = search_of(fit)
    return {
        "model": [
            one.hex()
            for value in asdict(fit.model).values()
            for one in (value if isinstance(value, tuple) else (value,))
        ],
        "cost": fit.cost.hex(),
        "offset": fit.offset.hex(),
        "history": search.history.tobytes(),
        "parameters": repr(dict(fit.parameters)),
        "counts": (
            search.nit,
            fit.nfev,
            search.nfail,
            search.npolish,
            search.substeps,
            fit.stop_reason,
        ),
    }


def published(**changes: Any) -> pt.identification.IdentifiedModel:
    """The published stage as an identified model."""
    content: dict[str, Any] = {
        "model": pt.DahlStage.xu_li_2010(),
        "offset": 1e-6,
        "offset_fitted": True,
        "scale_assumed": False,
        "stroke": 119e-6,
    }
    return pt.identification.IdentifiedModel(**(content | changes))
