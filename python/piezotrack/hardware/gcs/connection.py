"""The line to a controller: commands over TCP, each wait with its limit."""

from __future__ import annotations

import socket
import time
from typing import TYPE_CHECKING

from ..._support.messages import quoted
from ...errors import DeviceError
from .protocol import ENCODING, STOP, is_last, words_of

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["Connection"]

CHUNK = 65536
# Longest answer [bytes]: a whole data recorder is less.
LONGEST = 64 * 1024 * 1024
# Silence after which no answer is expected any more [s].
QUIET = 0.2


class Connection:
    """A connection to one controller.

    After a failure it is closed: a late answer would be taken for the next one.

    Parameters
    ----------
    host : str
        Name or address.
    port : int
        TCP port.
    timeout : float
        Longest wait for a connection, and for each part of an answer [s].

    Raises
    ------
    DeviceError
        Nobody answers.
    """

    def __init__(self, host: str, port: int, timeout: float) -> None:
        self.name = f"gcs://{host}:{port}"
        self._timeout = timeout
        self._got = bytearray()
        # Answers that have not come: the query was refused, or nobody waited to the end.
        self._due = 0
        self._lost = ""
        try:
            self._socket = socket.create_connection((host, port), timeout)
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        except OSError as error:
            raise DeviceError(f"{self.name}: nobody answers: {_reason(error)}") from None

    def send(self, *commands: str) -> None:
        """Send commands in one message, without a wait for anything."""
        self._still_there(commands)
        try:
            if self._due:
                self._forget()
            self._due = sum(map(_is_query, commands))
            self._socket.sendall("".join(map(_line, commands)).encode(ENCODING))
        except OSError as error:
            raise self._failed(commands, f"cannot be sent: {_reason(error)}") from None

    def ask(self, command: str) -> list[str]:
        """Send a query and return the lines of its answer.

        Raises
        ------
        DeviceError
            The controller refuses it, answers half or not at all, or the connection is lost.
        """
        self.send(command)
        try:
            return self.answer(command)
        except _NoAnswerError:
            # A query that is refused has no answer. Why, ERR? says.
            self._due = 0
            self.send("ERR?")
            try:
                lines = self.answer(command, "ERR?")
            except _NoAnswerError as error:
                raise self._failed([command], str(error)) from None
            if code := _code(lines):
                raise self._refused(command, code) from None
            said = f"was not answered, and ERR? then with {quoted(' '.join(lines))}"
            raise self._failed([command], said) from None

    def exchange(self, command: str, query: str) -> list[str]:
        """Send a query, a command and ERR? in one message; return the answer to the query."""
        self.send(query, command, "ERR?")
        try:
            lines = self.answer(query)
            if len(lines) == 1 and "=" not in lines[0] and (code := _code(lines)):
                # Only ERR? has answered: the query is refused.
                raise self._refused(query, code)
            self._no_error(command)
        except _NoAnswerError as error:
            raise self._failed([query, command], str(error)) from None
        return lines

    def command(self, *commands: str) -> None:
        """Send commands and ask for their error in the same message.

        Raises
        ------
        DeviceError
            The controller reports an error, by its code and words.
        """
        self.send(*commands, "ERR?")
        try:
            self._no_error("; ".join(commands))
        except _NoAnswerError as error:
            raise self._failed([*commands, "ERR?"], str(error)) from None

    def answer(self, *asked: str) -> list[str]:
        """Return the lines of the next answer, without the spaces that join them."""
        lines: list[str] = []
        size = 0
        while not lines or not is_last(lines[-1]):
            line = self._next_line(asked, len(lines))
            size += len(line) + 1
            if size > LONGEST:
                raise self._failed(asked, f"has an answer of more than {LONGEST} bytes")
            lines.append(line)
        self._due -= 1
        return [line.rstrip(" ") for line in lines]

    def unexpected(self, asked: str, lines: Sequence[str], expected: str) -> DeviceError:
        """Return the error of an answer that is of another kind."""
        shown = quoted("\n".join(lines))
        return DeviceError(
            f"{self.name}: {_shown(asked)} has the answer {shown}: expected {expected}"
        )

    def close(self) -> None:
        """Close it."""
        self._lost = self._lost or "it is closed"
        self._socket.close()

    def _forget(self) -> None:
        """Leave out answers that still come, and end what may have been sent by half."""
        self._socket.sendall(b"\nERR?\n")
        self._socket.settimeout(QUIET)
        try:
            while self._socket.recv(CHUNK):
                pass
        except TimeoutError:
            self._got.clear()
        self._socket.settimeout(self._timeout)

    def _next_line(self, asked: Sequence[str], before: int) -> str:
        latest = time.monotonic() + self._timeout
        while (end := self._got.find(b"\n")) < 0:
            left = latest - time.monotonic()
            try:
                self._socket.settimeout(max(left, 1e-3))
                more = self._socket.recv(CHUNK)
            except TimeoutError:
                more = b""
                if left > 0.0:
                    continue
            except OSError as error:
                raise self._failed(asked, f"has no answer: {_reason(error)}") from None
            else:
                if not more:
                    raise self._failed(asked, f"has no answer: {self._rest(before)}{HUNG_UP}")
            if not more:
                if self._got or before:
                    half = f"is answered by half, {self._rest(before)}and then by nothing in "
                    raise self._failed(asked, f"{half}{self._timeout:g} s")
                raise _NoAnswerError(f"was not answered in {self._timeout:g} s")
            if len(self._got) > LONGEST:
                raise self._failed(asked, f"has a line of more than {LONGEST} bytes")
            # Each part that comes begins the wait anew.
            latest = time.monotonic() + self._timeout
            self._got += more
        line = bytes(self._got[:end])
        del self._got[: end + 1]
        return line.decode(ENCODING, errors="replace").rstrip("\r")

    def _rest(self, before: int) -> str:
        said = f"{before} lines and " if before else ""
        rest = self._got.decode(ENCODING, errors="replace")
        return f"{said}{quoted(rest)}, " if rest or before else ""

    def _no_error(self, asked: str) -> None:
        lines = self.answer("ERR?")
        if (code := _code(lines)) is None:
            raise self._failed(
                ["ERR?"], f"has the answer {quoted(' '.join(lines))}: expected a code"
            )
        if code:
            raise self._refused(asked, code)

    def _refused(self, asked: str, code: int) -> DeviceError:
        return DeviceError(f"{self.name}: {_shown(asked)} is refused: {words_of(code)}")

    def _still_there(self, asked: Sequence[str]) -> None:
        if self._lost:
            raise DeviceError(
                f"{self.name}: {_shown(*asked)} cannot be sent: {self._lost}; connect again"
            )

    def _failed(self, asked: Sequence[str], how: str) -> DeviceError:
        self._lost = self._lost or "the connection was closed after an error"
        self._socket.close()
        return DeviceError(f"{self.name}: {_shown(*asked)} {how}")


HUNG_UP = "the controller has closed the connection"


class _NoAnswerError(Exception):
    """Nothing came within the time limit."""


def _line(command: str) -> str:
    """End a command; those of one byte have no end."""
    return command if len(command) == 1 else f"{command}\n"


def _is_query(command: str) -> bool:
    """Return whether a command has an answer."""
    if len(command) == 1:
        return command != STOP
    return command.partition(" ")[0].endswith("?")


def _code(lines: Sequence[str]) -> int | None:
    """Return the code of an answer to ERR?, or None where it is none."""
    try:
        (line,) = lines
        return int(line)
    except ValueError:
        return None


def _shown(*asked: str) -> str:
    """Write what was asked: a byte by its number, a long command by its beginning."""
    names = [f"#{ord(one)}" if len(one) == 1 else one for one in asked]
    text = "; ".join(names)
    return quoted(text if len(text) <= 40 else f"{text[:37]}...")


def _reason(error: OSError) -> str:
    if isinstance(error, TimeoutError):
        return "nothing came in time"
    return (error.strerror or str(error)).lower()
