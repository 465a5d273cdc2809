"""A virtual stage behind a small instrument that takes SCPI messages over TCP."""

from __future__ import annotations

import math
import socket
import threading
from typing import TYPE_CHECKING

import numpy as np

from ..errors import PiezotrackError
from .listening import cannot_listen, checked_port

if TYPE_CHECKING:
    from types import TracebackType

    from .virtual import VirtualDevice

__all__ = ["VirtualScpi"]

# How often it looks whether it should end, and how long a long answer may take to leave [s].
GLANCE, PATIENCE = 0.2, 10.0
NO_ERROR, UNKNOWN, RANGE = '0,"No error"', '-113,"Undefined header"', '-222,"Data out of range"'


class VirtualScpi:
    """An instrument in front of a virtual device, for tests and for trying things out.

    It knows ``*IDN?``, ``*OPC?``, ``SYST:ERR?``, ``VOLT 12.5``, ``VOLT?``, ``MEAS?`` [um],
    ``LIST:VOLT 0,1,2``, ``LIST:VOLT:APP 3,4``, ``LIST:RATE 1000``, ``INIT`` and ``FETC?`` [um];
    several in a line are separated by ``;`` or ``;:``.

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
        self._place = host, checked_port(port)
        self._list: list[float] = []
        self._rate, self._fetched, self._error = 1000.0, "", NO_ERROR
        self._lock, self._ends = threading.Lock(), threading.Event()
        self._listener: socket.socket | None = None
        self._threads: list[threading.Thread] = []

    @property
    def address(self) -> tuple[str, int]:
        """Host and port."""
        if self._listener is None:
            return self._place
        host, port = self._listener.getsockname()[:2]
        return host, port

    def __enter__(self) -> VirtualScpi:
        """Listen, in the background."""
        try:
            self._listener = socket.create_server(self._place)
        except OSError as error:
            raise cannot_listen(*self._place, error) from None
        self._listener.settimeout(GLANCE)
        self._begin(threading.Thread(target=self._accept, args=(self._listener,), daemon=True))
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End all connections."""
        self._ends.set()
        for thread in self._threads:
            thread.join()
        if self._listener is not None:
            self._listener.close()
            self._listener = None

    def serve(self) -> None:
        """Listen until Ctrl-C."""
        with self:
            self._ends.wait()

    def answer(self, line: str) -> str | None:
        """Do the messages of a line and return their answers, or None where there are none."""
        with self._lock:
            answers = [self._do(one.strip().lstrip(":")) for one in line.split(";") if one.strip()]
        said = [one for one in answers if one is not None]
        return ";".join(said) if said else None

    def _begin(self, thread: threading.Thread) -> None:
        self._threads.append(thread)
        thread.start()

    def _accept(self, listener: socket.socket) -> None:
        while not self._ends.is_set():
            try:
                link, _ = listener.accept()
            except TimeoutError:
                continue
            self._begin(threading.Thread(target=self._converse, args=(link,), daemon=True))

    def _converse(self, link: socket.socket) -> None:
        link.settimeout(GLANCE)
        link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        rest = b""
        with link:
            while not self._ends.is_set():
                try:
                    part = link.recv(65536)
                    if not part:
                        return
                    *lines, rest = (rest + part).split(b"\n")
                    for line in lines:
                        said = self.answer(line.decode("ascii", errors="replace"))
                        if said is not None:
                            link.settimeout(PATIENCE)
                            link.sendall(said.encode("ascii") + b"\n")
                            link.settimeout(GLANCE)
                except TimeoutError:
                    continue
                except OSError:
                    return

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
        elif head == "LIST:VOLT":
            self._list = [float(one) for one in rest.split(",")]
        elif head == "LIST:VOLT:APP":
            self._list += [float(one) for one in rest.split(",")]
        elif head == "LIST:RATE":
            self._rate = float(rest)
        elif head == "INIT":
            record = self.device.play(np.array(self._list), self._rate)
            self._fetched = ",".join(_micrometres(one) for one in record.displacement.tolist())
        elif head not in ("*RST", "*CLS"):
            self._error = UNKNOWN


def _micrometres(metres: float) -> str:
    return f"{1e6 * metres:.6f}" if math.isfinite(metres) else "9.91E+37"
