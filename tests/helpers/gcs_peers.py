"""Stages, clocks and controllers of a few lines, for the tests of GCS."""

from __future__ import annotations

import re
import socket
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING

import piezotrack as pt

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

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
def peer(answer: Callable[[str], str | None]) -> Iterator[int]:
    """A server for one connection that answers each line by a function; None hangs up."""
    with socket.create_server(("127.0.0.1", 0)) as listening:
        thread = threading.Thread(target=_serve, args=(listening, answer))
        thread.start()
        try:
            yield int(listening.getsockname()[1])
        finally:
            # Whoever waits for a connection or for a line goes on.
            listening.shutdown(socket.SHUT_RDWR)
            thread.join()


def _serve(listening: socket.socket, answer: Callable[[str], str | None]) -> None:
    try:
        connection, _ = listening.accept()
    except OSError:
        return
    with connection:
        connection.settimeout(60.0)
        pending = ""
        try:
            while more := connection.recv(65536):
                pending += more.decode("cp1252")
                # The state of the generator is asked for by a byte without an end.
                while found := re.match(r"\x09|[^\n]*\n", pending):
                    pending = pending[found.end() :]
                    said = answer(found[0].rstrip("\n"))
                    if said is None:
                        return
                    connection.sendall(said.encode("cp1252"))
        except OSError:
            return


def greeted(then: Mapping[str, str | None]) -> Callable[[str], str | None]:
    """Answer as a controller does that is fine, but for some commands."""

    def answer(line: str) -> str | None:
        known: dict[str, str | None] = {**GREETING, **then}
        return known.get(line, "0\n" if line == "ERR?" else "")

    return answer
