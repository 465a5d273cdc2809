"""A virtual stage behind a small instrument that takes SCPI messages over TCP."""

from __future__ import annotations

import math
import threading
from typing import TYPE_CHECKING

import numpy as np

from ...errors import PiezotrackError
from .listening import Listening
from .serving import Lines

if TYPE_CHECKING:
    import socket

    from numpy.typing import NDArray

    from ...hardware.virtual import VirtualDevice

    Array = NDArray[np.float64]

__all__ = ["VirtualScpi"]

# Longest line [bytes] and list [voltages], most messages in a line, longest answer [bytes].
LINE, LIST, MESSAGES, ANSWER = 1_000_000, 1_000_000, 1000, 20_000_000
NO_ERROR, UNKNOWN, RANGE = '0,"No error"', '-113,"Undefined header"', '-222,"Data out of range"'
TOO_MUCH, DEADLOCKED = '-223,"Too much data"', '-430,"Query DEADLOCKED"'


class VirtualScpi(Listening):
    """An instrument in front of a virtual device, for tests and for trying things out.

    It knows ``*IDN?``, ``*OPC?``, ``SYST:ERR?``, ``VOLT 12.5``, ``VOLT?``, ``MEAS?`` [um],
    ``LIST:VOLT 0,1,2``, ``LIST:VOLT:APP 3,4``, ``LIST:RATE 1000``, ``INIT`` and ``FETC?`` [um];
    several in a line are separated by ``;`` or ``;:``. A line has up to 1 MB, a list a million
    voltages, sent in parts; up to 64 clients may be connected.

    Parameters
    ----------
    device : VirtualDevice
        The stage. A list takes no time.
    host : str, optional
        Address to listen at; default this computer only.
    port : int, optional
        TCP port; default any that is free.

    Raises
    ------
    ParameterError
        It cannot listen there; this is seen when it begins to.

    Examples
    --------
    >>> import piezotrack as pt
    >>> instrument = pt.hardware.VirtualScpi(pt.hardware.connect("virtual:"))
    >>> instrument.answer("VOLT 5;:VOLT?")
    '5'
    """

    def __init__(self, device: VirtualDevice, *, host: str = "127.0.0.1", port: int = 0) -> None:
        self.device = device
        super().__init__(host, port)
        self._list: list[Array] = []
        self._rate, self._fetched, self._error = 1000.0, "", NO_ERROR
        self._lock = threading.Lock()

    def serve(self) -> None:
        """Listen until Ctrl-C."""
        with self:
            threading.Event().wait()

    def answer(self, line: str) -> str | None:
        """Do the messages of a line and return their answers, or None where there are none."""
        messages = [one.strip().lstrip(":") for one in line.split(";") if one.strip()]
        answers: list[str] = []
        with self._lock:
            if len(messages) > MESSAGES:
                self._error = TOO_MUCH
                return None
            for message in messages:
                if (answer := self._do(message)) is not None:
                    answers.append(answer)
                if sum(map(len, answers)) > ANSWER:
                    self._error = DEADLOCKED
                    return None
        return ";".join(answers) if answers else None

    def _converse(self, link: socket.socket) -> None:
        lines = Lines(b"\n", LINE)
        while more := link.recv(65536):
            for line in lines.of(more):
                if line is None:
                    with self._lock:
                        self._error = TOO_MUCH
                elif (said := self.answer(line.decode("ascii", errors="replace"))) is not None:
                    link.sendall(said.encode("ascii") + b"\n")

    def _do(self, message: str) -> str | None:
        """Do one message."""
        head, _, rest = message.partition(" ")
        head = head.upper()
        try:
            if head.endswith("?"):
                return self._query(head)
            self._command(head, rest)
        except (ValueError, PiezotrackError):
            # SCPI: an error is kept, and nothing is answered.
            self._error = RANGE
        return None

    def _query(self, head: str) -> str | None:
        if head == "*IDN?":
            return "piezotrack,virtual stage,0,0"
        if head == "*OPC?":
            return "1"
        if head == "SYST:ERR?":
            said, self._error = self._error, NO_ERROR
            return said
        if head == "VOLT?":
            return f"{self.device.held:.9g}"
        if head == "MEAS?":
            return _micrometres(self.device.exchange(self.device.held))
        if head == "FETC?":
            return self._fetched
        self._error = UNKNOWN
        return None

    def _command(self, head: str, rest: str) -> None:
        if head == "VOLT":
            self.device.hold(float(rest))
        elif head in ("LIST:VOLT", "LIST:VOLT:APP"):
            before = self._list if head.endswith("APP") else []
            part = np.array([float(one) for one in rest.split(",")])
            if sum(one.size for one in before) + part.size > LIST:
                self._error = TOO_MUCH
            else:
                self._list = [*before, part]
        elif head == "LIST:RATE":
            self._rate = float(rest)
        elif head == "INIT":
            record = self.device.play(np.concatenate([np.empty(0), *self._list]), self._rate)
            self._fetched = ",".join(_micrometres(one) for one in record.displacement.tolist())
        elif head not in ("*RST", "*CLS"):
            self._error = UNKNOWN


def _micrometres(metres: float) -> str:
    return f"{1e6 * metres:.6f}" if math.isfinite(metres) else "9.91E+37"
