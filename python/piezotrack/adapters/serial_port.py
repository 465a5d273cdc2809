"""A serial port that takes the place of a socket in a `Link`."""

from __future__ import annotations

from typing import Any

from ..hardware.options import required_package

__all__ = ["SerialPort"]

# Time for the answer to an empty line, which ends what another program left half sent [s].
SETTLE = 0.1
# More than it can have [bytes].
LEFT = 65536


class SerialPort:
    """A serial port, by pyserial, with the methods of a socket.

    Parameters
    ----------
    path : str
        Its name, as ``/dev/ttyACM0`` or ``COM3``.
    baud : int
        Rate [bit/s]; ports over USB take no notice of it.
    timeout : float
        Time limit to send a message [s].

    Raises
    ------
    DeviceError
        pyserial is not installed.
    OSError
        There is no such port, or another program has it.
    """

    def __init__(self, path: str, baud: int, timeout: float) -> None:
        serial = required_package("serial", "firmware", f"the serial port {path}")
        self._port: Any = serial.Serial(
            path, baud, timeout=SETTLE, write_timeout=timeout, exclusive=True
        )
        # What another program left half sent ends here, and its answer is nobody's.
        self._port.write(b"\n")
        self._port.read(LEFT)
        self._port.reset_input_buffer()

    def settimeout(self, seconds: float) -> None:
        """Set the time limit of what follows [s]."""
        self._port.timeout = self._port.write_timeout = seconds

    def setblocking(self, flag: bool) -> None:
        """Wait for what is read without a limit, or not at all."""
        self._port.timeout = None if flag else 0.0

    def recv(self, size: int) -> bytes:
        """Return what is there, a byte or more, up to some bytes."""
        first: bytes = self._port.read(1)
        if not first:
            raise TimeoutError if self._port.timeout else BlockingIOError
        waiting = min(self._port.in_waiting, size - 1)
        return first + (self._port.read(waiting) if waiting else b"")

    def sendall(self, data: bytes) -> None:
        """Send all of a message."""
        self._port.write(data)

    def close(self) -> None:
        """Close the port."""
        self._port.close()
