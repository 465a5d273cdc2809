"""PD with the inverse of a model: what a law without integrator leaves at rest."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import piezotrack as pt

LIMITS = (0.0, 75.0)
DT = 1e-3
GAIN = 1.2e-6
QUICK: dict[str, Any] = {
    "search": pt.TuningSearch(particles=24, iterations=25),
    "parts": "pid",
    "law": "pd",
}


def stage(gain: float = GAIN) -> pt.stages.PrandtlIshlinskiiStage:
    """A lag without hysteresis: its static gain [m/V] is one number."""
    return pt.stages.PrandtlIshlinskiiStage(
        linear=gain, thresholds=(10.0,), weights=(0.0,), time_constant=4e-3
    )


def steps() -> pt.Reference:
    return pt.staircase(dwell=0.3, steps=4, low=20e-6, high=60e-6)


def tuned(model: pt.stages.PrandtlIshlinskiiStage) -> pt.Controller:
    tuned = pt.tune(
        stage(), steps(), dt=DT, limits=LIMITS, feedforward=model.inverse(), **QUICK
    ).controller
    assert isinstance(tuned.feedback, pt.Pid)
    assert math.isinf(tuned.feedback.ti)
    return tuned


def at_rest(controller: pt.Controller) -> tuple[Any, Any]:
    """Desired displacement and error at the end of each dwell [m]."""
    run = pt.track(stage(), controller, steps())
    moved = np.flatnonzero(np.diff(run.desired) != 0.0)
    moved = moved[np.diff(moved, append=run.desired.size) > 100]
    last = np.append(moved[1:], run.desired.size - 1) - 60
    return run.desired[last], run.error[last]


@pytest.mark.parametrize("off", [0.9, 1.1])
def test_the_static_error_of_the_model_is_divided_by_one_plus_the_loop_gain(off: float) -> None:
    controller = tuned(stage(off * GAIN))
    assert isinstance(controller.feedback, pt.Pid)
    desired, error = at_rest(controller)
    # The inverse alone brings the stage to desired / off.
    alone = desired * (1.0 - 1.0 / off)
    np.testing.assert_allclose(error, alone / (1.0 + controller.feedback.kp * GAIN), rtol=1e-3)
    # Which the feedback makes smaller, but does not remove.
    assert np.all(np.abs(error) < 0.7 * np.abs(alone))
    assert np.all(np.abs(error) > 0.02 * np.abs(alone))


def test_with_the_inverse_of_the_stage_nothing_is_left_and_without_it_most_of_the_way() -> None:
    controller = tuned(stage())
    law = controller.feedback
    assert isinstance(law, pt.Pid)
    desired, with_inverse = at_rest(controller)
    assert np.abs(with_inverse).max() < 1e-4 * desired.max()
    _, without = at_rest(pt.Controller(dt=DT, limits=LIMITS, feedback=law))
    np.testing.assert_allclose(without, desired / (1.0 + law.kp * GAIN), rtol=1e-3)
    assert np.all(without > 100.0 * np.abs(with_inverse))


def test_its_margins_hold_for_the_gain_of_the_whole_set() -> None:
    spread = pt.Spread(gain=0.3)
    result = pt.tune(
        stage(), steps(), dt=DT, limits=LIMITS, feedforward=stage(1.1 * GAIN).inverse(),
        spread=spread, **QUICK,
    )  # fmt: skip
    assert max(one.share for one in result.kept) <= 1.01
    calm = result.controller
    free = tuned(stage(1.1 * GAIN))
    assert isinstance(calm.feedback, pt.Pid)
    assert isinstance(free.feedback, pt.Pid)
    # Less gain, and so more of the error of the model.
    assert calm.feedback.kp < free.feedback.kp
    assert np.all(np.abs(at_rest(calm)[1]) > np.abs(at_rest(free)[1]))


@pytest.mark.parametrize("plant", [stage(), pt.VirtualStage.of(stage(), noise=5e-9)])
def test_it_is_refused_without_feedforward(plant: Any) -> None:
    words = "law is 'pd' without feedforward: expected feedforward="
    with pytest.raises(pt.ParameterError, match=words):
        pt.tune(plant, steps(), dt=DT, limits=LIMITS, feedforward=None, **QUICK)


def test_a_virtual_stage_has_no_inverse_of_its_own() -> None:
    with pytest.raises(pt.ParameterError, match="law is 'pd' without feedforward"):
        pt.tune(pt.VirtualStage.of(stage()), steps(), dt=DT, limits=LIMITS, **QUICK)


def test_it_is_refused_without_a_reference() -> None:
    with pytest.raises(pt.ParameterError, match="law is 'pd' without a reference"):
        pt.tune(stage(), dt=DT, limits=LIMITS, **QUICK)
