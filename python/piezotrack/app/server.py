"""Server of the page: this computer alone, one socket for each window."""

from __future__ import annotations

import asyncio
import json
import time
from importlib.resources import files
from socket import create_server
from typing import TYPE_CHECKING, Any

from ..errors import DataError, ParameterError
from .access import HEADERS, Access
from .device import DeviceProcess
from .session import Session

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

try:
    from tornado.httpserver import HTTPServer
    from tornado.web import Application, RequestHandler
    from tornado.websocket import WebSocketHandler
except ImportError:
    raise DataError("the page needs tornado: pip install piezotrack[app]") from None

__all__ = ["serve"]

# Windows at once; seconds that the desk of a closed one is kept, and those without a window after
# which the server ends.
MOST_SESSIONS, KEPT, IDLE = 8, 300.0, 600.0
# Seconds without a window after which a device is stopped: longer than a page takes to load again.
GRACE = 3.0
# Bytes of a file, and characters of any other message.
LARGEST_FILE, LONGEST_MESSAGE = 64 * 2**20, 100_000
HIGHEST_PORT = 65535
# Seconds until a window has to say who it is.
PATIENCE = 10.0
# Codes of a closed socket, of those that applications may use.
REFUSED, FULL, MOVED = 4003, 4008, 4010
TYPES = {
    "html": "text/html; charset=utf-8",
    "css": "text/css; charset=utf-8",
    "js": "text/javascript; charset=utf-8",
    "svg": "image/svg+xml",
}


class Windows:
    """The sessions of all windows.

    Parameters
    ----------
    access : Access
        Who may reach them.
    log : pathlib.Path or None
        Log that a new window begins with.
    device : DeviceProcess or None
        The device that was named on the command line; one window at a time uses it.
    """

    def __init__(self, access: Access, log: Path | None, device: DeviceProcess | None) -> None:
        self.access = access
        self.log = log
        self.device = device
        self.sessions: dict[str, tuple[Session, Socket | None, float]] = {}
        self.last_open = time.monotonic()

    def attach(self, window: str, socket: Socket, state: object) -> Session | None:
        """Return the session of a window, or a new one; None where all are used."""
        self.drop_old()
        if window in self.sessions:
            session, other, _ = self.sessions[window]
            if other is not None:
                other.close(MOVED, "this page was opened in another window")
            session.send = socket.from_thread
        else:
            idle = [key for key, (_, one, _) in self.sessions.items() if one is None]
            if len(self.sessions) >= MOST_SESSIONS and idle:
                self.end(idle[0])
            if len(self.sessions) >= MOST_SESSIONS:
                return None
            session = Session(socket.from_thread, self.device)
            if self.log is not None:
                content = {"name": self.log.name, "content": self.log.read_bytes()}
                session.take({"do": "open", "purpose": "log", **content})
            if isinstance(state, str):
                session.take({"do": "link", "text": state})
        self.sessions[window] = (session, socket, time.monotonic())
        return session

    def detach(self, window: str, socket: Socket) -> None:
        """Keep the desk of a window for a while: it may be loaded again."""
        session, present, _ = self.sessions.get(window, (None, None, 0.0))
        if session is not None and present is socket:
            self.sessions[window] = (session, None, time.monotonic())
        self.last_open = time.monotonic()

    def drop_old(self) -> None:
        """End the sessions of windows that were closed long ago."""
        now = time.monotonic()
        for key, (_, socket, since) in list(self.sessions.items()):
            if socket is None and now - since > KEPT:
                self.end(key)

    def halt(self) -> None:
        """Lead the output of the device to rest, whichever window moves it."""
        if self.device is not None:
            self.device.stop()

    def end(self, window: str) -> None:
        """End a session."""
        session, _, _ = self.sessions.pop(window)
        session.close()

    @property
    def idle(self) -> float:
        """Seconds for which no window has been open."""
        is_open = any(socket is not None for _, socket, _ in self.sessions.values())
        return 0.0 if is_open else time.monotonic() - self.last_open


class _Checked(RequestHandler):
    """Checks that every request goes through."""

    def initialize(self, windows: Windows) -> None:
        self.windows = windows

    def set_default_headers(self) -> None:
        for name, value in HEADERS.items():
            self.set_header(name, value)
        self.clear_header("Server")

    def prepare(self) -> None:
        headers = self.request.headers
        refused = not self.windows.access.host_allowed(headers)
        if self.request.method != "GET":
            refused = refused or not self.windows.access.origin_allowed(headers)
        if refused:
            self.send_error(403)

    def write_error(self, status_code: int, **_: Any) -> None:
        self.set_header("Content-Type", "text/plain; charset=utf-8")
        self.finish(f"{status_code}: {self._reason}\n")


class _Nothing(_Checked):
    """Everything that is no file of the page."""

    def prepare(self) -> None:
        super().prepare()
        if not self._finished:
            self.send_error(404 if self.request.method == "GET" else 405)


class _File(_Checked):
    """The files of the page: those of the package, by name, and no others."""

    def initialize(self, windows: Windows, content: bytes = b"", kind: str = "") -> None:
        self.windows, self.content, self.kind = windows, content, kind

    def get(self) -> None:
        self.set_header("Content-Type", self.kind)
        self.finish(self.content)


class Socket(WebSocketHandler):
    """Connection of a window: first the token, then messages, and files as bytes."""

    session: Session | None = None
    window = ""
    upcoming: dict[str, Any] | None = None

    def initialize(self, windows: Windows) -> None:
        """Take what all connections share."""
        self.windows = windows
        self.loop = asyncio.get_event_loop()

    def set_default_headers(self) -> None:
        """Add the headers of every answer."""
        for name, value in HEADERS.items():
            self.set_header(name, value)

    def prepare(self) -> None:
        """Refuse another Host and another Origin, or none, before the upgrade."""
        access, headers = self.windows.access, self.request.headers
        if not (access.host_allowed(headers) and access.origin_allowed(headers)):
            self.send_error(403)

    def check_origin(self, origin: str) -> bool:
        """Refuse another Origin, which tornado hands over here as well."""
        return origin in self.windows.access.origins

    def open(self, *_: str, **__: str) -> None:
        """Wait for the token."""
        self.set_nodelay(True)
        self.loop.call_later(PATIENCE, self._expect_session)

    def _expect_session(self) -> None:
        if self.session is None:
            self.close(REFUSED, "no token was sent")

    def on_message(self, message: str | bytes) -> None:
        """Take a message, or the content of the file that was announced."""
        if isinstance(message, bytes):
            if self.session is None or self.upcoming is None:
                self.close(REFUSED, "bytes that were not announced")
                return
            self.session.take({**self.upcoming, "content": message})
            self.upcoming = None
            return
        if len(message) > LONGEST_MESSAGE:
            self.close(1009, f"a message of more than {LONGEST_MESSAGE} characters")
            return
        try:
            given = json.loads(message)
        except (ValueError, RecursionError):
            given = None
        if not isinstance(given, dict):
            self.close(1003, "expected an object in JSON")
        elif self.session is None:
            self._enter(given)
        elif given.get("do") == "halt":
            # At once: the worker may compute.
            self.windows.halt()
        elif given.get("do") == "open":
            self.upcoming = given
        else:
            self.session.take(given)

    def _enter(self, given: dict[str, Any]) -> None:
        """Let a window in that has the token."""
        window = given.get("window")
        if not self.windows.access.token_allowed(given.get("token")):
            self.close(REFUSED, "the token is not that of this server")
            return
        if not isinstance(window, str) or not 16 <= len(window) <= 64:
            self.close(REFUSED, "expected a window of 16 to 64 characters")
            return
        self.session = self.windows.attach(window, self, given.get("state"))
        if self.session is None:
            self.close(FULL, f"{MOST_SESSIONS} windows are open: close one")
            return
        self.window = window
        self.session.take({"do": "whole", "width": given.get("width"), "seq": given.get("seq")})

    def on_close(self) -> None:
        """Keep the desk for a while."""
        if self.session is not None:
            self.windows.detach(self.window, self)

    def from_thread(self, answer: dict[str, Any], content: bytes | None) -> None:
        """Send an answer of the worker, and a file with it."""
        text = json.dumps(answer, allow_nan=False, separators=(",", ":"))
        self.loop.call_soon_threadsafe(self._send, text, content)

    def _send(self, text: str, content: bytes | None) -> None:
        if self.ws_connection is not None and not self.ws_connection.is_closing():
            self.write_message(text)
            if content is not None:
                self.write_message(content, binary=True)


def application(windows: Windows) -> Application:
    """Return the files of the page and the socket."""
    shared = {"windows": windows}
    routes: list[Any] = [("/socket", Socket, shared)]
    for one in files(__package__).joinpath("static").iterdir():
        kind = TYPES.get(one.name.rpartition(".")[2])
        if kind is not None:
            path = "/" if one.name == "index.html" else f"/{one.name.replace('.', '[.]')}"
            routes.append((path, _File, {**shared, "content": one.read_bytes(), "kind": kind}))
    return Application(
        routes,
        default_handler_class=_Nothing,
        default_handler_args=shared,
        websocket_max_message_size=LARGEST_FILE,
        websocket_ping_interval=20,
        log_function=lambda _: None,
    )


def serve(
    ready: Callable[[str], None],
    *,
    log: Path | None = None,
    port: int = 0,
    device: str | None = None,
    idle: float = IDLE,
) -> None:
    """Serve the page to this computer until it is interrupted or no window has been open for long.

    Parameters
    ----------
    ready : callable
        Called with the address, whose fragment has the token, when the server listens.
    log : pathlib.Path, optional
        Log that a new window begins with.
    port : int, optional
        TCP port; any free one where it is 0.
    device : str, optional
        Address of a device that the page may use; its output is led to rest when the last window
        closes and when the server ends.
    idle : float, optional
        Seconds without a window after which it ends.

    Raises
    ------
    DataError
        The log cannot be read, or another program listens to the port.
    ParameterError
        `port` is none, or `device` is no address.
    DeviceError
        The device does not answer.
    """
    if not 0 <= port <= HIGHEST_PORT:
        raise ParameterError("port", port, f"0 to {HIGHEST_PORT}")
    if log is not None:
        try:
            size = log.stat().st_size
            if log.is_dir():
                raise DataError(f"{log} is a folder: expected a log")
        except OSError as error:
            raise DataError(f"{log}: {error.strerror}: expected a log") from None
        if size > LARGEST_FILE:
            raise DataError(f"{log} has {size} bytes: expected {LARGEST_FILE} at most")
    used = None if device is None else DeviceProcess(device)
    try:
        asyncio.run(_serve(ready, log, port, idle, used))
    finally:
        if used is not None:
            used.close()


async def _serve(
    ready: Callable[[str], None],
    log: Path | None,
    port: int,
    idle: float,
    device: DeviceProcess | None,
) -> None:
    try:
        listening = create_server(("127.0.0.1", port))
    except OSError as error:
        raise DataError(f"port {port}: {error.strerror}: expected a free one, or 0") from None
    listening.setblocking(False)
    place = listening.getsockname()[1]
    access = Access(place)
    windows = Windows(access, log, device)
    server = HTTPServer(application(windows), max_body_size=1024, max_header_size=16384)
    server.add_sockets([listening])
    try:
        ready(f"http://127.0.0.1:{place}/#token={access.token}")
        while windows.idle < idle:
            await asyncio.sleep(min(1.0, idle / 4.0))
            windows.drop_old()
            if windows.idle > GRACE:
                windows.halt()
    finally:
        server.stop()
        for window in list(windows.sessions):
            windows.end(window)
