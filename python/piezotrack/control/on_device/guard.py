"""Guard of a loop on a device: its readings and its clock are watched for faults."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from ...errors import DeviceError

if TYPE_CHECKING:
    from ..controller.session import RefusedReadings, Session

__all__ = ["Guard"]

# Readings in a row that are no measurements, and time without one [s], after which a loop ends.
MOST_INVALID, LONGEST_INVALID = 5, 0.1
# Equal readings in a row that show a sensor that stands still, while the drive moved by this
# share of its range.
MOST_EQUAL, MOVED = 20, 0.05
# Lateness of a tick with which a device counts as hung: intervals, and at least this time [s].
HUNG_INTERVALS, HUNG = 10.0, 0.25
# Share of late ticks over about a second, or some ticks, that is too much.
MOST_LATE, FEWEST = 0.5, 20.0


@dataclass
class Guard:
    """Ends a loop whose device or clock has failed.

    Attributes
    ----------
    session : Session
        The running controller, which counts the readings that it refuses.
    dt : float
        Its interval [s].
    span : float
        Range of the limits [V].
    """

    session: Session
    dt: float
    span: float
    _invalid: int = 0
    _late: float = 0.0
    _equal: int = 0
    _reading: float = math.nan
    _lowest: float = math.inf
    _highest: float = -math.inf
    _before: RefusedReadings | None = field(default=None)

    def reading(self, y: float, volts: float, t: float) -> None:
        """Take a reading [m] and the voltage [V] that the controller answered with at `t` s."""
        self._check_valid(y, t)
        if y != self._reading:
            self._reading, self._equal = y, 0
            self._lowest = self._highest = volts
            return
        self._equal += 1
        self._lowest, self._highest = min(self._lowest, volts), max(self._highest, volts)
        if self._equal >= MOST_EQUAL and self._highest - self._lowest > MOVED * self.span:
            raise DeviceError(
                f"the reading stands still at {1e6 * y:.6g} um since {self._equal} samples, at "
                f"{t:.4g} s, while the voltage moved by {self._highest - self._lowest:.3g} V: the "
                "sensor is stale, or the stage does not move"
            )

    def _check_valid(self, y: float, t: float) -> None:
        if self.session.last.measurement_valid:
            self._invalid, self._before = 0, self.session.refused
            return
        self._invalid += 1
        if self._invalid < max(MOST_INVALID, LONGEST_INVALID / self.dt):
            return
        before, now = self._before, self.session.refused
        counts = now if before is None else [a - b for a, b in zip(now, before, strict=True)]
        kinds = ("not finite", "outside of the span of the sensor", "too far from the last")
        what = " and ".join(f"{n} {kind}" for n, kind in zip(counts, kinds, strict=True) if n)
        raise DeviceError(
            f"{self._invalid} readings in a row are no measurements, at {t:.4g} s: {what}; the "
            f"last is {1e6 * y:.6g} um"
        )

    def tick(self, late: float, t: float) -> None:
        """Take how late a tick began [s], at `t` s."""
        if late > max(HUNG_INTERVALS * self.dt, HUNG):
            raise DeviceError(
                f"the exchange before {t:.4g} s took {1e3 * late:.4g} ms longer than an interval: "
                "the device hangs, or the computer does"
            )
        missed = 1.0 if late > self.dt else 0.0
        self._late += (missed - self._late) / max(FEWEST, 1.0 / self.dt)
        if self._late > MOST_LATE:
            raise DeviceError(
                f"most ticks up to {t:.4g} s began more than an interval late, the last by "
                f"{1e3 * late:.3g} ms: device or computer is too slow for an interval of "
                f"{1e3 * self.dt:.4g} ms"
            )
