"""Tracking on the virtual stage, beside the published figures."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

import piezotrack as pt
from loops import PID, STAGE, WINDING, fig_12, fig_13, forward, loop, sine

UM = 1e-6
TABLE_1 = pt.DahlStage.xu_li_2010()
# Where the inverse of Table 1, which is viscous, is not clipped.
WIDE = (-20.0, 95.0)


# Fig. 12: 0.2 Hz, 0 to 110 um.


def test_feedforward_alone_leaves_what_the_model_leaves() -> None:
    """Published: 5.69 um at most."""
    run = fig_12("FF")
    assert 4.5 * UM < run.metrics.max_error < 7.0 * UM
    assert not run.saturated.any()
    assert np.array_equal(run.voltage, run.feedforward)
    assert not run.feedback.any()


def test_feedback_alone_lags() -> None:
    """Published: 4.44 um, 0.063 rad, a loop of 6.24 % of the travel."""
    run = fig_12("FB")
    assert 3.0 * UM < run.metrics.max_error < 5.0 * UM
    assert run.metrics.phase_lag is not None
    assert run.metrics.widest_loop is not None
    assert 0.055 < run.metrics.phase_lag < 0.068
    assert 0.055 < run.metrics.widest_loop < 0.072
    # With an integrator at the head of the loop the error is (1/Kv) of the velocity.
    w, gain = 2 * math.pi * 0.2, 110 * UM / float(np.ptp(run.voltage))
    assert run.metrics.phase_lag == pytest.approx(w * 0.009 / (0.120e6 * gain), rel=0.1)


def test_both_together_are_better_than_either() -> None:
    """Published: within 1.5 um, 0.006 rad, 1.76 %."""
    run = fig_12("FF FB")
    assert run.metrics.phase_lag is not None
    assert run.metrics.widest_loop is not None
    # The noise of the sensor sets the floor.
    assert 0.3 * UM < run.metrics.max_error < 1.5 * UM
    assert abs(run.metrics.phase_lag) < 0.006
    assert run.metrics.widest_loop < 0.0176
    for other in ("FF", "FB"):
        assert run.metrics.max_error < 0.4 * fig_12(other).metrics.max_error
        assert run.metrics.rms_error < 0.2 * fig_12(other).metrics.rms_error
    away = run.desired > 5 * UM
    assert not run.saturated[away].any()
    # The sensor's noise is not in the true displacement.
    assert run.score(true=True).rms_error < run.metrics.rms_error


# Fig. 13: limits of 6 V and 28 V.


def test_saturation_weakens_and_antiwindup_helps() -> None:
    """Published: 6.35 um without antiwindup, six times as much as unsaturated; less with it."""
    free, winding, unwinding = fig_13(None), fig_13(WINDING), fig_13(PID)
    assert not free.saturated[250:].any()
    for run in (winding, unwinding):
        assert run.voltage.min() == 6.0
        assert run.voltage.max() == 28.0
        assert run.saturated[250:].any()
    assert free.metrics.max_error < 1.06 * UM
    assert winding.metrics.max_error > 6.0 * free.metrics.max_error
    assert unwinding.metrics.max_error < 0.6 * winding.metrics.max_error
    # What is left with it comes from where 28 V do not reach, and ends with it.
    clipped = unwinding.saturated & (unwinding.t >= 5.0)
    assert np.abs(unwinding.error[clipped]).max() == unwinding.metrics.max_error
    assert unwinding.saturated.mean() < 0.8 * winding.saturated.mean()


# Fig. 14: 0.5 Hz, repetitive control.


def test_half_a_hertz_without_learning() -> None:
    """Published: 2.29 um, with a stage whose model fits less well than this one's does."""
    run = pt.track(STAGE, loop(feedforward=forward(), feedback=PID), sine(0.5, 20.0))
    assert 0.8 * UM < run.metrics.max_error < 2.29 * UM
    later = [one.rms_error for one in run.periods[1:]]
    assert max(later) < 1.1 * min(later)


@pytest.mark.parametrize("kind", ["paper", "zero phase"])
def test_learning_makes_the_error_fall_period_by_period(kind: str) -> None:
    """Published: it falls until the fourth period; uRC grows while the total hardly changes.

    With feedback alone, so that there is something to learn: 9 um against 1 um of noise.
    """
    repetitive = (
        pt.Repetitive.xu_li_2010(2.0)
        if kind == "paper"
        else pt.Repetitive(period=2.0, smoothing=pt.control.ZeroPhase())
    )
    course = sine(0.5, 20.0, 10 * UM, 100 * UM)
    plain = pt.track(STAGE, loop(feedback=PID), course)
    run = pt.track(STAGE, loop(feedback=PID, repetitive=repetitive), course)
    rms = np.array([one.rms_error for one in run.periods])
    untaught = np.array([one.rms_error for one in plain.periods])
    assert np.all(np.diff(rms[1:4]) < 0.0)
    # The lag Tq leaves 0.62 to 0.74 of the fundamental's error at 0.5 Hz.
    assert rms[-1] < 0.85 * untaught[-1]
    learnt = np.abs(run.repetitive.reshape(-1, 100)).max(axis=1)
    assert not run.repetitive[:90].any()
    assert np.all(np.diff(learnt[:4]) > 0.0)
    total = run.voltage.reshape(-1, 100)
    assert np.abs(total[4:] - total[1]).mean() < 0.2 * learnt[4:].mean() + 2.0


def test_learning_beside_feedforward_stays_within_the_published_bound() -> None:
    """Fig. 14: within 1.5 um after three periods."""
    repetitive = pt.Repetitive.xu_li_2010(2.0)
    controller = loop(feedforward=forward(), feedback=PID, repetitive=repetitive)
    run = pt.track(STAGE, controller, sine(0.5, 20.0))
    plain = pt.track(STAGE, loop(feedforward=forward(), feedback=PID), sine(0.5, 20.0))
    assert max(one.max_error for one in run.periods[3:]) < 1.5 * UM
    assert run.score(6.0).rms_error < 0.9 * plain.score(6.0).rms_error
    # Without the filter's lag more is learnt.
    repetitive = pt.Repetitive(period=2.0, smoothing=pt.control.ZeroPhase())
    better = dataclasses.replace(controller, repetitive=repetitive)
    last = pt.track(STAGE, better, sine(0.5, 20.0)).periods[-1]
    assert last.rms_error < 0.6 * plain.periods[-1].rms_error
