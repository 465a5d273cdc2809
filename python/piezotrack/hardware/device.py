"""Protocol of a device: a table of voltages out, a record of displacements back."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, runtime_checkable

import numpy as np

from .._support.arguments import not_negative, positive
from .._support.arrays import signal_of
from ..errors import ParameterError, ShapeError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]

__all__ = ["Device", "Exchanging", "Rates", "Record"]


@dataclass(frozen=True, kw_only=True)
class Rates:
    """Sampling rates that a device can play at.

    Parameters
    ----------
    lowest, highest : float
        Range [Hz].
    clock : float, optional
        Clock of the device [Hz]: it plays at whole fractions of it only. By default any rate.

    Raises
    ------
    ParameterError
        A number is out of its range.

    Examples
    --------
    >>> import piezotrack as pt
    >>> rates = pt.hardware.Rates(lowest=1.0, highest=20e3, clock=20e3)
    >>> rates.nearest(3000.0)
    2857.1428571428573
    """

    lowest: float
    highest: float
    clock: float | None = None

    def __post_init__(self) -> None:
        for name in ("lowest", "highest"):
            object.__setattr__(self, name, positive(name, getattr(self, name), "Hz"))
        if self.highest < self.lowest:
            raise ParameterError(
                "highest", f"{self.highest:g} Hz", f"at least lowest, {self.lowest:g} Hz"
            )
        if self.clock is not None:
            clock = positive("clock", self.clock, "Hz")
            if clock < self.highest:
                raise ParameterError(
                    "clock", f"{clock:g} Hz", f"at least highest, {self.highest:g} Hz"
                )
            object.__setattr__(self, "clock", clock)

    def nearest(self, rate: float) -> float:
        """Return the rate at which a table that asks for `rate` is played.

        Parameters
        ----------
        rate : float
            Rate asked for [Hz].

        Returns
        -------
        float
            The obtainable rate nearest to it [Hz].

        Raises
        ------
        ParameterError
            It is out of the range.
        """
        rate = positive("rate", rate, "Hz")
        near = 1e-9 * rate
        if not self.lowest - near <= rate <= self.highest + near:
            raise ParameterError(
                "rate",
                f"{rate:g} Hz",
                f"{self.lowest:g} to {self.highest:g} Hz, the rates of the device",
            )
        if self.clock is None:
            return rate
        divisors = {math.floor(self.clock / rate), math.ceil(self.clock / rate)}
        return min((self.clock / one for one in divisors), key=lambda one: abs(one - rate))


@dataclass(frozen=True, kw_only=True, eq=False)
class Record:
    """Displacements that came back from a table that was played.

    Sample k of `displacement` is read on the clock edge at which sample k of `volts` goes out; each
    voltage is held until the next.

    Parameters
    ----------
    volts : array_like, shape (n,)
        Voltage that the device put out [V].
    displacement : array_like, shape (n,)
        Reading [m]; NaN where a sample was lost.
    rate : float
        Rate obtained [Hz].
    delay : float, optional
        Time from the edge of an output to the edge at which the input of the same sample is read
        [s], as far as the device knows it.
    channels : tuple of str, optional
        The channels used: output, input.
    notes : tuple of str, optional
        What a person should know.

    Raises
    ------
    ShapeError
        The arrays have different lengths.
    ParameterError
        A number is out of its range.
    """

    volts: Array
    displacement: Array
    rate: float
    delay: float = 0.0
    channels: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        volts: ArrayLike = self.volts
        object.__setattr__(self, "volts", signal_of("volts", volts))
        given = signal_of("displacement", self.displacement, finite=False)
        if given.size != self.volts.size:
            raise ShapeError(
                "displacement",
                f"{given.size} samples",
                f"{self.volts.size}, as many as were played",
            )
        object.__setattr__(self, "displacement", given)
        object.__setattr__(self, "rate", positive("rate", self.rate, "Hz"))
        object.__setattr__(self, "delay", not_negative("delay", self.delay, "s"))

    @property
    def lost(self) -> int:
        """Number of samples without a reading."""
        return int(np.count_nonzero(~np.isfinite(self.displacement)))


@runtime_checkable
class Device(Protocol):
    """An amplifier with a sensor, which plays a table and records on one clock."""

    @property
    def limits(self) -> tuple[float, float]:
        """Lowest and highest voltage that it may put out [V]: beyond them nothing is sent."""
        ...

    @property
    def rates(self) -> Rates:
        """Sampling rates of `play`."""
        ...

    @property
    def memory(self) -> int:
        """Longest table [samples]."""
        ...

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the channels, output first: for messages and records."""
        ...

    def play(self, volts: Array, rate: float, *, lead_in: float = 0.0) -> Record:
        """Play a whole table and record on the same clock.

        Parameters
        ----------
        volts : ndarray, shape (n,)
            Table [V], within `limits` and no longer than `memory`.
        rate : float
            One of the rates that ``rates.nearest`` returns [Hz].
        lead_in : float, optional
            How long the first voltage is held before the record begins [s].

        Returns
        -------
        Record
            Of n samples. The last voltage stays at the output.
        """
        ...

    def hold(self, volts: float) -> None:
        """Put out a constant voltage [V] from now on."""
        ...

    def close(self) -> None:
        """Give the connection back; the output stays where it is. A second call does nothing."""
        ...


@runtime_checkable
class Exchanging(Device, Protocol):
    """A device that can also be asked sample by sample."""

    def exchange(self, volts: float) -> float:
        """Read the displacement [m] and put out a voltage [V], in one round trip.

        NaN where there is no valid reading.
        """
        ...
