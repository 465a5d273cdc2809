"""What stands below nidaqmx in place of National Instruments' driver: a virtual stage.

nidaqmx calls its driver through an interpreter; this one does what the driver's manual says of the
calls that are made, and refuses what a real device would: a second task on a channel, a buffer that
is not filled, readings of an acquisition that was not armed.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from nidaqmx._base_interpreter import BaseInterpreter
from nidaqmx.constants import AcquisitionType, ChannelType, RegenerationMode, UsageTypeAI
from nidaqmx.error_codes import DAQmxErrors
from nidaqmx.errors import DaqError, DaqFunctionNotSupportedError

if TYPE_CHECKING:
    import piezotrack as pt

# Numbers of attributes in NI-DAQmx.h.
CHANNELS, CHANNELS_TO_READ, RATE, TIMEBASE = 0x1273, 0x1823, 0x1344, 0x1303
DELAY, DELAY_UNITS, REGENERATION, CHANNEL_TYPE = 0x1317, 0x1304, 0x1453, 0x187F
LIMITS = {0x298C: 1.25e6, 0x298E: 0.0, 0x2997: 2.86e6, 0x2998: 0.0}
CLOCKED, PRODUCT = 0x2996, 0x631
INPUT_RANGE = (-10.0, 10.0)


@dataclass
class Task:
    """A task as the driver has it."""

    channel: str = ""
    kind: str = ""
    span: tuple[float, float] = (0.0, 0.0)
    rate: float = 0.0
    source: str = ""
    mode: int = 0
    count: int = 0
    trigger: str = ""
    regenerates: bool = True
    table: Any = None
    read: Any = None
    started: bool = False
    log: list[str] = field(default_factory=list)


class NiStandIn(BaseInterpreter):  # type: ignore[misc]
    """Interpreter of nidaqmx in front of a virtual device, with a sensor of 10 um/V on ai0."""

    def __init__(
        self,
        device: pt.hardware.VirtualDevice,
        *,
        timebase: float = 80e6,
        delay: float | None = 25e-9,
        metres_per_volt: float = 10e-6,
        fail: str = "",
        clocked: bool = True,
    ) -> None:
        self.clocked = clocked
        self.device, self.timebase, self.delay = device, timebase, delay
        self.scale, self.fail = metres_per_volt, fail
        self.tasks: dict[int, Task] = {}
        self.done: list[Task] = []
        self.calls: list[str] = []
        self._last = 0

    def _error(self, message: str) -> DaqError:
        return DaqError(message, DAQmxErrors.INVALID_ATTRIBUTE_VALUE.value)

    def _called(self, name: str) -> None:
        self.calls.append(name)
        if name == self.fail:
            raise DaqError("Device identifier is invalid.", DAQmxErrors.INVALID_DEVICE_ID.value)

    def create_task(self, session_name: str) -> tuple[int, bool]:  # noqa: ARG002
        self._last += 1
        self.tasks[self._last] = Task()
        return self._last, True

    def clear_task(self, task: int) -> None:
        self.done.append(self.tasks.pop(task))

    def internal_get_last_created_chan(self) -> str:
        raise DaqFunctionNotSupportedError("before 24Q3")

    def _create(self, task: int, channel: str, low: float, high: float, kind: str) -> None:
        self._called(f"create_{kind}")
        if channel not in ("Dev1/ao0", "Dev1/ai0"):
            raise self._error(f"Physical channel {channel} does not exist.\n\nTask Name: x")
        one = self.tasks[task]
        one.channel, one.span, one.kind = channel, (low, high), kind

    def create_ao_voltage_chan(
        self, task: Any, physical_channel: Any, _name: Any, min_val: Any, max_val: Any, *_: Any
    ) -> None:
        self._create(task, physical_channel, min_val, max_val, "ao")

    def create_ai_voltage_chan(
        self, task: Any, physical_channel: Any, _n: Any, _t: Any, low: Any, high: Any, *_: Any
    ) -> None:
        self._create(task, physical_channel, low, high, "ai")

    def cfg_samp_clk_timing(
        self, task: Any, rate: Any, source: Any, _edge: Any, sample_mode: Any, count: Any
    ) -> None:
        one = self.tasks[task]
        one.rate = self.timebase / round(self.timebase / rate)
        one.source, one.mode, one.count = source, sample_mode, count

    def cfg_dig_edge_start_trig(self, task: Any, trigger_source: Any, _edge: Any) -> None:
        self.tasks[task].trigger = trigger_source

    def get_timing_attribute_double(self, task: Any, attribute: Any) -> float:
        if attribute == RATE:
            return self.tasks[task].rate
        if attribute == TIMEBASE:
            return self.timebase
        if attribute == DELAY and self.delay is not None:
            return self.delay
        raise self._error(f"attribute {attribute:#x} is not supported")

    def set_timing_attribute_int32(self, _task: Any, attribute: Any, _value: Any) -> None:
        if attribute != DELAY_UNITS or self.delay is None:
            raise self._error(f"attribute {attribute:#x} is not supported")

    def set_write_attribute_int32(self, task: Any, attribute: Any, value: Any) -> None:
        assert attribute == REGENERATION
        self.tasks[task].regenerates = value == RegenerationMode.ALLOW_REGENERATION.value

    def get_device_attribute_double(self, device_name: Any, attribute: Any) -> float:
        self._called("device")
        assert device_name == "Dev1"
        return LIMITS.get(attribute, 0.0)

    def get_device_attribute_bool(self, _device: Any, attribute: Any) -> bool:
        assert attribute == CLOCKED
        return self.clocked

    def get_device_attribute_string(self, _device: Any, attribute: Any) -> str:
        assert attribute == PRODUCT
        return "PCIe-6363" if self.clocked else "USB-6008"

    def get_task_attribute_string(self, task: Any, attribute: Any) -> str:
        return self.tasks[task].channel if attribute == CHANNELS else f"task {task}"

    def get_read_attribute_string(self, task: Any, attribute: Any) -> str:
        assert attribute == CHANNELS_TO_READ
        return self.tasks[task].channel

    def get_chan_attribute_int32(self, task: Any, _channel: Any, attribute: Any) -> int:
        if attribute != CHANNEL_TYPE:
            return int(UsageTypeAI.VOLTAGE.value)
        ao = self.tasks[task].kind == "ao"
        return int((ChannelType.ANALOG_OUTPUT if ao else ChannelType.ANALOG_INPUT).value)

    def write_analog_f64(
        self, task: Any, count: Any, auto_start: Any, _timeout: Any, _layout: Any, data: Any
    ) -> int:
        self._called("write")
        state, volts = self.tasks[task], np.array(data, dtype=float).reshape(-1)
        assert volts.size == count
        if np.any((volts < state.span[0]) | (volts > state.span[1])):
            raise self._error("Requested value is not a supported value for this property.")
        if state.mode == AcquisitionType.FINITE.value:
            if count != state.count or state.regenerates:
                raise self._error("The buffer was not filled as the timing says.")
            state.table = volts
        elif auto_start or state.started:
            self.device.hold(float(volts[-1]))
        return int(count)

    def start_task(self, task: Any) -> None:
        state = self.tasks[task]
        self._called(f"start_{state.kind}")
        rivals = [t for t in self.tasks.values() if t.kind == state.kind and t.started]
        if rivals:
            raise self._error("The specified resource is reserved.")
        state.started = True
        if state.kind != "ao" or state.table is None:
            return
        record = self.device.play(state.table, state.rate)
        for other in self.tasks.values():
            armed = other.started and other.trigger == "/Dev1/ao/StartTrigger"
            if other.kind == "ai" and armed and other.source == "/Dev1/ao/SampleClock":
                other.read = np.clip(record.displacement / self.scale, *INPUT_RANGE)

    def stop_task(self, task: Any) -> None:
        self.tasks[task].started = False

    def wait_until_task_done(self, task: Any, _time_to_wait: Any) -> None:
        self._called("wait")
        assert self.tasks[task].started

    def read_analog_f64(
        self, task: Any, count: Any, _timeout: Any, _mode: Any, data: Any
    ) -> tuple[Any, int]:
        self._called("read")
        state = self.tasks[task]
        if state.mode != AcquisitionType.FINITE.value:
            data[0] = self.device.exchange(self.device.held) / self.scale
            return data, 1
        if state.read is None:
            raise self._error("Some or all of the samples requested have not yet been acquired.")
        data[:count] = state.read[:count]
        return data, count

    def get_read_attribute_uint32(self, _task: Any, _attribute: Any) -> int:
        return 1

    driver_version = (24, 0)


# What is not called is not there: nidaqmx asks for some 380 functions.
NiStandIn.__abstractmethods__ = frozenset()
