"""Residual of a fit: the cause is that which the stage has and the model lacks."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from matplotlib.figure import Figure

import piezotrack as pt
from piezotrack.identification import residual_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from piezotrack.identification import Identification, Residual

    Array = NDArray[np.float64]

CAUSES = ("creep", "mode", "delay", "asymmetry", "rate", "hum", "drift")
# A single rate cannot distinguish these.
AT_ONE_RATE = ("delay", "rate")
SAMPLES, DT = 2500, 2e-3
T = DT * np.arange(SAMPLES)
LENGTH = SAMPLES * DT
# Nothing but plays.
PLAYS = pt.LeastSquares(creep=False, dynamics=None, dead_zones=False)


def drive_of(kind: str, rng: np.random.Generator) -> Array:
    if kind == "decaying":
        decay = np.exp(-rng.uniform(0.5, 1.5) * T / LENGTH)
        turned = np.cos(2.0 * np.pi * rng.integers(8, 20) * T / LENGTH)
        return np.asarray(50.0 - 50.0 * decay * turned)
    if kind == "chirp":
        phase = 2.0 * np.pi * (2.0 * T + 14.0 * T**2 / LENGTH) / LENGTH
        return np.asarray(50.0 - 45.0 * np.cos(phase))
    if kind == "triangles":
        ends = 50.0 + 50.0 * np.linspace(1.0, 0.3, 12) * np.tile([1.0, -1.0], 6)
        return np.asarray(np.interp(T, np.linspace(0.0, LENGTH, 13), [0.0, *ends]))
    waves = [
        rng.normal() * np.cos(2.0 * np.pi * k * T / LENGTH + rng.uniform(0.0, 6.0)) / k**0.5
        for k in (2, 3, 5, 9, 14, 23)
    ]
    total = np.sum(waves, axis=0)
    return np.asarray(100.0 * (total - total.min()) / np.ptp(total))


def log_of(cause: str | None, kind: str, seed: int) -> pt.Dataset:
    """Record a stage of plays with one more ingredient, and white noise."""
    rng = np.random.default_rng([seed, 0 if cause is None else 1 + CAUSES.index(cause)])
    u = drive_of(kind, rng)
    parts: dict[str, Any] = {
        "linear": 0.8e-6,
        "thresholds": tuple(np.sort(rng.uniform(1.0, 45.0, 16))),
        "weights": tuple(rng.uniform(5e-9, 4e-8, 16)),
    }
    stage: Any = pt.PrandtlIshlinskiiStage(**parts)
    if cause == "creep":
        times = float(np.exp(rng.uniform(np.log(LENGTH / 30.0), np.log(LENGTH / 3.0))))
        stage = replace(stage, creep_times=(times,), creep_weights=(rng.uniform(0.03, 0.1),))
    if cause == "mode":
        zeta = rng.uniform(0.01, 0.08)
        stage = replace(stage, frequency=rng.uniform(20.0, 70.0), damping_ratio=zeta)
    if cause == "asymmetry":
        stage = replace(
            stage,
            dead_zone_thresholds=(rng.uniform(2e-5, 7e-5),),
            dead_zone_weights=(rng.choice([-1.0, 1.0]) * rng.uniform(0.05, 0.2),),
        )
    if cause == "rate":
        fastest = float(np.abs(np.diff(u)).max()) / DT
        dilation = rng.uniform(3.0, 8.0) / fastest
        stage = pt.RateDependentPrandtlIshlinskiiStage(dilation=dilation, **parts)
    y = stage.simulate(u, DT, initial=stage.equilibrium(float(u[0]))).x
    noise = rng.choice([2e-4, 6e-4]) * float(np.ptp(y))
    if cause == "delay":
        y = np.interp(T - rng.uniform(1.0, 3.0) * DT, T, y)
    if cause == "hum":
        y = y + 3.0 * noise * np.sin(2.0 * np.pi * 50.02 * T)
    if cause == "drift":
        # Not one that grows or falls with the amplitude of the drive: plays can follow that.
        wander = rng.uniform(0.6, 1.5) * T / LENGTH + rng.uniform(0.0, 1.0)
        y = y + 6.0 * noise * np.cos(2.0 * np.pi * wander)
    return pt.Dataset(u=u, y=y + noise * rng.normal(size=SAMPLES), dt=DT)


def fit_of(data: pt.Dataset) -> Identification:
    return pt.identify(data, "prandtl-ishlinskii", method=PLAYS, drift=False, progress=False)


def judged(cause: str | None, kind: str, seed: int) -> Residual:
    return residual_of(fit_of(log_of(cause, kind, seed)))


@pytest.mark.parametrize("kind", ["chirp", "triangles"])
@pytest.mark.parametrize("cause", CAUSES)
def test_the_ingredient_that_the_model_lacks_is_the_cause(cause: str, kind: str) -> None:
    residual = judged(cause, kind, 3)
    assert not residual.is_white
    assert residual.cause == cause
    first, second = residual.candidates[:2]
    assert first.gain > second.gain
    assert 0.0 < first.gain <= first.share <= 1.0


@pytest.mark.parametrize("kind", ["decaying", "multisine"])
def test_noise_alone_has_no_cause(kind: str) -> None:
    residual = judged(None, kind, 2)
    assert residual.cause is None
    assert residual.likely == 0


@pytest.mark.slow
@pytest.mark.parametrize("cause", CAUSES)
def test_other_stages_and_drives(cause: str) -> None:
    kinds = ("decaying", "chirp", "triangles", "multisine")
    named: list[tuple[str, int, str | None]] = []
    for seed in range(100, 116):
        kind = kinds[seed % 4]
        if not (kind == "decaying" and cause in AT_ONE_RATE):
            named.append((kind, seed, judged(cause, kind, seed).cause))
    right = sum(one == cause for *_, one in named)
    wrong = [one for one in named if one[2] not in (cause, None)]
    print(f"{cause}: {right} of {len(named)}, wrong {wrong}")
    assert right >= 0.75 * len(named)
    assert len(wrong) <= 1


@pytest.mark.slow
def test_white_and_coloured_noise_have_no_cause() -> None:
    for seed in range(100, 112):
        kind = ("decaying", "chirp", "triangles", "multisine")[seed % 4]
        assert judged(None, kind, seed).cause is None
        clean = log_of(None, kind, seed)
        rng = np.random.default_rng(seed)
        coloured = np.zeros(SAMPLES)
        for i in range(1, SAMPLES):
            coloured[i] = 0.8 * coloured[i - 1] + 30e-9 * rng.normal()
        data = pt.Dataset(u=clean.u, y=clean.y + coloured, dt=DT)
        assert residual_of(fit_of(data)).cause is None


def test_whiteness_is_that_of_ljung_and_box() -> None:
    noise = 1e-8 * np.random.default_rng(3).normal(size=SAMPLES)
    rho = 0.5
    coloured = noise.copy()
    for i in range(1, SAMPLES):
        coloured[i] += rho * coloured[i - 1]
    base = log_of(None, "chirp", 4)
    fit = fit_of(base)
    x = fit.simulate(base, offset=0.0).x
    white, not_white = (
        residual_of(fit_of(pt.Dataset(u=base.u, y=x + one, dt=DT))) for one in (noise, coloured)
    )
    # Quantile of a chi-squared distribution of 20 degrees of freedom.
    assert white.threshold == pytest.approx(37.566, abs=1e-3)
    assert white.is_white
    assert not not_white.is_white
    assert not_white.correlations[1] == pytest.approx(rho, abs=0.06)
    # The sum of rho^2k.
    assert not_white.portmanteau == pytest.approx(SAMPLES * rho**2 / (1.0 - rho**2), rel=0.25)


def test_profiles_show_where_the_residual_is_large() -> None:
    residual = judged("mode", "triangles", 1)
    time, drive, rate, amplitude = residual.profiles
    assert [one.quantity for one in residual.profiles] == ["time", "drive", "rate", "amplitude"]
    for one in residual.profiles:
        assert np.all(one.rms >= np.abs(one.means) - 1e-15)
    # Triangles that become smaller: half of each travel.
    assert residual.amplitude.max() == pytest.approx(50.0, rel=0.05)
    assert residual.amplitude.min() < 20.0
    assert np.average(time.rms**2) == pytest.approx(residual.rms**2, rel=0.02)
    assert drive.unit == "V"
    assert rate.unit == "V/s"
    assert amplitude.centres[-1] > amplitude.centres[0]


def test_the_summary_names_the_cause_once() -> None:
    data = log_of("creep", "chirp", 1)
    fit = fit_of(data)
    notes = [line for line in fit.summary().splitlines() if line.startswith("note")]
    (note,) = [line for line in notes if "creep" in line]
    assert "creep=True" in note
    assert not any("the loop has a shape" in line for line in notes)
    hum = fit_of(log_of("hum", "chirp", 1))
    assert sum("hum" in line for line in hum.summary().splitlines()) == 1


def test_the_record_is_one_of_the_fit() -> None:
    fit = fit_of(log_of(None, "chirp", 1))
    with pytest.raises(pt.ParameterError, match="record"):
        residual_of(fit, 1)
    with pytest.raises(pt.ParameterError, match="fit"):
        residual_of(fit.model)


def test_readings_left_out_and_records_held_between_samples_are_judged() -> None:
    data = log_of("drift", "chirp", 1)
    y = data.y.copy()
    y[500:520] = np.nan
    gaps = pt.Dataset(u=data.u, y=y, dt=DT, missing="drop")
    residual = residual_of(fit_of(gaps))
    assert int((~residual.kept).sum()) == 20
    assert residual.cause == "drift"
    # A drive that is constant between samples is late by half of one.
    held = pt.Dataset(u=data.u, y=data.y, dt=DT, hold="zoh")
    assert residual_of(fit_of(held)).cause != "drift"
    held = pt.Dataset(u=data.u[:-1], y=data.y[1:], dt=DT, hold="zoh")


def test_the_picture_has_six_panels_with_labels() -> None:
    fit = fit_of(log_of("creep", "chirp", 1))
    figure = fit.plot_residual(fig=Figure(layout="constrained"))
    labels = [ax.get_xlabel() for ax in figure.axes]
    assert len(labels) == 6
    assert all("[" in label for label in labels)
