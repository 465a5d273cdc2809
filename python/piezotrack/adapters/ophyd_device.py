"""The ophyd-async device of `epics.ophyd_player`: a module of its own, as its base class is one."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING

import numpy as np
from bluesky.protocols import Flyable, Preparable
from ophyd_async.core import Array1D, AsyncStatus, StandardReadable, StrictEnum
from ophyd_async.epics.core import epics_signal_r, epics_signal_rw

from ..errors import DeviceError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["TablePlayer"]

# Time beyond the length of a table after which a play has failed [s].
PATIENCE = 10.0


class PlayStatus(StrictEnum):
    """Status of the last play, as the record ``Status`` has it."""

    IDLE = "idle"
    PLAYING = "playing"
    DONE = "done"
    FAILED = "failed"


class TablePlayer(StandardReadable, Preparable, Flyable):
    """A stage behind records of EPICS: prepare, kickoff and complete are a play.

    Parameters
    ----------
    prefix : str
        First part of the records' names.
    name : str
        Name of the device.

    Examples
    --------
    >>> TablePlayer("LAB:STAGE", "stage").play.source
    'ca://LAB:STAGE:Play'
    """

    def __init__(self, prefix: str, name: str) -> None:
        signals, place = Array1D[np.float64], f"ca://{prefix}"
        with self.add_children_as_readables():
            self.position = epics_signal_r(float, f"{place}:Position")
            self.table = epics_signal_rw(signals, f"{place}:Table")
            self.record = epics_signal_r(signals, f"{place}:Record")
        self.voltage = epics_signal_rw(float, f"{place}:Voltage")
        self.rate = epics_signal_rw(float, f"{place}:Rate")
        self.play = epics_signal_rw(bool, f"{place}:Play")
        self.status = epics_signal_r(PlayStatus, f"{place}:Status")
        # EPICS has longer strings as characters in an array.
        self.message = epics_signal_r(Array1D[np.uint8], f"{place}:Message")
        self._playing: asyncio.Task[None] | None = None
        super().__init__(name=name)

    @AsyncStatus.wrap
    async def prepare(self, value: tuple[ArrayLike, float]) -> None:
        """Send a table [V] and its rate [Hz]."""
        volts, rate = value
        await asyncio.gather(self.table.set(np.asarray(volts, float)), self.rate.set(rate))

    @AsyncStatus.wrap
    async def kickoff(self) -> None:
        """Begin to play the table."""
        table, rate = await asyncio.gather(self.table.get_value(), self.rate.get_value())
        self._playing = asyncio.create_task(self._play(PATIENCE + table.size / rate))

    @AsyncStatus.wrap
    async def complete(self) -> None:
        """Wait for the record.

        Raises
        ------
        DeviceError
            Nothing was begun, or the device says why it failed.
        """
        if self._playing is None:
            raise DeviceError(f"{self.name} plays nothing: expected kickoff before complete")
        playing, self._playing = self._playing, None
        await playing

    async def _play(self, patience: float) -> None:
        await self.play.set(True, timeout=patience)
        if await self.status.get_value() != PlayStatus.DONE:
            said = bytes(await self.message.get_value()).partition(b"\0")[0]
            raise DeviceError(f"{self.name}: {said.decode(errors='replace')}")
