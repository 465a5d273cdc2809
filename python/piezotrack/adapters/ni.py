"""Data acquisition devices of National Instruments, through nidaqmx."""

from __future__ import annotations

import math
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import _core
from .._support.arguments import finite, not_negative, positive
from .._support.arrays import signal_of
from .._support.messages import quoted
from ..errors import DeviceError, ParameterError
from ..hardware.device import Rates, Record
from ..hardware.limits import check_within, ordered
from ..hardware.options import Options, required_package

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]

__all__ = ["NiDevice"]

# Samples that the driver buffers on the computer.
MEMORY = 10_000_000
# Input range of a multifunction device [V].
SENSOR = (-10.0, 10.0)
# Rate of the task that is asked for the timebase [Hz].
ANY_RATE = 1000.0
# Time beyond the length of a table after which the driver gives up [s].
PATIENCE = 10.0
FORM = "ni:DEV/ao0,DEV/ai0?scale=10um/V&limits=0..7.5V[&offset=0um][&sensor=-10..10V]"


class NiDevice:
    """An analogue output and an analogue input of one device, on one sample clock.

    A table is a finite generation without regeneration. The acquisition takes the sample clock of
    the output and waits for its start trigger, so sample k is read at the edge at which voltage k
    goes out; the driver's delay from that edge to the conversion is in the record.

    Parameters
    ----------
    output, input : str
        Physical channels, as ``"Dev1/ao0"`` and ``"Dev1/ai0"``.
    metres_per_volt : float
        Scale of the sensor at the input [m/V].
    limits : (float, float)
        Lowest and highest voltage at the output [V].
    offset : float, optional
        Displacement at 0 V of the sensor [m].
    sensor : (float, float), optional
        Range of the input [V]; what is at its ends or beyond is no reading.
    timebase : float, optional
        Clock that the sample clock is divided from [Hz]; default what the driver says, which is
        80 MHz, 100 MHz or 20 MHz on most devices.
    memory : int, optional
        Longest table [samples].

    Raises
    ------
    ParameterError
        A number is out of its range, or the channels are on two devices.
    DeviceError
        nidaqmx or its driver is not installed, or there is no such channel.

    Notes
    -----
    Tested against a stand-in for the driver, below nidaqmx: not run on hardware.

    Examples
    --------
    >>> import piezotrack as pt
    >>> scale = {"metres_per_volt": 10e-6, "limits": (0.0, 7.5)}
    >>> pt.hardware.NiDevice("Dev1/ao0", "Dev2/ai0", **scale)
    Traceback (most recent call last):
        ...
    piezotrack.errors.ParameterError: output is 'Dev1/ao0' and input 'Dev2/ai0': expected \
channels of one device, as Dev1/ao0 and Dev1/ai0, which share a clock
    """

    def __init__(
        self,
        output: str,
        input: str,
        *,
        metres_per_volt: float,
        limits: tuple[float, float],
        offset: float = 0.0,
        sensor: tuple[float, float] = SENSOR,
        timebase: float | None = None,
        memory: int = MEMORY,
    ) -> None:
        self._output, self._input = output, input
        device = output.partition("/")[0]
        if device != input.partition("/")[0] or "/" not in output or "/" not in input:
            raise ParameterError(
                "output",
                f"{quoted(output)} and input {quoted(input)}",
                "channels of one device, as Dev1/ao0 and Dev1/ai0, which share a clock",
            )
        self._device = device
        self._daq = required_package("nidaqmx", "ni", f"device {output}")
        self._scale = finite("metres_per_volt", metres_per_volt, "m/V")
        if self._scale == 0.0:
            raise ParameterError("metres_per_volt", "0", "the scale of the sensor, in m/V")
        self._offset = finite("offset", offset, "m")
        self._limits = ordered("limits", limits)
        self._sensor = ordered("sensor", sensor)
        self._memory = _core.as_count("memory", memory)
        self._single: tuple[Any, Any] | None = None
        self._open = True
        self._rates = self._ask_rates(timebase)

    @property
    def limits(self) -> tuple[float, float]:
        """Lowest and highest voltage [V]."""
        return self._limits

    @property
    def rates(self) -> Rates:
        """Sampling rates: whole fractions of the timebase."""
        return self._rates

    @property
    def memory(self) -> int:
        """Longest table [samples]."""
        return self._memory

    @property
    def channels(self) -> tuple[str, ...]:
        """Physical channels, output first."""
        return (self._output, self._input)

    def play(self, volts: Array, rate: float, *, lead_in: float = 0.0) -> Record:
        """Play a table and record on the same clock; as `Device.play`.

        Parameters
        ----------
        volts : ndarray, shape (n,)
            Table [V].
        rate : float
            Sampling rate [Hz].
        lead_in : float, optional
            How long the first voltage is played before the record begins [s].

        Returns
        -------
        Record
            Of n samples; NaN where the input is at an end of its range.

        Raises
        ------
        DeviceError
            A voltage is beyond the limits, or the driver refuses or fails.
        """
        table = signal_of("volts", volts)
        before = round(not_negative("lead_in", lead_in, "s") * rate)
        whole = np.concatenate([np.full(before, table[0]), table])
        if whole.size > self._memory:
            raise DeviceError(
                f"the table has {whole.size} samples: expected {self._memory} at most"
            )
        # A finite generation has two samples at least.
        whole = np.append(whole, whole[-1:]) if whole.size == 1 else whole
        self._check(whole)
        self._end_single()
        raw = np.empty(whole.size)
        with self._sentences("play"), ExitStack() as tasks:
            ao, ai = (tasks.enter_context(self._task(side)) for side in ("ao", "ai"))
            obtained, delay, notes = self._set_clocks(ao, ai, rate, whole.size)
            ao.write(whole, auto_start=False)
            ai.start()
            ao.start()
            reader = self._module("stream_readers").AnalogSingleChannelReader(ai.in_stream)
            count = reader.read_many_sample(raw, whole.size, whole.size / obtained + PATIENCE)
            ao.wait_until_done(PATIENCE)
            # Else the driver's end of the generation may take the output away from its last value.
            ao.stop()
        if count != whole.size:
            raise DeviceError(f"{self._input} read {count} samples: expected {whole.size}")
        return Record(
            volts=table,
            displacement=self._metres(raw)[before : before + table.size],
            rate=obtained,
            delay=delay,
            channels=self.channels,
            notes=notes,
        )

    def exchange(self, volts: float) -> float:
        """Read the displacement [m] and put out a voltage [V], timed by the computer."""
        self._check(finite("volts", volts, "V"))
        with self._sentences("exchange"):
            if self._single is None:
                self._single = self._task("ao"), self._task("ai")
                for task in self._single:
                    task.start()
            output, source = self._single
            read = float(source.read())
            output.write(float(volts))
        return float(self._metres(np.array([read]))[0])

    def hold(self, volts: float) -> None:
        """Put out a constant voltage [V] from now on."""
        self._check(finite("volts", volts, "V"))
        self._end_single()
        with self._sentences("hold"), self._task("ao") as task:
            task.write(float(volts), auto_start=True)

    def close(self) -> None:
        """Give the channels back; the output stays where it is."""
        self._end_single()
        self._open = False

    def _set_clocks(
        self, ao: Any, ai: Any, rate: float, count: int
    ) -> tuple[float, float, tuple[str, ...]]:
        """Put both tasks on the output's clock: rate obtained [Hz], delay [s] and notes."""
        known = self._module("constants")
        finite_many = known.AcquisitionType.FINITE
        ao.timing.cfg_samp_clk_timing(rate, sample_mode=finite_many, samps_per_chan=count)
        ao.out_stream.regen_mode = known.RegenerationMode.DONT_ALLOW_REGENERATION
        ai.timing.cfg_samp_clk_timing(
            rate,
            source=f"/{self._device}/ao/SampleClock",
            sample_mode=finite_many,
            samps_per_chan=count,
        )
        ai.triggers.start_trigger.cfg_dig_edge_start_trig(f"/{self._device}/ao/StartTrigger")
        obtained = float(ao.timing.samp_clk_rate)
        try:
            ai.timing.delay_from_samp_clk_delay_units = known.DigitalWidthUnits.SECONDS
            return obtained, float(ai.timing.delay_from_samp_clk_delay), ()
        except self._error:
            return obtained, 0.0, ("delay from clock to conversion: the driver does not say it",)

    def _task(self, side: str) -> Any:
        """Return a new task with the output (``"ao"``) or the input (``"ai"``)."""
        task = self._daq.Task()
        try:
            if side == "ao":
                low, high = self._limits
                task.ao_channels.add_ao_voltage_chan(self._output, min_val=low, max_val=high)
            else:
                low, high = self._sensor
                task.ai_channels.add_ai_voltage_chan(self._input, min_val=low, max_val=high)
        except BaseException:
            task.close()
            raise
        return task

    def _ask_rates(self, timebase: float | None) -> Rates:
        with self._sentences("connect"):
            device = self._module("system").Device(self._device)
            if not device.ao_samp_clk_supported:
                raise DeviceError(
                    f"{self._output} is on a {device.product_type}, which has no sample clock for "
                    "its outputs: expected a device that plays a table by its own clock"
                )
            lowest = max(float(device.ao_min_rate), float(device.ai_min_rate))
            highest = min(float(device.ao_max_rate), float(device.ai_max_single_chan_rate))
            if timebase is None:
                with self._task("ao") as task:
                    task.timing.cfg_samp_clk_timing(min(max(ANY_RATE, lowest), highest))
                    timebase = float(task.timing.samp_clk_timebase_rate)
            # The input has to be there too.
            self._task("ai").close()
        return Rates(
            lowest=max(lowest, 1e-3), highest=highest, clock=positive("timebase", timebase, "Hz")
        )

    def _metres(self, raw: Array) -> Array:
        low, high = self._sensor
        metres: Array = np.where(
            (raw > low) & (raw < high), self._offset + self._scale * raw, np.nan
        )
        return metres

    def _check(self, volts: ArrayLike) -> None:
        if not self._open:
            raise DeviceError(f"{self._output} is closed")
        check_within(volts, self._limits, self._output)

    def _end_single(self) -> None:
        """Close the tasks of `exchange`, which reserve the channels."""
        tasks, self._single = self._single, None
        with self._sentences("close"):
            for task in tasks or ():
                task.close()

    @property
    def _error(self) -> Any:
        return self._module("errors").Error

    def _module(self, name: str) -> Any:
        return required_package(f"nidaqmx.{name}", "ni", f"device {self._output}")

    @contextmanager
    def _sentences(self, doing: str) -> Iterator[None]:
        """Turn errors of the driver into one sentence."""
        try:
            yield
        except self._error as error:
            said = " ".join(str(error).split())
            raise DeviceError(f"{self._output}, {doing}: the driver says {quoted(said)}") from None


def from_address(
    host: str | None, port: int | None, path: str, options: Mapping[str, str]
) -> NiDevice:
    """Connect to ``ni:Dev1/ao0,Dev1/ai0?scale=10um/V&limits=0..7.5V``."""
    output, comma, source = path.partition(",")
    if host or port or not comma or "," in source:
        raise ParameterError("device", f"on {quoted(path)}", FORM)
    given = Options(FORM, options)
    scale, limits = given.ratio("scale"), given.span("limits", "voltage")
    offset = given.value("offset", "displacement", 0.0)
    sensor = given.span("sensor", "voltage", SENSOR)
    timebase = given.value("timebase", "frequency", math.nan)
    given.done()
    return NiDevice(
        output,
        source,
        metres_per_volt=scale,
        limits=limits,
        offset=offset,
        sensor=sensor,
        timebase=None if math.isnan(timebase) else timebase,
    )
