"""A board that runs a firmware project of this package: its client, as a device."""

from __future__ import annotations

import struct
import threading
import time
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from .._support.arguments import expect, finite, not_negative, positive
from .._support.arrays import signal_of
from ..control.controller.controller import Controller
from ..control.loop.run import Run
from ..control.loop.tracking import Tracking
from ..data.dataset import Dataset
from ..data.dataset_arguments import MIN_SAMPLES
from ..errors import DeviceError, ParameterError
from ..export.c99.settings import settings_of
from ..export.firmware.project import layout_on_board, sensor_span
from ..hardware.device import Rates, Record
from ..hardware.limits import check_within
from ..hardware.options import Options
from ..references.parse import reference_of
from .answers import shown
from .scpi_link import Link

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from ..references.reference import Reference

    Array = NDArray[np.float64]

__all__ = ["FirmwareDevice"]

FORM = "firmware://HOST:PORT[?timeout=5s]"
PORT, TIMEOUT = 5555, 5.0
# Numbers in a message, samples in an answer, as in protocol.c.
NUMBERS, SAMPLES = 48, 128
# Flags of a sample, as in ring.h.
SATURATED = 1
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


class FirmwareDevice:
    """A board with the firmware that `control.export_controller` writes, over TCP.

    Tables are played, and loops are closed, on the clock of the board. While it is connected, a
    thread gives signs of life: without them for a second the board leads its output to the safe
    voltage.

    Parameters
    ----------
    host : str
        Name or address; of a serial port that of a program that passes it on, as ``ser2net``.
    port : int, optional
        TCP port.
    timeout : float, optional
        Time limit of an answer [s].

    Raises
    ------
    DeviceError
        Nobody answers there, or no firmware of this version.
    """

    def __init__(self, host: str, port: int = PORT, *, timeout: float = TIMEOUT) -> None:
        self._link = Link(host, port, positive("timeout", timeout, "s"))
        self._lock, self._closed = threading.Lock(), threading.Event()
        try:
            self.board = self._identified(self._ask("id"))
        except BaseException:
            self._link.close()
            raise
        threading.Thread(target=self._live, daemon=True).start()

    @property
    def limits(self) -> tuple[float, float]:
        """Lowest and highest voltage [V]."""
        return self.board.limits

    @property
    def rates(self) -> Rates:
        """Rate of the loop, and whole fractions of it."""
        rate = 1.0 / self.board.dt
        return Rates(lowest=rate / self.board.divider, highest=rate, clock=rate)

    @property
    def memory(self) -> int:
        """Longest table [samples]."""
        return self.board.memory

    @property
    def channels(self) -> tuple[str, ...]:
        """Name of the controller, and place."""
        return (f"{self.board.name} at {self._link.where}",)

    @property
    def voltage(self) -> float:
        """Voltage at the output [V]."""
        return self.state().voltage

    def state(self) -> BoardState:
        """Return what the board does, and what it has counted."""
        answer = self._ask("state")
        mode, *words = answer.split()
        named = dict(word.split("=", 1) for word in words if "=" in word)
        try:
            voltage, reading = (self._number(word) for word in words[-2:])
            counts = {
                name: int(named[name])
                for name in ("tick", "left", "recorded", "overruns", "invalid")
            }
            return BoardState(
                mode=mode, fault=named["fault"], voltage=voltage, reading=reading, **counts
            )
        except (KeyError, ValueError, struct.error):
            raise self._unexpected("state", answer) from None

    def exchange(self, volts: float) -> float:
        """Put out a voltage [V] and return the last reading [m]; NaN for none."""
        self._check(finite("volts", volts, "V"))
        message = f"exchange {self._bits(volts)}"
        answer = self._ask(message)
        try:
            return self._number(answer)
        except (ValueError, struct.error):
            raise self._unexpected(message, answer) from None

    def hold(self, volts: float) -> None:
        """Put out a constant voltage [V] from now on."""
        self._check(finite("volts", volts, "V"))
        self._ask(f"hold {self._bits(volts)}")

    def play(self, volts: Array, rate: float, *, lead_in: float = 0.0) -> Record:
        """Play a table and record, on the clock of the board; as `Device.play`.

        Parameters
        ----------
        volts : ndarray, shape (n,)
            Table [V].
        rate : float
            Sampling rate [Hz].
        lead_in : float, optional
            How long the first voltage is held before the record begins [s].

        Returns
        -------
        Record
            Of n samples.

        Raises
        ------
        DeviceError
            A voltage is beyond the limits, the table is longer than the memory, or the board has a
            fault: its output is then at the safe voltage, or on the way there.
        """
        table = signal_of("volts", volts)
        self._check(table)
        if table.size > self.memory:
            raise DeviceError(f"the table has {table.size} samples: the memory holds {self.memory}")
        dt = self.board.dt
        divider = round(1.0 / (self.rates.nearest(rate) * dt))
        before = round(not_negative("lead_in", lead_in, "s") / dt)
        self._load("voltage", table)
        self._ask(f"play {table.size} {divider} {before}")
        self._wait("hold", (table.size * divider + before) * dt)
        rows = self._recorded(table.size)
        return Record(
            volts=rows[:, 3],
            displacement=rows[:, 4],
            rate=1.0 / (divider * dt),
            channels=self.channels,
        )

    def track(self, controller: Controller, reference: Reference | str) -> Tracking:
        """Track a reference in closed loop, on the clock of the board.

        Settings of the controller are sent first, where the board takes them. The output stays in
        the loop at the end of the reference: `stop` leads it to the safe voltage.

        Parameters
        ----------
        controller : Controller
            That of the firmware, also with other gains.
        reference : Reference or str
            The reference, as of `track`.

        Returns
        -------
        Tracking
            The motion and its metrics; the true displacement is the measured one.

        Raises
        ------
        ParameterError
            The controller is another one, or the reference is longer than the memory.
        DeviceError
            The board has a fault.
        """
        self._check_controller(controller)
        if self.board.settings:
            self.retune(controller)
        run = Run(controller, reference_of(reference))
        x = run.samples.x
        if x.size > self.memory:
            raise ParameterError(
                "reference", f"{x.size} samples", f"at most {self.memory}", verb="has"
            )
        if self.state().mode == "run":
            # Tables in use are not changed: the voltage that is there is the start of the next run.
            self.hold(self.voltage)
        note = "feedforward sample by sample on the board"
        volts = np.zeros(x.size)
        if self.board.takes_voltages:
            planned, note = run.feedforward
            volts = np.clip(planned, *self.limits)
            self._load("voltage", volts)
        self._load("reference", x)
        self._ask(f"run {x.size} 1 {int(self.board.takes_voltages)}")
        self._wait("run", x.size * self.board.dt)
        rows = self._recorded(x.size)
        command, y = rows[:, 3], rows[:, 4]
        t = run.samples.t
        return Tracking(
            reference=run.reference,
            controller=controller,
            t=t,
            desired=x,
            measured=y,
            displacement=y,
            loop_error=x - y,
            voltage=command,
            feedforward=volts,
            feedback=command - volts,
            repetitive=np.zeros(x.size),
            saturated=(rows[:, 1].astype(int) & SATURATED) > 0,
            fine_t=t,
            fine_displacement=y,
            fine_voltage=command,
            note=f"{note}; the loop closed on {self.channels[0]}",
        )

    def follow(self, displacement: float) -> None:
        """Keep a displacement [m] in closed loop from now on."""
        self._ask(f"follow {self._bits(finite('displacement', displacement, 'm'))}")

    def stop(self) -> None:
        """Lead the output to the safe voltage."""
        self._ask("stop")
        self._wait("off", 1.0)

    def clear(self) -> None:
        """Forget a fault, once the output is at the safe voltage."""
        end = time.monotonic() + PATIENCE
        while self.state().mode == "fault":
            try:
                self._ask("clear")
            except DeviceError:
                if time.monotonic() > end:
                    raise
                time.sleep(GLANCE)

    def retune(self, controller: Controller) -> None:
        """Change the gains while the loop runs, without a bump; see `Session.retune`.

        Parameters
        ----------
        controller : Controller
            The structure is that of the firmware.

        Raises
        ------
        ParameterError
            The firmware has no settings, or the controller another structure.
        DeviceError
            The board refuses a number.
        """
        if not self.board.settings:
            raise ParameterError(
                "controller", "given", "none: the firmware was exported with fixed numbers"
            )
        self._check_controller(controller)
        values = settings_of(controller, single=self.board.real == 4)
        self._ask("stage")
        for place, value in enumerate(values.values()):
            self._ask(f"set {place} {self._bits(value)}")
        self._ask("tune")

    def settings(self) -> dict[str, float]:
        """Return the numbers in use, by their names."""
        found = {}
        for place in range(self.board.settings):
            answer = self._ask(f"setting {place}")
            try:
                words = answer.split()
                found[words[0]] = self._number(words[-4])
            except (IndexError, ValueError, struct.error):
                raise self._unexpected("setting", answer) from None
        return found

    def save_settings(self) -> None:
        """Keep the numbers in use over a reset, where the board has memory for it."""
        self._ask("save")

    def log(self) -> Dataset:
        """Return the newest samples that the board has kept, as a log."""
        recorded = self.state().recorded
        if recorded < MIN_SAMPLES:
            raise DeviceError(
                f"{self.channels[0]} has recorded {recorded} samples: expected at least "
                f"{MIN_SAMPLES}"
            )
        count = min(recorded, self.memory)
        while True:
            try:
                rows = self._recorded(count, recorded - count)
                break
            except DeviceError:
                # Older ones were overwritten meanwhile: fewer of the newest.
                recorded, count = self.state().recorded, count // 2
                if count < MIN_SAMPLES:
                    raise
        return Dataset(
            u=rows[:, 3],
            y=rows[:, 4],
            dt=float(np.median(np.diff(rows[:, 0]))) * self.board.dt,
            hold="zoh",
            source=self.channels[0],
        )

    def close(self) -> None:
        """Lead the output to the safe voltage, and close the connection.

        A connection that is lost is a fault, which leads it there too.
        """
        if not self._closed.is_set():
            with suppress(DeviceError):
                if self.state().mode != "fault":
                    self.stop()
        self._closed.set()
        with self._lock:
            self._link.close()

    def _check_controller(self, controller: Controller) -> None:
        """Refuse a controller that is not that of the firmware but for its settings."""
        expect("controller", controller, Controller, "pt.Controller")
        single, board = self.board.real == 4, self.board
        low, high = controller.limits
        bottom, top = sensor_span(controller)
        pairs = {
            "dt": ((controller.dt,), (board.dt,), "s"),
            "limits": ((low, high), board.limits, "V"),
            "span": ((bottom, top), board.span, "m"),
        }
        for name, (given, there, unit) in pairs.items():
            if not np.allclose(given, there, rtol=1e-6, atol=0.0):
                mine, others = (" to ".join(f"{one:g}" for one in pair) for pair in (given, there))
                raise ParameterError(
                    "controller", f"{name} {mine} {unit}", f"{others} {unit}, as the firmware",
                    verb="has",
                )  # fmt: skip
        if board.settings and layout_on_board(controller, single=single) != board.layout:
            names = ", ".join(settings_of(controller, single=single))
            others = ", ".join(self.settings())
            raise ParameterError(
                "controller", f"{names} as numbers", f"the structure of the firmware, {others}",
                verb="has",
            )  # fmt: skip

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
            low, high, bottom, top = (
                _number(named[name], real) for name in ("low", "high", "bottom", "top")
            )
            return Board(
                name=named["name"],
                real=real,
                dt=_rounded(_number(named["dt"], real), real),
                limits=(low, high),
                span=(bottom, top),
                memory=min(int(named["table"]), int(named["ring"])),
                divider=int(named["divider"]),
                settings=int(named["settings"]),
                layout=int(named["layout"]),
                takes_voltages=named["voltages"] == "1",
            )
        except (KeyError, ValueError, struct.error):
            raise self._unexpected("id", answer) from None

    def _load(self, table: str, numbers: Array) -> None:
        for first in range(0, numbers.size, NUMBERS):
            words = " ".join(map(self._bits, numbers[first : first + NUMBERS].tolist()))
            self._ask(f"load {table} {first} {words}")

    def _wait(self, mode: str, duration: float) -> None:
        """Wait until a table has ended."""
        end = time.monotonic() + duration + PATIENCE
        while True:
            state = self.state()
            if state.mode == "fault":
                raise DeviceError(
                    f"{self.channels[0]} has the fault {state.fault!r}: its output goes to the "
                    "safe voltage; clear() forgets the fault"
                )
            if state.mode == mode and state.left == 0:
                return
            if time.monotonic() > end:
                raise DeviceError(
                    f"{self.channels[0]} is in mode {state.mode!r} with {state.left} samples left: "
                    f"expected the end of the table after {duration:g} s"
                )
            time.sleep(GLANCE)

    def _recorded(self, count: int, first: int = 0) -> Array:
        """Read samples: tick, flags, reference, voltage, reading."""
        rows: list[Sequence[float]] = []
        while len(rows) < count:
            wanted = min(SAMPLES, count - len(rows))
            message = f"read {first + len(rows)} {wanted}"
            answer = self._ask(message)
            try:
                more = [
                    (float(tick), float(flags), *map(self._number, numbers))
                    for tick, flags, *numbers in (word.split(":") for word in answer.split())
                ]
            except (ValueError, struct.error):
                raise self._unexpected(message, answer) from None
            if not more or any(len(row) != 5 for row in more):
                raise self._unexpected(message, answer)
            rows += more
        return np.array(rows, dtype=np.float64).reshape(-1, 5)

    def _bits(self, value: float) -> str:
        return f"x{struct.pack('>f' if self.board.real == 4 else '>d', value).hex()}"

    def _number(self, word: str) -> float:
        return _number(word, self.board.real)

    def _ask(self, message: str) -> str:
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

    def _live(self) -> None:
        """Give signs of life until the connection is closed or lost."""
        while not self._closed.wait(ALIVE):
            # A connection that was lost is made anew, also by this.
            with suppress(DeviceError):
                self._ask("ping")

    def _unexpected(self, message: str, answer: str) -> DeviceError:
        return DeviceError(f"{self._link.where} answered {shown(message)} with {shown(answer)}")

    def _check(self, volts: Any) -> None:
        check_within(volts, self.limits, self.channels[0])


def _number(word: str, real: int) -> float:
    """Read the bits of a number."""
    if not word.startswith("x"):
        raise ValueError(word)
    return float(struct.unpack(">f" if real == 4 else ">d", bytes.fromhex(word[1:]))[0])


def _rounded(value: float, real: int) -> float:
    """Return the decimal that a float was rounded from."""
    return float(f"{value:.7g}") if real == 4 else value


def from_address(
    host: str | None, port: int | None, path: str, options: Mapping[str, str]
) -> FirmwareDevice:
    """Connect to ``firmware://HOST:PORT``."""
    if not host or path.strip("/"):
        raise ParameterError("device", "no host", FORM, verb="has")
    given = Options(FORM, options)
    timeout = given.value("timeout", "time", TIMEOUT)
    given.done()
    return FirmwareDevice(host, PORT if port is None else port, timeout=timeout)
