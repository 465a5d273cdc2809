"""A board that runs a firmware of this package, as a device."""

from __future__ import annotations

import struct
import time
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from ... import _core
from ..._support.arguments import expect, finite, not_negative, positive
from ..._support.arrays import signal_of
from ...control.controller.controller import Controller
from ...control.loop.run import Run
from ...control.loop.tracking import Tracking
from ...data.dataset import Dataset
from ...data.dataset_arguments import MIN_SAMPLES
from ...errors import DeviceError, ParameterError
from ...export.c99.settings import settings_of
from ...export.firmware.project import layout_on_board, sensor_span
from ...hardware.device import Rates, Record
from ...hardware.limits import check_within
from ...hardware.options import Options
from ...references.parse import reference_of
from .line import GLANCE, PATIENCE, BoardLine

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from ...references.reference import Reference
    from .line import BoardState

    Array = NDArray[np.float64]

__all__ = ["FirmwareDevice"]

FORM = "firmware://HOST:PORT[?timeout=5s], or firmware:///dev/PORT[?baud=115200]"
PORT, TIMEOUT, BAUD = 5555, 5.0, 115200
# Flags of a sample, as in ring.h.
SATURATED = 1


class FirmwareDevice:
    """A board with the firmware that `control.export_controller` writes, over TCP or a serial port.

    Tables are played, and loops are closed, on the clock of the board. While it is connected, a
    thread gives signs of life: without them for a second the board leads its output to the safe
    voltage.

    Parameters
    ----------
    host : str
        Name or address; of a serial port its name, as ``/dev/ttyACM0`` or ``COM3``.
    port : int, optional
        TCP port.
    timeout : float, optional
        Time limit of an answer [s].
    baud : int, optional
        Rate of a serial port [bit/s], of which those over USB take no notice; TCP without it.

    Raises
    ------
    DeviceError
        Nobody answers there, or no firmware of this version.
    """

    def __init__(
        self, host: str, port: int = PORT, *, timeout: float = TIMEOUT, baud: int | None = None
    ) -> None:
        if baud is not None:
            baud = _core.as_count("baud", baud)
        self._line = BoardLine(host, port, positive("timeout", timeout, "s"), baud)
        self.board = self._line.board

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
        return (self._line.name,)

    @property
    def voltage(self) -> float:
        """Voltage at the output [V]."""
        return self.state().voltage

    def state(self) -> BoardState:
        """Return what the board does, and what it has counted."""
        return self._line.state()

    def exchange(self, volts: float) -> float:
        """Put out a voltage [V] and return the last reading [m]; NaN for none."""
        self._check(finite("volts", volts, "V"))
        message = f"exchange {self._line.bits(volts)}"
        answer = self._line.ask(message)
        try:
            return self._line.number(answer)
        except (ValueError, struct.error):
            raise self._line.unexpected(message, answer) from None

    def hold(self, volts: float) -> None:
        """Put out a constant voltage [V] from now on."""
        self._check(finite("volts", volts, "V"))
        self._line.ask(f"hold {self._line.bits(volts)}")

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
        self._line.load("voltage", table)
        self._line.ask(f"play {table.size} {divider} {before}")
        self._line.wait("hold", (table.size * divider + before) * dt)
        rows = self._line.recorded(table.size)
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
            self._line.load("voltage", volts)
        self._line.load("reference", x)
        self._line.ask(f"run {x.size} 1 {int(self.board.takes_voltages)}")
        self._line.wait("run", x.size * self.board.dt)
        rows = self._line.recorded(x.size)
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
        self._line.ask(f"follow {self._line.bits(finite('displacement', displacement, 'm'))}")

    def stop(self) -> None:
        """Lead the output to the safe voltage."""
        self._line.ask("stop")
        self._line.wait("off", 1.0)

    def clear(self) -> None:
        """Forget a fault, once the output is at the safe voltage."""
        end = time.monotonic() + PATIENCE
        while self.state().mode == "fault":
            try:
                self._line.ask("clear")
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
        self._line.ask("stage")
        for place, value in enumerate(values.values()):
            self._line.ask(f"set {place} {self._line.bits(value)}")
        self._line.ask("tune")

    def settings(self) -> dict[str, float]:
        """Return the numbers in use, by their names."""
        return self._line.settings()

    def save_settings(self) -> None:
        """Keep the numbers in use over a reset, where the board has memory for it."""
        self._line.ask("save")

    def log(self) -> Dataset:
        """Return the newest samples that the board has kept, as a log.

        Of a recording that goes on these are the samples before this call without a gap; those that
        it wrote over while they were read are missing at the beginning.
        """
        recorded = self.state().recorded
        if recorded < MIN_SAMPLES:
            raise DeviceError(
                f"{self.channels[0]} has recorded {recorded} samples: expected at least "
                f"{MIN_SAMPLES}"
            )
        rows = self._line.newest(recorded)
        if len(rows) < MIN_SAMPLES:
            raise DeviceError(
                f"{self.channels[0]} has written over its record while it was read: expected one "
                "that has ended, as after stop()"
            )
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
        if not self._line.closed:
            with suppress(DeviceError):
                if self.state().mode != "fault":
                    self.stop()
        self._line.close()

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

    def _check(self, volts: Any) -> None:
        check_within(volts, self.limits, self.channels[0])


def from_address(
    host: str | None, port: int | None, path: str, options: Mapping[str, str]
) -> FirmwareDevice:
    """Connect to ``firmware://HOST:PORT``, ``firmware:///dev/PORT`` or ``firmware://COM3?baud=``."""
    given = Options(FORM, options)
    timeout = given.value("timeout", "time", TIMEOUT)
    serial = not host and bool(path.strip("/"))
    baud = given.count("baud", BAUD if serial else 0) or None
    given.done()
    if serial:
        return FirmwareDevice(path, timeout=timeout, baud=baud)
    if not host or path.strip("/"):
        raise ParameterError("device", "no host", FORM, verb="has")
    return FirmwareDevice(host, PORT if port is None else port, timeout=timeout, baud=baud)
