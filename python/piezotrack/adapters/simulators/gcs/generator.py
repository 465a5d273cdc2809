"""The wave generator and the data recorder of a virtual controller, on the servo clock."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from ...gcs.protocol import CONTROL_VALUE, POSITION, TARGET, VOLTAGE

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = ["Generator", "Recorder", "Samples"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Samples:
    """Samples of some servo cycles, all in the units of the controller (V, um)."""

    cycles: NDArray[np.int64]
    target: Array
    position: Array
    voltage: Array
    control: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Generator:
    """A wave table on its way out.

    Parameters
    ----------
    table : ndarray, shape (n,)
        Open-loop control values [V], or targets [um] with the servo on.
    rate : int
        Servo cycles for which a point lasts.
    start : int
        Servo cycle of the first point.
    repetitions : int
        How often the table goes out; 0 for ever.
    interpolated : bool
        Whether the output goes in straight lines from point to point.
    """

    table: Array
    rate: int
    start: int
    repetitions: int
    interpolated: bool

    @property
    def step(self) -> int:
        """Servo cycles in which the output stays the same."""
        return 1 if self.interpolated else self.rate

    @property
    def end(self) -> int | None:
        """Servo cycle at which it has ended."""
        if not self.repetitions:
            return None
        return self.start + self.repetitions * self.table.size * self.rate

    def at(self, cycles: NDArray[np.int64], before: float) -> Array:
        """Return the output at some servo cycles; `before` it begins, and the last one after."""
        since = cycles - self.start
        whole = since // self.rate
        out: Array = self.table[whole % self.table.size]
        if self.interpolated:
            following = self.table[(whole + 1) % self.table.size]
            out = out + (following - out) * (since % self.rate) / self.rate
        if self.end is not None:
            # The last point is followed by nothing to go to.
            out = np.where(cycles >= self.end - self.rate, self.table[-1], out)
        return np.where(since < 0, before, out)


@dataclass(kw_only=True, eq=False)
class Recorder:
    """A recording under way, or done.

    Parameters
    ----------
    start : int
        Servo cycle of the first sample.
    rate : int
        Servo cycles from sample to sample.
    points : int
        Samples after which it ends.
    """

    start: int
    rate: int
    points: int
    count: int = 0
    _parts: list[Samples] = field(default_factory=list)

    @property
    def active(self) -> bool:
        """Whether it goes on."""
        return self.count < self.points

    @property
    def end(self) -> int:
        """Servo cycle of its last sample, at which it has ended."""
        return self.start + (self.points - 1) * self.rate

    def take(self, seen: Samples) -> None:
        """Take those samples that are due."""
        since = seen.cycles - self.start
        due = np.flatnonzero((since >= 0) & (since % self.rate == 0))[: self.points - self.count]
        if due.size:
            self._parts.append(
                Samples(**{name: values[due] for name, values in vars(seen).items()})
            )
            self.count += due.size

    def column(self, option: int, first: int, count: int) -> Array:
        """Return `count` values of a record option from sample `first` on, which counts from 0."""
        name = {
            TARGET: "target",
            POSITION: "position",
            VOLTAGE: "voltage",
            CONTROL_VALUE: "control",
        }[option]
        whole = [getattr(part, name) for part in self._parts]
        values: Array = np.concatenate(whole) if whole else np.empty(0)
        return values[first : first + count]
