"""Devices that answer anything from some moment on, and do what they are told all the same.

Whatever they answer: a call ends in time, in one sentence, and the output ends at rest.
"""

from __future__ import annotations

import math
import re
import time
from contextlib import closing
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt
from gcs_peers import LIMITS, Spoilt, dripping, peer, quiet_stage
from piezotrack.control.on_device import latency

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from gcs_peers import Said

# Time limit of an answer, and how much longer a call may take: the way to rest, connections that
# are made anew, a busy machine [s].
TIMEOUT, LONGER = 0.5, 15.0
PLAYS = pt.PrandtlIshlinskiiStage(linear=1e-6, thresholds=(10.0, 25.0), weights=(2e-7, 1e-7))
LOOP = pt.Controller(dt=0.05, limits=LIMITS, feedback=pt.Pid.from_um(kp=0.1, ti=0.1))
MOTION = pt.sine(frequency=0.5, low=20e-6, high=60e-6, duration=2.0)
LIST = (
    "&upload=LIST:VOLT {table:.6f}&start=LIST:RATE {rate:.9g};:INIT&fetch=FETC?"
    "&rates=1..10000Hz&memory=4096"
)


def _endless(text: str) -> Iterator[str]:
    while True:
        yield text * 1000


def _cut(said: str) -> Iterator[str]:
    yield said[: len(said) // 2]
    raise ConnectionResetError


def _late(said: str) -> Iterator[str]:
    time.sleep(2.0 * TIMEOUT)
    yield said


def _number(word: str) -> Callable[[str], Said]:
    """Put a word in the place of every number of an answer."""
    return lambda said: re.sub(r"(?<![\w.])[+-]?\d+(\.\d+)?(e[+-]?\d+)?(?= ?\n|;|,)", word, said)


FAULTS: dict[str, Callable[[str], Said]] = {
    "drips": lambda said: dripping(said.rstrip("\n") or "1", 0.05),
    "drips lines": lambda _: dripping("1 \n", 0.05),
    "silent": lambda _: "",
    "half": lambda said: said[: len(said) // 2],
    "a line too many": lambda said: said + said,
    "many lines": lambda said: said * 500,
    "binary": lambda _: "".join(map(chr, range(160, 256))) + "\x00\x01\x07\n",
    "escapes": lambda _: "\x1b[2J\x1b]0;x\x07" * 30 + "\n",
    "endless line": lambda _: _endless("xyz"),
    "endless lines": lambda _: _endless("1 \n"),
    "endless empty lines": lambda _: _endless("\n"),
    "not a number": _number("nan"),
    "overflow": _number("1e400"),
    "overload": _number("9.91e37"),
    "digits": _number("9" * 1000),
    "closes in it": _cut,
    "closes": lambda _: None,
    "late": _late,
}


class Gcs(Spoilt):
    """A controller whose answers are spoilt from a moment on."""

    def __init__(self, fault: Callable[[str], Said], begin: str | None, count: int) -> None:
        super().__init__(self._spoilt, speed=1.0)
        self.fault, self.begin, self.count = fault, begin, count

    def _spoilt(self, _: str, said: str) -> Said:
        sent = sum(line.startswith(self.begin) for line in self.lines) if self.begin else 0
        return self.fault(said) if sent >= self.count else said

    def address(self, port: int) -> str:
        return f"gcs://127.0.0.1:{port}?timeout={TIMEOUT}s"


class Scpi:
    """An instrument whose answers are spoilt from a moment on."""

    def __init__(self, fault: Callable[[str], Said], begin: str | None, count: int) -> None:
        self.device = pt.hardware.VirtualDevice(quiet_stage())
        self.inside = pt.hardware.VirtualScpi(self.device)
        self.fault, self.begin, self.count, self.sent = fault, begin, count, 0
        self.options = LIST if begin and begin.startswith("LIST") else ""

    def __call__(self, line: str) -> Said:
        self.sent += self.begin is not None and line.startswith(self.begin)
        answer = self.inside.answer(line)
        if answer is None:
            return ""
        return self.fault(f"{answer}\n") if self.sent >= self.count else f"{answer}\n"

    def address(self, port: int) -> str:
        timeout = f"timeout={1e3 * TIMEOUT:g}ms"
        return f"scpi://127.0.0.1:{port}?unit=um&limits=0..75V&{timeout}{self.options}"

    @property
    def voltage(self) -> float:
        return self.device.held


def _measure(device: Any) -> Any:
    return pt.measure(device, np.full(100, 40.0), rate=100.0, ramp=0.1)


def _play(device: Any) -> Any:
    return pt.play(device, PLAYS.inverse(), MOTION, rate=100.0)


def _track(device: Any) -> Any:
    return pt.track(device, LOOP, MOTION)


def _exchange(device: Any) -> Any:
    device.hold(5.0)
    try:
        return device.exchange(7.0)
    finally:
        device.hold(0.0)


# What is done, and after which command the answers are spoilt: protocol, beginning, how many.
WORK: dict[str, tuple[Callable[[Any], Any] | None, type[Gcs | Scpi], str | None, int]] = {
    "gcs connect": (None, Gcs, None, 0),
    "gcs measure": (_measure, Gcs, "WGO 1 1", 1),
    "gcs play": (_play, Gcs, "WAV 1 &", 3),
    "gcs read": (_measure, Gcs, "DRL?", 1),
    "gcs track": (_track, Gcs, "SVA", 25),
    "gcs exchange": (_exchange, Gcs, "SVA", 2),
    "scpi connect": (None, Scpi, None, 0),
    "scpi measure": (_measure, Scpi, "VOLT", 40),
    "scpi list": (_measure, Scpi, "LIST:RATE", 1),
    "scpi play": (_play, Scpi, "VOLT", 50),
    "scpi track": (_track, Scpi, "VOLT", 25),
    "scpi exchange": (_exchange, Scpi, "VOLT", 2),
}
# Run with every `make test`; the others take some minutes.
QUICK = [
    ("gcs connect", "drips"),
    ("gcs measure", "drips"),
    ("gcs read", "endless lines"),
    ("gcs exchange", "not a number"),
    ("gcs track", "closes in it"),
    ("scpi measure", "many lines"),
    ("scpi list", "escapes"),
]
# An instrument that answers without having read cannot be told from one that has.
ALL = [
    (work, fault)
    for work in WORK
    for fault in FAULTS
    if not (work.startswith("scpi") and fault == "drips lines")
]


@pytest.fixture
def _short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Short measurements of the latency, and none refused: the machine of a test is busy."""
    monkeypatch.setattr(latency, "FEWEST", 5)
    monkeypatch.setattr(latency, "LONGEST", 0.2)
    monkeypatch.setattr(latency, "MOST", 1e3)


@pytest.mark.usefixtures("_short")
@pytest.mark.parametrize(
    ("work", "fault"),
    [pytest.param(*case, marks=[] if case in QUICK else [pytest.mark.slow]) for case in ALL],
)
def test_it_ends_in_time_in_one_sentence_and_at_rest(work: str, fault: str) -> None:
    done, kind, begin, count = WORK[work]
    there = kind(FAULTS[fault], begin, count)
    result: Any = None
    failure = None
    with peer(there) as port:
        begun = time.monotonic()
        try:
            with closing(pt.hardware.connect(there.address(port))) as device:
                begun = time.monotonic()
                result = done(device) if done else device
        except (pt.DeviceError, pt.DataError) as error:
            failure = str(error)
        duration = time.monotonic() - begun
        assert there.voltage == 0.0
    # What is recorded before has its time: up to 3 s of a table, with its ways.
    assert duration < 4.0 + TIMEOUT + LONGER
    if failure is not None:
        assert 20 <= len(failure) <= 500
        assert failure.isprintable()
    elif work.endswith("connect"):
        # A name may be anything; what counts is what it says of itself.
        assert all(map(math.isfinite, result.limits))
        assert all(name.isprintable() for name in result.channels)
    elif work.endswith("exchange"):
        assert math.isnan(result)
    else:
        pytest.fail(f"{result} was taken for a record")
