"""First-order Dahl friction and Bouc-Wen hysteresis in feedback on the displacement."""

from __future__ import annotations

import dataclasses
from functools import cache
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import piezotrack as pt

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

BENCHMARK = pt.BoucWenOscillator.benchmark()
FRICTION = pt.FirstOrderDahlStage(
    mass=0.1828,
    damping=50.0,
    stiffness=26065.0,
    piezo_coefficient=0.0468,
    rest_stiffness=2e4,
    coulomb_force=0.3,
)
# The benchmark's data were made at 15 kHz and handed out at 750 Hz.
FINE, COARSE, SAMPLES = 15000, 750, 8192


def oscillator_slope(of: pt.BoucWenOscillator) -> Callable[[float, float], float]:
    """dz/dy at z, in one direction."""

    def slope(z: float, sign: float) -> float:
        nu = of.exponent
        bend = of.gamma * sign * abs(z) ** (nu - 1) * z + of.delta * abs(z) ** nu
        return float(of.alpha - of.beta * bend)

    return slope


def friction_slope(of: pt.FirstOrderDahlStage) -> Callable[[float, float], float]:
    """dF/dx at F, in one direction."""

    def slope(force: float, sign: float) -> float:
        left = 1.0 - force * sign / of.coulomb_force
        # Below rounding the limit has been reached: exponents under 1 get there on a finite path.
        return float(of.rest_stiffness * left**of.exponent) if left > 1e-9 else 0.0

    return slope


def reference(
    stage: pt.BoucWenOscillator | pt.FirstOrderDahlStage, u: Array, dt: float, hold: str = "foh"
) -> Array:
    """Displacement by DOP853, started anew at every sample and at every reversal."""
    if isinstance(stage, pt.BoucWenOscillator):
        slope, gain = oscillator_slope(stage), 1.0
    else:
        slope, gain = friction_slope(stage), stage.piezo_coefficient
    state, x = np.zeros(3), [0.0]

    def turning(_t: float, y: Array, *_: float) -> float:
        return float(y[1])

    turning.terminal = True  # type: ignore[attr-defined]

    def rhs(t: float, y: Array, start: float, rate: float, sign: float) -> list[float]:
        force = gain * (start + rate * t)
        a = (force - stage.damping * y[1] - stage.stiffness * y[0] - y[2]) / stage.mass
        return [y[1], a, slope(float(y[2]), sign) * y[1]]

    for k in range(u.size - 1):
        rate = (u[k + 1] - u[k]) / dt if hold == "foh" else 0.0
        now = 0.0
        while now < dt:
            a = rhs(now, state, u[k], rate, 1.0)[1]
            jerk = gain * rate
            moving = state[1] if abs(state[1]) > 1e-14 else (a if abs(a) > 1e-12 else jerk)
            sign = 1.0 if moving >= 0 else -1.0
            turning.direction = -sign  # type: ignore[attr-defined]
            solution = solve_ivp(
                rhs,
                (now, dt),
                state,
                method="DOP853",
                args=(u[k], rate, sign),
                rtol=1e-10,
                atol=[1e-14, 1e-12, 1e-11],
                events=turning,
            )
            state, now = solution.y[:, -1], solution.t[-1]
            if solution.status == 1:
                state[1] = 0.0
        x.append(float(state[0]))
    return np.array(x)


def force_drive(n: int, dt: float) -> Array:
    """Two tones near the oscillator's resonance, both of which turn it."""
    t = np.arange(n) * dt
    drive: Array = 60.0 * np.sin(2 * np.pi * 31.0 * t) + 40.0 * np.sin(2 * np.pi * 87.0 * t + 0.5)
    return drive


def slow_drive(n: int, dt: float) -> Array:
    """Voltage with a small loop inside a large one."""
    t = np.arange(n) * dt
    drive: Array = 37.5 * (1 - np.cos(2 * np.pi * 2.0 * t)) + 12.0 * np.sin(2 * np.pi * 14.0 * t)
    return drive


@pytest.mark.parametrize("exponent", [1.0, 1.5])
@pytest.mark.parametrize("hold", ["foh", "zoh"])
def test_oscillator_against_an_independent_solver(hold: str, exponent: float) -> None:
    """Within a nanometre of a millimetre, whatever lies between the samples."""
    scale = 40.0 ** (1.0 - exponent)
    stage = dataclasses.replace(BENCHMARK, exponent=exponent, gamma=0.8 * scale, delta=-1.1 * scale)
    dt = 1 / 2000.0
    u = force_drive(160, dt)
    run = stage.simulate(u, dt, hold=hold)  # type: ignore[arg-type]
    assert np.ptp(run.x) > 1e-3
    np.testing.assert_allclose(run.x, reference(stage, u, dt, hold), rtol=0, atol=1e-9)


@pytest.mark.parametrize("exponent", [0.0, 0.5, 1.0, 2.0])
def test_friction_against_an_independent_solver(exponent: float) -> None:
    """Reversals of every size, with friction that slides and friction that never quite does."""
    stage = dataclasses.replace(FRICTION, exponent=exponent)
    dt = 1 / 500.0
    u = slow_drive(150, dt)
    run = stage.simulate(u, dt)
    assert np.abs(run.hysteresis).max() <= stage.coulomb_force * (1 + 1e-12)
    np.testing.assert_allclose(run.x, reference(stage, u, dt), rtol=0, atol=1e-9)


def multisine(n: int, rate: float, seed: int) -> Array:
    """5 to 150 Hz with random phases, 50 N rms, `n` samples long and periodic."""
    lines = np.fft.rfftfreq(n, 1.0 / rate)
    full = (lines >= 5.0) & (lines <= 150.0)
    phases = np.random.default_rng(seed).uniform(0.0, 2 * np.pi, full.sum())
    spectrum = np.zeros(lines.size, dtype=complex)
    spectrum[full] = np.exp(1j * phases)
    u = np.fft.irfft(spectrum, n)
    drive: Array = 50.0 * u / np.sqrt(np.mean(u**2))
    return drive


def upsampled(u: Array, factor: int) -> Array:
    """A periodic signal at a higher rate, exactly."""
    drive: Array = np.fft.irfft(np.fft.rfft(u), u.size * factor) * factor
    return drive


def test_benchmark_multisine_is_converged() -> None:
    """At the rate of the benchmark's own integration, against the drive eight times as fine."""
    u = multisine(SAMPLES * 20, FINE, seed=3)
    x = BENCHMARK.simulate(u, 1 / FINE).x
    converged = BENCHMARK.simulate(upsampled(u, 8), 1 / (8 * FINE)).x[::8]
    assert 4e-4 < np.sqrt(np.mean(x**2)) < 1e-3
    assert np.abs(x - converged).max() < 1e-6


@pytest.mark.slow
def test_benchmark_sweep_is_converged() -> None:
    """Through the resonance: 20 to 50 Hz in 180 s, of which the part that matters."""

    def sweep(rate: int) -> Array:
        t = np.arange(140 * rate, dtype=np.float64) / rate
        drive: Array = 40.0 * np.sin(2 * np.pi * (18.0 * t + t * t / 12.0))
        return drive

    x = BENCHMARK.simulate(sweep(FINE), 1 / FINE).x
    converged = BENCHMARK.simulate(sweep(4 * FINE), 1 / (4 * FINE)).x[::4]
    assert np.abs(x).max() > 1e-3
    assert np.abs(x - converged).max() < 1e-6


@cache
def noisy_benchmark() -> pt.Dataset:
    """A second period of the multisine at 750 Hz, with 7 um of noise; the first is warm-up."""
    over = FINE // COARSE
    u = np.tile(multisine(SAMPLES * over, FINE, seed=0), 2)
    x = BENCHMARK.simulate(u, 1 / FINE).x[::over]
    y = x + 7e-6 * np.random.default_rng(1).standard_normal(x.size)
    log = pt.Dataset(u=u[::over], y=y, dt=1 / COARSE, drive_unit="N")
    return log[SAMPLES / COARSE :]


@pytest.mark.slow
def test_benchmark_parameters_are_recovered() -> None:
    """Every one within 1 %, from the noisy record, with bounds from the record alone."""
    log = noisy_benchmark().interpolate(2)
    fit = pt.identify(
        log, "bouc-wen-oscillator", parameters={"beta": 1e3}, method=pt.Descents(seed=1)
    )
    assert fit.cost == pytest.approx(7e-6, rel=0.05)
    assert not fit.scale_assumed
    for name, value in dataclasses.asdict(BENCHMARK).items():
        assert getattr(fit.model, name) == pytest.approx(value, rel=0.01), name
    text = fit.summary()
    assert "delta" in text
    assert "beta       " not in text.split("parameters")[0]


def test_only_products_with_beta_show() -> None:
    """The same motion with twice the beta and half the gamma and delta."""
    other = dataclasses.replace(BENCHMARK, beta=2e3, gamma=0.4, delta=-0.55)
    u = force_drive(2000, 1e-3)
    a, b = (one.simulate(u, 1e-3).x for one in (BENCHMARK, other))
    np.testing.assert_allclose(a, b, rtol=0, atol=1e-15)


def cycles(n: int, rate: int = 250) -> Array:
    """0.25 Hz, 0 to 75 V."""
    t = np.arange(4 * rate * n + 1) / rate
    drive: Array = 37.5 * (1 - np.cos(2 * np.pi * 0.25 * t))
    return drive


def test_hundred_cycles() -> None:
    """Table 1 creeps as SPEC computed; first-order friction comes back to the same loop."""
    second = pt.DahlStage.xu_li_2010().simulate(cycles(100), 1 / 250).x[:-1].reshape(100, -1)
    # After one cycle, ten, 35 and 99.
    lows = 1e6 * second.min(axis=1)[[1, 10, 35, 99]]
    np.testing.assert_allclose(lows, [0.5, -1.9, -7.2, -16.0], atol=0.3)
    first = FRICTION.simulate(cycles(100), 1 / 250, accuracy=1e-13).x[:-1].reshape(100, -1)
    assert np.abs(first[2:] - first[-1]).max() < 1e-11
    assert np.ptp(first[-1]) > 1e-4


def test_friction_dissipates_over_each_cycle() -> None:
    """The area of the loop is heat; Table 1's is negative at first."""
    for stage, heats in ((FRICTION, True), (pt.DahlStage.xu_li_2010(), False)):
        run = stage.simulate(cycles(2), 1 / 250)
        whole = slice(0, 1000 + 1)
        x, force = run.x[whole], run.hysteresis[whole]
        work = float(np.sum(0.5 * (force[1:] + force[:-1]) * np.diff(x)))
        assert (work > 0) == heats


@pytest.mark.parametrize("exponent", [0.5, 1.0, 1.7])
def test_inverse_leads_the_stage_along_the_reference(exponent: float) -> None:
    """Feedforward of a stage that never moved, at 5 kHz."""
    stage = dataclasses.replace(FRICTION, exponent=exponent)
    path = pt.sine(frequency=1.0, low=0.0, high=100e-6, duration=2.0)
    volts = stage.inverse(playback="online").voltage(path, 2e-4)
    error = stage.simulate(volts, 2e-4).x - path.sample(2e-4).x
    assert np.abs(error).max() < 5e-11


def test_inverse_of_an_oscillator_is_a_force() -> None:
    """The same for the benchmark, in newtons."""
    path = pt.sine(frequency=5.0, low=0.0, high=1e-3, duration=1.0)
    force = BENCHMARK.inverse(playback="online").voltage(path, 1e-4)
    error = BENCHMARK.simulate(force, 1e-4).x - path.sample(1e-4).x
    assert np.abs(force).max() > 10.0
    assert np.abs(error).max() < 1e-9


def test_identification_of_friction(tmp_path: Path) -> None:
    """All ratios from a noisy record with small loops in it; the file gives the same stage."""
    dt = 1 / 500.0
    stage = dataclasses.replace(FRICTION, damping=260.0)
    u = slow_drive(1000, dt)
    noise = 20e-9 * np.random.default_rng(5).standard_normal(u.size)
    log = pt.Dataset(u=u, y=stage.simulate(u, dt).x + noise, dt=dt)
    fit = pt.identify(
        log, "first-order-dahl", parameters={"stiffness": 26065.0}, method=pt.Descents(seed=2)
    )
    assert fit.cost == pytest.approx(20e-9, rel=0.1)
    for name in ("damping", "piezo_coefficient", "rest_stiffness", "coulomb_force"):
        assert getattr(fit.model, name) == pytest.approx(getattr(stage, name), rel=0.02), name
    again = pt.load(fit.save(tmp_path / "friction.json"))
    assert again.model == fit.model
    assert "sigma/K" in fit.summary()


@pytest.mark.parametrize("stage", [FRICTION, BENCHMARK])
def test_a_run_can_be_carried_on(stage: pt.FirstOrderDahlStage | pt.BoucWenOscillator) -> None:
    """The last state is all that matters."""
    u, dt = slow_drive(400, 2e-3), 2e-3
    whole = stage.simulate(u, dt, accuracy=1e-13)
    first = stage.simulate(u[:201], dt, accuracy=1e-13)
    second = stage.simulate(u[200:], dt, initial=first.final, accuracy=1e-13)
    np.testing.assert_allclose(second.x, whole.x[200:], rtol=0, atol=1e-12)
    with pytest.raises(pt.ParameterError, match=r"initial is .*expected a pt\.stages\.ForceState"):
        stage.simulate(u, dt, initial=pt.stages.DahlState())


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("coulomb_force", 0.0, "coulomb_force is 0 N"),
        ("rest_stiffness", -1.0, "rest_stiffness is -1 N/m"),
        ("exponent", 21.0, "exponent is 21: expected a number from 0 to 20"),
        ("piezo_coefficient", 0.0, "piezo_coefficient is 0 N/V"),
        ("mass", float("nan"), "mass"),
    ],
)
def test_refusals_of_friction(name: str, value: float, expected: str) -> None:
    """By name, with the value and the unit."""
    with pytest.raises(pt.ParameterError, match=expected):
        dataclasses.replace(FRICTION, **{name: cast("Any", value)})


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("beta", 0.0, "beta is 0: expected a value other than 0"),
        ("exponent", 0.5, "exponent is 0.5: expected a number from 1 to 20"),
        ("stiffness", 0.0, "stiffness is 0 N/m"),
        ("delta", float("inf"), "delta"),
    ],
)
def test_refusals_of_the_oscillator(name: str, value: float, expected: str) -> None:
    """By name, with the value."""
    with pytest.raises(pt.ParameterError, match=expected):
        dataclasses.replace(BENCHMARK, **{name: cast("Any", value)})


def test_what_is_not_in_the_data_is_not_searched() -> None:
    """Beta and the exponents are held, and the reason is said."""
    log = noisy_benchmark()
    with pytest.raises(pt.ParameterError, match="only the products beta gamma and beta delta"):
        pt.identify(
            log, "bouc-wen-oscillator", parameters={"mass": pt.Parameter(), "beta": pt.Parameter()}
        )
    with pytest.raises(pt.ParameterError, match="all candidates of a search share it"):
        pt.identify(log, "first-order-dahl", parameters={"exponent": pt.Parameter()})


def test_interpolated_records() -> None:
    """Samples are kept, a tone between them is right, and what has no between is refused."""
    t = np.arange(400) / 100.0
    log = pt.Dataset(u=np.sin(2 * np.pi * 33.0 * t), y=np.cos(2 * np.pi * 20.0 * t), t=t)[1.0:]
    fine = log.interpolate(4)
    assert fine.dt == pytest.approx(log.dt / 4)
    assert fine.warmup == 4 * log.warmup
    np.testing.assert_array_equal(fine.full.u[::4], log.full.u)
    inner = slice(200, -200)
    np.testing.assert_allclose(
        fine.full.u[inner], np.sin(2 * np.pi * 33.0 * fine.full.t)[inner], atol=3e-4
    )
    with pytest.raises(pt.ParameterError, match="factor is 1: expected a whole number, 2 or more"):
        log.interpolate(1)
    with pytest.raises(pt.ParameterError, match="hold is 'zoh'"):
        pt.Dataset(u=t, y=t, dt=0.01, hold="zoh").interpolate(2)


@pytest.mark.parametrize(("scale", "accuracy"), [(1e90, 1e-10), (1.0, 1e-30)])
def test_what_cannot_be_computed_is_refused_soon(scale: float, accuracy: float) -> None:
    """A drive and an accuracy that no steps lead to."""
    u = scale * slow_drive(4000, 1e-3)
    with pytest.raises(pt.NumericalError, match=r"accuracy .* is out of reach: \d+ sub-steps"):
        FRICTION.simulate(u, 1e-3, accuracy=accuracy)
