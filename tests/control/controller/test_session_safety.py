"""What a session does with readings that are none, with wrong units, and with copies of itself."""

from __future__ import annotations

import copy
import math
import pickle
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt
from all_stages import STAGES

if TYPE_CHECKING:
    from collections.abc import Callable

DT = 0.02
LIMITS = (0.0, 75.0)
STAGE = pt.PrandtlIshlinskiiStage(
    linear=1.2e-6, thresholds=(2.0, 5.0, 10.0), weights=(5e-8, 5e-8, 5e-8), time_constant=0.002
)
PID = pt.Pid.from_um(kp=0.05, ti=0.05)


def loop(**changes: Any) -> pt.Controller:
    return pt.Controller(**{"dt": DT, "limits": LIMITS, "feedback": PID, **changes})


FULL = loop(
    feedforward=STAGE.inverse(),
    repetitive=pt.Repetitive(period=5.0, smoothing=pt.control.ZeroPhase(), kq=3e5),
    filters=[pt.LowPass(8.0)],
)
LAWS: dict[str, pt.Controller] = {
    "PID": loop(),
    "PID with a filter": loop(
        feedback=pt.Pid.from_um(kp=0.02, ti=0.1), filters=[pt.LowPass(5.0), pt.Notch(20.0)]
    ),
    "PID and repetitive": loop(
        repetitive=pt.Repetitive(period=5.0, kq=3e5, smoothing=pt.control.ZeroPhase())
    ),
    "the paper's": loop(repetitive=pt.Repetitive.xu_li_2010(5.0)),
    "state space": loop(feedback=pt.control.StateSpace([[1.0]], [2e4], [1.0])),
    "all": FULL,
}


class Plant:
    """Three plays and a lag, sample by sample."""

    def __init__(self) -> None:
        self.plays, self.x = [0.0] * 3, 0.0

    def __call__(self, volts: float) -> float:
        out = 1.2e-6 * volts
        for i, (threshold, weight) in enumerate(zip(STAGE.thresholds, STAGE.weights, strict=True)):
            self.plays[i] = max(volts - threshold, min(volts + threshold, self.plays[i]))
            out += weight * self.plays[i]
        self.x += 0.99995 * (out - self.x)
        return self.x


def desired(k: int, height: float = 60e-6) -> float:
    return 0.5 * height * (1.0 - math.cos(2.0 * math.pi * k * DT / 5.0))


def errors(session: pt.control.Session, plant: Plant, samples: range) -> list[float]:
    distances = []
    for k in samples:
        distances.append(abs(desired(k) - plant.x))
        plant(session.step(desired(k), plant.x))
    return distances


# Readings that are none.


@pytest.mark.parametrize("reading", [9.91e37, -9.9e37, 1.0, -0.3, math.nan, math.inf])
@pytest.mark.parametrize("law", LAWS)
def test_one_absurd_reading_is_forgotten_within_a_period(law: str, reading: float) -> None:
    session, plant = LAWS[law].start(), Plant()
    before = max(errors(session, plant, range(5000))[-250:])
    held = session.last.feedback
    session.step(desired(5000), reading)
    assert not session.last.measurement_valid
    assert session.last.feedback == held
    after = errors(session, plant, range(5001, 5251))
    assert max(after) < 1.2 * before + 1e-6
    outside = int(math.isfinite(reading))
    assert session.refused == (1 - outside, outside, 0)


def test_the_span_is_what_the_stage_of_the_feedforward_reaches() -> None:
    x = STAGE.simulate(np.repeat([0.0, 75.0, 0.0], 100), DT).x
    travel = float(x.max() - x.min())
    session = loop(feedforward=STAGE.inverse()).start()
    session.step(10e-6, 10e-6)
    for reading, valid in ((1.9 * travel, True), (2.1 * travel, False), (-0.9 * travel, True)):
        session.step(10e-6, reading)
        assert session.last.measurement_valid is valid
    shifted = pt.Inverse(stage=STAGE, offset=500e-6)
    session = loop(feedforward=shifted).start()
    session.step(550e-6, 550e-6)
    session.step(550e-6, 50e-6)
    assert session.refused.outside == 1
    # Without a stage, what no nanopositioner reaches.
    session = loop().start()
    session.step(10e-6, 9e-3)
    assert session.last.measurement_valid
    session.step(10e-6, 11e-3)
    assert session.refused == (0, 1, 0)


def test_a_jump_further_than_the_stage_can_move_is_refused_and_counted() -> None:
    session = loop(span=(-5e-6, 120e-6), max_jump=2e-6).start()
    for reading in (50e-6, 51e-6, 60e-6, 52e-6, math.nan, 130e-6):
        session.step(50e-6, reading)
    assert session.refused == pt.control.RefusedReadings(not_finite=1, outside=1, jumps=1)
    # A stage that was moved by hand is found again: the distance grows with each sample.
    for _ in range(30):
        session.step(50e-6, 90e-6)
    assert session.last.measurement_valid
    session.reset()
    assert session.refused == (0, 0, 0)


# Units.

WRONG: dict[str, tuple[Callable[[pt.control.Session], object], str]] = {
    "um for m": (
        lambda s: s.step(110.0, 0.0),
        "reference is 110 m: .*110 um is 110e-6 m, .*step_um",
    ),
    "a whole number": (lambda s: s.step(110, 0.0), "reference is 110 m"),
    "float32": (
        lambda s: s.step(np.float32(110), 0.0),  # type: ignore[arg-type]
        "reference is 110 m",
    ),
    "int64": (
        lambda s: s.step(np.int64(110), 0.0),  # type: ignore[arg-type]
        "reference is 110 m",
    ),
    "an array of one": (
        lambda s: s.step(np.array(110.0), 0.0),  # type: ignore[arg-type]
        "reference is 110 m",
    ),
    "nm for m": (lambda s: s.step(110_000.0, 0.0), "110000 nm is 110000e-9 m"),
    "half": (lambda s: s.step(0.5, 0.49), r"reference is 0.5 m: .*0.5 um is 0.5e-6 m"),
    "measured": (lambda s: s.step(10e-6, 9.8), r"measured is 9.8 m: .*9.8 um is 9.8e-6 m"),
    "measured whole": (lambda s: s.step(10e-6, 98), r"measured is 98 m"),
    "far too large": (lambda s: s.step(10**400, 0.0), r"reference is 1000.*"),
    "measured too large": (lambda s: s.step(0.0, 10**400), r"measured is 1000.*"),
    "preview too large": (lambda s: s.step(1e-6, 0.0, preview=10**400), r"preview is 1000.*"),
    "um of um": (lambda s: s.step_um(110e6, 0.0), r"reference is 110 m"),
    "text": (lambda s: s.step_um("1", 0.0), r"reference is '1'"),  # type: ignore[arg-type]
}


@pytest.mark.parametrize("name", WRONG)
@pytest.mark.parametrize("with_stage", [False, True])
def test_the_wrong_unit_moves_nothing(name: str, with_stage: bool) -> None:
    call, message = WRONG[name]
    session = (FULL if with_stage else loop()).start()
    if "preview" in name and not with_stage:
        pytest.skip("only an inverse takes a preview")
    with pytest.raises(pt.ParameterError, match=message) as caught:
        call(session)
    assert len(str(caught.value)) < 300
    # Nothing has changed.
    fresh = (FULL if with_stage else loop()).start()
    assert [session.step(desired(k), 0.0) for k in range(5)] == [
        fresh.step(desired(k), 0.0) for k in range(5)
    ]


def test_micrometres_are_metres() -> None:
    one, other = FULL.start(), FULL.start()
    for k in range(100):
        a = one.step(desired(k), 0.9 * desired(k), velocity=1e-6, preview=desired(k + 1))
        b = other.step_um(
            1e6 * desired(k), 0.9e6 * desired(k), velocity=1.0, preview=1e6 * desired(k + 1)
        )
        assert a == pytest.approx(b, rel=1e-12)


def test_a_displacement_beyond_the_stage_is_refused_without_a_guess() -> None:
    with pytest.raises(pt.ParameterError) as caught:
        FULL.start().step(300e-6, 0.0)
    assert " um is " not in str(caught.value)
    # It may be the sensor's zero: no reason to stop at the first sample.
    session = FULL.start()
    session.step(10e-6, 300e-6)
    assert session.refused.outside == 1


def test_a_glitch_that_is_no_unit_never_raises() -> None:
    session = loop().start()
    for reading in (9.91e37, math.nan, math.inf, -math.inf, 1e300):
        session.step(10e-6, reading)
    assert session.refused == (3, 2, 0)
    session.step(10e-6, 1e-6)
    # From the first valid reading on, a reading in another unit is a glitch too.
    session.step(10e-6, 9.8)
    assert session.refused == (3, 3, 0)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"span": (0.0, 1.5)}, "span is 1.5 m: expected a displacement in m, at most a metre"),
        ({"span": (1e-4, 0.0)}, r"span is \(0.0001, 0\) m: expected the lower one first"),
        ({"span": (0.0, math.nan)}, r"span\[1\] is nan"),
        ({"span": 1e-4}, r"span is 0.0001: expected \(low, high\) in m"),
        ({"max_jump": 0.0}, "max_jump is 0 m: expected a displacement above 0"),
        ({"max_jump": math.nan}, "max_jump is NaN m"),
        ({"max_jump": "1"}, "max_jump is '1'"),
    ],
)
def test_refuses_a_span_that_is_none(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(pt.ParameterError, match=message):
        loop(**changes)


# Saturation.


@pytest.mark.parametrize(
    "smoothing",
    [pt.control.ZeroPhase(), pt.control.Lag(), pt.control.Lag(compensated=True)],
    ids=repr,
)
def test_the_repetitive_part_is_well_again_after_a_reference_beyond_reach(smoothing: Any) -> None:
    session = loop(repetitive=pt.Repetitive(period=5.0, kq=3e5, smoothing=smoothing)).start()
    plant = Plant()

    def periods(count: int, height: float) -> float:
        worst = 0.0
        for n in range(count):
            for k in range(250):
                if n == count - 1:
                    worst = max(worst, abs(desired(k, height) - plant.x))
                plant(session.step(desired(k, height), plant.x))
                assert abs(session.last.repetitive) <= 75.0
        return worst

    before = periods(30, 80e-6)
    periods(300, 300e-6)
    periods(2, 80e-6)
    assert periods(1, 80e-6) < 1.5 * before + 1e-8


# Copies.


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(
    "copied", [copy.copy, copy.deepcopy, lambda one: pickle.loads(pickle.dumps(one))]
)
def test_a_copy_of_a_session_goes_on_by_itself(law: str, copied: Callable[[Any], Any]) -> None:
    session, plant = LAWS[law].start(), Plant()
    errors(session, plant, range(300))
    other = copied(session)
    assert other.last == session.last
    other.step(1e-6, 0.0)
    assert other.last != session.last
    other = copied(session)
    for k in range(300, 900):
        reading = math.nan if k % 50 == 0 else plant.x
        volts = session.step(desired(k), reading)
        assert other.step(desired(k), reading) == volts
        plant(volts)
    assert other.last == session.last
    assert other.refused == session.refused


@pytest.mark.parametrize("model", STAGES)
def test_a_copy_of_an_inverse_goes_on_by_itself(model: str) -> None:
    session = STAGES[model].inverse().start(DT)
    for k in range(300):
        session.step(desired(k), preview=desired(k + 1))
    other = pickle.loads(pickle.dumps(session))
    ahead = [session.step(desired(k), preview=desired(k + 1)) for k in range(300, 600)]
    assert [other.step(desired(k), preview=desired(k + 1)) for k in range(300, 600)] == ahead


def pickled(one: Any) -> Any:
    return pickle.loads(pickle.dumps(one))


def test_results_are_copied_whole() -> None:
    controller = FULL
    reference = pt.sine(frequency=0.2, low=0.0, high=60e-6, duration=10.0)
    run = pt.track(STAGE, controller, reference)
    report = pt.check_loop(STAGE, controller)
    copies: list[Callable[[Any], Any]] = [copy.deepcopy, pickled]
    for copied in copies:
        assert copied(controller) == controller
        again = copied(run)
        assert np.array_equal(again.voltage, run.voltage)
        assert again.metrics == run.metrics
        # A copied controller is one that works.
        assert np.array_equal(pt.track(STAGE, again.controller, reference).voltage, run.voltage)
        other = copied(report)
        assert str(other) == str(report)
        assert np.array_equal(other.response(50).open_loop, report.response(50).open_loop)


def test_a_state_of_another_controller_is_refused() -> None:
    session = FULL.start()
    with pytest.raises(pt.ParameterError, match="state is another"):
        session._core.load(b"0" * 40)
    assert session.refused == (0, 0, 0)


def test_an_absurd_report_of_the_amplifier_is_ignored() -> None:
    session, plant = LAWS["state space"].start(), Plant()
    before = max(errors(session, plant, range(5000))[-250:])
    session.applied(9.91e37)
    session.reset()
    assert max(errors(session, plant, range(5000, 5750))[-250:]) < 1.2 * before + 1e-6


def test_a_running_loop_never_raises_for_a_reading() -> None:
    session = loop().start()
    for _ in range(10):
        session.step(10e-6, math.nan)
    session.step(10e-6, 0.5)
    session.reset()
    session.step(10e-6, 0.5)
    assert session.refused == (0, 1, 0)


def test_an_inverse_refuses_another_unit() -> None:
    for reference in (110, np.float32(110), -110.0):
        with pytest.raises(pt.ParameterError, match=r"reference is -?110 m: .*110 um is -?110e-6"):
            STAGE.inverse().start(DT).step(reference)  # type: ignore[arg-type]
