"""A server of the page in a thread, and requests to it, also such as a browser never sends."""

from __future__ import annotations

import base64
import http.client
import json
import os
import re
import socket
import struct
import threading
from typing import Any

from piezotrack.app import server

WINDOW = "w" * 32


class Served:
    """A server in a thread, and requests to it."""

    def __init__(self, idle: float = 60.0, device: str | None = None) -> None:
        self.address = ""
        ready = threading.Event()

        def told(address: str) -> None:
            self.address = address
            ready.set()

        self.thread = threading.Thread(
            target=lambda: server.serve(told, idle=idle, device=device), daemon=True, name="server"
        )
        self.thread.start()
        assert ready.wait(20.0)
        found = re.fullmatch(r"http://127\.0\.0\.1:(\d+)/#token=(\S+)", self.address)
        assert found is not None
        self.port, self.token = int(found[1]), found[2]
        self.host = f"127.0.0.1:{self.port}"

    def request(
        self, path: str = "/", method: str = "GET", **headers: str
    ) -> http.client.HTTPResponse:
        """Send a request with exactly these headers, and the right Host where none is given."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=10.0)
        connection.putrequest(method, path, skip_host=True, skip_accept_encoding=True)
        for name, value in {"Host": self.host, **headers}.items():
            if value:
                connection.putheader(name, value)
        connection.endheaders()
        answer = connection.getresponse()
        answer.read()
        connection.close()
        return answer

    def upgrade(self, **headers: str) -> Socket | int:
        """Ask for a socket: the socket, or the status of the refusal."""
        given = {"Host": self.host, "Origin": f"http://{self.host}", **headers}
        lines = [f"{name}: {value}" for name, value in given.items() if value]
        key = base64.b64encode(os.urandom(16)).decode()
        lines += ["Upgrade: websocket", "Connection: Upgrade", "Sec-WebSocket-Version: 13"]
        text = "\r\n".join(["GET /socket HTTP/1.1", *lines, f"Sec-WebSocket-Key: {key}", "", ""])
        raw = socket.create_connection(("127.0.0.1", self.port), timeout=20.0)
        raw.sendall(text.encode())
        reading = raw.makefile("rb")
        status = int(reading.readline().split()[1])
        while reading.readline().strip():
            pass
        if status != 101:
            reading.close()
            raw.close()
            return status
        return Socket(raw, reading)

    def enter(self, window: str = WINDOW, token: Any = None) -> Socket:
        made = self.upgrade()
        assert isinstance(made, Socket)
        given = {"token": self.token if token is None else token, "window": window, "width": 800}
        made.send(json.dumps(given))
        return made


class Socket:
    """A client of a websocket, by hand (RFC 6455), so that it can send what is wrong."""

    def __init__(self, raw: socket.socket, reading: Any) -> None:
        self.raw, self.reading = raw, reading

    def send(self, message: str | bytes) -> None:
        data = message.encode("utf-8", "surrogatepass") if isinstance(message, str) else message
        size = len(data)
        head = bytes([0x81 if isinstance(message, str) else 0x82])
        if size < 126:
            head += bytes([0x80 | size])
        elif size < 65536:
            head += bytes([0x80 | 126]) + struct.pack(">H", size)
        else:
            head += bytes([0x80 | 127]) + struct.pack(">Q", size)
        # A mask of zeros leaves the data as they are.
        self.raw.sendall(head + bytes(4) + data)

    def receive(self) -> tuple[int, bytes]:
        """Return the code of a frame and its content."""
        first, second = self.reading.read(2)
        size = second & 0x7F
        if size == 126:
            (size,) = struct.unpack(">H", self.reading.read(2))
        elif size == 127:
            (size,) = struct.unpack(">Q", self.reading.read(8))
        return first & 0x0F, self.reading.read(size)

    def answer(self) -> dict[str, Any]:
        """Return the next message."""
        while True:
            code, data = self.receive()
            if code == 1:
                found: dict[str, Any] = json.loads(data)
                return found
            assert code == 9, data

    def closed(self) -> int:
        """Return the code with which the server closes."""
        while True:
            code, data = self.receive()
            if code == 8:
                self.end()
                return int(struct.unpack(">H", data[:2])[0])

    def end(self) -> None:
        self.reading.close()
        self.raw.close()
