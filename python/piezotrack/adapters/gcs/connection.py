"""The line to a controller: commands over TCP, each answer within its limits."""

from __future__ import annotations

import re
import socket
import time
from typing import TYPE_CHECKING

from ..._support.messages import quoted
from ...errors import DeviceError
from ..answers import shown
from .protocol import ENCODING, STOP, is_last, words_of

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["Connection"]

CHUNK = 65536
# Longest answer [bytes, lines], and what samples of a data recorder add to it [bytes, s]: a serial
# line behind a converter takes some 2 ms for a sample.
BYTES, LINES = 1_000_000, 10_000
SAMPLE_BYTES, SAMPLE_TIME = 100, 2e-3
# Longest wait on a connection that was made anew, until it has brought an answer [s].
UNPROVEN = 2.0
_CODE = re.compile(r"[+-]?[0-9]{1,9}")


class Connection:
    """A connection to one controller.

    After a failure, or an interruption while an answer was due, it is given up: a late answer would
    be taken for the next one. `ready` makes it anew.

    Parameters
    ----------
    host : str
        Name or address.
    port : int
        TCP port.
    timeout : float
        Longest wait for a connection, and for a whole answer [s].

    Attributes
    ----------
    number : int
        How many times it was made.

    Raises
    ------
    DeviceError
        Nobody answers.
    """

    def __init__(self, host: str, port: int, timeout: float) -> None:
        self.name = f"gcs://{host}:{port}"
        self.number = 0
        self._place, self._timeout = (host, port), timeout
        self._socket: socket.socket | None = None
        self._is_closed = False
        # Longest wait for an answer at present, the latest moment of that which is due [s], and how
        # many have not come.
        self._limit, self._latest, self._due = timeout, 0.0, 0
        self._got = bytearray()
        # Whether nothing was there a moment ago, so that the next command need not look again.
        self._is_looked_at = False
        self._connect(timeout)

    def ready(self) -> int:
        """Make the connection anew where it was given up or ended; return its number.

        Raises
        ------
        DeviceError
            Nobody answers, something came that was not asked for, or it is closed.
        """
        if self._is_closed:
            raise DeviceError(f"{self.name} is closed")
        if self._socket is None or self._due or not self._is_quiet(self._socket):
            self._drop()
            self._connect(min(self._timeout, UNPROVEN))
        self._is_looked_at = True
        return self.number

    def send(self, *commands: str, samples: int = 0) -> None:
        """Send commands in one message, without a wait for anything.

        Raises
        ------
        DeviceError
            The connection is lost, or something came that was not asked for.
        """
        link, looked_at = self._socket, self._is_looked_at
        self._is_looked_at = False
        if link is None or self._due or not (looked_at or self._is_quiet(link)):
            raise self._failed(commands, "cannot be sent: the connection was lost")
        self._due = sum(map(_is_query, commands))
        self._latest = time.monotonic() + self._limit + samples * SAMPLE_TIME
        try:
            link.settimeout(self._limit)
            link.sendall("".join(map(_line, commands)).encode(ENCODING))
        except OSError as error:
            raise self._failed(commands, f"cannot be sent: {_reason(error)}") from None
        except BaseException:
            # Half a command may be out.
            self._drop()
            raise

    def ask(self, command: str, *, samples: int = 0) -> list[str]:
        """Send a query and return the lines of its answer.

        Parameters
        ----------
        command : str
            The query.
        samples : int, optional
            How many samples of the data recorder the answer may have.

        Raises
        ------
        DeviceError
            The controller refuses it, answers half or not at all, or the connection is lost.
        """
        self.send(command, samples=samples)
        try:
            return self.answer(command, samples=samples)
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
            told = f"was not answered, and ERR? then with {shown(' '.join(lines))}"
            raise self._failed([command], told) from None

    def exchange(self, query: str, *commands: str) -> list[str]:
        """Send a query, commands and ERR? in one message; return the answer to the query."""
        self.send(query, *commands, "ERR?")
        try:
            lines = self.answer(query)
            if len(lines) == 1 and "=" not in lines[0] and (code := _code(lines)):
                # Only ERR? has answered: the query is refused.
                self._due = 0
                raise self._refused(query, code)
            self._no_error(commands)
        except _NoAnswerError as error:
            raise self._failed([query, *commands], str(error)) from None
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
            self._no_error(commands)
        except _NoAnswerError as error:
            raise self._failed([*commands, "ERR?"], str(error)) from None

    def answer(self, *commands: str, samples: int = 0) -> list[str]:
        """Return the lines of the next answer, without the spaces that join them."""
        lines: list[str] = []
        room, most = BYTES + samples * SAMPLE_BYTES, LINES + samples
        while not lines or not is_last(lines[-1]):
            if len(lines) == most:
                raise self._failed(commands, f"has an answer of more than {most} lines")
            line = self._next_line(commands, len(lines), room)
            room -= len(line) + 1
            lines.append(line)
        self._due -= 1
        lines = [line.rstrip(" ") for line in lines]
        if self._got and not self._due:
            told, more = shown("\n".join(lines[:3])), shown(self._rest())
            raise self._failed(commands, f"has the answer {told} and then {more}: expected no more")
        self._limit = self._timeout
        return lines

    def unexpected(self, command: str, lines: Sequence[str], expected: str) -> DeviceError:
        """Return the error of an answer that is of another kind: that to another query, perhaps."""
        told = shown("\n".join(lines[:3]))
        return self._failed([command], f"has the answer {told}: expected {expected}")

    def close(self) -> None:
        """Close it for good."""
        self._is_closed = True
        self._drop()

    def _connect(self, limit: float) -> None:
        try:
            self._socket = socket.create_connection(self._place, limit)
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        except OSError as error:
            raise self._failed((), f"nobody answers: {_reason(error)}") from None
        self.number += 1
        self._limit, self._due = limit, 0
        self._got.clear()

    def _drop(self) -> None:
        link, self._socket = self._socket, None
        if link is not None:
            link.close()

    def _is_quiet(self, link: socket.socket) -> bool:
        """Return whether a connection is there on which nothing has come; fail where it has."""
        unasked = self._rest()
        try:
            link.setblocking(False)
            unasked += link.recv(CHUNK).decode(ENCODING, errors="replace")
        except BlockingIOError:
            if not unasked:
                return True
        except OSError:
            return False
        if unasked:
            raise self._failed((), f"sent {shown(unasked)} unasked: expected answers only")
        return False

    def _next_line(self, commands: Sequence[str], before: int, room: int) -> str:
        link = self._socket
        if link is None:
            raise self._failed(commands, "has no answer: the connection was lost")
        # For a long answer silence is the end too, well before its last moment.
        searched, silent = 0, time.monotonic() + self._limit
        while (end := self._got.find(b"\n", searched)) < 0:
            searched = len(self._got)
            if searched > room:
                break
            left = min(silent, self._latest) - time.monotonic()
            try:
                link.settimeout(max(left, 1e-3))
                more = link.recv(CHUNK)
            except TimeoutError:
                self._check_whole(commands, before)
                raise _NoAnswerError(f"was not answered in {self._limit:g} s") from None
            except OSError as error:
                raise self._failed(commands, f"has no answer: {_reason(error)}") from None
            if not more:
                half = f"{self._half(before)}, " if self._got or before else ""
                raise self._failed(commands, f"has no answer: {half}{HUNG_UP}")
            self._got += more
            silent = time.monotonic() + self._limit
            if left < 0.0 and b"\n" not in more:
                self._check_whole(commands, before)
        if not 0 <= end <= room:
            raise self._failed(commands, "has an answer that is too long")
        line = bytes(self._got[:end])
        del self._got[: end + 1]
        return line.decode(ENCODING, errors="replace").rstrip("\r")

    def _check_whole(self, commands: Sequence[str], before: int) -> None:
        """Fail where a part of an answer has come in the time for the whole."""
        if self._got or before:
            half = f"is answered by half, {self._half(before)}, and by no more in time"
            raise self._failed(commands, half) from None

    def _rest(self) -> str:
        return self._got.decode(ENCODING, errors="replace")

    def _half(self, before: int) -> str:
        lines = f"{before} lines and " if before else ""
        return f"{lines}{shown(self._rest())}"

    def _no_error(self, commands: Sequence[str]) -> None:
        lines = self.answer("ERR?")
        if (code := _code(lines)) is None:
            raise self.unexpected("ERR?", lines, "a code")
        if code:
            raise self._refused("; ".join(commands), code)

    def _refused(self, asked: str, code: int) -> DeviceError:
        return DeviceError(f"{self.name}: {_shown(asked)} is refused: {words_of(code)}")

    def _failed(self, commands: Sequence[str], how: str) -> DeviceError:
        """Give the connection up, and return the error that says why."""
        self._drop()
        what = f"{_shown(*commands)} " if commands else ""
        return DeviceError(f"{self.name}: {what}{how}")


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
    if len(lines) != 1 or not _CODE.fullmatch(lines[0].strip()):
        return None
    return int(lines[0])


def _shown(*asked: str) -> str:
    """Write what was asked: a byte by its number, a long command by its beginning."""
    names = [f"#{ord(one)}" if len(one) == 1 else one for one in asked]
    text = "; ".join(names)
    return quoted(text if len(text) <= 40 else f"{text[:37]}...")


def _reason(error: OSError) -> str:
    if isinstance(error, TimeoutError):
        return "nothing came in time"
    return (error.strerror or str(error)).lower()
