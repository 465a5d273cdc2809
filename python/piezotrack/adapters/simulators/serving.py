"""A TCP port with a thread for each client, which goes on whatever clients and system do."""

from __future__ import annotations

import os
import re
import socket
import socketserver
import struct
import sys
import threading
import time
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

__all__ = ["Lines", "Server"]

# Clients at once; those that are one too many are hung up on.
CLIENTS = 64
# Pause after a connection that could not be accepted, and between two looks whether to end [s].
PAUSE, GLANCE = 0.2, 0.05
# How long an answer may take to leave, and a thread to end [s].
PATIENCE, END = 10.0, 5.0


class Server(socketserver.TCPServer):
    """A port that is listened at from the start on, in threads.

    Parameters
    ----------
    place : (str, int)
        Address and port; 0 for any that is free.
    converse : callable
        Answers one client until it goes; an OSError ends it too.

    Raises
    ------
    OSError
        It cannot be listened at.
    """

    # Windows would let two servers have one port.
    allow_reuse_address = os.name == "posix"
    request_queue_size = 128

    def __init__(self, place: tuple[str, int], converse: Callable[[socket.socket], None]) -> None:
        self._converse = converse
        self._connected: dict[Any, threading.Thread] = {}
        super().__init__(place, socketserver.BaseRequestHandler)
        self._thread = threading.Thread(target=self.serve_forever, args=(GLANCE,), daemon=True)
        self._thread.start()

    def end(self) -> None:
        """Close the port and all connections. A second call does nothing."""
        if not self._thread.is_alive():
            return
        self.shutdown()
        self._thread.join()
        self.server_close()
        for link, thread in list(self._connected.items()):
            try:
                link.shutdown(socket.SHUT_RDWR)
            except OSError:
                # It has just been closed by its other end.
                continue
            finally:
                thread.join(timeout=END)

    def get_request(self) -> tuple[socket.socket, Any]:
        """Accept a client; where the system has no room for one, it waits a little."""
        try:
            return super().get_request()
        except OSError:
            time.sleep(PAUSE)
            raise

    def verify_request(self, request: Any, client_address: Any) -> bool:
        """Return whether there is room for another client."""
        del request, client_address
        return len(self._connected) < CLIENTS

    def process_request(self, request: Any, client_address: Any) -> None:
        """Begin a thread for a client, or hang up where none can be begun."""
        thread = threading.Thread(target=self._serve, args=(request, client_address), daemon=True)
        self._connected[request] = thread
        try:
            thread.start()
        except (RuntimeError, MemoryError):
            self.shutdown_request(request)
            time.sleep(PAUSE)

    def _serve(self, link: Any, client_address: Any) -> None:
        try:
            link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            link.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, _span(PATIENCE))
            self._converse(link)
        except Exception:
            self.handle_error(link, client_address)
        finally:
            self.shutdown_request(link)

    def shutdown_request(self, request: Any) -> None:
        """Close a connection and forget it."""
        self._connected.pop(request, None)
        super().shutdown_request(request)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing of a client that has gone; other errors are printed."""
        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)


def _span(seconds: float) -> bytes:
    """Write a time as the system has it: an answer that does not leave in it is an OSError."""
    if os.name == "posix":
        return struct.pack("ll", int(seconds), 0)
    return struct.pack("i", int(1e3 * seconds))


class Lines:
    r"""Bytes of a client, cut into lines; each is looked at once.

    Parameters
    ----------
    ends : bytes
        Bytes that end a line.
    longest : int
        Longest line [bytes].
    single : bytes, optional
        Bytes that are a line of their own where another would begin.

    Examples
    --------
    >>> lines = Lines(b"\n", longest=5)
    >>> list(lines.of(b"one\ntoo long")), list(lines.of(b"\ntw")), list(lines.of(b"o\n"))
    ([b'one'], [None], [b'two'])
    """

    def __init__(self, ends: bytes, longest: int, single: bytes = b"") -> None:
        self._end = re.compile(b"[" + re.escape(ends) + b"]")
        self._longest, self._single = longest, single
        self._begun, self._size = bytearray(), 0

    def of(self, more: bytes) -> Iterator[bytes | None]:
        """Yield the lines that end in more bytes, without their ends; None for one too long."""
        at = 0
        while at < len(more):
            if not self._size and more[at] in self._single:
                yield more[at : at + 1]
                at += 1
                continue
            match = self._end.search(more, at)
            stop = match.start() if match else len(more)
            self._size += stop - at
            if self._size > self._longest:
                self._begun.clear()
            else:
                self._begun += more[at:stop]
            if not match:
                return
            at = match.end()
            line = bytes(self._begun) if self._size <= self._longest else None
            self._begun.clear()
            self._size = 0
            yield line
