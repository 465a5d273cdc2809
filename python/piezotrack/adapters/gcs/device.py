"""A controller that speaks GCS as a device: wave tables out, the data recorder back."""

from __future__ import annotations

import math
import re
import time
from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np

from ..._support.arguments import finite, not_negative, plain, positive
from ..._support.arrays import signal_of
from ..._support.messages import quoted
from ...errors import DeviceError, ParameterError
from ...hardware.device import Rates, Record
from ...hardware.limits import check_within, ordered
from ...hardware.options import Options
from ..answers import number, printable
from .connection import Connection
from .protocol import GENERATOR, POSITION, RECORD_POINTS, SERVO_CYCLE, VOLTAGE, WAVE_POINTS

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]

__all__ = ["GcsDevice", "from_address"]

PORT, TIMEOUT = 50000, 5.0
FORM = "gcs://HOST[:PORT][/AXIS][?limits=0..100V][&factor=1V][&timeout=5s]"
NEEDED = ("POS?", "SVO", "SVA", "WAV", "WSL", "WGC", "WTR", "WGO", "DRC", "RTR", "DRL?", "DRR?")
# Metres in the units of positions that PUN? answers with.
UNITS = {"um": 1e-6, "micron": 1e-6, "\u03bcm": 1e-6, "nm": 1e-9, "mm": 1e-3}
# Longest command [characters], and commands after which errors are asked for.
LINE, TOGETHER = 240, 50
# Smallest parameter: no servo cycle is below it, and no memory above its inverse.
LEAST = 1e-9
# Slowest rate of a table [servo cycles].
SLOWEST = 10_000
# Waits between two looks at the generator [s].
FIRST_LOOK, LONGEST_LOOK = 1e-3, 0.05
# Largest share of the range by which the output may differ from the table without a note.
NEAR = 1e-3
# Answers that are whole numbers: of tables, and the state of the generators.
_COUNT, _BITS = re.compile(r"[0-9]{1,6}"), re.compile(r"(0[xX])?[0-9a-fA-F]{1,16}")


class GcsDevice:
    """A piezo controller with wave generator and data recorder, over TCP.

    It drives one axis in open loop, by control values that are taken for volts, and records the
    position and the voltage of the output channel of the same number. Positions are in the unit
    that the controller says (``PUN?``), um where it says none.

    Parameters
    ----------
    host : str
        Name or address.
    port : int, optional
        TCP port, 50000 by default.
    axis : str, optional
        Axis, wave generator and output channel.
    limits : (float, float), optional
        Lowest and highest voltage [V]; default those of the controller, ``VMI?`` and ``VMA?``.
    factor : float, optional
        Voltage of a control value of 1 [V], where the controller's are not volts.
    timeout : float, optional
        Longest wait for an answer [s].

    Raises
    ------
    ParameterError
        An argument is out of its range, or the controller does not say its limits.
    DeviceError
        Nobody answers, or the controller lacks a command.

    Examples
    --------
    >>> import piezotrack as pt
    >>> with pt.hardware.GcsServer(pt.VirtualStage.xu_li_2010(seed=1)) as server:
    ...     device = pt.hardware.GcsDevice("127.0.0.1", server.port)
    ...     print(device.limits, device.rates.nearest(3000.0))
    ...     device.close()
    (0.0, 75.0) 2857.1428571428573
    """

    def __init__(
        self,
        host: str,
        port: int = PORT,
        *,
        axis: str = "1",
        limits: tuple[float, float] | None = None,
        factor: float = 1.0,
        timeout: float = TIMEOUT,
    ) -> None:
        if not (isinstance(axis, str) and axis.isdecimal() and axis.isascii()):
            raise ParameterError("axis", quoted(axis), "a number, as '1'")
        self._axis, self._factor = axis, positive("factor", factor, "V")
        self._open = True
        # The number of the connection on which the servo was switched off.
        self._prepared = 0
        self._line = Connection(host, port, positive("timeout", timeout, "s"))
        try:
            name = printable(" ".join(self._line.ask("*IDN?")))
            self._known = {words[0].upper() for line in self._line.ask("HLP?")
                           if (words := line.split())}  # fmt: skip
            missing = [name for name in NEEDED if name not in self._known]
            if missing:
                raise DeviceError(
                    f"{self._line.name}: {name} does not know {', '.join(missing)}: expected "
                    "a controller with wave generator and data recorder"
                )
            self._unit, self._travel = self._metres(), self._ends()
            self._limits = ordered("limits", self._range() if limits is None else limits)
            clock = 1.0 / self._parameter(SERVO_CYCLE)
            self._rates = Rates(lowest=clock / SLOWEST, highest=clock, clock=clock)
            self._memory = self._points()
        except BaseException:
            self._line.close()
            raise

    @property
    def limits(self) -> tuple[float, float]:
        """Lowest and highest voltage [V]."""
        return self._limits

    @property
    def rates(self) -> Rates:
        """Sampling rates: whole fractions of the servo clock."""
        return self._rates

    @property
    def memory(self) -> int:
        """Longest table [samples]: what both a wave table and the recorder hold."""
        return self._memory

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of output and input."""
        name = self._line.name
        return (f"{name} output {self._axis}", f"{name} axis {self._axis}")

    @property
    def travel(self) -> tuple[float, float]:
        """Lowest and highest position of the axis [m]; infinite where the controller says none."""
        low, high = self._travel
        return self._unit * low, self._unit * high

    @property
    def position(self) -> float:
        """Reading of the sensor now [m]; NaN where it is none, as of `exchange`."""
        return self._unit * float(_near(self._value("POS?"), self._travel))

    @property
    def voltage(self) -> float:
        """Voltage at the output now [V]; NaN where it is beyond the limits by more than a range."""
        return float(_near(self._value("VOL?"), self._limits))

    def play(self, volts: Array, rate: float, *, lead_in: float = 0.0) -> Record:
        """Play a table by the wave generator and record; as `Device.play`.

        Parameters
        ----------
        volts : ndarray, shape (n,)
            Table [V].
        rate : float
            Sampling rate [Hz].
        lead_in : float, optional
            How long the first voltage is held before [s].

        Returns
        -------
        Record
            Of n samples, with the voltage that the recorder saw at the output.

        Raises
        ------
        DeviceError
            The controller refuses something, or does not answer.
        """
        table = signal_of("volts", volts)
        self._check(table)
        if table.size > self._memory:
            raise DeviceError(
                f"the table has {table.size} samples: the memory of {self._line.name} holds "
                f"{self._memory}"
            )
        cycles = round(self._clock / self._rates.nearest(rate))
        rate = self._clock / cycles
        before = round(not_negative("lead_in", lead_in, "s") * rate)
        if before + table.size > self._memory:
            self.hold(float(table[0]))
            time.sleep(lead_in)
            before = 0
        self._tell()
        self._upload(np.concatenate([np.full(before, table[0]), table]), cycles)
        count = before + table.size
        try:
            self._line.command(f"WGO {self._axis} 1")
            self._wait(count / rate)
            return self._record(table, before, rate)
        except BaseException:
            with suppress(DeviceError):
                self._line.ready()
                self._line.send(f"WGO {self._axis} 0")
            raise

    def exchange(self, volts: float) -> float:
        """Read the displacement and put out a voltage, in one message each way.

        Parameters
        ----------
        volts : float
            Voltage [V].

        Returns
        -------
        float
            Displacement before it goes out [m]; NaN where there is no reading: an overload, or
            further beyond the travel than the travel is long.

        Raises
        ------
        DeviceError
            The controller refuses something, or does not answer.
        """
        self._check(finite("volts", volts, "V"))
        before, query = self._preparation(), f"POS? {self._axis}"
        lines = self._line.exchange(query, *before, f"SVA {self._axis} {self._control(volts)}")
        self._prepared = self._line.number
        return self._unit * float(_near(self._number(query, lines), self._travel))

    def hold(self, volts: float) -> None:
        """Put out a constant voltage from now on.

        Parameters
        ----------
        volts : float
            Voltage [V].

        Raises
        ------
        DeviceError
            The controller refuses it, or does not answer.
        """
        self._check(finite("volts", volts, "V"))
        self._tell(f"SVA {self._axis} {self._control(volts)}")

    def close(self) -> None:
        """Give the connection back; the output stays where it is."""
        self._open = False
        self._line.close()

    @property
    def _clock(self) -> float:
        assert self._rates.clock is not None
        return self._rates.clock

    def _check(self, volts: ArrayLike) -> None:
        if not self._open:
            raise DeviceError(f"{self._line.name} is closed")
        check_within(volts, self._limits, self._line.name)

    def _preparation(self) -> list[str]:
        """Return what has to be sent before the first voltage of a connection.

        Of what was on the last one nothing is known any more: a table may still go out.
        """
        number = self._line.ready()
        if number == self._prepared:
            return []
        return [f"WGO {self._axis} 0"] * (number > 1) + [f"SVO {self._axis} 0"]

    def _tell(self, *commands: str) -> None:
        """Send commands for an axis that has its servo off; who switches it on gets its error."""
        if commands := (*self._preparation(), *commands):
            self._line.command(*commands)
            self._prepared = self._line.number

    def _control(self, volts: float) -> str:
        """Write a voltage [V] as a control value that is within the limits as it is written."""
        value, (low, high) = volts / self._factor, self._limits
        text = f"{value:.9g}"
        return text if low <= float(text) * self._factor <= high else f"{value:.17g}"

    def _upload(self, table: Array, cycles: int) -> None:
        """Write the wave table, and set up generator and recorder."""
        axis = self._axis
        waiting: list[str] = []
        for command in self._points_of(table):
            waiting.append(command)
            if len(waiting) == TOGETHER:
                self._line.command(*waiting)
                waiting.clear()
        self._line.command(
            *waiting,
            f"WSL {axis} {axis}",
            f"WGC {axis} 1",
            f"WTR {axis} {cycles} 0",
            f"RTR {cycles}",
            f"DRC 1 {axis} {POSITION}",
            f"DRC 2 {axis} {VOLTAGE}",
        )

    def _points_of(self, table: Array) -> Iterator[str]:
        """Write a table as commands of a length that controllers take."""
        words = [self._control(float(volts)) for volts in table]
        k = 0
        while k < len(words):
            size, count = 0, 0
            while k + count < len(words) and size + len(words[k + count]) < LINE:
                size += len(words[k + count]) + 1
                count += 1
            append = "&" if k else "X"
            values = " ".join(words[k : k + count])
            yield f"WAV {self._axis} {append} PNT {k + 1} {count} {values}"
            k += count

    def _wait(self, duration: float) -> None:
        """Wait until the generator has ended."""
        bit = 1 << (int(self._axis) - 1)
        latest = time.monotonic() + 1.5 * duration + 5.0
        pause = FIRST_LOOK
        while True:
            lines = self._line.ask(GENERATOR)
            if len(lines) != 1 or not _BITS.fullmatch(lines[0]):
                raise self._line.unexpected(GENERATOR, lines, "a hexadecimal number")
            if not int(lines[0], 16) & bit:
                return
            if time.monotonic() > latest:
                raise DeviceError(
                    f"{self._line.name}: the wave generator still runs: expected it to end after "
                    f"{duration:g} s"
                )
            time.sleep(pause)
            pause = min(2.0 * pause, LONGEST_LOOK)

    def _record(self, table: Array, before: int, rate: float) -> Record:
        """Read the data recorder."""
        count = before + table.size
        query = "DRL? 1"
        there = self._number(query, self._line.ask(query), "1")
        if not there >= count:
            raise DeviceError(
                f"{self._line.name}: the data recorder has {there:g} samples: expected {count}"
            )
        query = f"DRR? {before + 1} {table.size} 1 2"
        lines = self._line.ask(query, samples=table.size)
        data, interval = _array(lines)
        if data is None or data.shape != (table.size, 2):
            told = lines if data is None else [f"... {len(lines)} lines ..."]
            raise self._line.unexpected(query, told, f"2 columns of {table.size} samples")
        if not math.isclose(interval, 1.0 / rate, rel_tol=1e-4):
            raise DeviceError(
                f"{self._line.name}: the data recorder says {interval:g} s from sample to sample: "
                f"expected {1.0 / rate:g} s"
            )
        low, high = self._limits
        beyond = np.flatnonzero(np.isnan(_near(data[:, 1], self._limits)))
        if beyond.size:
            k = int(beyond[0])
            raise DeviceError(
                f"{self._line.name}: the data recorder says {data[k, 1]:g} V at sample {k}: "
                f"expected {table[k]:g} V"
            )
        other = float(np.max(np.abs(data[:, 1] - table)))
        notes = () if other <= NEAR * (high - low) else (
            f"output: up to {plain(other)} V other than the table, as the data recorder says",
        )  # fmt: skip
        return Record(
            volts=data[:, 1],
            displacement=self._unit * _near(data[:, 0], self._travel),
            rate=rate,
            channels=self.channels,
            notes=notes,
        )

    def _value(self, query: str) -> float:
        """Ask for a number of the axis."""
        self._line.ready()
        command = f"{query} {self._axis}"
        return self._number(command, self._line.ask(command))

    def _number(self, query: str, lines: Sequence[str], item: str = "") -> float:
        """Read ``ITEM=NUMBER``."""
        name, equals, text = lines[0].partition("=")
        wanted = item or self._axis
        try:
            if len(lines) != 1 or not equals or name.strip() != wanted:
                raise ValueError
            return number(text)
        except ValueError:
            raise self._line.unexpected(query, lines, f"{wanted}=NUMBER") from None

    def _parameter(self, address: int) -> float:
        query = f"SPA? {self._axis} 0x{address:08X}"
        lines = self._line.ask(query)
        try:
            value = number(lines[0].partition("=")[2])
        except ValueError:
            value = math.nan
        if not LEAST < value < 1.0 / LEAST:
            raise self._line.unexpected(query, lines, "a parameter above 0")
        return value

    def _metres(self) -> float:
        """Return the unit of positions [m]."""
        if "PUN?" not in self._known:
            return UNITS["um"]
        query = f"PUN? {self._axis}"
        lines = self._line.ask(query)
        unit = lines[0].partition("=")[2].strip().casefold()
        if unit not in UNITS:
            raise self._line.unexpected(query, lines, "um, nm or mm")
        return UNITS[unit]

    def _range(self) -> tuple[float, float]:
        """Return the limits of the output [V]."""
        if not {"VMI?", "VMA?"} <= self._known:
            raise ParameterError(
                "limits",
                f"not given, and {self._line.name} does not say them",
                "(low, high) in V, in an address ?limits=0..100V",
                verb="are",
            )
        low, high = self._value("VMI?"), self._value("VMA?")
        if not low < high:
            told = [f"{plain(low)} to {plain(high)}"]
            raise self._line.unexpected("VMI?; VMA?", told, "two voltages, the lower one first")
        return low, high

    def _ends(self) -> tuple[float, float]:
        """Return the travel in the controller's unit; infinite where it does not say one."""
        if not {"TMN?", "TMX?"} <= self._known:
            return -math.inf, math.inf
        low, high = self._value("TMN?"), self._value("TMX?")
        return (low, high) if low < high else (-math.inf, math.inf)

    def _points(self) -> int:
        """Return the samples that both a wave table and the recorder hold."""
        tables = self._line.ask("TNR?") if "TNR?" in self._known else ["1"]
        if not _COUNT.fullmatch(tables[0]) or not int(tables[0]):
            raise self._line.unexpected("TNR?", tables, "the number of tables")
        points = self._parameter(RECORD_POINTS) / int(tables[0])
        # Not every controller says how long a wave may be; it refuses what is too long.
        with suppress(DeviceError):
            points = min(points, self._parameter(WAVE_POINTS))
        return int(points)


def _near(values: ArrayLike, span: tuple[float, float]) -> Array:
    """Return values, NaN where they are further beyond a span than it is long, or are infinite."""
    low, high = span
    y = np.asarray(values, dtype=np.float64)
    length = high - low
    return np.where((y >= low - length) & (y <= high + length) & np.isfinite(y), y, np.nan)


def _array(lines: Sequence[str]) -> tuple[Array | None, float]:
    """Read an array of data: rows, and the sampling interval [s]; None where it is none."""
    interval = math.nan
    try:
        end = next(k for k, line in enumerate(lines) if line.startswith("# END_HEADER"))
        for line in lines[:end]:
            name, _, text = line.lstrip("# ").partition("=")
            if name.strip() == "SAMPLE_TIME":
                interval = number(text)
        # NumPy would read 1_0 as 10.
        rows = [line.replace("_", "?").split() for line in lines[end + 1 :]]
        return np.array(rows, dtype=np.float64), interval
    except (StopIteration, ValueError):
        return None, interval


def from_address(
    host: str | None, port: int | None, path: str, options: Mapping[str, str]
) -> GcsDevice:
    """Connect to the controller of an address: ``gcs://HOST[:PORT][/AXIS][?limits=0..100V]``."""
    if not host:
        raise ParameterError("device", "no host", "gcs://HOST[:PORT][/AXIS]", verb="has")
    given = Options(FORM, options)
    limits = given.span("limits", "voltage") if "limits" in options else None
    factor = given.value("factor", "voltage", 1.0)
    timeout = given.value("timeout", "time", TIMEOUT)
    given.done()
    return GcsDevice(
        host,
        port or PORT,
        axis=path.strip("/") or "1",
        limits=limits,
        factor=factor,
        timeout=timeout,
    )
