"""Stages, clocks and controllers of a few lines, for the tests of GCS."""

from __future__ import annotations

import re
import socket
import threading
import time
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

import piezotrack as pt
from piezotrack.adapters.gcs.protocol import one_answer
from piezotrack.adapters.simulators.gcs.arguments import Refusal
from piezotrack.adapters.simulators.gcs.controller import VirtualController

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

    # A whole answer, one in pieces, or None to hang up.
    Said = str | Iterable[str] | None

LIMITS = (0.0, 75.0)


def quiet_stage() -> pt.VirtualStage:
    """A stage without noise: two readings of the same motion are the same."""
    return pt.VirtualStage.of(
        pt.stages.PrandtlIshlinskiiStage(
            linear=1e-6, thresholds=(0.0, 10.0, 25.0), weights=(0.3e-6, 0.2e-6, 0.1e-6)
        ),
        mode=(160.0, 0.065),
        limits=LIMITS,
    )


class Clock:
    """A clock that goes on when it is told to [s]."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


# What a controller says when a client connects, as far as the client asks.
GREETING = {
    "*IDN?": "somebody, else, 1, 2\n",
    "HLP?": "".join(
        f"{name} ... \n"
        for name in (
            *("begin", "POS?", "SVO", "SVA", "WAV", "WSL", "WGC", "WTR", "WGO", "DRC", "RTR"),
            *("DRL?", "DRR?", "VMI?", "VMA?", "TNR?"),
        )
    )
    + "end\n",
    "VMI? 1": "1=0\n",
    "VMA? 1": "1=100\n",
    "SPA? 1 0x0E000200": "1 0x0E000200=5.0e-05\n",
    "TNR?": "2\n",
    "SPA? 1 0x16000200": "1 0x16000200=2000\n",
    "SPA? 1 0x13000004": "1 0x13000004=1500\n",
    # No generator runs.
    "\x09": "0\n",
}


@contextmanager
def peer(answer: Callable[[str], Said]) -> Iterator[int]:
    """A server that answers each line by a function: pieces go out one by one, None hangs up."""
    ends = threading.Event()
    connected: list[socket.socket] = []
    threads: list[threading.Thread] = []

    def accept() -> None:
        while not ends.is_set():
            try:
                connection, _ = listening.accept()
            except OSError:
                return
            connected.append(connection)
            threads.append(threading.Thread(target=_serve, args=(connection, answer)))
            threads[-1].start()

    with socket.create_server(("127.0.0.1", 0)) as listening:
        accepting = threading.Thread(target=accept)
        accepting.start()
        try:
            yield int(listening.getsockname()[1])
        finally:
            # Whoever waits for a connection or for a line goes on.
            ends.set()
            listening.shutdown(socket.SHUT_RDWR)
            accepting.join()
            for connection in connected:
                with suppress(OSError):
                    connection.shutdown(socket.SHUT_RDWR)
            for thread in threads:
                thread.join()


def _serve(connection: socket.socket, answer: Callable[[str], Said]) -> None:
    with connection, suppress(OSError):
        connection.settimeout(60.0)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        pending = ""
        while more := connection.recv(65536):
            pending += more.decode("cp1252")
            # The state of the generator is asked for by a byte without an end.
            while found := re.match(r"\x09|[^\n]*\n", pending):
                pending = pending[found.end() :]
                reply = answer(found[0].rstrip("\n"))
                if reply is None:
                    return
                for piece in [reply] if isinstance(reply, str) else reply:
                    connection.sendall(piece.encode("cp1252"))


def dripping(text: str, pause: float = 0.1) -> Iterator[str]:
    """Return a text byte by byte, without an end, with pauses [s] below any time limit."""
    while True:
        for byte in text:
            yield byte
            time.sleep(pause)


def greeted(then: Mapping[str, Said]) -> Callable[[str], Said]:
    """Answer as a controller does that is fine, but for some commands."""

    def answer(line: str) -> Said:
        known: dict[str, Said] = {**GREETING, **then}
        return known.get(line, "0\n" if line == "ERR?" else "")

    return answer


class Spoilt:
    """A virtual controller that is well, on a line that is not: a function spoils answers of it.

    Parameters
    ----------
    spoil : callable
        Takes a command and its answer; returns what goes out, or None to hang up.
    """

    def __init__(self, spoil: Callable[[str, str], Said], speed: float = 100.0) -> None:
        self.controller = VirtualController(quiet_stage(), LIMITS, speed=speed)
        self.spoil, self.error = spoil, 0
        self.lines: list[str] = []

    def __call__(self, line: str) -> Said:
        self.lines.append(line)
        said = self._answer(line)
        return self.spoil(line, said) if said else said

    def _answer(self, line: str) -> str:
        if line == "ERR?":
            code, self.error = self.error, 0
            return f"{code}\n"
        try:
            lines = self.controller.ask(line)
        except Refusal as refusal:
            self.error = refusal.code
            return ""
        return "" if lines is None else one_answer(lines)

    @property
    def voltage(self) -> float:
        """Voltage at the output [V]."""
        (answer,) = self.controller.ask("VOL? 1") or [""]
        return float(answer.partition("=")[2])

    @property
    def runs(self) -> bool:
        """Whether the wave generator runs."""
        return self.controller.ask("\x09") != ["0x0"]


def once(number: int, query: str, spoilt: Callable[[str], Said]) -> Callable[[str, str], Said]:
    """Spoil the answer to a query when it is asked for the time `number`, which counts from 1."""
    times = 0

    def spoil(line: str, text: str) -> Said:
        nonlocal times
        times += line == query
        return spoilt(text) if line == query and times == number else text

    return spoil
