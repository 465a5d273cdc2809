"""Sessions given anything at all: the command stays finite and within the limits."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import strategies as st

import piezotrack as pt
from edge_values import Slot, arguments, number
from fuzzing import fuzz
from soak import Script, Tally

if TYPE_CHECKING:
    from collections.abc import Callable

    Draw = Callable[[st.SearchStrategy[Any]], Any]

pytestmark = [
    pytest.mark.slow,
    # A call stopped for its time may be stopped in a callback of Python's own, which says so.
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]

DAHL = pt.DahlStage.xu_li_2010()
FEEDBACKS = [
    None, pt.Pid.xu_li_2010(), pt.Pid.from_um(kp=0.01, ti=0.05),
    pt.control.StateSpace([[1.0]], [2000.0], [1.0]),
    pt.control.StateSpace([[1.0]], [2000.0], [1.0], back=[0.5]),
    pt.control.StateSpace([[2.0]], [2000.0], [1.0]),
]  # fmt: skip
LEARNERS = [
    None, None, pt.Repetitive.xu_li_2010(0.2),
    pt.Repetitive(period=0.2, smoothing=pt.control.ZeroPhase()),
    pt.Repetitive(period=0.213, forgetting_factor=1.0, pause=False, smoothing=None),
]  # fmt: skip
FILTERS = [(), (), (pt.LowPass(5.0),), (pt.LowPass(5.0), pt.Notch(10.0))]
FORWARDS = [None, None, DAHL.inverse(), DAHL.inverse(playback="online")]
SPANS = [None, None, (-5e-6, 120e-6), (-1.0, 1.0)]
JUMPS = [None, None, 2e-6, 5e-324]
LIMITS = [(0.0, 75.0), (0.0, 75.0), (-20.0, 120.0), (20.0, 75.0), (-75.0, -20.0), (0.0, 5e-324)]

STEP = {name: number(1e-5) for name in ("reference", "measured")}
OTHERS = {name: Slot(None, number(1e-5).other) for name in ("velocity", "acceleration", "preview")}
OTHERS["feedforward"] = Slot(None, number(20.0).other)


def loop(script: Script, draw: Draw) -> Any:
    return script.new(
        "pt.Controller",
        dt=0.02,
        limits=draw(st.sampled_from(LIMITS)),
        feedback=draw(st.sampled_from(FEEDBACKS)),
        repetitive=draw(st.sampled_from(LEARNERS)),
        filters=draw(st.sampled_from(FILTERS)),
        feedforward=draw(st.sampled_from(FORWARDS)),
        span=draw(st.sampled_from(SPANS)),
        max_jump=draw(st.sampled_from(JUMPS)),
    )


def drive(script: Script, draw: Draw) -> None:
    """Step a session with odd values now and then, and use its other methods between."""
    controller = loop(script, draw)
    if controller is None:
        return
    present = number(None, near=20.0).draw(draw, odd=draw(st.integers(0, 2)) == 0)
    session = script.on(controller, "start", present=present, again=False)
    if session is None:
        return
    low, high = controller.limits
    for _ in range(draw(st.integers(1, 20))):
        given = arguments(draw, STEP | OTHERS, most=draw(st.sampled_from([0, 0, 1, 3])))
        reference, measured = given.pop("reference"), given.pop("measured")
        door = draw(st.sampled_from(["step", "step", "step_um"]))
        volts = script.on(session, door, reference, measured, again=False, **given)
        if not script.refused:
            script.judge(low <= volts <= high, "outside the limits", f"{low} <= {{}} <= {high}")
            last = script.on(session, "last", again=False)
            script.judge(last.voltage == volts, "another voltage", f"{{}}.voltage == {volts}")
        other = draw(st.integers(0, 20))
        if other == 0:
            script.on(session, "applied", number(20.0).draw(draw, odd=True), again=False)
        elif other == 1:
            script.on(session, "reset", again=False)
        elif other == 2:
            second = loop(script, draw)
            script.on(session, "retune", second, again=False)
            if not script.refused:
                low, high = second.limits


@pytest.mark.parametrize("part", range(2))
def test_a_session_stays_within_its_limits(
    part: int, request: pytest.FixtureRequest, record_property: Any
) -> None:
    tally = Tally(f"sessions, part {part + 1}")
    calls = int(0.2 * request.config.getoption("--soak-calls"))
    fuzz(tally, drive, calls=calls, start=request.config.getoption("--soak-seed"))
    record_property("tally", tally.row())
    tally.verdict()
