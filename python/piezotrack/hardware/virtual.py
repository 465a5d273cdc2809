"""A virtual stage behind a device: what is written for hardware runs on it."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np

from .. import _core
from .._support.arguments import expect, finite, not_negative
from .._support.arrays import signal_of
from ..errors import DeviceError, ParameterError
from ..identification.fitted.model_file import load
from ..stages.virtual import VirtualStage
from .device import Rates, Record
from .limits import check_within, ordered

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = ["VirtualDevice", "virtual_stage"]

RATES = Rates(lowest=0.1, highest=100e3)
MEMORY = 10_000_000
# Shortest time between two exchanges that is simulated [s].
INSTANT = 1e-6
# Longest time between two exchanges that is simulated, in steps of the stage.
LONGEST_IDLE = 2e6


class VirtualDevice:
    """A virtual stage as a device: it remembers, from table to table, where it has been.

    Parameters
    ----------
    stage : VirtualStage
        The stage between its amplifier and its sensor.
    limits : (float, float), optional
        Lowest and highest voltage [V]; default those of the amplifier.
    rates : Rates, optional
        Sampling rates; default 0.1 Hz to 100 kHz.
    memory : int, optional
        Longest table [samples].
    clock : callable, optional
        Time [s] for `exchange`, default that of the computer: the stage moves on in real time.

    Raises
    ------
    ParameterError
        `limits` is not given, and the amplifier has none.

    Examples
    --------
    >>> import piezotrack as pt
    >>> device = pt.hardware.VirtualDevice(pt.VirtualStage.xu_li_2010(seed=1))
    >>> log = pt.measure(device, "decaying:1Hz,0..75V", rate=1000.0)
    >>> log
    Dataset(12000 samples, 12 s at 1000 Hz, stroke 118 um, warm-up 500 samples)
    """

    def __init__(
        self,
        stage: VirtualStage,
        *,
        limits: tuple[float, float] | None = None,
        rates: Rates = RATES,
        memory: int = MEMORY,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        expect(
            "stage",
            stage,
            VirtualStage,
            "pt.VirtualStage, as VirtualStage.of makes it",
        )
        self._limits = ordered("limits", stage.amplifier.limits if limits is None else limits)
        self._rates, self._memory = rates, _core.as_count("memory", memory)
        self._clock = clock
        self._run, self._step = _core.VirtualRun(stage._core), stage.step
        self._at, self._held, self._open = clock(), 0.0, True

    @property
    def limits(self) -> tuple[float, float]:
        """Lowest and highest voltage [V]."""
        return self._limits

    @property
    def rates(self) -> Rates:
        """Sampling rates."""
        return self._rates

    @property
    def memory(self) -> int:
        """Longest table [samples]."""
        return self._memory

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of output and input."""
        return ("virtual amplifier", "virtual sensor")

    @property
    def held(self) -> float:
        """Voltage at the output [V]."""
        return self._held

    def play(self, volts: Array, rate: float, *, lead_in: float = 0.0) -> Record:
        """Play a table and record; as `Device.play`. It takes no time.

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
            Of n samples.

        Raises
        ------
        DeviceError
            A voltage is beyond the limits, or the table is longer than the memory.
        """
        table = signal_of("volts", volts)
        if table.size > self._memory:
            raise DeviceError(
                f"the table has {table.size} samples: the memory holds {self._memory}"
            )
        self._check(table)
        obtained = self._rates.nearest(rate)
        before = np.full(round(not_negative("lead_in", lead_in, "s") * obtained), table[0])
        _, y, _ = self._run.advance(np.concatenate([before, table]), 1.0 / obtained)
        self._at, self._held = self._clock(), float(table[-1])
        return Record(
            volts=table, displacement=y[before.size :], rate=obtained, channels=self.channels
        )

    def exchange(self, volts: float) -> float:
        """Read the displacement [m] now, and put out a voltage [V]; as `Exchanging.exchange`."""
        self._check(np.array([finite("volts", volts, "V")]))
        now = self._clock()
        # A stage that was left alone for longer has settled.
        idle = min(now - self._at, LONGEST_IDLE * self._step)
        _, y, _ = self._run.advance([volts], max(idle, INSTANT))
        self._at, self._held = now, float(volts)
        return float(y[0])

    def hold(self, volts: float) -> None:
        """Put out a constant voltage [V] from now on."""
        self.exchange(volts)

    def close(self) -> None:
        """Close it; what is asked of it afterwards is refused."""
        self._open = False

    def _check(self, volts: Array) -> None:
        if not self._open:
            raise DeviceError("the virtual device is closed")
        check_within(volts, self._limits, self.channels[0])


def from_address(
    host: str | None, port: int | None, path: str, options: Mapping[str, str]
) -> VirtualDevice:
    """Make the virtual stage of an address: ``virtual:`` or ``virtual:MODEL.json[?zero]``."""
    known = options in ({}, {"zero": ""}) if path else not options
    if host or port or not known:
        raise ParameterError(
            "device", "a virtual stage", "virtual:, virtual:MODEL.json or virtual:MODEL.json?zero"
        )
    stage, limits = virtual_stage(path or None, zeroed=bool(options))
    if path and limits is None:
        raise ParameterError(
            f"device {path}", "without the range of its drive", "a model identified from a record"
        )
    return VirtualDevice(stage, limits=limits)


def virtual_stage(
    path: str | Path | None, *, zeroed: bool = False
) -> tuple[VirtualStage, tuple[float, float] | None]:
    """Return the stage of a model file with the range of its drive [V], or that of the paper.

    Parameters
    ----------
    path : str, pathlib.Path or None
        Model file; None for the stage of Xu and Li 2010.
    zeroed : bool, optional
        Whether the sensor reads 0 at the beginning of the record identified, in place of what it
        read then; see `IdentifiedModel.zeroed`.

    Returns
    -------
    stage : VirtualStage
        The stage.
    limits : (float, float) or None
        Voltages that it was identified with [V]; None where its amplifier has limits.

    Raises
    ------
    ParameterError
        Its drive is no voltage.
    DataError
        The file is no model file.
    """
    if path is None:
        return VirtualStage.xu_li_2010(), None
    known = load(path)
    if known.drive_unit != "V":
        raise ParameterError(
            f"device {path}", f"driven in {known.drive_unit}", "a stage that a voltage drives"
        )
    return VirtualStage.of(known.zeroed() if zeroed else known), known.drive_range
