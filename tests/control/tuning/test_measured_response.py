"""Tuning on a measured response: gains of the true stage, and margins within the band."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import piezotrack as pt
from piezotrack.control.tuning.measured_response import controller_response, worst_sensitivity

RATE = 2000.0
LIMITS = (0.0, 75.0)
MODE = pt.PrandtlIshlinskiiStage(
    linear=1e-6, thresholds=(), weights=(), frequency=160.0, damping_ratio=0.05
)
LINES = pt.RandomPhaseMultisine(band=(8.0, 900.0), low=28.0, high=32.0)
FEW = pt.TuningSearch(particles=12, iterations=30, seed=1)


def stage(noise: float = 5e-9) -> pt.VirtualStage:
    return pt.VirtualStage.of(MODE, noise=noise, delay=2e-4)


def test_gains_are_those_of_the_true_stage() -> None:
    response = pt.frequency_response(stage(), LINES, rate=RATE)
    tuned = pt.tune(response, limits=LIMITS, parts="pid")
    true = pt.tune(stage(), dt=1 / RATE, limits=LIMITS, parts="pid")

    def ki(one: Any) -> float:
        law = one.controller.feedback
        return float(law.kp / law.ti)

    assert ki(tuned) == pytest.approx(ki(true), rel=0.01)
    # What holds within the band holds on the stage.
    report = pt.check_loop(stage(), tuned.controller)
    assert report.everywhere
    assert report.middle.sensitivity < 2.0 * 1.005
    assert tuned.kept[-1].value <= 2.0


def test_first_gains_in_ten_seconds() -> None:
    quick = pt.RandomPhaseMultisine(
        band=(4.0, 900.0), low=29.0, high=31.0, realisations=3, periods=2
    )
    # With the ramps from rest and back.
    assert quick.duration + 3 * 2 * 0.5 < 10.0
    device = pt.hardware.VirtualDevice(stage(), limits=LIMITS)
    first = pt.tune(
        pt.frequency_response(device, quick, rate=RATE), limits=LIMITS, parts="pid", search=FEW
    )
    true = pt.tune(stage(), dt=1 / RATE, limits=LIMITS, parts="pid", search=FEW)
    size = [float(one.controller.feedback.kp / one.controller.feedback.ti) for one in (first, true)]  # type: ignore[union-attr]
    assert size[0] == pytest.approx(size[1], rel=0.1)
    assert pt.check_loop(stage(), first.controller).middle.sensitivity < 2.0
    assert device.held == 0.0


def test_a_wider_band_costs_gain() -> None:
    loose, tight = (
        pt.tune(
            pt.frequency_response(stage(noise), LINES, rate=RATE),
            limits=LIMITS,
            parts="pid",
            search=FEW,
        ).controller
        for noise in (400e-9, 5e-9)
    )
    assert loose.feedback is not None
    assert tight.feedback is not None
    size = [float(one.feedback.kp / one.feedback.ti) for one in (loose, tight)]  # type: ignore[union-attr]
    assert size[0] < 0.97 * size[1]
    assert pt.check_loop(stage(), loose).middle.sensitivity < 2.0


def test_the_worst_sensitivity_is_that_of_the_circles() -> None:
    law = pt.Pid(kp=2e5, ti=0.002, td=1e-4)
    notch = pt.Notch(frequency=160.0, width=0.5, depth=0.2)
    loop = pt.Controller(dt=1 / RATE, limits=LIMITS, feedback=law, filters=(notch,))
    response = pt.frequency_response(stage(20e-9), LINES, rate=RATE)
    f = response.frequency
    z = np.exp(2j * np.pi * f / RATE)
    q = 1.0 - 1.0 / z
    pid = law.kp * (1.0 + (1.0 / RATE / law.ti) / q + law.td * RATE * q)
    without = controller_response(replace(loop, filters=()), f)
    assert without == pytest.approx(pid, rel=1e-9)
    gain = controller_response(loop, f)
    # On a dense sample of each circle the sensitivity is as large, and not larger.
    turn = np.exp(2j * np.pi * np.arange(720) / 720)
    plants = response.value[:, np.newaxis] + response.band()[:, np.newaxis] * turn
    size = 1.0 / np.abs(1.0 + gain[:, np.newaxis] * plants)
    value, frequency = worst_sensitivity(response, loop)
    assert value == pytest.approx(size.max(), rel=1e-3)
    assert frequency == f[np.argmax(size.max(axis=1))]


def test_what_cannot_be_tuned_is_refused() -> None:
    response = pt.frequency_response(stage(), LINES, rate=RATE)
    with pytest.raises(pt.ParameterError, match="rate of the loop"):
        pt.tune(response, limits=LIMITS, dt=1e-3)
    with pytest.raises(pt.ParameterError, match="limits"):
        pt.tune(response)
    wide = replace(response, variance=response.variance * 1e10)
    with pytest.raises(pt.ParameterError, match=r"band of the response|keeps? the margins"):
        pt.tune(wide, limits=LIMITS, parts="pid", search=FEW)
