"""Lines of SCPI that break between two messages and in one: no answer is taken for another."""

from __future__ import annotations

import os
import signal
import socket
import struct
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING

import pytest

import piezotrack as pt
from gcs_peers import peer
from piezotrack.adapters.scpi_link import Link

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator


def device_at(
    place: tuple[str, int], *, identify: str = "", timeout: float = 60.0
) -> pt.hardware.ScpiDevice:
    options = {"identify": identify, "timeout": timeout}
    return pt.hardware.ScpiDevice(*place, unit="um", limits=(0.0, 75.0), **options)  # type: ignore[arg-type]


def reset(link: socket.socket) -> None:
    """Close a connection as an instrument does that is switched off: by a reset."""
    link.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    link.close()


def said(link: socket.socket) -> None:
    link.recv(1000)
    link.sendall(b"2.000000\n")


@contextmanager
def visits(*guests: Callable[[socket.socket], None]) -> Iterator[tuple[str, int]]:
    """Serve connections one after another, each by a function of its own."""
    with socket.create_server(("127.0.0.1", 0)) as listening:

        def serve() -> None:
            for guest in guests:
                link, _ = listening.accept()
                with link:
                    guest(link)

        thread = threading.Thread(target=serve)
        thread.start()
        try:
            yield "127.0.0.1", int(listening.getsockname()[1])
        finally:
            thread.join(timeout=60.0)
            assert not thread.is_alive()


@pytest.mark.parametrize("end", [socket.socket.close, reset])
def test_a_connection_closed_between_two_readings_is_made_anew(
    end: Callable[[socket.socket], None],
) -> None:
    left = threading.Event()

    def leave(link: socket.socket) -> None:
        said(link)
        end(link)
        left.set()

    with visits(leave, said) as place:
        device = device_at(place)
        assert device.exchange(1.0) == pytest.approx(2e-6)
        assert left.wait(60.0)
        assert device.exchange(1.0) == pytest.approx(2e-6)
        device.close()


def test_an_instrument_that_does_not_say_its_name_is_left() -> None:
    seen: list[bytes] = []

    def mumbles(link: socket.socket) -> None:
        seen.append(link.recv(1000))
        link.sendall(b"half a name")
        # Until the client goes.
        seen.append(link.recv(1000))

    with visits(mumbles) as place, pytest.raises(pt.DeviceError, match="with 'half a name'"):
        device_at(place, identify="*IDN?", timeout=0.2)
    assert seen == [b"*IDN?\n", b""]


def test_a_reset_in_place_of_an_answer_is_a_sentence_and_the_next_is_heard() -> None:
    def leave(link: socket.socket) -> None:
        link.recv(1000)
        reset(link)

    with visits(leave, said) as place:
        device = device_at(place)
        with pytest.raises(pt.DeviceError, match=r"did not answer 'VOLT 1.000000;:MEAS\?'"):
            device.exchange(1.0)
        assert device.exchange(1.0) == pytest.approx(2e-6)
        device.close()


def test_what_comes_unasked_is_never_taken_for_an_answer() -> None:
    sent = threading.Event()

    def stray() -> Iterator[str]:
        yield "2.000000\n"
        assert heard.wait(60.0)
        yield "99.000000\n"
        sent.set()

    heard, answers = threading.Event(), iter([stray(), "3.000000\n"])
    with peer(lambda _: next(answers)) as port:
        device = device_at(("127.0.0.1", port))
        assert device.exchange(1.0) == pytest.approx(2e-6)
        heard.set()
        assert sent.wait(60.0)
        with pytest.raises(pt.DeviceError, match=r"sent '99\.000000.*' unasked"):
            device.exchange(1.0)
        assert device.exchange(1.0) == pytest.approx(3e-6)
        device.close()


def test_an_answer_without_an_end_has_a_limit() -> None:
    def endless() -> Iterator[str]:
        while True:
            yield "1" * 100_000

    with peer(lambda _: endless()) as port:
        device = device_at(("127.0.0.1", port))
        with pytest.raises(pt.DeviceError, match="no end of line in 1000000 bytes"):
            device.exchange(1.0)
        device.close()


def taking_no_more() -> tuple[
    threading.Event, list[bytes], tuple[Callable[[socket.socket], None], ...]
]:
    ended, messages = threading.Event(), list[bytes]()

    def deaf(_: socket.socket) -> None:
        assert ended.wait(60.0)

    def hears(link: socket.socket) -> None:
        messages.append(link.recv(1000))
        link.sendall(b"2.000000\n")

    return ended, messages, (deaf, hears)


@pytest.mark.parametrize(
    "is_interrupted",
    [
        False,
        pytest.param(
            True, marks=pytest.mark.skipif(os.name == "nt", reason="another Ctrl-C on Windows")
        ),
    ],
)
def test_half_a_message_is_never_completed_by_the_next(is_interrupted: bool) -> None:
    """An instrument that takes no more: what follows goes out on a connection of its own."""
    ended, messages, guests = taking_no_more()
    failure = KeyboardInterrupt if is_interrupted else pt.DeviceError
    long = "LIST:VOLT " + "0," * 10_000_000
    with visits(*guests) as place:
        link = Link(*place, 60.0 if is_interrupted else 0.2)
        if is_interrupted:
            threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT)).start()
        with pytest.raises(failure) as caught:
            link.ask(long)
        ended.set()
        assert is_interrupted or "did not take 'LIST:VOLT 0,0,0" in str(caught.value)
        assert link.ask("MEAS?") == "2.000000"
        link.close()
    assert messages == [b"MEAS?\n"]
