"""The virtual controller on its port: what is cut into commands, and who hears what."""

from __future__ import annotations

import socket
from contextlib import contextmanager
from typing import TYPE_CHECKING

import pytest

from gcs_peers import quiet_stage
from piezotrack.hardware import GcsServer

if TYPE_CHECKING:
    from collections.abc import Iterator


@pytest.fixture(scope="module")
def server() -> Iterator[GcsServer]:
    with GcsServer(quiet_stage(), speed=100.0) as server:
        yield server


class Client:
    """A socket, and the next answer."""

    def __init__(self, connection: socket.socket) -> None:
        self.socket = connection
        self._lines = connection.makefile("r", encoding="cp1252", newline="\n")

    def send(self, text: str) -> None:
        self.socket.sendall(text.encode("cp1252"))

    def answer(self) -> str:
        whole = ""
        while not whole or whole.endswith(" \n"):
            whole += self._lines.readline()
        return whole

    def close(self) -> None:
        self._lines.close()


@contextmanager
def client(server: GcsServer) -> Iterator[Client]:
    with socket.create_connection(("127.0.0.1", server.port), 30.0) as connection:
        connected = Client(connection)
        try:
            yield connected
        finally:
            connected.close()


def test_commands_are_cut_where_they_end(server: GcsServer) -> None:
    with client(server) as peer:
        peer.send("SVA 1 5\nSVA? 1\nCS")
        assert peer.answer() == "1=5\n"
        peer.send("V?\r\nSSN?\r")
        assert peer.answer() == "2.0\n"
        assert peer.answer() == "0\n"
        # Bytes without an end, before a command and alone.
        peer.send("\x09\x05VOL? 1\n")
        assert [peer.answer() for _ in range(3)] == ["0x0\n", "0x0\n", "1=5\n"]
        peer.send("\x07")
        assert peer.answer() == "\xb1\n"
        peer.send("\n\n \nERR?\n")
        assert peer.answer() == "0\n"


def test_lines_of_an_answer_have_a_space_but_for_the_last(server: GcsServer) -> None:
    with client(server) as one:
        one.send("WAV?\n")
        lines = one.answer().split("\n")
        assert lines.pop() == ""
        assert len(lines) == 8
        assert [line.endswith(" ") for line in lines] == [True] * 7 + [False]


def test_a_refused_query_has_no_answer_and_an_error_that_is_read_once(server: GcsServer) -> None:
    with client(server) as peer, client(server) as other:
        peer.send("POS? 9\nERR?\nERR?\n")
        assert [peer.answer(), peer.answer()] == ["15\n", "0\n"]
        # The last error counts, and the other client has none.
        peer.send("POS? 9\nFOO\n")
        other.send("ERR?\n")
        assert other.answer() == "0\n"
        peer.send("ERR?\n")
        assert peer.answer() == "2\n"


def test_a_command_too_long_is_an_error_and_no_more(server: GcsServer) -> None:
    with client(server) as peer:
        peer.send("WAV 1 X PNT 1 99999 " + "1 " * 99999 + "\nERR?\n")
        # What is left of it may be a command that nobody knows.
        assert peer.answer() in ("2\n", "3\n")
        peer.send("CSV?\n")
        assert peer.answer() == "2.0\n"


def test_bytes_that_are_no_text_are_an_unknown_command(server: GcsServer) -> None:
    with client(server) as one:
        one.socket.sendall(bytes(range(128, 256)) + b"\nERR?\n")
        assert one.answer() == "2\n"


def test_a_client_that_goes_without_a_word_leaves_the_others(server: GcsServer) -> None:
    with client(server) as peer:
        for _ in range(5):
            with client(server) as other:
                other.send("HLP?\nDRR?\nWA")
        peer.send("CSV?\n")
        assert peer.answer() == "2.0\n"


def test_a_server_that_ends_closes_its_connections() -> None:
    server = GcsServer(quiet_stage())
    with client(server) as peer:
        peer.send("CSV?\n")
        assert peer.answer() == "2.0\n"
        server.close()
        server.close()
        assert peer.socket.recv(1) == b""
    with pytest.raises(OSError, match=r"refused"):
        socket.create_connection(("127.0.0.1", server.port), 5.0)
