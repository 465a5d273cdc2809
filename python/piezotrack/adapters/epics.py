"""EPICS: an input/output controller that publishes a device, and an ophyd-async device for it."""

from __future__ import annotations

import asyncio
import os
import threading
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import _core
from .._support.messages import quoted
from ..errors import DeviceError, ParameterError, PiezotrackError
from ..hardware.device import Device, Exchanging
from ..hardware.measuring import check_device, check_table, play_table
from ..hardware.options import required_package

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable

__all__ = ["RECORDS", "ophyd_player", "serve_epics"]

RECORDS = ("Voltage", "Position", "Table", "Rate", "Play", "Record", "Status", "Message")
# Letters of a record's name that EPICS can hold, and of the longest prefix before a colon.
LONGEST_NAME = 60
LONGEST_PREFIX = LONGEST_NAME - 1 - max(map(len, RECORDS))
# Channel Access stays on this computer where nothing else is said.
LOCAL = {
    "EPICS_CAS_INTF_ADDR_LIST": "127.0.0.1",
    "EPICS_CAS_BEACON_ADDR_LIST": "127.0.0.1",
    "EPICS_CAS_AUTO_BEACON_ADDR_LIST": "NO",
}
# Longest table in the records [samples], unless the device holds less.
LONGEST = 100_000
# Time between two readings of the position [s].
PERIOD = 0.1
FIRST_RATE = 1000.0


def serve_epics(
    device: Device,
    prefix: str,
    *,
    longest: int = LONGEST,
    ready: Callable[[], None] | None = None,
) -> None:
    """Publish a device over EPICS Channel Access until Ctrl-C; once in a process.

    =================== =====================================================================
    ``PREFIX:Voltage``  puts out a constant voltage [V]; beyond the limits it is refused
    ``PREFIX:Position`` displacement [um], ten times a second, where the device can be asked
    ``PREFIX:Table``    voltages of the next play [V]
    ``PREFIX:Rate``     its rate [Hz]; after a play the one obtained
    ``PREFIX:Play``     plays the table; a put with callback ends when the record is there
    ``PREFIX:Record``   displacements of the last play [um], NaN where a sample was lost
    ``PREFIX:Status``   ``idle``, ``playing``, ``done`` or ``failed``
    ``PREFIX:Message``  the sentence of the last failure
    =================== =====================================================================

    From a failure of the device until it answers again, ``Voltage`` and ``Position`` have the
    severity ``INVALID``, ``Voltage`` is the last one that went out, and ``Message`` the first
    failure.

    Parameters
    ----------
    device : Device
        The device.
    prefix : str
        First part of the names.
    longest : int, optional
        Length of the records of table and displacements [samples].
    ready : callable, optional
        Called when the records are there.

    Raises
    ------
    DeviceError
        softioc is not installed: the extra ``epics``.
    ParameterError
        An argument cannot be used.

    Notes
    -----
    It listens on this computer only, unless ``EPICS_CAS_INTF_ADDR_LIST`` says otherwise. At the end
    the output stays where it is. ``piezotrack serve epics`` calls it.

    Examples
    --------
    >>> import piezotrack as pt
    >>> pt.hardware.serve_epics(pt.hardware.connect("virtual:"), "")
    Traceback (most recent call last):
        ...
    piezotrack.errors.ParameterError: prefix is '': expected the start of names, as LAB:STAGE
    """
    check_device(device)
    if not isinstance(prefix, str) or not prefix or not prefix.isascii() or " " in prefix:
        raise ParameterError("prefix", quoted(prefix), "the start of names, as LAB:STAGE")
    if len(prefix) > LONGEST_PREFIX:
        raise ParameterError(
            "prefix",
            f"{quoted(prefix)}, {len(prefix)} letters",
            f"{LONGEST_PREFIX} at most, as a name in EPICS has at most {LONGEST_NAME} with "
            f":{max(RECORDS, key=len)}",
        )
    longest = min(_core.as_count("longest", longest), device.memory)
    builder = required_package("softioc.builder", "epics", "serving EPICS")
    alarm = required_package("softioc.alarm", "epics", "serving EPICS")
    ioc = required_package("softioc.softioc", "epics", "serving EPICS")
    dispatcher = required_package(
        "softioc.asyncio_dispatcher", "epics", "serving EPICS"
    ).AsyncioDispatcher()
    for name, value in LOCAL.items():
        # An empty one means all addresses too.
        if not os.environ.get(name, "").strip():
            os.environ[name] = value
    records = _Records(device, prefix, longest, builder, alarm)
    builder.LoadDatabase()
    ioc.iocInit(dispatcher, enable_pva=False)
    dispatcher(records.read_position_on)
    if ready is not None:
        ready()
    try:
        threading.Event().wait()
    finally:
        dispatcher.close()


class _Records:
    """The records of a device, and what a put into them does."""

    def __init__(self, device: Device, prefix: str, longest: int, builder: Any, alarm: Any) -> None:
        self._device, self._lock, self._is_failing = device, asyncio.Lock(), False
        self._fine = {"severity": alarm.NO_ALARM, "alarm": alarm.NO_ALARM}
        self._invalid = {"severity": alarm.INVALID_ALARM, "alarm": alarm.COMM_ALARM}
        low, high = device.limits
        self._held = min(max(0.0, low), high)
        builder.SetDeviceName(prefix)
        volts = {"EGU": "V", "PREC": 6}
        self._voltage = builder.aOut(
            "Voltage",
            initial_value=self._held,
            LOPR=low,
            HOPR=high,
            validate=self._is_within,
            on_update=self._hold,
            # After a failure the voltage that is shown may be asked for again.
            always_update=True,
            blocking=True,
            **volts,
        )
        self._position = builder.aIn("Position", EGU="um", PREC=6)
        self._table = builder.WaveformOut(
            "Table", initial_value=np.full(1, self._held), length=longest, **volts
        )
        self._rate = builder.aOut("Rate", initial_value=FIRST_RATE, EGU="Hz", PREC=9)
        self._play = builder.Action(
            "Play", ZNAM="idle", ONAM="play", on_update=self._play_table, blocking=True
        )
        self._record = builder.WaveformIn(
            "Record", initial_value=np.zeros(1), length=longest, EGU="um", PREC=6
        )
        self._status = builder.mbbIn("Status", "idle", "playing", "done", ("failed", "MAJOR"))
        self._message = builder.longStringIn("Message", length=512, initial_value="")

    async def read_position_on(self) -> None:
        """Read the position again and again."""
        while isinstance(self._device, Exchanging):
            async with self._lock:
                await self._tried(self._read_position)
            await asyncio.sleep(PERIOD)

    def _is_within(self, _record: Any, volts: float) -> bool:
        low, high = self._device.limits
        if low <= volts <= high:
            return True
        self._message.set(f"Voltage is {volts:g} V: expected {low:g} to {high:g} V")
        return False

    async def _hold(self, volts: float) -> None:
        async with self._lock:
            if await self._tried(lambda: asyncio.to_thread(self._device.hold, volts)):
                self._held = volts
            self._show_voltage()

    def _show_voltage(self) -> None:
        """Publish the last voltage that went out, with an alarm while the device fails."""
        self._voltage.set(
            self._held, process=False, **(self._invalid if self._is_failing else self._fine)
        )

    async def _read_position(self) -> None:
        assert isinstance(self._device, Exchanging)
        x = await asyncio.to_thread(self._device.exchange, self._held)
        self._position.set(1e6 * x)

    async def _play_table(self, _value: int) -> None:
        async with self._lock:
            self._status.set(1)
            is_done = await self._tried(self._play_once)
            self._status.set(2 if is_done else 3)

    async def _play_once(self) -> None:
        table = np.array(self._table.get(), dtype=float)
        check_table(self._device, "Table", table)
        rate = self._device.rates.nearest(float(self._rate.get()))
        record = await asyncio.to_thread(play_table, self._device, table, rate)
        self._held = float(table[-1])
        self._rate.set(rate, process=False)
        self._show_voltage()
        self._record.set(1e6 * record.displacement)

    async def _tried(self, doing: Callable[[], Awaitable[None]]) -> bool:
        """Do something; where it fails, publish the sentence."""
        try:
            await doing()
        except DeviceError as error:
            self._set_failing(str(error))
            return False
        except PiezotrackError as error:
            self._message.set(str(error))
            return False
        self._set_failing("")
        return True

    def _set_failing(self, why: str) -> None:
        """Set or clear the alarms; what follows the first failure is not its reason."""
        if bool(why) == self._is_failing:
            return
        self._is_failing = bool(why)
        self._show_voltage()
        if why:
            self._message.set(why)
            self._position.set_alarm(**self._invalid)


def ophyd_player(prefix: str, name: str = "") -> Any:
    """Make an ophyd-async device of the records that `serve_epics` publishes.

    ``prepare((volts, rate))`` sends the table, ``kickoff()`` plays it, ``complete()`` ends when the
    record is there; ``read()`` has table, record and position.

    Parameters
    ----------
    prefix : str
        As of `serve_epics`.
    name : str, optional
        Name of the device.

    Returns
    -------
    ophyd_async.core.StandardReadable
        A device that is Preparable and Flyable: for a plan of Bluesky.

    Raises
    ------
    DeviceError
        ophyd-async is not installed: the extra ``epics``.

    Examples
    --------
    >>> import piezotrack as pt
    >>> pt.hardware.ophyd_player("LAB:STAGE", name="stage").name
    'stage'
    """
    required_package("ophyd_async.epics.core", "epics", "an ophyd-async device")
    from .ophyd_device import TablePlayer

    return TablePlayer(prefix, name)
