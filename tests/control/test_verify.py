"""Verification: the sensitivity of a loop measured, against the exact one."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt
from commands import run
from piezotrack.control.on_device import closed_loop, latency

if TYPE_CHECKING:
    from pathlib import Path

DT, LIMITS, LEVEL = 5e-4, (0.0, 75.0), 30e-6
MODE = pt.PrandtlIshlinskiiStage(
    linear=1e-6, thresholds=(), weights=(), frequency=160.0, damping_ratio=0.1
)
LINES = pt.RandomPhaseMultisine(band=(8.0, 800.0), low=-1.0, high=1.0)
LOOP = pt.Controller(dt=DT, limits=LIMITS, feedback=pt.Pid(kp=5e3, ti=2.5e-5, td=0.05))


def stage(noise: float = 5e-9, **others: Any) -> pt.VirtualStage:
    return pt.VirtualStage.of(MODE, noise=noise, limits=LIMITS, **others)


def exact(frequency: Any, delay: int = 0) -> tuple[Any, Any]:
    """Compute plant and open loop of the sampled mode and the PID by scipy."""
    from scipy.signal import cont2discrete, freqz

    w = 2.0 * np.pi * 160.0
    system = ([1e-6 * w * w], [1.0, 0.2 * w, w * w])
    numerator, denominator, _ = cont2discrete(system, DT, method="zoh")
    z = np.exp(2j * np.pi * frequency * DT)
    _, plant = freqz(np.squeeze(numerator), denominator, worN=2.0 * np.pi * frequency * DT)
    law, q = LOOP.feedback, 1.0 - 1.0 / z
    assert isinstance(law, pt.Pid)
    return plant / z**delay, law.kp * (1.0 + DT / law.ti / q + law.td / DT * q) * plant / z**delay


def test_the_bands_hold_the_exact_sensitivity_and_plant() -> None:
    inside = []
    for seed in range(20):
        found = pt.verify(
            stage(noise=20e-9, seed=seed), LOOP, replace(LINES, seed=seed), level=LEVEL
        )
        plant, loop = exact(found.sensitivity.frequency)
        for measured, truth in (
            (found.sensitivity, 1.0 / (1.0 + loop)),
            (found.plant, plant),
            (found.loop, loop),
        ):
            inside.append(np.abs(measured.value - truth) <= measured.band())
    assert 0.92 <= np.mean(inside[0::3]) <= 0.98
    assert 0.92 <= np.mean(inside[1::3]) <= 0.98
    assert found.predicted is not None
    assert found.predicted[1] == pytest.approx(1.0 / (1.0 + loop), rel=1e-6)
    law = loop / plant
    wide = np.abs(found.feedback.value - law) <= 1.5 * found.feedback.band()
    assert wide.mean() > 0.9


def test_the_verdict_is_that_of_the_loop() -> None:
    quiet = stage(noise=1e-9)
    found = pt.verify(quiet, LOOP, LINES, level=LEVEL)
    _, loop = exact(found.sensitivity.frequency)
    worst = float(np.abs(1.0 / (1.0 + loop)).max())
    bounds = {"holds": 1.1 * worst, "fails": 0.9 * worst}
    for verdict, bound in bounds.items():
        margins = pt.Margins(sensitivity=bound)
        assert pt.verify(quiet, LOOP, LINES, level=LEVEL, margins=margins).verdict == verdict
    noisy = pt.verify(
        stage(noise=2e-6), LOOP, LINES, level=LEVEL, margins=pt.Margins(sensitivity=1.02 * worst)
    )
    assert noisy.verdict == "undecided"
    margin = found.phase_margin
    assert margin is not None
    report = pt.check_loop(quiet, LOOP).middle
    assert margin == pytest.approx(report.phase_margin, abs=0.05)


def test_a_delay_that_the_model_lacks_is_seen() -> None:
    # The model promises what the stage, two samples later, does not keep.
    model = stage()
    found = pt.verify(stage(noise=1e-9, delay=2 * DT), LOOP, LINES, level=LEVEL, model=model)
    _, late = exact(found.sensitivity.frequency, delay=2)
    assert found.sensitivity.value == pytest.approx(1.0 / (1.0 + late), rel=0.02)
    assert found.predicted is not None
    assert np.abs(found.predicted).max() < 0.8 * found.sensitivity.magnitude.max()


def test_a_response_predicts_as_the_stage_does() -> None:
    lines = replace(LINES, low=28.0, high=32.0)
    response = pt.frequency_response(stage(), lines, rate=1.0 / DT)
    found = pt.verify(stage(), LOOP, LINES, level=LEVEL, model=response)
    _, loop = exact(found.sensitivity.frequency)
    assert found.predicted is not None
    assert found.predicted[1] == pytest.approx(1.0 / (1.0 + loop), rel=5e-3)


def test_what_cannot_be_verified_is_refused() -> None:
    quiet = stage()
    with pytest.raises(pt.ParameterError, match="feedback"):
        pt.verify(quiet, replace(LOOP, feedback=None), LINES, level=LEVEL)
    with pytest.raises(pt.ParameterError, match="about 0 V"):
        pt.verify(quiet, LOOP, replace(LINES, low=1.0, high=2.0), level=LEVEL)
    fast = replace(LOOP, feedback=pt.Pid(kp=5e5, ti=1e-3))
    with pytest.raises(pt.ParameterError, match="unstable"):
        pt.verify(quiet, fast, LINES, level=LEVEL)
    with pytest.raises(pt.DataError, match="clipped"):
        pt.verify(quiet, LOOP, replace(LINES, low=-70.0, high=70.0), level=LEVEL)
    with pytest.raises(pt.ParameterError, match="half the sampling rate"):
        pt.verify(quiet, LOOP, replace(LINES, band=(8.0, 1200.0)), level=LEVEL)
    with pytest.raises(pt.ParameterError, match="reach"):
        pt.verify(quiet, LOOP, LINES, level=300e-6)


class Clock:
    """A clock that goes on only when it is waited for: a loop on a virtual device in no time."""

    def __init__(self) -> None:
        self.now = 0.0

    def perf_counter(self) -> float:
        return self.now


def test_on_a_device_the_voltage_is_added_at_each_tick(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = Clock()
    device = pt.hardware.VirtualDevice(stage(), clock=clock.perf_counter)

    def wait(tick: float) -> None:
        clock.now = max(clock.now, tick)

    monkeypatch.setattr(closed_loop, "time", clock)
    monkeypatch.setattr(closed_loop, "wait_until", wait)
    monkeypatch.setattr(closed_loop, "refuse_slow", lambda *_: None)
    found = pt.verify(device, LOOP, replace(LINES, realisations=3), level=LEVEL)
    _, loop = exact(found.sensitivity.frequency)
    truth = 1.0 / (1.0 + loop)
    # An exchange of the virtual device takes two microseconds of each interval.
    assert np.abs(found.sensitivity.value - truth).max() < 0.01
    assert found.predicted is None
    assert device.held == 0.0


def test_the_command_writes_what_it_found(tmp_path: Path) -> None:
    loop = replace(
        LOOP,
        feedforward=pt.PrandtlIshlinskiiStage(
            linear=1e-6, thresholds=(5.0,), weights=(1e-7,), frequency=160.0, damping_ratio=0.1
        ).inverse(),
    )
    file = loop.save(tmp_path / "controller.json")
    words = ["verify", str(file), "random-phase:8..800Hz,-1..1V", "--level", "30um"]
    done = run(*words, "--noise", "5nm", "-o", str(tmp_path / "out"))
    assert done.exit_code == 0, done.stderr
    document = json.loads((tmp_path / "out" / "verification.json").read_text())
    assert document["verdict"] in ("holds", "fails", "undecided")
    assert f"{document['largest_sensitivity']:.3g}" in done.stdout
    for wrong, named in (
        (["--sensitivity", "0.5"], "--sensitivity"),
        (["--level", "30V"], "--level"),
        (["--rest", "0V"], "--rest"),
    ):
        failed = run(*words, *wrong, "-o", str(tmp_path / "other"))
        assert failed.exit_code != 0
        assert named in failed.stderr


@pytest.mark.slow
def test_from_a_response_to_a_verified_loop_on_a_gcs_controller(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # The machine of a test is busy.
    monkeypatch.setattr(latency, "MOST", 1e3)
    monkeypatch.setattr("piezotrack.control.verifying.verify.MOST_LATE", 0.1)
    plays = pt.PrandtlIshlinskiiStage(
        linear=1e-6, thresholds=(0.5, 2.0), weights=(2e-7, 1e-7), time_constant=1e-2
    )
    server = pt.hardware.GcsServer(pt.VirtualStage.of(plays, noise=5e-9, limits=LIMITS))
    with server:
        device = pt.hardware.connect(server.address)
        lines = pt.RandomPhaseMultisine(
            band=(0.25, 11.0), low=28.0, high=32.0, realisations=3, periods=2
        )
        response = pt.frequency_response(device, lines, rate=25.0)
        tuned = pt.tune(response, limits=LIMITS, parts="pid")
        added = replace(lines, low=-1.0, high=1.0, realisations=4)
        found = pt.verify(device, tuned.controller, added, level=30e-6, model=response)
        assert found.verdict != "fails"
        # The plant in the loop is that which was measured, at another amplitude.
        alike = np.abs(found.plant.value - response.value) / response.magnitude
        assert np.median(alike) < 0.1
        assert np.median(np.abs(found.feedback.value / _law(tuned.controller, found) - 1.0)) < 0.1
        device.close()


def _law(loop: pt.Controller, found: pt.control.Verification) -> Any:
    """Compute the PID at the lines."""
    law, q = loop.feedback, 1.0 - np.exp(-2j * np.pi * found.sensitivity.frequency * loop.dt)
    assert isinstance(law, pt.Pid)
    return law.kp * (1.0 + loop.dt / law.ti / q + law.td / loop.dt * q)


def test_a_law_that_damps_is_verified_at_the_command() -> None:
    # The loop opened there is P (C - K); a reference alone would not show it.
    ringing = replace(MODE, damping_ratio=0.02)
    virtual = pt.VirtualStage.of(ringing, noise=1e-9, delay=1e-4, limits=LIMITS)
    law = pt.control.PositivePositionFeedback(
        pid=pt.Pid(kp=6e5, ti=2.4e-3), gain=8e5, frequency=300.0, damping_ratio=0.6
    )
    loop = pt.Controller(dt=2e-4, limits=LIMITS, feedback=law)
    lines = pt.RandomPhaseMultisine(band=(8.0, 2000.0), low=-0.2, high=0.2)
    found = pt.verify(virtual, loop, lines, level=LEVEL)
    assert found.predicted is not None
    inside = np.abs(found.sensitivity.value - found.predicted[1]) <= found.sensitivity.band()
    assert inside.mean() > 0.9
    w = 2j * np.pi * found.sensitivity.frequency
    k = 8e5 * 600.0**2 * np.pi**2 / (w * w + 1.2 * 600.0 * np.pi * w + 600.0**2 * np.pi**2)
    difference = 6e5 * (1.0 + 1.0 / (2.4e-3 * w)) - k
    # The laws are sampled: as in continuous time at low frequencies.
    slow = found.sensitivity.frequency < 200.0
    assert found.feedback.value[slow] == pytest.approx(difference[slow], abs=0.05 * 8e5)
