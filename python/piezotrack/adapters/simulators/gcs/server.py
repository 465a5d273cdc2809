"""The virtual controller on a TCP port."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, Self

from .... import _core
from ...._support.arguments import expect, one_of
from ....errors import ParameterError
from ....hardware.limits import ordered
from ....stages.virtual import VirtualStage
from ...gcs.protocol import ENCODING, GENERATOR, MOVING, READY, STOP, one_answer
from ..listening import cannot_listen, checked_port
from ..serving import Lines, Server
from .arguments import Refusal
from .controller import VirtualController

if TYPE_CHECKING:
    import socket
    from types import TracebackType

__all__ = ["GcsServer"]

SINGLE = (MOVING + READY + GENERATOR + STOP).encode(ENCODING)
# Speed beyond which no computer keeps up.
FASTEST = 1e4
ABANDONED = ("runs", "stops", "rests")
# Longest command [bytes].
LONGEST = 65536
# Characters of answers from which on they go out before the next command is looked at.
TOGETHER = 65536


class GcsServer:
    """A virtual stage behind a virtual controller that speaks GCS over TCP.

    It runs in threads of its own from the start on; leaving the ``with`` block ends it. Up to 64
    clients may be connected; each has its own ERR?. It is meant for tests of software that
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
    abandoned : {"runs", "stops", "rests"}, optional
        What becomes of a wave when the client that has started it has gone: it goes on, as with a
        real controller; it stops where it is; or the output is led to 0 V, or the limit nearest to
        it, in half a second of the stage.

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
        abandoned: Literal["runs", "stops", "rests"] = "runs",
    ) -> None:
        expect(
            "stage",
            stage,
            VirtualStage,
            "pt.VirtualStage, as VirtualStage.of makes it",
        )
        within = ordered("limits", stage.amplifier.limits if limits is None else limits)
        port = checked_port(port)
        speed = _core.as_number("speed", speed)
        if not 0.0 < speed <= FASTEST:
            raise ParameterError(
                "speed", f"{speed:g}", f"above 0, and up to {FASTEST:g} times real time"
            )
        one_of("abandoned", abandoned, ABANDONED)
        self._abandoned: str = abandoned
        # The connection that has started the last wave.
        self._started: socket.socket | None = None
        self._host, self._limits = host, within
        self._controller = VirtualController(stage, within, speed=speed)
        try:
            self._server = Server((host, port), self._converse)
        except OSError as error:
            raise cannot_listen(host, port, error) from None

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
        self._server.end()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _converse(self, link: socket.socket) -> None:
        """Answer a client until it goes, and end its wave where that is asked for."""
        try:
            self._answer(link)
        finally:
            if self._started is link:
                self._controller.left(self._abandoned)

    def _answer(self, link: socket.socket) -> None:
        """Answer a client until it goes; no more answers are kept than go out together."""
        lines, error = Lines(b"\r\n", LONGEST, SINGLE), 0
        while more := link.recv(65536):
            answers = ""
            for line in lines.of(more):
                if line is None:
                    error = 3
                    continue
                command = line.decode(ENCODING, errors="replace")
                if command.strip().upper() == "ERR?":
                    answer, error = [str(error)], 0
                else:
                    try:
                        answer = self._controller.ask(command) or []
                        if command.strip().upper().startswith("WGO "):
                            self._started = link
                    except Refusal as refusal:
                        answer, error = [], refusal.code
                answers += one_answer(answer) if answer else ""
                if len(answers) > TOGETHER:
                    link.sendall(answers.encode(ENCODING, errors="replace"))
                    answers = ""
            if answers:
                link.sendall(answers.encode(ENCODING, errors="replace"))
