"""Instruments that take messages over TCP, as SCPI: templates say which."""

from __future__ import annotations

import math
from dataclasses import dataclass
from string import Formatter
from typing import TYPE_CHECKING

import numpy as np

from .. import _core
from .._support.arguments import finite, not_negative, positive
from .._support.arrays import signal_of
from .._support.messages import quoted
from .._support.units import require
from ..errors import DeviceError, ParameterError
from ..hardware.device import Rates, Record
from ..hardware.limits import check_within, ordered
from ..hardware.options import Options
from ..hardware.pacing import play_paced
from .answers import number, printable, shown
from .scpi_link import Link, number_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]

__all__ = ["ScpiBuffer", "ScpiDevice"]

EXCHANGE, IDENTIFY = "VOLT {volts:.6f};:MEAS?", "*IDN?"
# Rates of a play that the computer paces.
PACED = Rates(lowest=1e-3, highest=1000.0)
MEMORY, TIMEOUT = 1_000_000, 2.0
# Share of the range by which a voltage may be beyond the limits as it is written.
ROUNDING = 1e-9
FORM = "scpi://HOST:PORT?unit=um&limits=0..75V[&exchange=VOLT {volts:.6f};:MEAS?][&timeout=2s]"


@dataclass(frozen=True, kw_only=True)
class ScpiBuffer:
    """Messages with which an instrument plays a list of voltages and records, by its own clock.

    Parameters
    ----------
    upload : str
        Sends a list: ``{table:.6f}`` becomes its voltages [V], separated by commas.
    start : str
        Starts it; may have ``{rate}`` [Hz], ``{dt}`` [s], ``{count}``.
    fetch : str
        Asks for the readings, separated by commas; may have ``{count}``.
    rates : Rates
        Rates of the instrument.
    memory : int
        Longest list [samples].
    done : str, optional
        Asks whether it is done; answered when it is, with 1.
    append : str, optional
        Sends more of a list, where one message takes `chunk` voltages only.
    chunk : int, optional
        Voltages in one message, at most.

    Raises
    ------
    ParameterError
        A template has another field, or `chunk` comes without `append`.

    Examples
    --------
    >>> import piezotrack as pt
    >>> buffer = pt.hardware.ScpiBuffer(
    ...     upload="LIST:VOLT {table:.6f}",
    ...     start="LIST:RATE {rate:.9g};:INIT",
    ...     fetch="FETC?",
    ...     rates=pt.hardware.Rates(lowest=1.0, highest=10e3),
    ...     memory=4096,
    ... )
    >>> buffer.done
    '*OPC?'
    """

    upload: str
    start: str
    fetch: str
    rates: Rates
    memory: int
    done: str = "*OPC?"
    append: str | None = None
    chunk: int | None = None

    def __post_init__(self) -> None:
        _check_template("upload", self.upload, needed="table")
        _check_template("start", self.start, "rate", "dt", "count")
        _check_template("fetch", self.fetch, "count")
        _check_template("done", self.done)
        _core.as_count("memory", self.memory)
        if self.append is not None:
            _check_template("append", self.append, needed="table")
        if (self.chunk is None) != (self.append is None):
            raise ParameterError(
                "chunk", f"{self.chunk} and append is {quoted(self.append)}", "both, or none"
            )
        if self.chunk is not None:
            _core.as_count("chunk", self.chunk)


class ScpiDevice:
    """An instrument that takes messages in lines over TCP.

    Sample by sample one message sets the voltage and asks for the displacement: joined, they are
    one round trip. Without a `buffer` a table is played so too, paced by the computer, and the
    record says how late it was.

    Parameters
    ----------
    host : str
        Name or address of the instrument.
    port : int
        TCP port; SCPI's is 5025.
    unit : str
        Unit of its answers, as ``"um"``.
    limits : (float, float)
        Lowest and highest voltage [V].
    exchange : str, optional
        Sets the voltage ``{volts}`` [V] and asks for the displacement; where the instrument does
        not take two messages in a line, with a line feed between them.
    buffer : ScpiBuffer, optional
        How it plays a list by its own clock.
    errors : str, optional
        Asks for its oldest error after a list and a constant voltage, as ``"SYST:ERR?"``; the
        answer has to begin with 0.
    identify : str, optional
        Asks for its name, which messages and records then have; ``""`` asks nothing.
    timeout : float, optional
        Time limit of an answer [s].

    Raises
    ------
    ParameterError
        An argument cannot be used.
    DeviceError
        Nobody answers there.

    Examples
    --------
    >>> import piezotrack as pt
    >>> with pt.hardware.VirtualScpi(pt.hardware.connect("virtual:")) as instrument:
    ...     device = pt.hardware.ScpiDevice(*instrument.address, unit="um", limits=(0.0, 75.0))
    ...     x = device.exchange(0.0)
    ...     device.close()
    >>> abs(x) < 1e-6
    True
    """

    def __init__(
        self,
        host: str,
        port: int,
        *,
        unit: str,
        limits: tuple[float, float],
        exchange: str = EXCHANGE,
        buffer: ScpiBuffer | None = None,
        errors: str | None = None,
        identify: str = IDENTIFY,
        timeout: float = TIMEOUT,
    ) -> None:
        self._unit = require(unit, "displacement")
        self._limits = ordered("limits", limits)
        _check_template("exchange", exchange, needed="volts")
        self._exchange, self._buffer, self._errors = exchange, buffer, errors
        self._link = Link(host, port, positive("timeout", timeout, "s"))
        self._open, self._voltage = True, math.nan
        try:
            self._name = printable(self._link.ask(identify)) if identify else "instrument"
        except BaseException:
            self._link.close()
            raise

    @property
    def limits(self) -> tuple[float, float]:
        """Lowest and highest voltage [V]."""
        return self._limits

    @property
    def rates(self) -> Rates:
        """Those of the buffer; without one up to 1 kHz, as far as the round trip allows."""
        return PACED if self._buffer is None else self._buffer.rates

    @property
    def memory(self) -> int:
        """Longest table [samples]."""
        return MEMORY if self._buffer is None else self._buffer.memory

    @property
    def channels(self) -> tuple[str, ...]:
        """Name and place of the instrument."""
        return (f"{self._name} at {self._link.where}",)

    @property
    def voltage(self) -> float:
        """Voltage that was put out last [V]; NaN from the start of a buffer to its end."""
        return self._voltage

    def exchange(self, volts: float) -> float:
        """Put out a voltage [V] and read the displacement [m], in one message.

        NaN where the instrument says overload (9.9e37) or not a number.
        """
        self._check(finite("volts", volts, "V"))
        message = self._setting(volts)
        self._voltage = float(volts)
        return self._number(message, self._link.ask(message))

    def play(self, volts: Array, rate: float, *, lead_in: float = 0.0) -> Record:
        """Play a table: by the buffer, or paced by the computer; as `Device.play`.

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
            A voltage is beyond the limits; the instrument is silent, late or answers something
            else.
        """
        table = signal_of("volts", volts)
        self._check(table)
        if self._buffer is None:
            return play_paced(self.exchange, table, rate, lead_in=lead_in, channels=self.channels)
        before = round(not_negative("lead_in", lead_in, "s") * rate)
        whole = np.concatenate([np.full(before, table[0]), table])
        self._voltage = math.nan
        y = self._play_buffered(self._buffer, whole, rate)
        self._voltage = float(table[-1])
        return Record(volts=table, displacement=y[before:], rate=rate, channels=self.channels)

    def hold(self, volts: float) -> None:
        """Put out a constant voltage [V] from now on; what the sensor says does not matter."""
        self._check(finite("volts", volts, "V"))
        message = self._setting(volts)
        self._voltage = float(volts)
        self._link.ask(message)
        self._check_errors()

    def close(self) -> None:
        """Close the connection; the output stays where it is."""
        self._open = False
        self._link.close()

    def _play_buffered(self, buffer: ScpiBuffer, volts: Array, rate: float) -> Array:
        if volts.size > buffer.memory:
            raise DeviceError(
                f"the table has {volts.size} samples with its lead-in: {self.channels[0]} holds "
                f"{buffer.memory}"
            )
        step, messages = buffer.chunk or volts.size, []
        for first in range(0, volts.size, step):
            template = buffer.append if first and buffer.append else buffer.upload
            table = _Written(volts[first : first + step], ".6f")
            messages.append(template.format(table=table))
            self._check_written(template, table)
        for message in messages:
            self._link.tell(message)
        self._check_errors()
        self._link.tell(buffer.start.format(rate=rate, dt=1.0 / rate, count=volts.size))
        done = self._link.ask(buffer.done, patience=volts.size / rate)
        if done.lstrip("+") != "1":
            raise self._unexpected(buffer.done, done, "1")
        message = buffer.fetch.format(count=volts.size)
        answer = self._link.ask(message, readings=volts.size)
        self._check_errors()
        readings = answer.split(",")
        if len(readings) != volts.size:
            raise self._unexpected(
                message, f"{len(readings)} readings, {answer}", f"{volts.size} readings"
            )
        return np.array([self._number(message, one) for one in readings])

    def _number(self, message: str, answer: str) -> float:
        try:
            return number_of(answer, self._unit)
        except ValueError:
            raise self._unexpected(message, answer, f"a number in {self._unit.name}") from None

    def _check_errors(self) -> None:
        if self._errors is None:
            return
        answer = self._link.ask(self._errors)
        if answer.partition(",")[0].lstrip("+-") != "0":
            raise self._unexpected(self._errors, answer, "0, no error")

    def _unexpected(self, message: str, answer: str, expected: str) -> DeviceError:
        return DeviceError(
            f"{self._link.where} answered {quoted(message)} with {shown(answer)}: expected "
            f"{expected}"
        )

    def _setting(self, volts: float) -> str:
        """Write the message that sets a voltage [V]."""
        written = _Written(np.array([float(volts)]))
        message = self._exchange.format(volts=written)
        self._check_written(self._exchange, written)
        return message

    def _check_written(self, template: str, written: _Written) -> None:
        """Refuse what a template rounds to beyond the limits."""
        low, high = self._limits
        room = ROUNDING * (high - low)
        sent = np.array(written.written)
        beyond = np.flatnonzero(~((sent >= low - room) & (sent <= high + room)))
        if beyond.size:
            raise DeviceError(
                f"volts is written as {sent[beyond[0]]:g} V by {quoted(template)}: "
                f"{self._link.where} puts out {low:g} to {high:g} V"
            )

    def _check(self, volts: ArrayLike) -> None:
        if not self._open:
            raise DeviceError(f"{self._link.where} is closed")
        check_within(volts, self._limits, self._link.where)


class _Written:
    """Voltages [V] that a template writes one by one, and what it has written."""

    def __init__(self, volts: Array, usual: str = "") -> None:
        self._volts, self._usual = volts, usual
        self.written: list[float] = []

    def __format__(self, spec: str) -> str:
        texts = [format(one, spec or self._usual) for one in self._volts.tolist()]
        self.written += map(number, texts)
        return ",".join(texts)

    def __str__(self) -> str:
        return format(self, "")

    __repr__ = __str__


def _check_template(name: str, template: str, *allowed: str, needed: str | None = None) -> None:
    """Refuse a template with a field that it cannot have, or without the one that it needs."""
    known = (*allowed, needed) if needed else allowed
    values: dict[str, object] = dict.fromkeys(known, 1.0)
    values |= {"volts": _Written(np.ones(1)), "table": _Written(np.ones(1), ".6f"), "count": 1}
    problem = ""
    try:
        fields = [field for _, field, _, _ in Formatter().parse(template) if field is not None]
        template.format(**values).encode("ascii")
    except (ValueError, LookupError, TypeError, AttributeError) as error:
        fields, problem = [], f" ({error})"
    if problem or set(fields) - set(known) or (needed and needed not in fields):
        takes = ", ".join(f"{{{one}}}" for one in known) or "no field"
        raise ParameterError(name, f"{quoted(template)}{problem}", f"a text with {takes}")


def from_address(
    host: str | None, port: int | None, path: str, options: Mapping[str, str]
) -> ScpiDevice:
    """Connect to ``scpi://HOST:PORT?unit=um&limits=0..75V``."""
    if not host or port is None or path.strip("/"):
        raise ParameterError("device", "no host and port", FORM, verb="has")
    given = Options(FORM, options)
    unit, limits = given.text("unit"), given.span("limits", "voltage")
    exchange, timeout = given.text("exchange", EXCHANGE), given.value("timeout", "time", TIMEOUT)
    errors, identify = given.optional("errors"), given.text("identify", IDENTIFY)
    buffer = _buffer_of(given)
    given.done()
    return ScpiDevice(
        host,
        port,
        unit=unit,
        limits=limits,
        exchange=exchange,
        buffer=buffer,
        errors=errors,
        identify="" if identify == "none" else identify,
        timeout=timeout,
    )


def _buffer_of(given: Options) -> ScpiBuffer | None:
    upload = given.optional("upload")
    if upload is None:
        return None
    lowest, highest = given.span("rates", "frequency")
    clock = given.value("clock", "frequency", 0.0)
    chunk = given.count("chunk", 0)
    return ScpiBuffer(
        upload=upload,
        start=given.text("start"),
        fetch=given.text("fetch"),
        rates=Rates(lowest=lowest, highest=highest, clock=clock or None),
        memory=given.count("memory", MEMORY),
        done=given.text("done", "*OPC?"),
        append=given.optional("append"),
        chunk=chunk or None,
    )
