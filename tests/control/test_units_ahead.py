"""What is given to a session beside reference and measurement, in another unit."""

from __future__ import annotations

from typing import Any

import pytest

import piezotrack as pt

PLAYS = pt.PrandtlIshlinskiiStage(
    linear=10e-6, thresholds=(0.3, 0.8), weights=(2e-6, 1e-6), time_constant=2e-3
)


def session() -> pt.control.Session:
    return pt.Controller(
        dt=5e-3,
        limits=(0.0, 3.6),
        feedforward=PLAYS.inverse(),
        feedback=pt.Pid.from_um(kp=0.01, ti=0.01),
    ).start()


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"velocity": 37.0}, "velocity is 37 m/s: expected .* at most, the span of the sensor"),
        ({"preview": 10.0}, "preview is 10 m: expected .* what the sensor of this controller"),
        (
            {"feedforward": 1500.0},
            "feedforward is 1500 V: expected one near the limits, 0 to 3.6 V",
        ),
        ({"velocity": "fast"}, "velocity is 'fast'"),
    ],
)
def test_another_unit_is_refused_before_it_reaches_the_stage(
    given: dict[str, Any], message: str
) -> None:
    tried, same = session(), session()
    tried.step(20e-6, 19e-6)
    same.step(20e-6, 19e-6)
    with pytest.raises(pt.ParameterError, match=message):
        tried.step(20e-6, 20e-6, **given)
    # Nothing has changed.
    assert tried.step(21e-6, 20e-6) == same.step(21e-6, 20e-6)


def test_what_a_stage_can_have_goes_through() -> None:
    one = session()
    one.step(20e-6, 19e-6, velocity=4e-3, preview=22e-6)
    one.step(20e-6, 19e-6, feedforward=30.0)
    bare = pt.Controller(dt=0.01, limits=(0.0, 75.0), feedback=pt.Pid.xu_li_2010()).start()
    assert bare.step(1e-6, 0.0, feedforward=2.0) > 2.0


def test_noise_in_another_unit_is_refused() -> None:
    for noise in (65, 0.065):
        with pytest.raises(pt.ParameterError, match=f"noise is {noise:g} m rms: expected metres"):
            pt.VirtualStage.of(PLAYS, noise=noise)
