"""A board at a serial port: the firmware of this computer behind a pseudo terminal."""

from __future__ import annotations

import os
import socket
import threading
from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np
import pytest

import piezotrack as pt
from boards import booted, controller, within
from c_exports import needs_gcc

if TYPE_CHECKING:
    from pathlib import Path

pty = pytest.importorskip("pty", reason="pseudo terminals are those of POSIX")


class Passage:
    """A pseudo terminal that passes on to the address of a firmware."""

    def __init__(self, address: str) -> None:
        host, _, port = address.removeprefix("firmware://").partition(":")
        self._link = socket.create_connection((host, int(port)))
        self._link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._master, self._slave = pty.openpty()
        self.path = os.ttyname(self._slave)
        self._jobs = [threading.Thread(target=one) for one in (self._to_board, self._to_port)]

    def __enter__(self) -> Passage:
        for job in self._jobs:
            job.start()
        return self

    def __exit__(self, *error: object) -> None:
        self.cut()
        # Ends what waits for the next byte.
        os.write(self._slave, b"\n")
        for job in self._jobs:
            job.join()
        for end in (self._master, self._slave):
            os.close(end)
        self._link.close()

    def send(self, data: bytes) -> None:
        """Send what another program would."""
        self._link.sendall(data)

    def cut(self) -> None:
        """Pull the cable."""
        with suppress(OSError):
            self._link.shutdown(socket.SHUT_RDWR)

    def _to_board(self) -> None:
        with suppress(OSError):
            while True:
                self._link.sendall(os.read(self._master, 4096))

    def _to_port(self) -> None:
        with suppress(OSError):
            while data := self._link.recv(4096):
                os.write(self._master, data)


@needs_gcc
def test_a_board_at_a_serial_port_is_the_same_device(
    stage: pt.hardware.Converters, tmp_path: Path
) -> None:
    one = controller()
    with (
        booted(one, tmp_path, "host", stage.address) as (address, _),
        Passage(address) as passage,
    ):
        # Half a command of a program that is gone.
        passage.send(b"hol")
        board = pt.hardware.connect(f"firmware://{passage.path}?baud=921600&timeout=2s")
        assert isinstance(board, pt.hardware.FirmwareDevice)
        assert board.limits == (0.0, 75.0)
        assert passage.path in board.channels[0]
        log = pt.measure(board, "sine:5Hz,20..40V,0.4s", rate=500.0)
        assert 10e-6 < np.ptp(log.y) < 60e-6
        board.hold(20.0)
        run = board.track(one, "sine:2Hz,10..60um,0.5s")
        session = one.start(present=20.0)
        signals = zip(run.desired, run.measured, strict=True)
        assert [session.step(x, y, feedforward=0.0) for x, y in signals] == run.voltage.tolist()
        with pytest.raises(pt.DeviceError, match="no other program has"):
            pt.hardware.FirmwareDevice(passage.path, baud=921600)
        board.exchange(40.0)
        passage.cut()
        with pytest.raises(pt.DeviceError, match="did not answer"):
            board.state()
        board.close()
        other = pt.hardware.connect(address)
        assert isinstance(other, pt.hardware.FirmwareDevice)
        assert within(lambda: other.state().mode == "fault")
        assert within(lambda: other.voltage == 0.0)
        other.close()


def test_a_port_that_is_not_there_is_told() -> None:
    for address in ("firmware:///dev/tty-of-nobody", "firmware:///dev/tty-of-nobody?baud=9600"):
        with pytest.raises(pt.DeviceError, match="tty-of-nobody"):
            pt.hardware.connect(address)
    with pytest.raises(pt.ParameterError, match="baud"):
        pt.hardware.connect("firmware:///dev/ttyACM0?baud=fast")
