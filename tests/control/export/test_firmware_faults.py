"""Faults of a firmware: whatever fails, its output goes to the safe voltage."""

from __future__ import annotations

import math
import select
import socket
import struct
import threading
import time
from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np
import pytest

import piezotrack as pt
from boards import MACHINES, TIMED, booted, connected, controller, needs_cross, within
from c_exports import needs_gcc

if TYPE_CHECKING:
    from pathlib import Path

SAFE = 0.0


class Clock:
    """Converters that send what a test says, and keep what is answered [V]."""

    def __init__(self, one: pt.Controller) -> None:
        low, high = one.limits
        self._scale = (high - low) / (2**20 - 1)
        self._socket = socket.create_server(("127.0.0.1", 0))
        self.address: tuple[str, int] = self._socket.getsockname()[:2]
        self.status, self.volts, self.going = 0, [math.nan], True
        self.code = 2**19
        # How long an answer may take before the board begins anew [s]; None: for ever.
        self.patience: float | None = None
        self.begun = 0
        self._thread = threading.Thread(target=self._run)

    def __enter__(self) -> Clock:
        self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        """Wait for the board to go, which is killed before."""
        self._thread.join()
        self._socket.close()

    def _run(self) -> None:
        link, _ = self._socket.accept()
        with link:
            link.recv(1 + 7 * 8, socket.MSG_WAITALL)
            self.begun += 1
            while True:
                while not self.going:
                    time.sleep(0.001)
                try:
                    link.sendall(struct.pack("<IB", self.code, self.status))
                    ready, _, _ = select.select([link], [], [], self.patience)
                    if not ready:
                        # A board that starts says how codes are meant.
                        link.recv(1 + 7 * 8, socket.MSG_WAITALL)
                        self.begun += 1
                        continue
                    answer = link.recv(4, socket.MSG_WAITALL)
                except OSError:
                    return
                if len(answer) < 4:
                    return
                self.volts.append(struct.unpack("<I", answer)[0] * self._scale)


@needs_gcc
@pytest.mark.parametrize(
    ("status", "mode", "fault"), [(1, "hold", "overrun"), (2, "run", "reading")]
)
def test_samples_that_are_late_or_have_no_reading_lead_to_the_safe_voltage(
    status: int, mode: str, fault: str, tmp_path: Path
) -> None:
    one = controller()
    with Clock(one) as clock, booted(one, tmp_path, "host", clock.address) as (address, _):
        device = connected(address)
        device.hold(30.0)
        if mode == "run":
            device.follow(5e-5)
        clock.status = status
        assert within(lambda: device.state().fault == fault)
        assert within(lambda: clock.volts[-1] == SAFE)
        # On the way there no step is larger than that of half a second over the range.
        steps = np.abs(np.diff(clock.volts))
        way = steps[np.flatnonzero(steps > 0.0)[-100:]]
        assert 0.14 < way.max() < 0.16
        clock.status = 0
        device.clear()
        assert device.state().mode == "off"
        device.close()


@needs_gcc
def test_samples_that_do_not_come_are_a_fault(tmp_path: Path) -> None:
    one = controller()
    pt.control.export_controller(one, tmp_path, to="firmware", name="axis")
    text = (tmp_path / "Makefile").read_text().replace("CFLAGS +=", "CFLAGS :=")
    (tmp_path / "Makefile").write_text(text)
    with Clock(one) as clock, booted(one, tmp_path, "host", clock.address) as (address, _):
        device = connected(address)
        device.hold(30.0)
        assert within(lambda: clock.volts[-1] > 29.0)
        clock.going = False
        assert within(lambda: device.state().fault == "sampling")
        clock.going = True
        assert within(lambda: clock.volts[-1] == SAFE)
        device.clear()
        # Also on the way to the safe voltage.
        device.hold(70.0)
        assert within(lambda: clock.volts[-1] > 69.0)
        device._line.ask("stop")
        clock.going = False
        assert within(lambda: device.state().fault == "sampling")
        assert device.voltage == SAFE
        clock.going = True
        assert within(lambda: clock.volts[-1] == SAFE)
        device.close()


@needs_cross
@pytest.mark.slow
def test_the_timer_of_a_board_is_its_clock(tmp_path: Path, stage: pt.hardware.Converters) -> None:
    """However fast the converters answer: they would give a thousand samples a second and more."""
    one = controller(dt=0.02, feedback=pt.Pid.from_um(kp=0.02, ti=0.05), filters=[])
    with booted(one, tmp_path, "m4-timer", stage.address, emulator=()) as (address, _):
        device = connected(address)
        before, first = time.monotonic(), device.state().tick
        assert within(lambda: device.state().tick >= first + 40)
        last, after = device.state().tick, time.monotonic()
        device.close()
    # Where the computer is busy, it waits for them.
    assert (last - first - 2) * one.dt <= after - before


@needs_cross
@pytest.mark.slow
@pytest.mark.parametrize("board", TIMED)
def test_a_step_that_lasts_longer_than_its_interval_is_an_overrun(
    board: str, tmp_path: Path, stage: pt.hardware.Converters
) -> None:
    one = controller()
    pt.control.export_controller(one, tmp_path, to="firmware", name="axis")
    # Above 60 um a step has 20000 instructions more, which take 1.28 ms; below a tenth of them.
    source = tmp_path / "firmware.c"
    wait = "for (volatile int i = constant > (real)6e-5 ? 6000 : 600; i > 0; i--) {\n}\n"
    text = source.read_text()
    assert text.count("case MODE_RUN:\n") == 1
    source.write_text(text.replace("case MODE_RUN:\n", f"case MODE_RUN:\n{wait}"))
    with booted(one, tmp_path, board, stage.address) as (address, _):
        device = connected(address)
        device.follow(4e-5)
        assert within(lambda: device.state().recorded > 300)
        assert device.state().overruns == 0
        device._line.ask("follow 7e-5")
        assert within(lambda: device.state().fault == "overrun")
        assert within(lambda: stage.voltage == SAFE)
        # On the way there the steps are short again.
        assert device.state().overruns < 6
        device.close()


@needs_cross
@pytest.mark.slow
@pytest.mark.parametrize("board", MACHINES)
def test_the_watchdog_resets_a_processor_that_hangs(board: str, tmp_path: Path) -> None:
    one = controller()
    pt.control.export_controller(one, tmp_path, to="firmware", name="axis")
    # A processor that stops with its interrupts held, ten seconds after it began.
    main = tmp_path / "main.c"
    hang = "if (board_millis() > 10000u) {\n board_mask(true);\n for (;;) {\n }\n }"
    main.write_text(main.read_text().replace("firmware_poll();", f"firmware_poll();\n{hang}"))
    with Clock(one) as clock, booted(one, tmp_path, board, clock.address) as (address, _):
        clock.patience = 0.5
        device = connected(address)
        device.hold(30.0)
        assert within(lambda: clock.volts[-1] == pytest.approx(30.0, abs=1e-3))
        # Nobody feeds it: after twice its second the board begins anew, in off. Emulated time is
        # slower where the computer is busy.
        assert within(lambda: clock.begun == 2, 90.0)
        assert within(lambda: clock.volts[-1] == SAFE)
        state = device.state()
        assert (state.mode, state.fault) == ("off", "none")
        assert state.tick < len(clock.volts)
        device.close()


@needs_gcc
def test_a_second_reference_begins_from_the_voltage_that_is_there(
    tmp_path: Path, stage: pt.hardware.Converters
) -> None:
    one = controller(filters=[])
    with booted(one, tmp_path, "host", stage.address) as (address, _):
        device = connected(address)
        first = device.track(one, "triangle:2Hz,5..10um,0.5s")
        with pytest.raises(pt.DeviceError, match="in use"):
            device._line.load("voltage", np.full(10, 70.0))
        second = device.track(one, "triangle:2Hz,70..90um,0.5s")
        device.close()
    assert abs(second.voltage[0] - first.voltage[-1]) < 1.0
    # The PID alone answers the step of the reference.
    assert np.abs(np.diff(second.voltage)).max() < 3.0


@needs_gcc
@pytest.mark.parametrize("code", [0, 2**20 - 1])
def test_a_sensor_at_an_end_of_its_range_gives_no_reading(code: int, tmp_path: Path) -> None:
    one = controller()
    with Clock(one) as clock, booted(one, tmp_path, "host", clock.address) as (address, _):
        device = connected(address)
        device.follow(4e-5)
        clock.code = code
        assert within(lambda: device.state().fault == "reading")
        assert within(lambda: clock.volts[-1] == SAFE)
        device.close()


@needs_gcc
def test_a_second_client_is_told_that_it_is_one(
    tmp_path: Path, stage: pt.hardware.Converters
) -> None:
    with booted(controller(), tmp_path, "host", stage.address) as (address, _):
        device = connected(address)
        for _ in range(5):
            with pytest.raises(pt.DeviceError, match="another program has the link"):
                pt.hardware.connect(address)
        assert device.state().mode == "off"
        device.close()
        connected(address).close()


@needs_gcc
def test_half_a_line_is_not_that_of_the_next_client(
    tmp_path: Path, stage: pt.hardware.Converters
) -> None:
    with booted(controller(), tmp_path, "host", stage.address) as (address, _):
        host, port = address.removeprefix("firmware://").split(":")
        with socket.create_connection((host, int(port))) as link:
            link.sendall(b"hold 7")
            time.sleep(0.1)
        with socket.create_connection((host, int(port))) as link, link.makefile("rw") as lines:
            lines.write("5\n")
            lines.flush()
            assert lines.readline().startswith("error command")


@needs_gcc
def test_a_client_that_does_not_read_is_hung_up_on(
    tmp_path: Path, stage: pt.hardware.Converters
) -> None:
    with booted(controller(), tmp_path, "host", stage.address) as (address, _):
        host, port = address.removeprefix("firmware://").split(":")
        with socket.create_connection((host, int(port))) as link:
            link.sendall(b"hold 60\n")
            assert within(lambda: stage.voltage > 59.9)
            link.settimeout(0.5)
            with suppress(OSError):
                for _ in range(100_000):
                    link.sendall(b"read 0 256\n")
            assert within(lambda: stage.voltage == SAFE)


@needs_cross
@pytest.mark.slow
def test_answers_that_a_client_does_not_read_do_not_stop_a_board(tmp_path: Path) -> None:
    """Output that does not leave is dropped, no line is a mixture of two, sampling goes on."""
    one, path = controller(), tmp_path / "link"
    place = f"unix:{path.name},server=on,wait=off"
    with (
        Clock(one) as clock,
        booted(one, tmp_path, "m4", clock.address, link=place),
        socket.socket(socket.AF_UNIX) as link,
    ):
        assert within(path.exists)
        link.connect(str(path))
        link.settimeout(20.0)
        link.sendall(b"hold 60\n")
        # Few bytes find room. Longer than twice the time of the watchdog nobody reads.
        for _ in range(50):
            link.sendall(b"id\n")
            time.sleep(0.1)
        received = b""
        while select.select([link], [], [], 1.0)[0]:
            received += link.recv(2**16)
        # The first command ends the line that was cut.
        link.sendall(b"ping\nstate\n")
        while b"fault=" not in received or not received.endswith(b"\n"):
            received += link.recv(2**16)
        assert clock.volts[-1] == pytest.approx(60.0, abs=1e-3)
    answers = received.decode().splitlines()
    assert answers[0] == "ok"
    assert answers[-1].startswith("ok hold fault=none")
    assert len(answers) < 40
    # Of two answers there is no mixture.
    assert all(line.startswith("ok") and line.count("ok") == 1 for line in answers)


@needs_gcc
def test_lines_that_make_no_sense_are_answered(
    tmp_path: Path, stage: pt.hardware.Converters
) -> None:
    with booted(controller(), tmp_path, "host", stage.address) as (address, process):
        host, port = address.removeprefix("firmware://").split(":")
        with socket.create_connection((host, int(port))) as link, link.makefile("rw") as lines:
            for line, answer in {
                "ping": "ok",
                "": "error command",
                "hold": "error hold",
                "hold 75.1": "error hold",
                "hold nan": "error hold",
                "hold 1e9999999999": "error hold",
                "hold x7ff8000000000000": "error hold",
                "hold 1.25e1": "ok",
                "load voltage 4096 1": "error table",
                "load voltage 4000 " + "1 " * 49: "error number",
                "load sideways 0 1": "error table",
                "load voltage 0 -0.001": "error table",
                "load voltage 4294967295 1 2": "error table",
                "play 0 1 0": "error play",
                "play 4097 1 0": "error play",
                "play 2 1 4294967295": "error play",
                "play 99999999999 1 0": "error play",
                "run 1 1 2": "error run",
                "read 0 257": "error samples",
                "clear": "error clear",
                "tune": "error tune",
                "follow 1": "error follow",
                "load reference 0 1e300": "error table",
                "stage": "ok",
                "set 99 1": "error set",
                "set 0": "error set",
                "set 0 1e30": "ok",
                "tune ": "error tune",
                "setting 99": "error setting",
                "x" * 2000: "error line",
                "ping ": "ok",
            }.items():
                lines.write(f"{line}\n")
                lines.flush()
                assert lines.readline().startswith(answer), line
        assert process.poll() is None
