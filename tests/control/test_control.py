"""Controllers as sessions: the paper's recursions, and what they do when something goes wrong."""

from __future__ import annotations

import dataclasses
import math
import re
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt

if TYPE_CHECKING:
    from collections.abc import Callable

DT, LIMITS, GAIN = 0.02, (0.0, 75.0), 1.57e-6  # s, V, m/V
PID = pt.Pid.xu_li_2010()
INVERSE = pt.DahlStage.xu_li_2010().inverse()


def loop(**parts: Any) -> pt.Controller:
    return pt.Controller(**{"dt": DT, "limits": LIMITS, **parts})


FULL = loop(
    feedforward=INVERSE,
    feedback=PID,
    repetitive=pt.Repetitive(period=2.0),
    filters=[pt.LowPass(20.0), pt.Notch(15.0, 0.3)],
)


def sine(n: int, low: float = 10e-6, high: float = 100e-6) -> Any:
    reference = pt.sine(frequency=0.5, low=low, high=high, duration=n * DT, ramp=0.0)
    return reference.sample(DT).x


def drive(session: pt.control.Session, reference: Any, x: float = 0.0, lag: float = 0.3) -> Any:
    """Lead a first-order lag of the stage's gain, and return errors and commands."""
    errors, commands = [], []
    for desired in np.asarray(reference).tolist():
        errors.append(desired - x)
        volts = session.step(desired, x)
        commands.append(session.last)
        x += (1.0 - lag) * (GAIN * volts - x)
    return np.array(errors), commands


# The recursions of the paper.


def test_pid_is_equations_22_to_25_as_corrected() -> None:
    kp, ti, td = 0.120e6, 0.009, 0.044
    tt = math.sqrt(ti * td)
    reference = sine(300, 0.0, 140e-6)
    errors, commands = drive(loop(feedback=PID).start(), reference)
    u, eu, e1, e2 = 0.0, 0.0, errors[0], errors[0]
    for e, command in zip(errors, commands, strict=True):
        u += kp * (e - e1) + kp * DT / ti * e + kp * td / DT * (e - 2 * e1 + e2) + DT / tt * eu
        v = min(max(u, 0.0), 75.0)
        assert command.unclipped == pytest.approx(u, rel=1e-9, abs=1e-9)
        assert command.voltage == pytest.approx(v, rel=1e-9, abs=1e-9)
        eu, e1, e2 = v - u, e, e1
    assert any(command.saturated for command in commands)


def test_the_literal_reading_of_23_fails_where_ours_works() -> None:
    """Printed, the recursion starts from the total command and adds the feedforward again."""
    reference = sine(500)
    table = reference / GAIN * 0.95
    session = loop(feedback=PID).start(present=float(table[0]))
    x, ours = reference[0], []
    for desired, volts in zip(reference.tolist(), table.tolist(), strict=True):
        ours.append(desired - x)
        x += 0.7 * (GAIN * session.step(desired, x, feedforward=volts) - x)
    kp, ti, td, tt = 0.120e6, 0.009, 0.044, math.sqrt(0.009 * 0.044)
    x, u, eu, e1, e2, printed = reference[0], 0.0, 0.0, 0.0, 0.0, []
    for desired, volts in zip(reference.tolist(), table.tolist(), strict=True):
        e = desired - x
        u = u + kp * (e - e1) + kp * DT / ti * e + kp * td / DT * (e - 2 * e1 + e2) + DT / tt * eu
        u = u + volts
        v = min(max(u, 0.0), 75.0)
        eu, e1, e2 = v - u, e, e1
        x += 0.7 * (GAIN * v - x)
        printed.append(e)
    assert np.abs(ours[100:]).max() < 1.5e-6
    assert np.abs(printed[100:]).max() > 20 * np.abs(ours[100:]).max()


@pytest.mark.parametrize("period", [2.0, 5.0])
def test_repetitive_is_equation_27_as_a_recursion(period: float) -> None:
    p, n = math.exp(-DT / 0.2), round(period / DT)
    session = loop(limits=(-500.0, 500.0), repetitive=pt.Repetitive.xu_li_2010(period)).start()
    errors = np.random.default_rng(1).normal(0.0, 1e-6, 4 * n)
    expected: list[float] = []
    for k, error in enumerate(errors.tolist()):
        old = expected[k - n - 1] + 1e6 * errors[k - n - 1] if k > n else 0.0
        expected.append(p * (expected[-1] if expected else 0.0) + (1 - p) * old)
        session.step(error, 0.0)
        assert session.last.repetitive == pytest.approx(expected[-1], rel=1e-9, abs=1e-12)
    # The pole printed in (29) and (30) grows by 4.4 % a period; this one does not grow.
    assert np.abs(expected).max() < 10.0


def test_a_law_in_state_space_is_what_it_says() -> None:
    a, b, c, d = np.array([[0.5, 0.1], [0.0, 1.0]]), [1e4, 2e4], [1.0, 0.5], 3e4
    session = loop(limits=(-1e3, 1e3), feedback=pt.control.StateSpace(a, b, c, d)).start()
    x = np.zeros(2)
    for error in np.random.default_rng(2).normal(0.0, 1e-5, 50).tolist():
        assert session.step(error, 0.0) == pytest.approx(float(c @ x + d * error), abs=1e-12)
        x = a @ x + np.array(b) * error


def test_the_filters_pass_a_constant_and_stop_what_they_should() -> None:
    t = DT * np.arange(2000)

    def passed(filters: list[pt.LowPass | pt.Notch], f: float) -> float:
        session = loop(filters=filters).start()
        out = []
        for value in (1e-6 * np.sin(2 * np.pi * f * t)).tolist():
            session.step(0.0, value)
            out.append(-session.last.error)
        return float(np.std(out[1000:])) * math.sqrt(2.0) / 1e-6

    assert passed([pt.Notch(10.0)], 10.0) < 1e-3
    assert passed([pt.Notch(10.0, 0.5, 0.25)], 10.0) == pytest.approx(0.25, abs=0.01)
    assert passed([pt.LowPass(2.0)], 2.0) == pytest.approx(math.sqrt(0.5), abs=0.01)
    assert passed([pt.LowPass(2.0)], 0.1) == pytest.approx(1.0, abs=0.01)
    session = loop(filters=[pt.LowPass(2.0), pt.Notch(10.0)]).start()
    for _ in range(3):
        session.step(0.0, 5e-6)
        assert session.last.error == pytest.approx(-5e-6, rel=1e-12)


# Sessions.


def test_the_parts_of_a_command_add_up() -> None:
    _, commands = drive(FULL.start(), sine(400, 0.0, 130e-6))
    for command in commands:
        total = command.feedforward + command.feedback + command.repetitive
        assert command.unclipped == pytest.approx(total, abs=1e-9)
        assert command.voltage == min(max(command.unclipped, 0.0), 75.0)
        assert command.saturated == (command.voltage != command.unclipped)
        assert command.measurement_valid
    assert {command.saturated for command in commands} == {True, False}
    assert max(abs(command.repetitive) for command in commands) > 0.1


def test_sessions_know_nothing_of_each_other() -> None:
    reference = sine(250)
    alone = drive(FULL.start(), reference)[1]
    session, other = FULL.start(), FULL.start()
    x = 0.0
    for desired, expected in zip(reference.tolist(), alone, strict=True):
        other.step(-desired, math.nan if desired > 50e-6 else 3e-6)
        volts = session.step(desired, x)
        assert session.last == expected
        x += 0.7 * (GAIN * volts - x)


def test_reset_goes_on_from_the_voltage_that_is_there() -> None:
    session = FULL.start()
    drive(session, sine(250))
    for _ in range(100):
        session.step(60e-6, 60e-6)
    before = session.last.voltage
    assert before > 10.0
    session.reset()
    # The first sample of an error of 0 leaves it, whatever was learnt and wherever the plays were.
    assert session.step(60e-6, 60e-6) == pytest.approx(before, abs=1e-9)
    assert session.last.repetitive == 0.0
    session.applied(before - 5.0)
    session.reset()
    assert session.step(60e-6, 60e-6) == pytest.approx(before - 5.0, abs=1e-9)
    # Before its first step a session has nothing to go on from.
    reference, unused = sine(250), FULL.start()
    unused.reset()
    assert drive(unused, reference)[1] == drive(FULL.start(), reference)[1]


def test_it_starts_without_a_bump() -> None:
    for error in (0.0, 1e-6, -1e-6):
        session = FULL.start(present=40.0)
        assert session.last.voltage == 40.0
        first = session.step(60e-6, 60e-6 - error)
        # One sample of the integral part, and no kick of the others.
        assert first - 40.0 == pytest.approx(0.120e6 * DT / 0.009 * error, abs=1e-9)
    cold = loop(feedback=PID).start()
    assert cold.step(1e-6, 0.0) == pytest.approx(0.120 * DT / 0.009, rel=1e-12)


def test_gains_change_without_a_bump() -> None:
    """At rest, the voltage that holds the stage stays, whatever the gains."""
    session = loop(feedback=PID).start()
    _, commands = drive(session, np.full(300, 50e-6))
    before = commands[-1].voltage
    session.retune(loop(feedback=pt.Pid.from_um(kp=0.06, ti=0.02, td=0.01)))
    error = commands[-1].error
    assert session.step(50e-6, 50e-6 - error) == pytest.approx(before, abs=1e-3)
    # From now on with the new gains: half the proportional part, and 0.06 Ts/Ti of the integral.
    jump = session.step(51e-6, 50e-6) - before
    assert jump == pytest.approx(0.06 * (1.0 + DT / 0.02 + 0.01 / DT), abs=1e-3)


def test_what_a_session_cannot_be_retuned_to() -> None:
    session = loop(feedback=PID, repetitive=pt.Repetitive(period=2.0)).start()
    for other, message in (
        (loop(feedback=PID, repetitive=pt.Repetitive(period=5.0)), "repetitive part of the same"),
        (loop(feedback=PID), "repetitive part of the same"),
        (loop(repetitive=pt.Repetitive(period=2.0)), "feedback of the same kind"),
        (loop(dt=0.01, feedback=PID, repetitive=pt.Repetitive(period=2.0)), "dt is 0.01 s"),
        (
            loop(feedback=PID, repetitive=pt.Repetitive(period=2.0), feedforward=INVERSE),
            "feedforward is another",
        ),
        (5, "controller is 5"),
    ):
        with pytest.raises(pt.ParameterError, match=message):
            session.retune(other)  # type: ignore[arg-type]


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_what_is_no_number_never_reaches_the_actuator(bad: float) -> None:
    reference = sine(500)
    session, x, errors = FULL.start(), 0.0, []
    hole = range(200, 205)
    held = 0.0
    for k, desired in enumerate(reference.tolist()):
        volts = session.step(desired, bad if k in hole else x)
        command = session.last
        assert math.isfinite(volts)
        assert 0.0 <= volts <= 75.0
        assert command.measurement_valid == (k not in hole)
        if k in hole:
            assert command.feedback == held
        held = command.feedback
        errors.append(desired - x)
        x += 0.7 * (GAIN * volts - x)
    whole = drive(FULL.start(), reference)[0]
    assert np.abs(errors[205:]).max() < 10e-6
    assert np.abs(np.array(errors)[300:] - whole[300:]).max() < 1e-6


@pytest.mark.parametrize("bad", [math.nan, math.inf])
@pytest.mark.parametrize("where", ["reference", "feedforward"])
def test_nor_does_a_bad_reference(where: str, bad: float) -> None:
    session = FULL.start()
    drive(session, sine(60))
    before = session.last
    given: dict[str, Any] = {"reference": 50e-6, "measured": 50e-6, "feedforward": 30.0}
    volts = session.step(**{**given, where: bad})
    assert 0.0 <= volts <= 75.0
    if where == "feedforward":
        assert session.last.feedforward == before.feedforward
    assert math.isfinite(session.step(**given))


def test_a_sensor_dead_from_the_start_gives_feedforward_alone() -> None:
    session = FULL.start()
    volts = INVERSE.start(DT)
    for desired in sine(100).tolist():
        expected = min(max(volts.step(desired), 0.0), 75.0)
        assert session.step(desired, math.nan) == pytest.approx(expected, abs=1e-9)


# Antiwindup.


@pytest.mark.parametrize("share", [0.0, 0.9], ids=["alone", "with feedforward"])
@pytest.mark.parametrize("beyond", [150e-6, -40e-6], ids=["upper", "lower"])
def test_antiwindup_recovers_at_both_limits(beyond: float, share: float) -> None:
    """A reference beyond reach for 2 s, and back to 60 um: how long until it is there."""
    reference = np.concatenate([np.full(100, 60e-6), np.full(100, beyond), np.full(300, 60e-6)])

    def late(pid: pt.Pid) -> int:
        session, x, errors = loop(feedback=pid).start(), 0.0, []
        for desired in reference.tolist():
            errors.append(desired - x)
            x += 0.7 * (GAIN * session.step(desired, x, feedforward=share * desired / GAIN) - x)
        return int(np.flatnonzero(np.abs(errors[200:]) > 1e-6)[-1])

    # Some 15 samples, as any step takes; without, as long as was wound up.
    assert late(PID) < 30
    assert late(dataclasses.replace(PID, tt=math.inf)) > 60


def test_antiwindup_goes_by_what_the_amplifier_gave() -> None:
    """A slew limit of one's own: told of it, the controller does not go on asking for more."""

    def overshoot(tells: bool) -> float:
        session, x, given = loop(feedback=PID).start(), 0.0, 0.0
        most = 0.0
        for _ in range(300):
            volts = session.step(60e-6, x)
            given += min(max(volts - given, -0.5), 0.5)
            if tells:
                session.applied(given)
            x += 0.7 * (GAIN * given - x)
            most = max(most, x)
        return most - 60e-6

    assert overshoot(True) < 0.5 * overshoot(False)
    session = loop(feedback=PID).start()
    session.step(10e-6, 0.0)
    session.applied(session.last.voltage - 1.0)
    again = session.step(10e-6, 0.0)
    tt = math.sqrt(0.009 * 0.044)
    assert again == pytest.approx(2 * 0.120 * 10 * DT / 0.009 - DT / tt, rel=1e-12)


# What it refuses.

BAD: dict[str, tuple[Callable[[], Any], str]] = {
    "dt": (lambda: loop(dt=0.0), "dt"),
    "limits crossed": (lambda: loop(limits=(75, 0)), "limits"),
    "limits equal": (lambda: loop(limits=(5, 5)), "limits"),
    "limits not finite": (lambda: loop(limits=(0.0, math.inf)), "limits[1]"),
    "three limits": (lambda: loop(limits=(0, 1, 2)), "limits"),
    "limits text": (lambda: loop(limits="07"), "limits"),
    "feedforward": (
        lambda: loop(feedforward=pt.DahlStage.xu_li_2010()),
        "feedforward",
    ),
    "feedback": (
        lambda: loop(feedback=5),
        "feedback",
    ),
    "repetitive": (lambda: loop(repetitive=PID), "repetitive"),
    "one filter": (lambda: loop(filters=pt.LowPass(5.0)), "filters"),
    "no filter": (lambda: loop(filters=[PID]), "filters"),
    "three filters": (lambda: loop(filters=[pt.LowPass(5.0)] * 3), "filters"),
    "cutoff": (lambda: pt.LowPass(0.0), "cutoff"),
    "low-pass too fast": (lambda: loop(filters=[pt.LowPass(25.01)]), "cutoff"),
    "notch too fast": (lambda: loop(filters=[pt.Notch(25.0)]), "frequency"),
    "notch text": (lambda: pt.Notch("10"), "frequency"),  # type: ignore[arg-type]
    "notch width": (lambda: pt.Notch(10.0, 0.0), "width"),
    "notch depth": (lambda: pt.Notch(10.0, 0.5, 2.0), "depth"),
    "kp": (lambda: pt.Pid(kp=math.nan, ti=1.0), "kp"),
    "kp text": (lambda: pt.Pid.from_um(kp="1", ti=1.0), "kp"),  # type: ignore[arg-type]
    "ti = 0": (lambda: pt.Pid(kp=1e5, ti=0.0), "ti"),
    "ti not a number": (lambda: pt.Pid(kp=1e5, ti=math.nan), "ti"),
    "td": (lambda: pt.Pid(kp=1e5, ti=1.0, td=-1.0), "td"),
    "td not finite": (lambda: pt.Pid(kp=1e5, ti=1.0, td=math.inf), "td"),
    "tt = 0": (lambda: pt.Pid(kp=1e5, ti=1.0, tt=0.0), "tt"),
    "tt = dt/2": (
        lambda: loop(feedback=dataclasses.replace(PID, tt=0.01)),
        "tt",
    ),
    "nothing to unwind": (
        lambda: loop(feedback=pt.Pid(kp=1e5, ti=math.inf, tt=1.0)),
        "tt",
    ),
    "period": (lambda: pt.Repetitive(period=0.0), "period"),
    "period under two samples": (
        lambda: loop(repetitive=pt.Repetitive(period=0.03)),
        "period",
    ),
    "kq = 0": (lambda: pt.Repetitive(period=2.0, kq=0.0), "kq"),
    "kq = 2": (lambda: pt.Repetitive(period=2.0, kq=2e6), "kq"),
    "kq negative": (lambda: pt.Repetitive(period=2.0, kq=-1.0), "kq"),
    "kq in V/um": (lambda: pt.Repetitive.from_um(period=2.0, kq=2.0), "kq"),
    "kq without its unit": (
        lambda: loop(repetitive=pt.Repetitive(period=2.0, kq=1.0)),
        "kq",
    ),
    "kq not a number": (lambda: pt.Repetitive(period=2.0, kq=math.nan), "kq"),
    "tq": (lambda: pt.Repetitive.from_um(period=2.0, tq=0.0), "tq"),
    "tq beside a filter": (
        lambda: pt.Repetitive.from_um(period=2.0, tq=0.2, smoothing=pt.control.ZeroPhase()),
        "tq",
    ),
    "compensated": (lambda: pt.control.Lag(compensated=1), "compensated"),  # type: ignore[arg-type]
    "smoothing": (lambda: pt.Repetitive(period=2.0, smoothing="some"), "smoothing"),  # type: ignore[arg-type]
    "order": (lambda: pt.control.ZeroPhase(order=5), "order"),
    "forgetting": (
        lambda: pt.Repetitive(period=2.0, forgetting_factor=0.0),
        "forgetting_factor",
    ),
    "forgetting above 1": (
        lambda: pt.Repetitive(period=2.0, forgetting_factor=1.1),
        "forgetting_factor",
    ),
    "lead": (lambda: loop(repetitive=pt.Repetitive(period=2.0, lead=500)), "lead"),
    "lead beyond all": (lambda: pt.Repetitive(period=2.0, lead=2**40), "lead"),
    "pause": (lambda: pt.Repetitive(period=2.0, pause="no"), "pause"),  # type: ignore[arg-type]
    "matrix": (lambda: pt.control.StateSpace([[math.nan]], [1.0], [1.0]), "a"),
    "matrix of text": (
        lambda: pt.control.StateSpace([["x"]], [1.0], [1.0]),
        "a",
    ),
    "many states": (
        lambda: loop(feedback=pt.control.StateSpace(np.eye(17), np.ones(17), np.ones(17))),
        "b",
    ),
    "back": (
        lambda: loop(feedback=pt.control.StateSpace([[1]], [1], [1], 0, [1, 2])),
        "back",
    ),
    "present": (lambda: loop().start(present=80.0), "present"),
    "present not finite": (lambda: loop().start(present=math.nan), "present"),
    "measured": (lambda: loop().start().step(0.0, None), "measured"),  # type: ignore[arg-type]
    "reference": (lambda: FULL.start().step("0", 0.0), "reference"),  # type: ignore[arg-type]
    "applied": (lambda: loop().start().applied(math.nan), "voltage"),
}


@pytest.mark.parametrize("name", BAD)
def test_refuses(name: str) -> None:
    call, message = BAD[name]
    with pytest.raises(pt.ParameterError) as caught:
        call()
    assert re.match(rf"{re.escape(message)}(?!\w)", str(caught.value))
    assert "\n" not in str(caught.value)


def test_a_refusal_names_argument_value_unit_and_expectation() -> None:
    with pytest.raises(pt.ParameterError) as caught:
        pt.Pid(kp=math.nan, ti=1.0)
    assert str(caught.value) == "kp is NaN V/m: expected a finite number"
    with pytest.raises(
        pt.ParameterError, match=r"kq is 1 V/m: .*write pt\.Repetitive\.from_um\(kq=1"
    ):
        loop(repetitive=pt.Repetitive(period=2.0, kq=1.0))


@pytest.mark.parametrize(
    ("a", "b", "c"), [([[1.0, 2.0]], [1.0], [1.0]), ([[1.0]], [1.0], [1.0, 2.0]), ([], [], [])]
)
def test_refuses_matrices_that_do_not_fit(a: Any, b: Any, c: Any) -> None:
    with pytest.raises(pt.ShapeError, match="expected"):
        pt.control.StateSpace(a, b, c)


@pytest.mark.parametrize("limits", [(0.0, 10.0), (0.0, 75.0), (-20.0, 130.0), (0.0, 1000.0)])
def test_refuses_a_gain_in_the_wrong_unit_with_a_hint(limits: tuple[float, float]) -> None:
    """The published gain for 117 um at 75 V, for stages of that travel and other voltages."""
    right = 0.120 * (limits[1] - limits[0]) / 75.0
    loop(limits=limits, feedback=pt.Pid.from_um(kp=right, ti=0.009, td=0.044))
    with pytest.raises(pt.ParameterError, match=r"if it is in V/um, write pt\.Pid\.from_um\(kp="):
        loop(limits=limits, feedback=pt.Pid(kp=right, ti=0.009, td=0.044))
    with pytest.raises(
        pt.ParameterError, match=re.escape(f"{1e6 * right:g} V/m is {right:g} V/um")
    ):
        loop(limits=limits, feedback=pt.Pid.from_um(kp=1e6 * right, ti=0.009, td=0.044))
