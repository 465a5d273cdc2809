"""The virtual controller on a TCP port."""

from __future__ import annotations

import socket
import socketserver
import sys
import threading
from typing import TYPE_CHECKING, Self

from ... import _core
from ...errors import ParameterError
from ...stages.virtual import VirtualStage
from ..limits import ordered
from ..listening import cannot_listen, checked_port
from .arguments import Refusal
from .controller import VirtualController
from .protocol import ENCODING, GENERATOR, MOVING, READY, STOP, one_answer

if TYPE_CHECKING:
    from types import TracebackType

__all__ = ["GcsServer"]

SINGLE = {ord(byte) for byte in (MOVING, READY, GENERATOR, STOP)}
ENDS = (ord("\n"), ord("\r"))
# Speed beyond which no computer keeps up.
FASTEST = 1e4
# Longest command [bytes].
LONGEST = 65536


class GcsServer:
    """A virtual stage behind a virtual controller that speaks GCS over TCP.

    It runs in threads of its own from the start on; leaving the ``with`` block ends it. Any number
    of clients may be connected; each has its own ERR?. It is meant for tests of software that
    controls a stage, and has no protection: whoever reaches the port may move the virtual stage.

    Parameters
    ----------
    stage : VirtualStage
        The stage on axis 1.
    limits : (float, float), optional
        Lowest and highest voltage [V]; default those of the stage's amplifier.
    host : str, optional
        Address at which it listens; default this computer only.
    port : int, optional
        TCP port, 0 for any free one.
    speed : float, optional
        How much faster than real time the stage goes, as far as the computer keeps up.

    Raises
    ------
    ParameterError
        An argument is out of its range, or the port is taken.

    Examples
    --------
    >>> import piezotrack as pt
    >>> stage = pt.VirtualStage.xu_li_2010(seed=1)
    >>> with pt.hardware.GcsServer(stage, speed=100.0) as server:
    ...     device = pt.hardware.connect(server.address)
    ...     log = pt.measure(device, "decaying:1Hz,0..75V", rate=1000.0)
    ...     device.close()
    >>> log
    Dataset(12000 samples, 12 s at 1000 Hz, stroke 118 um, warm-up 500 samples)
    """

    def __init__(
        self,
        stage: VirtualStage,
        *,
        limits: tuple[float, float] | None = None,
        host: str = "127.0.0.1",
        port: int = 0,
        speed: float = 1.0,
    ) -> None:
        if not isinstance(stage, VirtualStage):
            raise ParameterError(
                f"stage is {type(stage).__name__}: expected pt.VirtualStage, as VirtualStage.of "
                "makes one of any model"
            )
        within = ordered("limits", stage.amplifier.limits if limits is None else limits)
        port = checked_port(port)
        speed = _core.as_number("speed", speed)
        if not 0.0 < speed <= FASTEST:
            raise ParameterError(
                f"speed is {speed:g}: expected above 0, and up to {FASTEST:g} times real time"
            )
        self._host, self._limits = host, within
        controller = VirtualController(stage, within, speed=speed)
        try:
            self._server = _Server((host, port), controller)
        except OSError as error:
            raise cannot_listen(host, port, error) from None
        self._thread = threading.Thread(
            target=self._server.serve_forever, kwargs={"poll_interval": 0.05}, daemon=True
        )
        self._thread.start()

    @property
    def limits(self) -> tuple[float, float]:
        """Lowest and highest voltage [V]."""
        return self._limits

    @property
    def port(self) -> int:
        """TCP port at which it listens."""
        return int(self._server.server_address[1])

    @property
    def address(self) -> str:
        """Address for `hardware.connect`."""
        return f"gcs://{self._host}:{self.port}"

    def close(self) -> None:
        """Close the port and all connections. A second call does nothing."""
        if self._thread.is_alive():
            self._server.shutdown()
            self._thread.join()
            self._server.server_close()
            self._server.hang_up()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


class _Server(socketserver.ThreadingTCPServer):
    """The port, with a thread for each connection."""

    allow_reuse_address = True
    daemon_threads = True
    block_on_close = False

    def __init__(self, address: tuple[str, int], controller: VirtualController) -> None:
        self.controller = controller
        self._connected: dict[socket.socket, threading.Thread] = {}
        super().__init__(address, _Session)

    def enter(self, connection: socket.socket) -> None:
        """Note a connection."""
        self._connected[connection] = threading.current_thread()

    def leave(self, connection: socket.socket) -> None:
        """Forget a connection."""
        self._connected.pop(connection, None)

    def hang_up(self) -> None:
        """Close all connections, and wait for their threads."""
        for connection, thread in list(self._connected.items()):
            try:
                connection.shutdown(socket.SHUT_RDWR)
            except OSError:
                # It has just been closed by its other end.
                continue
            finally:
                thread.join(timeout=5.0)

    def handle_error(self, request: object, client_address: object) -> None:
        """Say nothing of a client that has gone; other errors are printed."""
        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)  # type: ignore[arg-type]


class _Session(socketserver.BaseRequestHandler):
    """One connection: it cuts what comes into commands, and has an error code."""

    def setup(self) -> None:
        """Send answers at once."""
        self.request.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.error = 0
        self.server.enter(self.request)  # type: ignore[attr-defined]

    def finish(self) -> None:
        """Note that it has ended."""
        self.server.leave(self.request)  # type: ignore[attr-defined]

    def handle(self) -> None:
        """Answer until the client goes."""
        pending = bytearray()
        while more := self.request.recv(65536):
            pending += more
            answers = "".join(self._answered(line) for line in _lines(pending))
            if len(pending) > LONGEST:
                pending.clear()
                self.error = 3
            if answers:
                self.request.sendall(answers.encode(ENCODING, errors="replace"))

    def _answered(self, line: str) -> str:
        if line.strip().upper() == "ERR?":
            code, self.error = self.error, 0
            return f"{code}\n"
        if len(line) > LONGEST:
            self.error = 3
            return ""
        try:
            lines = self.server.controller.ask(line)  # type: ignore[attr-defined]
        except Refusal as refusal:
            self.error = refusal.code
            return ""
        return "" if lines is None else one_answer(lines)


def _lines(pending: bytearray) -> list[str]:
    """Take the whole commands from the front of what has come."""
    found, begin = [], 0
    for k, byte in enumerate(pending):
        if byte in ENDS or (byte in SINGLE and k == begin):
            found.append(pending[begin : k + (byte in SINGLE)])
            begin = k + 1
    del pending[:begin]
    return [bytes(line).decode(ENCODING, errors="replace") for line in found if line]
