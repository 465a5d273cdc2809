"""What least squares choose by the record: modes, lags, creep, histories, bounds."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt
from piezotrack import _core
from piezotrack.identification.problem.problem import Problem
from play_records import PLAIN, STAGE, drive, record
from records import of_relays

if TYPE_CHECKING:
    from numpy.typing import NDArray

MODE = replace(PLAIN, frequency=160.0, damping_ratio=0.03)
DT = 1e-3


def fitted(
    u: NDArray[np.float64],
    y: NDArray[np.float64],
    *,
    dt: float = DT,
    start: int = 0,
    history: Any = None,
    drift: bool | None = False,
    model: str = "prandtl-ishlinskii",
    **given: Any,
) -> Any:
    """A fit of one record through the core; what is not given is chosen."""
    data = pt.Dataset(u=u, y=y, dt=dt)
    record = pt.Record(data[float(data.t[start]) :], history=history, drift=drift)
    settings: dict[str, Any] = {
        "count": None,
        "thresholds": list(PLAIN.thresholds),
        "zones": 0,
        "creep_times": [],
        "dynamics": "none",
        "start": None,
        "threads": 0,
    }
    return _core.identify_weights(Problem(model=model, records=(record,)), **settings | given)


def number(fit: Any, name: str) -> float:
    (value,) = dict(fit.parameters)[name]
    return float(value)


def noisy(y: NDArray[np.float64], nanometres: float = 10.0) -> NDArray[np.float64]:
    return y + 1e-9 * nanometres * np.random.default_rng(3).normal(size=y.size)


def shaken(kind: str, samples: int = 3000) -> NDArray[np.float64]:
    rng, t = np.random.default_rng(5), DT * np.arange(samples)
    slow: NDArray[np.float64] = 37.5 * (1.0 - np.cos(2.0 * np.pi * t))
    if kind == "steps":
        return np.repeat(rng.uniform(0.0, 75.0, 30), samples // 30)
    if kind == "noise":
        return 37.5 + 20.0 * np.convolve(rng.normal(size=samples), np.ones(5) / 5.0, "same")
    if kind == "chirp":
        return 37.5 + 5.0 * np.sin(2.0 * np.pi * (1.0 + 40.0 * t) * t)
    return np.where(t < 1.5, slow, 75.0 - 0.5 * slow)


@pytest.mark.parametrize("kind", ["steps", "noise", "chirp", "sine with a step"])
def test_a_lightly_damped_mode_that_the_record_shows_is_found(kind: str) -> None:
    u = shaken(kind)
    y = noisy(MODE.simulate(u, DT).x)
    for dynamics in ("auto", "second"):
        fit = fitted(u, y, dynamics=dynamics, history="virgin", start=200)
        assert number(fit, "frequency") == pytest.approx(160.0, rel=0.01)
        assert number(fit, "damping_ratio") == pytest.approx(0.03, rel=0.1)
        assert fit.rms < 15e-9
        assert not fit.at_bound


@pytest.mark.parametrize("frequency", [560.0, 720.0])
def test_a_mode_above_half_the_sampling_rate_is_found(frequency: float) -> None:
    # The straight ramps between samples tell it from the slower mode that rings alike at them.
    fine = 20
    u = shaken("steps")
    between = np.interp(np.arange(fine * (u.size - 1) + 1) / fine, np.arange(u.size), u)
    stage = replace(PLAIN, frequency=frequency, damping_ratio=0.03)
    y = noisy(stage.simulate(between, DT / fine).x[::fine])
    fit = fitted(u, y, dynamics="auto", history="virgin", start=200)
    assert number(fit, "frequency") == pytest.approx(frequency, rel=0.01)
    assert fit.rms < 12e-9


def test_two_modes_are_found() -> None:
    stage = replace(
        MODE, mode_weights=(0.2,), mode_frequencies=(60.0,), mode_damping_ratios=(0.05,)
    )
    u = shaken("steps")
    fit = fitted(u, noisy(stage.simulate(u, DT).x), dynamics="auto", history="virgin", start=200)
    found = sorted(dict(fit.parameters)["frequency"] + dict(fit.parameters)["mode_frequencies"])
    assert found == pytest.approx([60.0, 160.0], rel=0.02)
    assert fit.rms < 40e-9


def test_a_mode_beyond_the_sweep_shows_in_what_the_first_leaves() -> None:
    stage = replace(
        PLAIN,
        frequency=60.0,
        damping_ratio=0.16,
        mode_weights=(0.11,),
        mode_frequencies=(210.0,),
        mode_damping_ratios=(0.09,),
    )
    t = DT * np.arange(3000)
    u = 37.5 + 35.0 * np.sin(2.0 * np.pi * (1.0 + 13.0 * t) * t) / (1.0 + 0.5 * t)
    fit = fitted(u, noisy(stage.simulate(u, DT).x), dynamics="auto", history="virgin", start=200)
    found = sorted(dict(fit.parameters)["frequency"] + dict(fit.parameters)["mode_frequencies"])
    assert found == pytest.approx([60.0, 210.0], rel=0.02)
    assert fit.rms < 15e-9


def test_choices_on_a_thinned_record_are_those_of_the_whole() -> None:
    stage = replace(PLAIN, creep_weights=(0.01, 0.01), creep_times=(0.5, 5.0))
    short, long = np.arange(3000) / 1e3, np.arange(15000) / 5e3

    def fit(t: NDArray[np.float64]) -> Any:
        u = 37.5 - 30.0 * np.cos(2.0 * np.pi * 1.3 * t)
        start = stage.equilibrium([70.0, float(u[0])])
        y = noisy(stage.simulate(u, t[1], initial=start).x)
        free: dict[str, Any] = {"thresholds": None, "creep_times": None, "dynamics": "auto"}
        return fitted(u, y, dt=t[1], **free)

    few, many = fit(short), fit(long)
    assert few.records[0]["history"] == many.records[0]["history"] == "fit"
    assert len(dict(few.parameters)["creep_times"]) == len(dict(many.parameters)["creep_times"])
    assert few.rms < 15e-9
    assert many.rms < 15e-9


def test_least_squares_end_where_they_are_to_stop() -> None:
    t = np.arange(500_000) / 1e5
    u = 37.5 - 30.0 * np.cos(2.0 * np.pi * 1.3 * t)
    free: dict[str, Any] = {"thresholds": None, "creep_times": None, "dynamics": "auto"}
    with pytest.raises(KeyboardInterrupt):
        fitted(u, noisy(PLAIN.simulate(u, t[1]).x), dt=t[1], stopped=lambda: True, **free)


def test_a_slow_record_shows_no_mode() -> None:
    u = drive()
    for stage in (MODE, replace(PLAIN, creep_weights=(0.01, 0.01), creep_times=(0.1, 1.0))):
        fit = fitted(u, noisy(stage.simulate(u, DT).x), dynamics="auto", creep_times=None)
        assert dict(fit.parameters)["frequency"] == []


def test_a_lag_is_told_as_a_range() -> None:
    u = drive()
    fit = fitted(u, noisy(PLAIN.simulate(u, DT).x), dynamics="auto")
    shortest, longest = fit.lag_range
    assert shortest == 0.0
    assert 0.0 < longest < 5e-3
    assert dict(fit.parameters)["time_constant"] == []
    late = replace(PLAIN, time_constant=4e-3)
    fit = fitted(u, noisy(late.simulate(u, DT).x), dynamics="auto")
    shortest, longest = fit.lag_range
    assert (shortest, longest) == pytest.approx((4e-3, 4e-3), rel=0.05)
    assert number(fit, "time_constant") == pytest.approx(4e-3, rel=0.02)


def simulated(fit: Any, u: NDArray[np.float64]) -> NDArray[np.float64]:
    optional = ("time_constant", "frequency", "damping_ratio")
    values: dict[str, Any] = {
        name: (value[0] if value else None) if name in optional else tuple(value)
        for name, value in dict(fit.parameters).items()
    }
    values["linear"] = values["linear"][0]
    stage = pt.PrandtlIshlinskiiStage(**values)
    state = stage.simulate([0.0], DT).final
    start = dict(fit.records[0]["start"])
    first = {
        name: start[name][0] if isinstance(getattr(state, name), float) else tuple(start[name])
        for name in start
    }
    return stage.simulate(u, DT, initial=replace(state, **first)).x


@pytest.mark.parametrize("history", ["virgin", "settled", "fit"])
@pytest.mark.parametrize("dynamics", ["none", "first", "second"])
def test_the_start_reproduces_the_cost(history: str, dynamics: str) -> None:
    u = 20.0 + 0.5 * drive()
    y = noisy(replace(STAGE, creep_weights=(0.02,), creep_times=(0.5,)).simulate(u, DT).x)
    fit = fitted(u, y, zones=2, creep_times=[0.5], history=history, dynamics=dynamics, start=10)
    left = (y - simulated(fit, u) - fit.records[0]["offset"])[10:]
    assert np.sqrt(np.mean(left**2)) == pytest.approx(fit.rms, rel=1e-6)


def test_a_record_that_begins_at_half_of_the_range() -> None:
    t = DT * np.arange(3000)
    u = 37.5 + 37.5 * np.sin(2.0 * np.pi * t)
    before = 37.5 * (1.0 - np.cos(2.0 * np.pi * np.linspace(0.0, 2.25, 9001)))[:-1]
    y = noisy(PLAIN.simulate(np.concatenate([before, u]), DT).x[before.size :])
    assert fitted(u, y, history="virgin").rms > 30e-9
    fit = fitted(u, y)
    assert fit.records[0]["history"] == "settled"
    assert fit.rms < 11e-9
    # One that came from another voltage.
    before = np.concatenate([np.linspace(0.0, 60.0, 500), np.linspace(60.0, 37.5, 500)])
    y = noisy(PLAIN.simulate(np.concatenate([before, u]), DT).x[before.size :])
    fit = fitted(u, y, history="fit")
    assert fit.rms < 12e-9


def test_bounds_hold_and_are_named() -> None:
    # A kink far sharper than a dead zone may make.
    u = drive()
    x = PLAIN.simulate(u, DT).x
    fit = fitted(u, x + 3.0 * np.maximum(x - 40e-6, 0.0), zones=1)
    (bend,) = dict(fit.parameters)["dead_zone_weights"]
    assert bend == pytest.approx(1.0, abs=1e-3)
    assert "dead_zone_weights[0]" in fit.at_bound
    # Creep that would be most of the displacement.
    stage = replace(PLAIN, creep_weights=(0.8,), creep_times=(0.3,))
    fit = fitted(u, stage.simulate(u, DT).x, creep_times=[0.3, 3.0])
    assert sum(dict(fit.parameters)["creep_weights"]) <= 0.5 + 1e-6


def test_corners_are_found() -> None:
    log = record(STAGE, samples=6000)
    fit = fitted(log.u, log.y, zones=2, thresholds=list(STAGE.thresholds))
    assert dict(fit.parameters)["dead_zone_thresholds"] == pytest.approx([20e-6, 50e-6], rel=1e-2)
    assert dict(fit.parameters)["dead_zone_weights"] == pytest.approx([0.08, -0.05], rel=2e-2)
    assert fit.rms < 1e-9


def test_resonances_of_a_record() -> None:
    u = shaken("noise")
    y = noisy(MODE.simulate(u, DT).x)
    found = _core.resonances(u=u, y=y, dt=DT, hold_name="foh", start=0, most=1)
    assert found[0][:2] == pytest.approx((160.0, 0.03), rel=0.03)
    u = drive()
    y = noisy(MODE.simulate(u, DT).x)
    assert _core.resonances(u=u, y=y, dt=DT, hold_name="foh", start=0, most=1) == []


@pytest.mark.parametrize("seed", [0, 4])
def test_twelve_intervals_of_levels_are_weighed_before_a_mode_moves(seed: int) -> None:
    log, noise = of_relays(
        seed, intervals=12, mass=0.02e-6, damping_ratio=0.05, steps=40, share=1e-4
    )
    fit = pt.identify(log, model="preisach")
    # Six intervals leave 3.1 and 1.2 times the noise.
    assert fit.cost < 1.05 * noise
