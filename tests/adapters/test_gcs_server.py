"""The virtual controller on its port: what is cut into commands, and who hears what."""

from __future__ import annotations

import socket
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

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


@pytest.mark.parametrize(
    ("abandoned", "running", "voltage"),
    [("runs", "0x1", (5.0, 20.0)), ("stops", "0x0", (5.0, 20.0)), ("rests", "0x0", (0.0, 0.0))],
)
def test_a_wave_whose_client_has_gone(
    abandoned: Any, running: str, voltage: tuple[float, float]
) -> None:
    """The wave goes from 10 to 15 V and back for ever; another client looks at what is left."""
    with GcsServer(quiet_stage(), speed=100.0, abandoned=abandoned) as server:
        with client(server) as peer:
            peer.send("SVA 1 10\nWAV 1 X LIN 2000 5 10 2000 0 0\nWSL 1 1\nWGC 1 0\nWGO 1 1\n\x09")
            assert peer.answer() == "0x1\n"
        with client(server) as other:
            seen = []
            for _ in range(200):
                other.send("\x09VOL? 1\n")
                answers = [other.answer().strip() for _ in range(2)]
                seen.append((answers[0], float(answers[1].partition("=")[2])))
                if len(seen) > 20 and seen[-1] == seen[-10]:
                    break
                time.sleep(0.005)
        assert seen[-1][0] == running
        low, high = voltage
        assert low <= seen[-1][1] <= high
        # On its way to rest the output has been between.
        assert len({volts for _, volts in seen}) > (1 if abandoned == "runs" else 0)


def test_one_client_that_goes_does_not_end_the_wave_of_another() -> None:
    with GcsServer(quiet_stage(), speed=100.0, abandoned="rests") as server, client(server) as peer:
        peer.send("SVA 1 10\nWAV 1 X LIN 2000 5 10 2000 0 0\nWSL 1 1\nWGC 1 0\nWGO 1 1\n\x09")
        assert peer.answer() == "0x1\n"
        with client(server) as other:
            other.send("POS? 1\n")
            other.answer()
        time.sleep(0.1)
        peer.send("\x09")
        assert peer.answer() == "0x1\n"


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
