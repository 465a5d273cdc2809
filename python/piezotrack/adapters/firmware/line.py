"""The line to a board with a firmware of this package: commands, answers, signs of life."""

from __future__ import annotations

import struct
import threading
import time
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...errors import DeviceError
from ..answers import shown
from ..scpi_link import Link

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = ["Board", "BoardLine", "BoardState"]

# Numbers in a message, samples in an answer, as in protocol.c.
NUMBERS, SAMPLES = 48, 128
# Time between two signs of life [s], a quarter of the firmware's patience, and two looks whether
# a table has ended.
ALIVE, GLANCE = 0.25, 0.02
# How much longer than its time a table may take [s].
PATIENCE = 10.0


@dataclass(frozen=True, kw_only=True)
class Board:
    """Properties of a board and of its controller.

    Attributes
    ----------
    name : str
        Name of the controller.
    real : int
        Bytes of its numbers.
    dt : float
        Sampling interval [s].
    limits : (float, float)
        Lowest and highest voltage [V].
    span : (float, float)
        Displacements at both ends of the ADC [m].
    memory : int
        Samples of a table that can be recorded whole.
    divider : int
        Most intervals of one sample of a table.
    settings : int
        Numbers that can be changed while it runs; 0 for none.
    layout : int
        Hash of which numbers these are.
    takes_voltages : bool
        Whether a loop adds the voltages of the table.
    """

    name: str
    real: int
    dt: float
    limits: tuple[float, float]
    span: tuple[float, float]
    memory: int
    divider: int
    settings: int
    layout: int
    takes_voltages: bool


@dataclass(frozen=True, kw_only=True)
class BoardState:
    """State of a board.

    Attributes
    ----------
    mode : {"off", "ramp", "hold", "play", "run", "fault"}
        What it does.
    fault : {"none", "overrun", "reading", "link", "sampling"}
        Why it led the output to the safe voltage.
    tick, left, recorded, overruns, invalid : int
        Samples since the start, until the end of a table, in the record; samples that took longer
        than their interval, and without a reading.
    voltage, reading : float
        Output [V], and the last reading [m]; NaN for none.
    """

    mode: str
    fault: str
    tick: int
    left: int
    recorded: int
    overruns: int
    invalid: int
    voltage: float
    reading: float


class BoardLine:
    """The line to a board: commands and answers, signs of life in between.

    Parameters
    ----------
    host : str
        Name or address, or the name of a serial port.
    port : int
        TCP port.
    timeout : float
        Time limit of an answer [s].
    baud : int or None
        Rate of a serial port [bit/s]; None over TCP.

    Raises
    ------
    DeviceError
        Nobody answers there, or no firmware of this version.
    """

    def __init__(self, host: str, port: int, timeout: float, baud: int | None) -> None:
        self._link = Link(host, port, timeout, baud=baud)
        self._lock, self._closed = threading.Lock(), threading.Event()
        try:
            self.board = self._identified(self.ask("id"))
        except BaseException:
            self._link.close()
            raise
        threading.Thread(target=self._live, daemon=True).start()

    @property
    def name(self) -> str:
        """Name of the controller, and place."""
        return f"{self.board.name} at {self._link.where}"

    @property
    def closed(self) -> bool:
        """Whether it was closed."""
        return self._closed.is_set()

    def close(self) -> None:
        """Close the line, whatever the board does; a second call does nothing."""
        self._closed.set()
        with self._lock:
            self._link.close()

    def ask(self, message: str) -> str:
        """Send a command and return what is answered behind its ok.

        Raises
        ------
        DeviceError
            The line is closed or lost, or the board refuses.
        """
        with self._lock:
            if self._closed.is_set():
                raise DeviceError(f"{self._link.where} is closed")
            answer = self._link.ask(message)
        verdict, _, rest = answer.partition(" ")
        if verdict != "ok":
            raise DeviceError(
                f"{self._link.where} answered {shown(message)} with {shown(answer)}: expected ok"
            )
        return rest

    def state(self) -> BoardState:
        """Return what the board does, and what it has counted."""
        answer = self.ask("state")
        mode, *words = answer.split()
        named = dict(word.split("=", 1) for word in words if "=" in word)
        try:
            voltage, reading = (self.number(word) for word in words[-2:])
            counts = {
                name: int(named[name])
                for name in ("tick", "left", "recorded", "overruns", "invalid")
            }
            return BoardState(
                mode=mode, fault=named["fault"], voltage=voltage, reading=reading, **counts
            )
        except (KeyError, ValueError, struct.error):
            raise self.unexpected("state", answer) from None

    def settings(self) -> dict[str, float]:
        """Return the numbers in use, by their names."""
        found = {}
        for place in range(self.board.settings):
            answer = self.ask(f"setting {place}")
            try:
                words = answer.split()
                found[words[0]] = self.number(words[-4])
            except (IndexError, ValueError, struct.error):
                raise self.unexpected("setting", answer) from None
        return found

    def load(self, table: str, numbers: Array) -> None:
        """Load numbers into a table, from its beginning."""
        for first in range(0, numbers.size, NUMBERS):
            words = " ".join(map(self.bits, numbers[first : first + NUMBERS].tolist()))
            self.ask(f"load {table} {first} {words}")

    def wait(self, mode: str, duration: float) -> None:
        """Wait until a table has ended."""
        end = time.monotonic() + duration + PATIENCE
        while True:
            state = self.state()
            if state.mode == "fault":
                raise DeviceError(
                    f"{self.name} has the fault {state.fault!r}: its output goes to the "
                    "safe voltage; clear() forgets the fault"
                )
            if state.mode == mode and state.left == 0:
                return
            if time.monotonic() > end:
                raise DeviceError(
                    f"{self.name} is in mode {state.mode!r} with {state.left} samples left: "
                    f"expected the end of the table after {duration:g} s"
                )
            time.sleep(GLANCE)

    def recorded(self, count: int) -> Array:
        """Read the first samples: tick, flags, reference, voltage, reading."""
        rows: list[Sequence[float]] = []
        while len(rows) < count:
            more = self._samples(len(rows), min(SAMPLES, count - len(rows)))
            if not more:
                raise DeviceError(
                    f"{self.name} does not have sample {len(rows)} of its record any more"
                )
            rows += more
        return np.array(rows, dtype=np.float64).reshape(-1, 5)

    def newest(self, recorded: int) -> Array:
        """Read the samples before one, as far back as they are there without a gap.

        From the newest to the oldest: of a recording that goes on, these are written over first.
        """
        rows: list[Sequence[float]] = []
        first, count = recorded, SAMPLES
        while count > 0 and first > 0:
            count = min(count, first)
            more = self._samples(first - count, count)
            if len(more) < count:
                count //= 2
                continue
            if rows and more[-1][0] >= rows[0][0]:
                break  # of a recording that has begun since
            rows, first = more + rows, first - count
        return np.array(rows, dtype=np.float64).reshape(-1, 5)

    def _samples(self, first: int, count: int) -> list[Sequence[float]]:
        """Ask for samples; those up to the first that is not there any more."""
        message = f"read {first} {count}"
        answer = self.ask(message)
        try:
            rows = [
                (float(tick), float(flags), *map(self.number, numbers))
                for tick, flags, *numbers in (word.split(":") for word in answer.split())
            ]
        except (ValueError, struct.error):
            raise self.unexpected(message, answer) from None
        if len(rows) > count or any(len(row) != 5 for row in rows):
            raise self.unexpected(message, answer)
        return [*rows]

    def bits(self, value: float) -> str:
        """Write the bits of a number as the board reads them."""
        return f"x{struct.pack('>f' if self.board.real == 4 else '>d', value).hex()}"

    def number(self, word: str) -> float:
        """Read the bits of a number; ValueError or struct.error where it is none."""
        return _number(word, self.board.real)

    def unexpected(self, message: str, answer: str) -> DeviceError:
        """Return the error of an answer that cannot be read."""
        return DeviceError(f"{self._link.where} answered {shown(message)} with {shown(answer)}")

    def _identified(self, answer: str) -> Board:
        words = answer.split()
        named = dict(word.split("=", 1) for word in words if "=" in word)
        if words[:2] != ["piezotrack-firmware", "1"]:
            raise DeviceError(
                f"{self._link.where} answered 'id' with {shown(answer)}: expected a firmware of "
                "piezotrack, version 1"
            )
        try:
            real = int(named["real"])
            dt, low, high, bottom, top = (
                _rounded(_number(named[name], real), real)
                for name in ("dt", "low", "high", "bottom", "top")
            )
            return Board(
                name=named["name"],
                real=real,
                dt=dt,
                limits=(low, high),
                span=(bottom, top),
                memory=min(int(named["table"]), int(named["ring"])),
                divider=int(named["divider"]),
                settings=int(named["settings"]),
                layout=int(named["layout"]),
                takes_voltages=named["voltages"] == "1",
            )
        except (KeyError, ValueError, struct.error):
            raise self.unexpected("id", answer) from None

    def _live(self) -> None:
        """Give signs of life until the line is closed."""
        while not self._closed.wait(ALIVE):
            # A connection that was lost is made anew, also by this.
            with suppress(DeviceError):
                self.ask("ping")


def _number(word: str, real: int) -> float:
    """Read the bits of a number."""
    if not word.startswith("x"):
        raise ValueError(word)
    return float(struct.unpack(">f" if real == 4 else ">d", bytes.fromhex(word[1:]))[0])


def _rounded(value: float, real: int) -> float:
    """Return the decimal that a float was rounded from."""
    return float(f"{value:.7g}") if real == 4 else value
