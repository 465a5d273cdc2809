"""Controllers that do not answer, answer half, or answer something else: one sentence each."""

from __future__ import annotations

import socket
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np
import pytest

import piezotrack as pt
from gcs_peers import GREETING, greeted, peer, quiet_stage
from piezotrack.hardware import GcsDevice, GcsServer

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gcs_peers import Said

# Long enough for an answer on a busy machine, where one is to come.
SOON = 30.0
# A wait that is to end without an answer.
NEVER = 0.2


@contextmanager
def connected(then: dict[str, Said], timeout: float = SOON) -> Iterator[GcsDevice]:
    with peer(greeted(then)) as port:
        device = GcsDevice("127.0.0.1", port, timeout=timeout)
        try:
            yield device
        finally:
            device.close()


def refused(then: dict[str, Said], timeout: float = SOON) -> str:
    """What a client says of a controller that is wrong from the start."""
    with peer(greeted(then)) as port, pytest.raises(pt.DeviceError) as failure:
        GcsDevice("127.0.0.1", port, timeout=timeout)
    said = str(failure.value)
    assert said.startswith(f"gcs://127.0.0.1:{port}: ")
    return said


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as one:
        return int(one.getsockname()[1])


def test_a_controller_of_a_few_lines_is_enough() -> None:
    with connected({}) as device:
        assert device.limits == (0.0, 100.0)
        # 2000 points of the recorder for two tables, and a wave of 1500.
        assert device.memory == 1000


def test_nobody_answers() -> None:
    port = free_port()
    with pytest.raises(pt.DeviceError) as failure:
        pt.hardware.connect(f"gcs://127.0.0.1:{port}")
    assert str(failure.value) == f"gcs://127.0.0.1:{port}: nobody answers: connection refused"


def test_a_host_without_an_address() -> None:
    with pytest.raises(pt.DeviceError, match=r"gcs://no\.such\.host\.invalid:50000: nobody"):
        pt.hardware.connect("gcs://no.such.host.invalid")


def test_somebody_who_says_nothing() -> None:
    said = refused({"*IDN?": "", "ERR?": ""}, NEVER)
    assert said.endswith("'*IDN?' was not answered in 0.2 s")


def test_half_an_answer() -> None:
    message = refused({"VMI? 1": "1=0.5"}, NEVER)
    assert "'VMI? 1' is answered by half, '1=0.5'" in message
    # A line that another is to follow, which does not come.
    message = refused({"HLP?": "begin \nPOS? \n"}, NEVER)
    assert "'HLP?' is answered by half, 2 lines and ''" in message


def test_a_connection_that_is_closed() -> None:
    assert refused({"VMA? 1": None}).endswith(
        "'VMA? 1' has no answer: the controller has closed the connection"
    )


@pytest.mark.parametrize(
    ("command", "answer", "words"),
    [
        ("VMI? 1", "hello\n", "'VMI? 1' has the answer 'hello': expected 1=NUMBER"),
        ("VMI? 1", "2=0\n", "'VMI? 1' has the answer '2=0': expected 1=NUMBER"),
        ("VMI? 1", "1=x\n", "'VMI? 1' has the answer '1=x': expected 1=NUMBER"),
        ("VMI? 1", "1=0 \n2=0\n", "expected 1=NUMBER"),
        ("SPA? 1 0x0E000200", "1 0x0E000200=0\n", "expected a parameter above 0"),
        ("SPA? 1 0x0E000200", "\x00\xff\n", "expected a parameter above 0"),
        ("TNR?", "0\n", "'TNR?' has the answer '0': expected the number of tables"),
        ("TNR?", "two\n", "'TNR?' has the answer 'two': expected the number of tables"),
        ("TNR?", "-1\n", "'TNR?' has the answer '-1': expected the number of tables"),
        ("TNR?", "1_0\n", "expected the number of tables"),
        ("TNR?", "9" * 1000 + "\n", "expected the number of tables"),
        ("VMI? 1", "1=1_0\n", "'VMI? 1' has the answer '1=1_0': expected 1=NUMBER"),
        ("VMI? 1", "1=nan\n", "expected two voltages"),
        ("VMA? 1", "1=1e400\n", "expected two voltages"),
        ("VMA? 1", "1=-5\n", "expected two voltages"),
        ("SPA? 1 0x0E000200", "1 0x0E000200=5_0\n", "expected a parameter above 0"),
        ("SPA? 1 0x0E000200", "1 0x0E000200=1e-320\n", "expected a parameter above 0"),
        ("PUN? 1", "1=INCH\n", "'PUN? 1' has the answer '1=INCH': expected um, nm or mm"),
    ],
)
def test_an_answer_of_another_kind(command: str, answer: str, words: str) -> None:
    known = GREETING["HLP?"].replace("end\n", "PUN? ... \nend\n")
    assert words in refused({"HLP?": known, "PUN? 1": "1=UM\n", command: answer})


def test_a_controller_without_a_wave_generator() -> None:
    said = refused({"HLP?": "begin \nPOS? \nSVO \nSVA \nDRC \nRTR \nDRL? \nDRR? \nend\n"})
    assert "does not know WAV, WSL, WGC, WTR, WGO: expected a controller with wave" in said


def test_a_controller_that_does_not_say_its_limits_needs_them() -> None:
    known = GREETING["HLP?"].replace("VMI? ... \n", "")
    needed = pytest.raises(pt.ParameterError, match=r"limits are not given.*\?limits=0..100V")
    with peer(greeted({"HLP?": known})) as port, needed:
        GcsDevice("127.0.0.1", port, timeout=SOON)
    with peer(greeted({"HLP?": known})) as port:
        device = GcsDevice("127.0.0.1", port, limits=(-10.0, 120.0), timeout=SOON)
        assert device.limits == (-10.0, 120.0)
        device.close()


@pytest.mark.parametrize(
    ("unit", "metres"), [("UM", 1e-6), ("um", 1e-6), ("\u00b5m", 1e-6), ("nm", 1e-9), ("MM", 1e-3)]
)
def test_positions_are_in_the_unit_of_the_controller(unit: str, metres: float) -> None:
    known = GREETING["HLP?"].replace("end\n", "PUN? ... \nend\n")
    with connected({"HLP?": known, "PUN? 1": f"1={unit}\n", "POS? 1": "1=2.5e+01\n"}) as device:
        assert device.position == pytest.approx(25.0 * metres, rel=1e-12)


def test_a_controller_that_does_not_say_how_long_a_wave_may_be() -> None:
    then: dict[str, Said] = {
        "SPA? 1 0x13000004": "",
        "ERR?": "54\n",
        "SPA? 1 0x16000200": "1 0x16000200=6000\n",
    }
    with connected(then, NEVER) as device:
        assert device.memory == 3000


def test_an_error_has_its_code_and_its_words() -> None:
    answers = {"SVA 1 5": "", "ERR?": "66\n"}
    with connected({}) as device:
        pass
    with peer(greeted(answers)) as port:
        device = GcsDevice("127.0.0.1", port, timeout=SOON)
        with pytest.raises(pt.DeviceError, match=r"'SVO 1 0; SVA 1 5' is refused: error 66 "):
            device.hold(5.0)
        device.close()


def test_a_query_that_is_refused_has_the_words_of_its_error() -> None:
    with connected({"POS? 1": "", "ERR?": "15\n"}, NEVER) as device:
        with pytest.raises(pt.DeviceError, match=r"'POS\? 1' is refused: error 15 \(invalid axis"):
            _ = device.position
        # Nothing is lost: others are answered.
        assert device.limits == (0.0, 100.0)


def test_an_unknown_code_is_told_as_it_is() -> None:
    told = pytest.raises(pt.DeviceError, match=r"is refused: error 4711$")
    with connected({"POS? 1": "", "ERR?": "4711\n"}, NEVER) as device, told:
        _ = device.position


def test_a_code_that_is_none() -> None:
    with connected({"ERR?": "ok\n"}) as device, pytest.raises(pt.DeviceError) as failure:
        device.hold(1.0)
    assert "'ERR?' has the answer 'ok': expected a code" in str(failure.value)


def test_after_a_failure_the_next_command_makes_a_new_connection() -> None:
    answers = iter(["1=3", "1=4\n"])
    there = greeted({"ERR?": ""})

    def answer(line: str) -> Said:
        return next(answers) if line == "POS? 1" else there(line)

    with peer(answer) as port:
        device = GcsDevice("127.0.0.1", port, timeout=NEVER)
        with pytest.raises(pt.DeviceError, match="answered by half"):
            _ = device.position
        assert device.position == pytest.approx(4e-6)
        device.close()
        with pytest.raises(pt.DeviceError, match="is closed"):
            _ = device.position


GOOD = "# SAMPLE_TIME=0.00100000 \n# END_HEADER \n"
ROWS = "".join(f"{k} 5 \n" for k in range(9)) + "9 5\n"


@pytest.mark.parametrize(
    ("data", "words"),
    [
        ("nothing\n", "expected 2 columns of 10 samples"),
        (GOOD + "1 2 \n3 4\n", "expected 2 columns of 10 samples"),
        (GOOD + "1 2 \n3\n", "expected 2 columns of 10 samples"),
        (GOOD + "1 x\n", "expected 2 columns of 10 samples"),
        (GOOD + ROWS.replace("3 5", "3_0 5"), "expected 2 columns of 10 samples"),
        (GOOD.replace("0.001", "0.002") + ROWS, "says 0.002 s from sample to sample: expected"),
        (GOOD.replace("SAMPLE_TIME=0.00100000", "") + ROWS, "says nan s from sample to sample"),
    ],
)
def test_a_record_that_is_none(data: str, words: str) -> None:
    then: dict[str, Said] = {"DRL? 1": "1=10\n", "DRR? 1 10 1 2": data}
    with connected(then) as device, pytest.raises(pt.DeviceError, match=words):
        device.play(np.full(10, 5.0), 1000.0)


@pytest.mark.parametrize("count", ["nan", "1_0", "1e400"])
def test_a_number_of_samples_that_is_none(count: str) -> None:
    with connected({"DRL? 1": f"1={count}\n"}) as device, pytest.raises(pt.DeviceError) as failure:
        device.play(np.full(10, 5.0), 1000.0)
    assert "recorder has nan samples" in str(failure.value) or "1=NUMBER" in str(failure.value)


def test_a_code_of_many_digits_is_shortened() -> None:
    with connected({"ERR?": "1" * 1000 + "\n"}) as device:
        with pytest.raises(pt.DeviceError, match="expected a code") as failure:
            device.hold(1.0)
        assert len(str(failure.value)) < 300


@pytest.mark.parametrize(("limit", "factor"), [(74.12345678912345, 1.0), (11.23456785, 7.3)])
def test_a_voltage_at_a_limit_is_within_it_as_it_is_written(limit: float, factor: float) -> None:
    sent: list[str] = []
    there = greeted({})

    def answer(line: str) -> Said:
        sent.append(line)
        return there(line)

    with peer(answer) as port:
        device = GcsDevice("127.0.0.1", port, limits=(-limit, limit), factor=factor, timeout=SOON)
        for volts in (limit, -limit):
            device.hold(volts)
        device.close()
    values = [float(line.split()[2]) for line in sent if line.startswith("SVA")]
    assert values == pytest.approx([limit / factor, -limit / factor], rel=1e-8)
    assert all(abs(value) * factor <= limit for value in values)


def test_a_record_that_is_too_short() -> None:
    told = pytest.raises(pt.DeviceError, match="the data recorder has 9 samples: expected 10")
    with connected({"DRL? 1": "1=9\n"}) as device, told:
        device.play(np.full(10, 5.0), 1000.0)


def test_a_record_is_taken_as_it_comes() -> None:
    then: dict[str, Said] = {"DRL? 1": "1=12\n", "DRR? 1 10 1 2": GOOD + ROWS}
    with connected(then) as device:
        record = device.play(np.full(10, 5.0), 1000.0)
    np.testing.assert_allclose(record.displacement, 1e-6 * np.arange(10), rtol=1e-12)
    assert record.volts.tolist() == [5.0] * 10


def interrupted(*_: object) -> None:
    raise KeyboardInterrupt


@pytest.mark.parametrize("where", ["between two looks", "while an answer comes", "before it"])
def test_ctrl_c_in_a_table_stops_it_and_leads_home(
    where: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with GcsServer(quiet_stage()) as server:
        device = GcsDevice("127.0.0.1", server.port)
        device.hold(5.0)
        ask = device._line.ask

        def once(command: str) -> list[str]:
            if command == "\x09":
                monkeypatch.undo()
                device._line.send("\x09", "HLP?")
                if where == "while an answer comes":
                    device._line.answer("#9")
                interrupted()
            return ask(command)

        if where == "between two looks":
            monkeypatch.setattr("piezotrack.adapters.gcs.device.time.sleep", interrupted)
        else:
            monkeypatch.setattr(device._line, "ask", once)
        with pytest.raises(KeyboardInterrupt):
            pt.measure(device, "sine:0.1Hz,20..75V,600s", rate=100.0, rest=0.0)
        monkeypatch.undo()
        assert device._line.ask("\x09") == ["0x0"]
        assert device.voltage == 0.0
        device.close()


def test_a_server_that_goes_in_the_middle_of_a_table() -> None:
    server = GcsServer(quiet_stage())
    device = GcsDevice("127.0.0.1", server.port)
    failures: list[BaseException] = []

    def play() -> None:
        try:
            pt.measure(device, "sine:0.1Hz,0..75V,600s", rate=100.0)
        except BaseException as error:
            failures.append(error)

    thread = threading.Thread(target=play)
    thread.start()
    with socket.create_connection(("127.0.0.1", server.port), SOON) as other:
        lines = other.makefile("rw", encoding="ascii", newline="")
        running = False
        while not running:
            lines.write("\x09")
            lines.flush()
            running = int(lines.readline(), 16) == 1
        lines.close()
    server.close()
    thread.join()
    device.close()
    (failure,) = failures
    assert isinstance(failure, pt.DeviceError)
    assert f"gcs://127.0.0.1:{server.port}: '#9'" in str(failure)
