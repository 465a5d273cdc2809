"""References beyond what a stage reaches within the limits of its loop."""

from __future__ import annotations

from typing import Any

import pytest

import piezotrack as pt
from loops import PID, STAGE, loop, sine

UM = 1e-6
TABLE_1 = pt.DahlStage.xu_li_2010()


def test_a_reference_out_of_reach_is_told_how_far_and_where() -> None:
    with pytest.raises(
        pt.ParameterError,
        match=r"reference is 150 um at 2\.5 s, 3\d(\.\d)? um beyond 11\d\S* um: expected -0\.\d+ "
        r"to 11\d\S* um on the sensor, which this stage reaches from 0 to 75 V, "
        r"or beyond_reach=True",
    ):
        pt.track(STAGE, loop(feedback=PID), sine(0.2, 10.0, 0.0, 150 * UM))
    run = pt.track(STAGE, loop(feedback=PID), sine(0.2, 10.0, 0.0, 150 * UM), beyond_reach=True)
    assert run.saturated.any()
    assert 110 * UM < run.displacement.max() < 120 * UM


# On its settled loop from 0 to 60 um and back it stands 6.68 um high at 0 V.
REMANENT = pt.PrandtlIshlinskiiStage(
    linear=8e-7, thresholds=(3.0, 8.0, 15.0, 25.0), weights=(2e-7, 1e-7, 2e-7, 1e-7)
)


def test_a_reference_below_the_settled_loop_is_told_how_far() -> None:
    """From rest 0 um are at 0 V; once the stage was up, only a lower voltage leads there."""
    controller = loop(dt=1e-3, feedforward=REMANENT.inverse())
    with pytest.raises(
        pt.ParameterError,
        match=r"reference is 0 um at 1 s, 6\.68 um below 6\.679 um: expected "
        r"displacements that the stage reaches at 0 V on the settled loop, from 60 um "
        r"down, or beyond_reach=True",
    ):
        pt.track(REMANENT, controller, sine(1.0, 3.0, 0.0, 60 * UM))
    run = pt.track(REMANENT, controller, sine(1.0, 3.0, 0.0, 60 * UM), beyond_reach=True)
    assert run.displacement[500:].min() == pytest.approx(6.679 * UM, rel=1e-3)
    # What it says is what can be reached; with lower limits, all of it.
    assert not pt.track(REMANENT, controller, sine(1.0, 3.0, 7 * UM, 60 * UM)).saturated.any()
    lower = loop(dt=1e-3, limits=(-30.0, 75.0), feedforward=REMANENT.inverse())
    assert not pt.track(REMANENT, lower, sine(1.0, 3.0, 0.0, 60 * UM)).saturated.any()
    # A reference that does not come back is reached from rest.
    up = pt.sine(frequency=0.1, low=0.0, high=60 * UM, duration=5.0)
    pt.track(REMANENT, controller, up)


@pytest.mark.parametrize("stage", [STAGE, TABLE_1], ids=["virtual", "dahl"])
def test_below_the_lower_limit_is_out_of_reach_too(stage: Any) -> None:
    """At 6 V the stage stands some 8 um high, although it comes from 0."""
    with pytest.raises(pt.ParameterError, match=r"reference is 0 um at 0 s, \S+ um beyond"):
        pt.track(stage, loop(limits=(6.0, 28.0), feedback=PID), sine(0.2, 10.0, 0.0, 30 * UM))
    pt.track(stage, loop(limits=(6.0, 28.0), feedback=PID), sine(0.2, 5.0, 16 * UM, 30 * UM))
