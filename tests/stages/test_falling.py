"""Stages with plays whose displacement falls as the drive rises."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import piezotrack as pt
from play_records import STAGE

BEHIND: dict[str, Any] = {
    "creep_weights": (0.004, 0.01),
    "creep_times": (0.1, 1.0),
    "frequency": 160.0,
    "damping_ratio": 0.065,
}
ENVELOPE = pt.GeneralisedPrandtlIshlinskiiStage(
    linear=8e-7,
    thresholds=(3.0, 8.0, 15.0),
    weights=(2e-7, 0.0, 2e-7),
    scale=60.0,
    slope=0.02,
    shift=-0.3,
    level=17.0,
    falling_scale=60.0,
    falling_slope=0.02,
    falling_shift=-0.3,
    falling_level=20.0,
)


def falling(stage: Any) -> Any:
    """The same stage with the signs of all weights turned."""
    return replace(stage, linear=-stage.linear, weights=tuple(-w for w in stage.weights))


def path() -> np.ndarray:
    """A drive that turns at places which do not repeat, from 0 V on."""
    t = np.arange(4000) * 0.01
    u: np.ndarray = 20.0 * np.sin(t) + 12.0 * np.sin(2.7 * t) + 3.0 * np.sin(17.3 * t)
    return u


@pytest.mark.parametrize("behind", [{}, BEHIND], ids=["bare", "behind"])
@pytest.mark.parametrize("hold", ["foh", "zoh"])
def test_it_does_under_the_negative_drive_what_the_rising_one_does(behind: Any, hold: Any) -> None:
    stage = replace(STAGE, **behind)
    x = stage.simulate(path(), 1e-3, hold=hold).x
    np.testing.assert_array_equal(falling(stage).simulate(-path(), 1e-3, hold=hold).x, x)
    assert np.ptp(x) > 1e-5


@pytest.mark.parametrize("behind", [{}, BEHIND], ids=["bare", "behind"])
def test_with_envelopes_it_is_the_negative(behind: Any) -> None:
    stage = replace(ENVELOPE, **behind)
    x = stage.simulate(path(), 1e-3).x
    np.testing.assert_array_equal(falling(stage).simulate(path(), 1e-3).x, -x)


@pytest.mark.parametrize("stage", [STAGE, ENVELOPE], ids=["plays", "envelopes"])
def test_the_inverse_undoes_it(stage: Any) -> None:
    stage = falling(stage)
    x = stage.simulate(path(), 0.01).x
    none = np.zeros_like(x)
    back = stage.inverse()._begun(0.01).along(x, none, none)
    np.testing.assert_allclose(stage.simulate(back, 0.01).x, x, rtol=0.0, atol=1e-17)
    moved = np.r_[False, np.diff(x) != 0.0]
    np.testing.assert_allclose(back[moved], path()[moved], rtol=0.0, atol=1e-10)


@pytest.mark.parametrize("stage", [STAGE, ENVELOPE], ids=["plays", "envelopes"])
def test_the_inverse_can_begin_on_a_settled_loop(stage: Any) -> None:
    stage = falling(stage)
    u = path()
    before = stage.simulate(u[:2000], 0.01)
    x = stage.simulate(u[1999:], 0.01, initial=before.final).x
    none = np.zeros_like(x)
    back = stage.inverse(initial=before.final)._begun(0.01).along(x, none, none)
    again = stage.simulate(np.r_[u[:2000], back[1:]], 0.01).x[1999:]
    np.testing.assert_allclose(again, x, rtol=0.0, atol=1e-17)


@pytest.mark.parametrize("stage", [STAGE, ENVELOPE], ids=["plays", "envelopes"])
def test_its_gains_are_negative(stage: Any) -> None:
    plants = falling(stage)._core.loop_plants(-30.0, 30.0, 0.0)
    least, middle, most = (plant.matrices()[3] for plant in plants)
    # Between two envelopes the output stands still after a reversal.
    assert 0.0 >= least > middle > most
    if stage is ENVELOPE:
        rising = [plant.matrices()[3] for plant in stage._core.loop_plants(-30.0, 30.0, 0.0)]
        assert [-least, -middle, -most] == rising


def test_it_is_controlled_with_a_negative_gain() -> None:
    stage = falling(replace(STAGE, **BEHIND))
    reference = pt.sine(frequency=5.0, low=-40e-6, high=0.0, duration=1.0)
    pid = pt.Pid.from_um(kp=-0.05, ti=0.002, td=0.0)
    loop = pt.Controller(dt=1e-4, limits=(-10.0, 75.0), feedforward=stage.inverse(), feedback=pid)
    assert pt.track(stage, loop, reference).metrics.rms_error < 50e-9


@pytest.mark.parametrize("stage", [STAGE, ENVELOPE], ids=["plays", "envelopes"])
def test_mixed_signs_and_no_gain_are_refused(stage: Any) -> None:
    mixed = (-1e-7,) * len(stage.weights)
    with pytest.raises(pt.ParameterError) as caught:
        replace(stage, weights=mixed)
    message = "weights[0] is -1e-7 m/V: expected a finite number, 0 or above, as linear is"
    assert str(caught.value) == message
    with pytest.raises(pt.ParameterError, match=r"weights\[1\] is .*: expected .*0 or below"):
        replace(falling(stage), weights=(0.0, 1e-7, *mixed[2:]))
    with pytest.raises(pt.ParameterError, match=r"^linear is 0 m/V: expected .* other than 0"):
        replace(stage, linear=0.0)
