"""Who may reach the page: each rule with the request that breaks it."""

from __future__ import annotations

import base64
import json
import os
import socket
import stat
import struct
import time
from typing import TYPE_CHECKING, Any

import pytest

from page.server import WINDOW, Served, Socket
from piezotrack.app import server
from piezotrack.app.desk import Desk
from piezotrack.errors import PiezotrackError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


@pytest.fixture(scope="module")
def served() -> Iterator[Served]:
    made = Served()
    yield made
    assert made.thread.is_alive()


@pytest.mark.parametrize("path", ["/", "/app.js", "/nothing"])
@pytest.mark.parametrize(
    "host",
    ["", "evil.example", "127.0.0.1", "127.0.0.1.evil.example:{}", "127.0.0.1:1", "[::1]:{}"],
)
def test_another_host_gets_nothing(served: Served, path: str, host: str) -> None:
    named = host.format(served.port)
    assert served.request(path, Host=named).status in (400, 403)
    if path == "/":
        assert served.upgrade(Host=named) in (400, 403)


@pytest.mark.parametrize(
    "origin",
    ["", "null", "http://evil.example", "https://{}", "http://localhost:{port}", "http://{}.evil"],
)
def test_another_origin_gets_no_socket(served: Served, origin: str) -> None:
    # localhost is a name of this server too, but not the one of the Host: a rebound pair.
    assert served.upgrade(Origin=origin.format(served.host, port=served.port)) == 403


def test_localhost_with_its_own_origin_is_this_computer(served: Served) -> None:
    name = f"localhost:{served.port}"
    made = served.upgrade(Host=name, Origin=f"http://{name}")
    assert isinstance(made, Socket)
    made.end()


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "OPTIONS", "PATCH"])
@pytest.mark.parametrize("path", ["/", "/app.js", "/socket", "/x"])
def test_there_is_nothing_to_post(served: Served, method: str, path: str) -> None:
    origin = f"http://{served.host}"
    assert served.request(path, method, Origin=origin).status in (403, 405)
    assert served.request(path, method).status in (403, 405)


@pytest.mark.parametrize("path", ["/../state.py", "/%2e%2e/state.py", "/static/app.js", "/app.py"])
def test_only_the_files_of_the_page_are_there(served: Served, path: str) -> None:
    assert served.request(path).status == 404
    assert served.request("/app.js").status == 200


@pytest.mark.parametrize("path", ["/", "/app.js", "/app.css", "/nothing"])
def test_every_answer_forbids_what_is_not_of_the_page(served: Served, path: str) -> None:
    answer = served.request(path)
    policy = answer.headers["Content-Security-Policy"]
    assert "default-src 'none'" in policy
    assert "frame-ancestors 'none'" in policy
    assert "unsafe" not in policy
    assert answer.headers["X-Content-Type-Options"] == "nosniff"
    assert answer.headers["Referrer-Policy"] == "no-referrer"
    assert answer.headers["Server"] is None


@pytest.mark.parametrize("token", ["", "x", 7, None, ["a"], "\u00e9" * 43, "\ud800"], ids=repr)
def test_without_the_token_a_socket_is_closed(served: Served, token: Any) -> None:
    made = served.upgrade()
    assert isinstance(made, Socket)
    made.send(json.dumps({"token": token, "window": WINDOW}))
    assert made.closed() == 4003
    assert served.request().status == 200


def test_a_message_before_the_token_is_not_done(served: Served) -> None:
    made = served.upgrade()
    assert isinstance(made, Socket)
    made.send(json.dumps({"do": "log.example"}))
    assert made.closed() == 4003


def test_silence_is_closed(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "PATIENCE", 0.1)
    made = served.upgrade()
    assert isinstance(made, Socket)
    assert made.closed() == 4003


@pytest.mark.parametrize("text", ["[]", "7", "{", "[" * 50_000, '"x"'])
def test_what_is_no_message_closes_the_socket(served: Served, text: str) -> None:
    made = served.enter()
    made.answer()
    made.send(text)
    assert made.closed() == 1003


def test_sizes_are_limited(served: Served) -> None:
    made = served.enter()
    made.answer()
    made.send(json.dumps({"do": "x" * 100_001}))
    assert made.closed() == 1009


def test_bytes_that_were_not_announced_are_refused(served: Served) -> None:
    made = served.enter()
    made.answer()
    made.send(b"time_s,u_V,y_um\n0,0,0\n")
    assert made.closed() == 4003


def test_an_action_that_does_not_exist_is_one_sentence(served: Served) -> None:
    made = served.enter()
    made.answer()
    for given in ({"do": "log.__class__"}, {"do": None}, {"do": "os.system"}, {"do": ["x"]}):
        made.send(json.dumps({**given, "seq": 5}))
        assert "action of the page" in made.answer()["error"]["text"]
    made.send(json.dumps({"do": "set", "step": "log", "values": {"dt": True}, "seq": 6}))
    assert made.answer()["error"]["control"] == "dt"
    made.end()


def test_the_same_window_has_one_socket_and_a_ninth_none(served: Served) -> None:
    first = served.enter("a" * 32)
    first.answer()
    again = served.enter("a" * 32)
    again.answer()
    assert first.closed() == 4010
    others = [again]
    for i in range(server.MOST_SESSIONS - 1):
        others.append(served.enter(f"{i:032}"))
        others[-1].answer()
    assert served.enter("b" * 32).closed() == 4008
    for one in others:
        one.end()


def test_the_token_has_256_bits_and_is_in_no_answer(served: Served) -> None:
    assert len(base64.urlsafe_b64decode(served.token + "=")) == 32
    made = served.enter("c" * 32)
    assert served.token not in json.dumps(made.answer())
    made.end()


def test_other_addresses_of_this_computer_are_not_listened_to(served: Served) -> None:
    for family, address in ((socket.AF_INET, "127.0.0.2"), (socket.AF_INET6, "::1")):
        with socket.socket(family) as one:
            one.settimeout(2.0)
            with pytest.raises(OSError):  # noqa: PT011
                one.connect((address, served.port))


def test_it_ends_when_no_window_is_open() -> None:
    short = Served(idle=0.3)
    short.thread.join(timeout=10.0)
    assert not short.thread.is_alive()


@pytest.mark.parametrize(
    "name",
    ["../../x.csv", "/etc/passwd", "a\0b.csv", "x" * 10_000, "", "..", "C:\\x\\y.csv", "a/b"],
)
def test_a_file_keeps_to_its_folder(name: str) -> None:
    desk = Desk(lambda _: None)
    kept = desk.keep("log", name, b"content")
    path = desk.file("log", kept)
    folder = path.parent.parent
    assert path.parent.name == "log"
    assert path.read_bytes() == b"content"
    if os.name == "posix":
        assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    desk.close()
    assert not folder.exists()


def test_a_large_file_ends_the_socket_not_the_server(served: Served) -> None:
    # The limit itself is tested by the length that a frame announces.
    made = served.enter("d" * 32)
    made.answer()
    made.send(json.dumps({"do": "open", "purpose": "log", "name": "x.csv"}))
    head = bytes([0x82, 0x80 | 127]) + struct.pack(">Q", server.LARGEST_FILE + 1) + bytes(4)
    made.raw.sendall(head)
    begun = time.monotonic()
    assert made.closed() == 1009
    assert time.monotonic() - begun < 5.0
    assert served.request().status == 200


def test_what_cannot_be_served_is_one_sentence(served: Served, tmp_path: Path) -> None:
    for given, words in (
        ({"port": 99_999}, "port is 99999"),
        ({"port": served.port}, f"port {served.port}"),
        ({"log": tmp_path}, "is a folder"),
        ({"log": tmp_path / "nothing.csv"}, "No such file"),
    ):
        with pytest.raises(PiezotrackError, match=words):
            server.serve(lambda _: None, **given)
