"""A controller that is well on a bad line: the output ends at rest, and no answer shifts."""

from __future__ import annotations

import math
import os
import signal
import socket
import threading
import time
from contextlib import closing, contextmanager
from typing import TYPE_CHECKING

import numpy as np
import pytest

import piezotrack as pt
from gcs_peers import LIMITS, Spoilt, dripping, greeted, once, peer
from piezotrack.control.on_device import latency
from piezotrack.hardware import GcsDevice

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from gcs_peers import Said

PLAYS = pt.PrandtlIshlinskiiStage(linear=1e-6, thresholds=(10.0, 25.0), weights=(2e-7, 1e-7))
LOOP = pt.Controller(dt=0.05, limits=LIMITS, feedback=pt.Pid.from_um(kp=0.1, ti=0.1))
MOTION = pt.sine(frequency=0.2, low=20e-6, high=60e-6, duration=5.0)
# Long enough for a busy machine, where an answer is to come; short, where it is not.
WAIT = 0.5

FAULTS: dict[str, Callable[[str], Said]] = {
    "half": lambda said: said[: len(said) // 2],
    "a line too many": lambda said: said + said,
    "late": lambda said: _later(said),
    "closed": lambda _: None,
}


def _later(said: str) -> Said:
    time.sleep(2.0 * WAIT)
    return said


def _measure(device: GcsDevice) -> None:
    pt.measure(device, np.full(2000, 40.0), rate=100.0, ramp=0.1)


def _play(device: GcsDevice) -> None:
    pt.play(device, PLAYS.inverse(), MOTION, rate=100.0)


def _track(device: GcsDevice) -> None:
    pt.track(device, LOOP, MOTION)


@contextmanager
def connected(answer: Callable[[str], Said], timeout: float = 30.0) -> Iterator[GcsDevice]:
    with peer(answer) as port, closing(GcsDevice("127.0.0.1", port, timeout=timeout)) as device:
        yield device


@pytest.fixture
def _short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Short measurements of the latency, and none refused: the machine of a test is busy."""
    monkeypatch.setattr(latency, "FEWEST", 5)
    monkeypatch.setattr(latency, "LONGEST", 0.2)
    monkeypatch.setattr(latency, "MOST", 1e3)


@pytest.mark.usefixtures("_short")
@pytest.mark.parametrize("fault", list(FAULTS))
@pytest.mark.parametrize(
    ("work", "after", "number"),
    [(_measure, "WGO 1 1", 1), (_play, "WGO 1 1", 1), (_track, "SVA", 20)],
)
def test_after_one_bad_answer_the_output_ends_at_rest(
    work: Callable[[GcsDevice], None], after: str, number: int, fault: str
) -> None:
    def spoil(line: str, answer: str) -> Said:
        """Spoil what is said of the errors of one command."""
        sent = [one for one in there.lines if one.startswith(after)]
        is_due = line == "ERR?" and len(sent) == number and there.lines[-2] == sent[-1]
        return FAULTS[fault](answer) if is_due else answer

    there = Spoilt(spoil, speed=1.0)
    with connected(there, WAIT) as device:
        device.hold(40.0)
        with pytest.raises(pt.DeviceError) as failure:
            work(device)
        assert there.voltage == 0.0
        assert not there.runs
        assert "could not be led" not in str(failure.value)
        # What follows is in step again.
        assert device.voltage == 0.0


def test_what_is_known_of_a_connection_ends_with_it() -> None:
    there = Spoilt(once(1, "POS? 1", FAULTS["half"]), speed=1.0)
    with connected(there, WAIT) as device:
        device.hold(10.0)
        with pytest.raises(pt.DeviceError, match="not answered"):
            device.exchange(20.0)
        # Somebody switches the servo on meanwhile, with which no voltage is taken.
        there.controller.ask("SVO 1 1")
        there.lines.clear()
        device.hold(5.0)
        device.hold(6.0)
    assert there.lines == ["WGO 1 0", "SVO 1 0", "SVA 1 5", "ERR?", "SVA 1 6", "ERR?"]
    assert there.voltage == 6.0


def test_a_connection_that_ends_in_an_upload_is_not_made_anew_in_it() -> None:
    """The controller may have been switched off and on: half of a table would go out."""

    def last(said: str) -> Iterator[str]:
        yield said
        raise ConnectionResetError

    there = Spoilt(once(2, "ERR?", last))
    lost = pytest.raises(pt.DeviceError, match="connection")
    with connected(there, WAIT) as device, lost:
        device.play(np.full(100, 5.0), 100.0)
    assert any(line.startswith("WAV") for line in there.lines)
    assert "WGO 1 1" not in there.lines


def test_a_query_that_is_refused_beside_a_voltage_shifts_no_answer() -> None:
    """The reading and the voltage go out in one message, whose error is that of the query."""

    def refuse(_: str) -> Said:
        there.error = 5
        return ""

    there = Spoilt(once(2, "POS? 1", refuse), speed=1.0)
    with connected(there, WAIT) as device:
        device.exchange(20.0)
        with pytest.raises(pt.DeviceError, match=r"POS\? 1.*5"):
            device.exchange(20.0)
        # A position on the way to 20 V, neither the error nor the voltage.
        assert abs(device.exchange(20.0)) < 100e-6
        assert device.voltage == 20.0


@pytest.mark.parametrize("failure", [BrokenPipeError, KeyboardInterrupt])
def test_a_command_that_goes_out_by_half_is_not_completed_by_the_next(
    failure: type[BaseException], monkeypatch: pytest.MonkeyPatch
) -> None:
    there = Spoilt(lambda _, answer: answer, speed=1.0)
    whole = socket.socket.sendall

    def half(link: socket.socket, data: bytes) -> None:
        if threading.current_thread() is not threading.main_thread():
            return whole(link, data)
        whole(link, data[: len(data) // 2])
        raise failure

    with connected(there, 30.0) as device:
        device.hold(5.0)
        with monkeypatch.context() as patched:
            patched.setattr(socket.socket, "sendall", half)
            with pytest.raises(
                KeyboardInterrupt if failure is KeyboardInterrupt else pt.DeviceError
            ):
                device.hold(66.0)
        device.hold(7.0)
        assert there.voltage == 7.0
    sent = [line for line in there.lines if line.startswith("SVA")]
    assert sent == ["SVA 1 5", "SVA 1 7"]


def test_a_connection_that_is_reset_while_idle_is_a_sentence_and_then_made_anew(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    there = Spoilt(lambda _, answer: answer, speed=1.0)

    def reset(*_: object) -> bytes:
        raise ConnectionResetError

    with connected(there, 30.0) as device:
        device.hold(5.0)
        with monkeypatch.context() as patched:
            patched.setattr(socket.socket, "recv", reset)
            with pytest.raises(pt.DeviceError):
                device.exchange(6.0)
        device.hold(7.0)
        assert there.voltage == 7.0


# A line that never ends.


def test_a_line_that_drips_has_one_time_limit() -> None:
    begun = time.monotonic()
    by_half = pytest.raises(pt.DeviceError, match=r"'HLP\?' is answered by half")
    with peer(greeted({"HLP?": dripping("begin \n")})) as port, by_half:
        GcsDevice("127.0.0.1", port, timeout=WAIT)
    assert time.monotonic() - begun < 20.0


def _interrupted(device: GcsDevice, there: Spoilt, after: float) -> float:
    """Interrupt a measurement by one Ctrl-C and return how long it then took [s]."""
    pressed: list[float] = []

    def press() -> None:
        pressed.append(time.monotonic())
        os.kill(os.getpid(), signal.SIGINT)

    def spoil(_: str, answer: str) -> Said:
        if "WGO 1 1" not in there.lines:
            return answer
        if not pressed and not timer.is_alive():
            timer.start()
        return dripping(answer.rstrip("\n") or "1")

    timer = threading.Timer(after, press)
    there.spoil = spoil
    with pytest.raises((KeyboardInterrupt, pt.DeviceError)):
        _measure(device)
    return time.monotonic() - pressed[0]


@pytest.mark.skipif(os.name == "nt", reason="Windows sends Ctrl-C in another way")
@pytest.mark.parametrize("timeout", [WAIT, pytest.param(60.0, marks=pytest.mark.slow)])
def test_ctrl_c_while_everything_drips_sends_the_safe_voltage(timeout: float) -> None:
    there = Spoilt(lambda _, said: said, speed=1.0)
    with connected(there, timeout) as device:
        device.hold(40.0)
        assert _interrupted(device, there, 0.2) < 20.0
        assert there.voltage == 0.0
        assert not there.runs
    assert "SVA 1 0" in there.lines


@pytest.mark.skipif(os.name == "nt", reason="Windows sends Ctrl-C in another way")
def test_the_answer_to_an_interrupted_query_is_never_taken_for_the_next() -> None:
    there = Spoilt(once(2, "VOL? 1", FAULTS["late"]))
    with connected(there) as device:
        assert device.voltage == 0.0
        threading.Timer(0.3 * WAIT, os.kill, (os.getpid(), signal.SIGINT)).start()
        with pytest.raises(KeyboardInterrupt):
            _ = device.voltage
        device.hold(7.0)
        assert device.voltage == 7.0


@pytest.mark.parametrize("line", ["x" * 70_000, " \n" * 30_000, "\n" * 30_000])
def test_an_answer_without_end_is_refused_early(line: str) -> None:
    sent = [0]

    def endless() -> Iterator[str]:
        while True:
            sent[0] += len(line)
            yield line

    def ask(device: GcsDevice) -> None:
        for _ in range(3):
            _ = device.position

    begun = time.monotonic()
    with (
        connected(greeted({"POS? 1": endless()})) as device,
        pytest.raises(pt.DeviceError) as failure,
    ):
        ask(device)
    assert len(str(failure.value)) <= 500
    # What lies in the buffers of two sockets is more than what is looked at.
    assert sent[0] < 30e6
    assert time.monotonic() - begun < 20.0


# Answers that nobody asked for.


@pytest.mark.parametrize("pause", [0.0, 0.1])
def test_a_line_too_many_shifts_no_answer(pause: float) -> None:
    def twice(said: str) -> Iterator[str]:
        yield said if pause else said + "1=11\n"
        time.sleep(pause)
        if pause:
            yield "1=11\n"

    def ask(device: GcsDevice) -> None:
        _ = device.position
        time.sleep(5.0 * pause)
        _ = device.voltage

    there = Spoilt(once(2, "POS? 1", twice))
    with connected(there) as device:
        first = device.position
        with pytest.raises(pt.DeviceError, match="1=11"):
            ask(device)
        assert device.voltage == 0.0
        assert device.position == pytest.approx(first, abs=1e-9)


# Readings that cannot be.


@pytest.mark.parametrize("word", ["9.91e37", "1e400", "-1e80", "nan", "1e6"])
def test_a_reading_far_beyond_the_travel_is_none(word: str) -> None:
    there = Spoilt(lambda line, said: f"1={word}\n" if line == "POS? 1" else said)
    with connected(there) as device:
        low, high = device.travel
        assert 75e-6 < high - low < 200e-6
        assert math.isnan(device.position)
        assert math.isnan(device.exchange(3.0))
        assert there.voltage == 3.0


@pytest.mark.parametrize(("bad", "lost"), [(1, 1), (30, None)])
def test_such_readings_are_lost_samples_of_a_log(bad: int, lost: int | None) -> None:
    def spoil(line: str, answer: str) -> Said:
        if not line.startswith("DRR?"):
            return answer
        *lines, last = answer.split("\n")
        rows = range(len(lines) - 100, len(lines) - 100 + bad)
        for k in rows:
            lines[k] = f"9.91e37 {lines[k].split(' ')[1]} "
        return "\n".join([*lines, last])

    with connected(Spoilt(spoil)) as device:
        if lost is None:
            with pytest.raises(pt.DataError, match=r"30 of \d+ samples without"):
                pt.measure(device, np.linspace(0.0, 40.0, 300), rate=100.0)
        else:
            log = pt.measure(device, np.linspace(0.0, 40.0, 300), rate=100.0)
            assert any("lost samples: 1 of" in note for note in log.notes)
            assert np.ptp(log.y) < 200e-6


def test_a_voltage_that_cannot_be_is_no_record() -> None:
    def spoil(line: str, said: str) -> Said:
        return said.replace(" 5 \n", " 9.91e37 \n", 1) if line.startswith("DRR?") else said

    told = pytest.raises(pt.DeviceError, match=r"recorder says 9.91e\+37 V at sample 0: expected 5")
    with connected(Spoilt(spoil)) as device, told:
        device.play(np.full(50, 5.0), 100.0)


def test_an_output_that_reads_as_nonsense_is_led_home_at_once() -> None:
    """From a voltage that cannot be, a way to rest would begin at a limit."""
    there = Spoilt(lambda line, said: "1=9.91e37\n" if line == "VOL? 1" else said)
    with connected(there) as device:
        device.hold(20.0)
        assert math.isnan(device.voltage)
        there.spoil = lambda line, said: (
            "1=9.91e37\n" if line == "VOL? 1" else "1=2\n" if line == "DRL? 1" else said
        )
        with pytest.raises(pt.DeviceError, match="has 2 samples"):
            pt.measure(device, np.full(100, 20.0), rate=100.0, ramp=0.05)
    assert "SVA 1 75" not in there.lines
    assert there.voltage == 0.0
