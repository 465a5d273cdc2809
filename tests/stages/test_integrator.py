"""The Dahl stage's integrator against SciPy, closed forms and its own promises."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache
from itertools import product
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import StateSpace, lsim

import piezotrack as pt
from reference import (
    DahlParameters,
    Hold,
    Method,
    dahl_reference,
    multisine,
    sine,
    steps,
    triangle,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

Drive = Literal["sine", "triangle", "multisine", "steps"]

TABLE_1 = DahlParameters()
RATES = (50, 200, 1000, 5000, 50000)
DRIVES: tuple[Drive, ...] = ("sine", "triangle", "multisine", "steps")
HOLDS: tuple[Hold, ...] = ("foh", "zoh")


def stage_of(p: DahlParameters) -> pt.DahlStage:
    return pt.DahlStage(
        mass=p.mass,
        damping=p.damping,
        stiffness=p.stiffness,
        piezo_coefficient=p.piezo_coefficient,
        a1=p.a1,
        a2=p.a2,
        b1=p.b1,
        b0=p.b0,
        up=p.up,
    )


def resonant(frequency: float, zeta: float, *, mass: float = 0.1828) -> DahlParameters:
    """A stage with this natural frequency and damping ratio, 1.6 um/V, and Table 1's hysteresis."""
    wn = 2 * math.pi * frequency
    stiffness = mass * wn**2
    return replace(
        TABLE_1,
        mass=mass,
        damping=2 * zeta * mass * wn,
        stiffness=stiffness,
        piezo_coefficient=1.6e-6 * stiffness,
        b1=TABLE_1.b1 * stiffness / TABLE_1.stiffness,
    )


CORNERS = {
    f"M{m}-D{d:.0f}-K{k:.0e}-T{t}": replace(
        TABLE_1, mass=m, damping=d, stiffness=k, piezo_coefficient=t
    )
    for m, d, k, t in product((0.1, 0.2), (1000.0, 5000.0), (1e4, 5e4), (0.01, 0.1))
}
RESONANT = {
    f"{frequency:.0f}Hz-zeta{zeta}": resonant(frequency, zeta)
    for frequency, zeta in product((60.0, 160.0, 1000.0), (0.02, 0.065, 0.3))
}
STAGES = {**CORNERS, **RESONANT}


@dataclass(frozen=True)
class Case:
    """One stage under one drive."""

    stage: DahlParameters
    drive: Drive
    rate: int
    hold: Hold
    samples: int
    cycles: float = 3.3
    low: float = 0.0
    high: float = 75.0
    phase: float = 0.0

    @property
    def dt(self) -> float:
        return 1.0 / self.rate

    @property
    def u(self) -> NDArray[np.float64]:
        n = self.samples
        if self.drive == "steps":
            return steps(n, max(1, round(n / (2 * self.cycles))))
        signal = {"sine": sine, "triangle": triangle, "multisine": multisine}[self.drive]
        frequency = self.cycles / (n * self.dt)
        return signal(n, self.dt, frequency, low=self.low, high=self.high, phase=self.phase)


def spread() -> dict[str, Case]:
    """Two cases a stage, which together meet every rate with every drive and hold."""
    combinations = list(product(RATES, DRIVES, HOLDS))
    samples = {50: 24, 200: 40, 1000: 60, 5000: 90, 50000: 120}
    cases = {}
    for k in range(2 * len(STAGES)):
        name, stage = list(STAGES.items())[k // 2]
        rate, drive, hold = combinations[17 * k % len(combinations)]
        cycles = (1.3, 2.7, 5.1)[k % 3]
        case = Case(stage, drive, rate, hold, samples[rate], cycles=cycles, phase=float(k % 4))
        cases[f"{name}-{rate}Hz-{drive}-{hold}"] = case
    return cases


LIGHTLY_DAMPED = RESONANT["1000Hz-zeta0.02"]
FASTEST_DECAY = CORNERS["M0.1-D5000-K1e+04-T0.1"]
HARD = {
    "hard-20-periods-per-sample-steps-zoh": Case(LIGHTLY_DAMPED, "steps", 50, "zoh", 20),
    "hard-20-periods-per-sample-steps-foh": Case(LIGHTLY_DAMPED, "steps", 50, "foh", 20),
    "hard-20-periods-per-sample-triangle-foh": Case(LIGHTLY_DAMPED, "triangle", 50, "foh", 20),
    "hard-5-periods-per-sample-steps-zoh": Case(LIGHTLY_DAMPED, "steps", 200, "zoh", 40),
    "hard-3-periods-per-sample-multisine-foh": Case(
        RESONANT["160Hz-zeta0.02"], "multisine", 50, "foh", 40, phase=1.0
    ),
    "hard-driven-at-resonance-zoh": Case(
        LIGHTLY_DAMPED, "sine", 5000, "zoh", 120, cycles=24.0, high=10.0
    ),
    "hard-both-signs-sine-foh": Case(
        RESONANT["60Hz-zeta0.065"], "sine", 1000, "foh", 60, low=-25.0, high=25.0
    ),
    "hard-fastest-decay-steps-zoh": Case(FASTEST_DECAY, "steps", 50, "zoh", 24),
    "hard-fastest-decay-50kHz-steps-zoh": Case(FASTEST_DECAY, "steps", 50000, "zoh", 120),
    "hard-1g-stage-50Hz-sine-foh": Case(replace(TABLE_1, mass=1e-3), "sine", 50, "foh", 20),
}
CASES = {**spread(), **HARD}


@cache
def solved(name: str) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    case = CASES[name]
    return dahl_reference(case.stage, case.u, case.dt, case.hold)


def params(names: dict[str, Case]) -> list[Any]:
    return [pytest.param(name, id=name) for name in names]


# The reference itself.

PROOF = {
    "160Hz-zeta0.065-steps": Case(
        RESONANT["160Hz-zeta0.065"], "steps", 1000, "zoh", 10, cycles=2.0
    ),
    "1000Hz-zeta0.02-sine": Case(LIGHTLY_DAMPED, "sine", 5000, "foh", 12, phase=1.0),
    "table1-triangle": Case(TABLE_1, "triangle", 200, "foh", 12),
    "fastest-decay-steps": Case(FASTEST_DECAY, "steps", 1000, "zoh", 12),
}


@pytest.mark.parametrize("case", [pytest.param(case, id=name) for name, case in PROOF.items()])
@pytest.mark.parametrize(
    ("method", "rtol", "steps_per_sample"),
    [
        pytest.param("radau", 1e-12, 1, id="radau"),
        pytest.param("dop853", 3e-14, 50, id="short-steps"),
    ],
)
def test_reference_does_not_depend_on_method_or_step(
    case: Case, method: Method, rtol: float, steps_per_sample: int
) -> None:
    x, _, force = dahl_reference(case.stage, case.u, case.dt, case.hold, method="dop853")
    other, _, other_force = dahl_reference(
        case.stage,
        case.u,
        case.dt,
        case.hold,
        method=method,
        rtol=rtol,
        max_step=case.dt / steps_per_sample,
    )
    assert np.abs(x - other).max() <= 1e-14
    assert np.abs(force - other_force).max() <= 1e-14 * case.stage.stiffness


@pytest.mark.parametrize("name", ["160Hz-zeta0.065-steps", "fastest-decay-steps"])
def test_reference_agrees_with_the_equations_integrated_without_restarts(name: str) -> None:
    case = PROOF[name]
    s, u, dt = case.stage, case.u, case.dt
    y = np.zeros(4)
    expected = np.zeros(case.samples)
    for k in range(case.samples - 1):
        held = float(u[k])

        def rhs(_: float, y: NDArray[np.float64], held: float = held) -> list[float]:
            x, v, q1, q2 = y.tolist()
            force = s.piezo_coefficient * held - s.damping * v - s.stiffness * x - s.b1 * q1
            return [v, force / s.mass, q2 * v, (s.up - s.a2 * q1) * v - s.a1 * q2 * abs(v)]

        y = solve_ivp(
            rhs, (0.0, dt), y, method="DOP853", rtol=1e-12, atol=1e-18, max_step=dt / 300
        ).y[:, -1]
        expected[k + 1] = y[0]
    x, _, _ = dahl_reference(s, u, dt, "zoh")
    assert np.abs(x - expected).max() <= 1e-12


# Accuracy.


@pytest.mark.parametrize("name", params(CASES))
def test_default_is_within_a_tenth_of_a_nanometre(name: str) -> None:
    case = CASES[name]
    s = case.stage
    x, v, force = solved(name)
    result = stage_of(s).simulate(case.u, case.dt, hold=case.hold)
    fastest = max(math.sqrt(s.stiffness / s.mass), s.damping / s.mass)
    assert np.abs(result.x - x).max() <= 1e-10
    assert np.abs(result.v - v).max() <= 1e-9 * fastest
    assert np.abs(result.hysteresis - force).max() <= 1e-9 * s.stiffness


@pytest.mark.parametrize("name", params(HARD))
def test_accuracy_can_be_loosened(name: str) -> None:
    case = HARD[name]
    stage = stage_of(case.stage)
    default = stage.simulate(case.u, case.dt, hold=case.hold)
    loose = stage.simulate(case.u, case.dt, hold=case.hold, accuracy=1e-8)
    assert np.abs(loose.x - solved(name)[0]).max() <= 1e-8
    assert loose.substeps <= default.substeps


def test_scheme_is_fourth_order_across_reversals() -> None:
    """Sub-steps are halved at 500 Hz, where a 160 Hz stage turns in every second sample."""
    p = RESONANT["160Hz-zeta0.065"]
    dt, n = 2e-3, 25
    u = sine(n, dt, 120.0, high=40.0, phase=0.5)
    x, v, _ = dahl_reference(p, u, dt, "foh")
    assert np.count_nonzero(np.diff(np.sign(v[1:]))) >= 10
    # Each accuracy that is asked for ends with a number of sub-steps; the errors fall with them.
    stage = stage_of(p)
    runs = [stage.simulate(u, dt, accuracy=10.0**power) for power in np.arange(-5.0, -14.0, -0.5)]
    errors_of = {run.substeps: float(np.abs(run.x - x).max()) for run in runs}
    halvings, errors = np.log2(list(errors_of)), np.array(list(errors_of.values()))
    used = (errors < 1e-8) & (errors > 1e-14)
    assert np.count_nonzero(used) >= 3, errors_of
    slope = -np.polyfit(halvings[used], np.log2(errors[used]), 1)[0]
    assert slope >= 3.7, errors_of


# Closed forms.


def step_response(p: DahlParameters, volts: float, t: NDArray[np.float64]) -> NDArray[np.float64]:
    """The linear second-order step response, b1 = 0."""
    wn = math.sqrt(p.stiffness / p.mass)
    zeta = p.damping / (2 * math.sqrt(p.stiffness * p.mass))
    level = p.piezo_coefficient * volts / p.stiffness
    if zeta < 1:
        sigma, wd = zeta * wn, wn * math.sqrt((1 - zeta) * (1 + zeta))
        return level * (1 - np.exp(-sigma * t) * (np.cos(wd * t) + sigma / wd * np.sin(wd * t)))
    if zeta == 1:
        return level * (1 - (1 + wn * t) * np.exp(-wn * t))
    fast = -wn * (zeta + math.sqrt((zeta - 1) * (zeta + 1)))
    slow = wn**2 / fast
    return level * (1 + (slow * np.exp(fast * t) - fast * np.exp(slow * t)) / (fast - slow))


@pytest.mark.parametrize("zeta", [0.02, 0.065, 0.999999, 1.0, 1.000001, 5.0, 20.0])
@pytest.mark.parametrize("rate", [50, 1000, 50000])
def test_without_hysteresis_a_step_gives_the_second_order_response(zeta: float, rate: int) -> None:
    mass, wn = 0.25, 512.0
    p = replace(
        TABLE_1,
        mass=mass,
        damping=2 * zeta * mass * wn,
        stiffness=mass * wn**2,
        piezo_coefficient=1.6e-6 * mass * wn**2,
        b1=0.0,
    )
    result = stage_of(p).simulate(np.full(100, 75.0), 1.0 / rate, hold="zoh")
    np.testing.assert_allclose(result.t, np.arange(100) / rate, rtol=1e-12)
    assert np.abs(result.x - step_response(p, 75.0, result.t)).max() <= 1e-12


@pytest.mark.parametrize("hold", HOLDS)
@pytest.mark.parametrize(
    "p",
    [pytest.param(LIGHTLY_DAMPED, id="1000Hz-zeta0.02"), pytest.param(TABLE_1, id="table1")],
)
def test_without_hysteresis_any_drive_gives_the_linear_response(
    p: DahlParameters, hold: Hold
) -> None:
    n, dt = 80, 1e-3
    u = multisine(n, dt, 30.0, phase=1.0)
    system = StateSpace(
        [[0.0, 1.0], [-p.stiffness / p.mass, -p.damping / p.mass]],
        [[0.0], [p.piezo_coefficient / p.mass]],
        [[1.0, 0.0]],
        [[0.0]],
    )
    _, expected, _ = lsim(system, u, np.arange(n) * dt, interp=hold == "foh")
    result = stage_of(replace(p, b1=0.0)).simulate(u, dt, hold=hold)
    assert np.abs(result.x - expected).max() <= 1e-12
    assert not np.any(result.hysteresis)


def virgin_force(p: DahlParameters, x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Fh on the first ascent, from ``q1'' + a1 q1' + a2 q1 = up`` in x with ``q1 = q1' = 0``."""
    decay = p.a1 / 2
    k = math.sqrt(p.a2 - decay**2)
    wave = np.exp(-decay * x) * (np.cos(k * x) + decay / k * np.sin(k * x))
    return p.b1 * p.up / p.a2 * (1 - wave)


@pytest.mark.parametrize("duration", [0.02, 1.0, 40.0])
def test_first_ascent_has_the_same_hysteresis_force_at_any_speed(duration: float) -> None:
    n = 201
    result = stage_of(TABLE_1).simulate(np.linspace(0.0, 75.0, n), duration / (n - 1))
    assert np.all(np.diff(result.x) > 0)
    np.testing.assert_allclose(
        result.hysteresis, virgin_force(TABLE_1, result.x), rtol=1e-9, atol=1e-12
    )


def test_slow_ramp_balances_the_static_forces() -> None:
    p, n, dt = TABLE_1, 2001, 0.02
    u = np.linspace(0.0, 75.0, n)
    result = stage_of(p).simulate(u, dt)
    static = p.stiffness * result.x + virgin_force(p, result.x) - p.piezo_coefficient * u
    viscous = p.damping * result.v
    settled = result.t > 2.0
    assert np.abs(static[settled] + viscous[settled]).max() <= 1e-7
    assert np.abs(static[-1]) <= 0.005 * p.piezo_coefficient * u[-1]


# State carried on.


@pytest.mark.parametrize("cut", [1, 7, 20])
@pytest.mark.parametrize(
    "name",
    [
        "hard-20-periods-per-sample-steps-zoh",
        "hard-20-periods-per-sample-triangle-foh",
        "hard-3-periods-per-sample-multisine-foh",
        "hard-driven-at-resonance-zoh",
        "hard-fastest-decay-50kHz-steps-zoh",
    ],
)
def test_carrying_on_equals_one_run(name: str, cut: int) -> None:
    case = HARD[name]
    stage, u, dt = stage_of(case.stage), case.u, case.dt
    cut = min(cut, case.samples - 2)
    whole = stage.simulate(u, dt, hold=case.hold)
    first = stage.simulate(u[: cut + 1], dt, hold=case.hold)
    second = stage.simulate(u[cut:], dt, hold=case.hold, initial=first.final)
    assert second.x[0] == first.x[-1]
    assert np.abs(first.x - whole.x[: cut + 1]).max() <= 1e-10
    assert np.abs(second.x - whole.x[cut:]).max() <= 1e-10


@pytest.mark.parametrize("hold", HOLDS)
def test_final_state_is_that_of_the_last_sample(hold: Hold) -> None:
    result = pt.DahlStage.xu_li_2010().simulate(sine(50, 0.02, 0.7), 0.02, hold=hold)
    assert result.final.x == result.x[-1]
    assert result.final.v == result.v[-1]


def test_starts_at_rest_under_the_first_sample() -> None:
    result = pt.DahlStage.xu_li_2010().simulate(np.full(5, 30.0), 0.02, hold="zoh")
    assert result.x[0] == 0.0
    assert result.v[0] == 0.0
    assert result.hysteresis[0] == 0.0
    assert result.x[1] > 0.0


def test_one_sample_is_the_state_at_rest() -> None:
    result = pt.DahlStage.xu_li_2010().simulate(np.array([30.0]), 0.02)
    assert result.x.tolist() == [0.0]
    assert result.final.x == 0.0


def test_no_drive_gives_no_motion() -> None:
    result = pt.DahlStage.xu_li_2010().simulate(np.zeros(20), 0.02)
    assert not np.any(result.x)
    assert not np.any(result.v)


# Wrong input.


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("mass", -0.1),
        ("mass", 0.0),
        ("mass", math.nan),
        ("damping", -1.0),
        ("damping", math.inf),
        ("stiffness", -1.0),
        ("stiffness", 0.0),
        ("piezo_coefficient", math.nan),
        ("a1", math.nan),
        ("a2", math.nan),
        ("b1", math.inf),
        ("up", math.nan),
    ],
)
def test_parameters_that_cannot_be_used_are_named(name: str, value: float) -> None:
    with pytest.raises(pt.ParameterError, match=rf"\b{name}\b"):
        stage_of(replace(TABLE_1, **{name: value}))


@pytest.mark.parametrize("dt", [0.0, -1e-3, math.nan, math.inf])
def test_dt_must_be_positive_and_finite(dt: float) -> None:
    stage = pt.DahlStage.xu_li_2010()
    with pytest.raises(pt.ParameterError, match=r"\bdt\b"):
        stage.simulate(np.zeros(3), dt)


@pytest.mark.parametrize("accuracy", [0.0, -1e-10, math.nan])
def test_accuracy_must_be_positive(accuracy: float) -> None:
    stage = pt.DahlStage.xu_li_2010()
    with pytest.raises(pt.ParameterError, match=r"\baccuracy\b"):
        stage.simulate(np.zeros(3), 0.02, accuracy=accuracy)


def test_hold_must_be_known() -> None:
    stage: Any = pt.DahlStage.xu_li_2010()
    with pytest.raises(pt.ParameterError, match=r"\bhold\b"):
        stage.simulate(np.zeros(3), 0.02, hold="linear")


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_drive_must_be_finite(value: float) -> None:
    stage = pt.DahlStage.xu_li_2010()
    with pytest.raises(pt.DataError, match=r"\bu\b"):
        stage.simulate(np.array([0.0, value, 1.0]), 0.02)


@pytest.mark.parametrize("shape", [(3, 2), (0,), ()])
def test_drive_must_be_a_vector_with_entries(shape: tuple[int, ...]) -> None:
    stage = pt.DahlStage.xu_li_2010()
    with pytest.raises(pt.ShapeError, match=r"\bu\b"):
        stage.simulate(np.zeros(shape), 0.02)
