"""Messages and answers of an instrument over TCP or a serial port: one line each."""

from __future__ import annotations

import re
import socket
import time

from .._support.messages import quoted
from .._support.units import Unit, lookup
from ..errors import DeviceError
from .answers import number, shown
from .serial_port import SerialPort

__all__ = ["Link", "number_of"]

# Longest answer, and what readings add to it [bytes].
LONGEST, READING = 1_000_000, 40
NO_NUMBER = ("NAN", "INF", "+INF", "-INF", "NINF")
_ANSWER = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*([^\d\s.+-]*)")


class Link:
    """A connection that asks and tells in lines, with a time limit.

    Over TCP a message leaves in one segment, without Nagle's algorithm. After a failure the
    connection is given up, and the next message makes a new one: an answer that comes late is never
    taken for that of the next message.

    Parameters
    ----------
    host : str
        Name or address, or the name of a serial port.
    port : int
        TCP port.
    timeout : float
        Time limit of an answer [s].
    baud : int, optional
        Rate of a serial port [bit/s].
    """

    def __init__(self, host: str, port: int, timeout: float, *, baud: int | None = None) -> None:
        self._host, self._port, self._timeout, self._baud = host, port, timeout, baud
        self.where = f"{host}:{port}" if baud is None else host
        self._socket: socket.socket | SerialPort | None = None
        self._open()

    def tell(self, message: str) -> None:
        """Send a message that has no answer."""
        self._send(self._ready(), message)

    def ask(self, message: str, *, patience: float = 0.0, readings: int = 0) -> str:
        """Send a message and return its answer, which is one line.

        Parameters
        ----------
        message : str
            The message.
        patience : float, optional
            How much longer than its time limit it may take [s].
        readings : int, optional
            How many readings the answer may have.

        Raises
        ------
        DeviceError
            No connection, no answer or half of one within the time limit, or more than one.
        """
        link = self._ready()
        try:
            self._send(link, message)
            longest = LONGEST + readings * READING
            return self._answer(link, message, self._timeout + patience, longest)
        except KeyboardInterrupt:
            # Its answer may still come, and the output is to be led to a safe voltage.
            self.close()
            raise

    def _answer(
        self, link: socket.socket | SerialPort, message: str, limit: float, longest: int
    ) -> str:
        parts: list[bytes] = []
        end, length = time.monotonic() + limit, 0
        while True:
            try:
                link.settimeout(max(end - time.monotonic(), 1e-6))
                part = link.recv(65536)
            except TimeoutError:
                raise self._failed(message, b"".join(parts), f"within {limit:g} s") from None
            except OSError as error:
                raise self._failed(message, b"".join(parts), str(error)) from None
            if not part:
                raise self._failed(message, b"".join(parts), "and closed the connection")
            parts.append(part)
            length += len(part)
            if b"\n" in part:
                break
            if length > longest:
                raise self._failed(message, b"".join(parts), f"in {longest} bytes")
        line, _, more = b"".join(parts).partition(b"\n")
        if more:
            self.close()
            raise DeviceError(
                f"{self.where} answered {quoted(message)} with {shown(_text(line))} and then "
                f"{shown(_text(more))}: expected one line"
            )
        return _text(line).strip()

    def close(self) -> None:
        """Close the connection."""
        link, self._socket = self._socket, None
        if link is not None:
            link.close()

    def _open(self) -> socket.socket | SerialPort:
        if self._baud is not None:
            try:
                port = SerialPort(self._host, self._baud, self._timeout)
            except OSError as error:
                raise DeviceError(
                    f"{self._host} cannot be used: {error}; expected a serial port that no other "
                    "program has"
                ) from None
            self._socket = port
            return port
        try:
            link = socket.create_connection((self._host, self._port), timeout=self._timeout)
        except OSError as error:
            raise DeviceError(
                f"{self.where} does not answer: {error.strerror or error}; expected an instrument "
                "that takes messages over TCP there"
            ) from None
        # Else a second message waits for the acknowledgement of the first.
        link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket = link
        return link

    def _ready(self) -> socket.socket | SerialPort:
        """Return the connection, a new one where the last was given up; nothing waits in it."""
        if self._socket is None:
            return self._open()
        link = self._socket
        try:
            link.setblocking(False)
            unasked = link.recv(4096)
        except BlockingIOError:
            return link
        except OSError:
            unasked = b""
        self.close()
        if unasked:
            raise DeviceError(
                f"{self.where} sent {shown(_text(unasked))} unasked: expected answers only"
            )
        # It closed the connection while nothing was asked.
        return self._open()

    def _send(self, link: socket.socket | SerialPort, message: str) -> None:
        try:
            link.settimeout(self._timeout)
            link.sendall(message.encode("ascii") + b"\n")
        except OSError as error:
            self.close()
            raise DeviceError(
                f"{self.where} did not take {quoted(message)}: {error.strerror or error}"
            ) from None
        except BaseException:
            # Half a message may be out, to which the next one would be added.
            self.close()
            raise

    def _failed(self, message: str, got: bytes, why: str) -> DeviceError:
        self.close()
        if got:
            said = f"answered {quoted(message)} with {shown(_text(got))}, no end of line"
            return DeviceError(f"{self.where} {said} {why}: expected a whole line")
        return DeviceError(f"{self.where} did not answer {quoted(message)} {why}")


def _text(raw: bytes) -> str:
    return raw.decode("ascii", errors="backslashreplace")


def number_of(answer: str, unit: Unit) -> float:
    """Return a displacement [m] as an instrument wrote it in `unit`; NaN for an overload.

    Raises
    ------
    ValueError
        It is no number, or has another unit behind it.

    Examples
    --------
    >>> from piezotrack._support.units import require
    >>> number_of("+1.5E+00", require("um")), number_of("9.91E37", require("um"))
    (1.5e-06, nan)
    """
    text = answer.strip()
    if text.upper() in NO_NUMBER:
        return float("nan")
    match = _ANSWER.fullmatch(text)
    if match is None or (match[2] and lookup(match[2]) != unit):
        raise ValueError(answer)
    return number(match[1]) * unit.factor / unit.divisor
