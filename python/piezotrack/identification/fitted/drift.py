"""Slow drift of a sensor's reading along one record."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from ... import _core
from ..._support.arguments import positive
from ..._support.arrays import LARGEST, SHORTEST
from ..._support.files.json_text import object_of
from ...errors import ParameterError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...data.dataset import Dataset

    Array = NDArray[np.float64]

__all__ = ["Drift", "drift_entry", "drift_of", "time_constant"]


# Instants of a record, on any clock [s].
LATEST = 1e15


@dataclass(frozen=True, kw_only=True)
class Drift:
    """A part of a reading that decays along a record and has nothing to do with its drive.

    As what is left of the creep under an earlier drive, or of the warmth of an amplifier, it
    belongs to the record, not to the stage::

        y = x + offset + amplitude (exp(-(t - begin) / time) - exp(-(end - begin) / time))

    It is 0 at the end of the window, so that the offset is what the sensor showed at rest last.

    Attributes
    ----------
    amplitude : float
        Of the part that decays, at `begin` [m].
    time : float
        Time constant [s]. Where it is much longer than the record, the drift is a straight line.
    begin, end : float
        First and last instant of the window that was fitted, on the record's own time axis [s].
    time_fitted : bool
        Whether the time constant was fitted too.
    deviation : float or None
        Standard deviation of `moved` [m], infinite where the record does not determine it; None
        where it is not known.
    """

    amplitude: float
    time: float
    begin: float
    end: float
    time_fitted: bool = True
    deviation: float | None = None

    @classmethod
    def _fading(cls, part: float, time: float, data: Dataset, *, time_fitted: bool) -> Self:
        """Of a part of the reading [m] that fades along the window of a record."""
        begin, end = float(data.t[0]), float(data.t[-1])
        amplitude = part / -float(np.expm1((begin - end) / time))
        return cls(amplitude=amplitude, time=time, begin=begin, end=end, time_fitted=time_fitted)

    @property
    def moved(self) -> float:
        """Change of the reading along the window [m]."""
        return self.amplitude * float(np.expm1((self.begin - self.end) / self.time))

    @property
    def slopes(self) -> dict[str, float]:
        """Change of `moved` with ``"drift"``, the amplitude, and ``"drift_time"`` if fitted."""
        lasting = (self.begin - self.end) / self.time
        slopes = {"drift": float(np.expm1(lasting))}
        if self.time_fitted:
            slopes["drift_time"] = -self.amplitude * float(np.exp(lasting)) * lasting / self.time
        return slopes

    def __str__(self) -> str:
        return (
            f"a drift of {1e6 * self.moved:.3g} um along the window fitted, "
            f"time constant {self.time:.3g} s"
        )

    def at(self, t: Array) -> Array:
        """Value at some instants of the record; before `begin` that at `begin`.

        Parameters
        ----------
        t : ndarray, shape (n,)
            Times of the record [s].

        Returns
        -------
        ndarray, shape (n,)
            Part of the reading [m].
        """
        x: Array = self.amplitude * self._shape(np.maximum(t, self.begin), self.begin, self.end)
        return x

    def _shape(self, t: Array, begin: float, end: float) -> Array:
        """Return a drift of 1 at `begin`, less its value at `end`."""
        last = np.exp((begin - end) / self.time)
        slow = end - begin < self.time
        # The difference of two numbers near 1 would be rounding.
        shape: Array = (
            last * np.expm1((end - t) / self.time)
            if slow
            else np.exp((begin - t) / self.time) - last
        )
        return shape

    def left_of(self, t: Array, rest: Array) -> Array:
        """Take the best drift with this time constant, and an offset, off a residual.

        Parameters
        ----------
        t : ndarray, shape (n,)
            Times of a record [s].
        rest : ndarray, shape (n,)
            What the stage leaves of its readings [m].

        Returns
        -------
        ndarray, shape (n,)
            What is left [m].
        """
        left = rest - self.of_another(t, rest, centred=True)
        left -= left.mean()
        return left

    def of_another(
        self,
        t: Array,
        rest: Array,
        *,
        centred: bool,
        left_out: NDArray[np.bool_] | None = None,
    ) -> Array:
        """Drift of another record of the same sensor, by least squares with this time constant.

        Parameters
        ----------
        t : ndarray, shape (n,)
            Times of that record [s].
        rest : ndarray, shape (n,)
            What the stage leaves of its readings [m].
        centred : bool
            Whether an offset is taken off besides.
        left_out : ndarray of bool, shape (n,), optional
            Readings that do not count.

        Returns
        -------
        ndarray, shape (n,)
            Part of its readings [m].
        """
        fading = self._shape(t, float(t[0]), float(t[-1]))
        counted, rest = (fading, rest) if left_out is None else (fading[~left_out], rest[~left_out])
        shape = counted - counted.mean() if centred else counted
        size = float(shape @ shape)
        found: Array = fading * (float(shape @ rest) / size if size > 0.0 else 0.0)
        return found


def time_constant(name: str, value: object) -> float:
    """Check the time constant of a drift [s]."""
    time = positive(name, value, "s")
    if time < SHORTEST:
        raise ParameterError(name, f"{time:g} s", f"{SHORTEST:g} s or more")
    return time


def drift_entry(drift: Drift | None) -> dict[str, Any]:
    """Entry of a drift in a file; none where there is no drift.

    Parameters
    ----------
    drift : Drift or None
        The drift.

    Returns
    -------
    dict
        Of numbers and texts only.
    """
    if drift is None:
        return {}
    entry = {
        "amplitude": {"value": drift.amplitude, "unit": "m"},
        "time": {"value": drift.time, "unit": "s", "free": drift.time_fitted},
        "begin": {"value": drift.begin, "unit": "s"},
        "end": {"value": drift.end, "unit": "s"},
    }
    if drift.deviation is not None and math.isfinite(drift.deviation):
        entry["moved"] = {"value": drift.moved, "deviation": drift.deviation, "unit": "m"}
    return {"drift": entry}


def drift_of(entry: Any) -> Drift | None:
    """Read a drift from a file.

    Parameters
    ----------
    entry : Any
        Its entry; None where there is none.

    Returns
    -------
    Drift or None
        The drift.

    Raises
    ------
    ParameterError
        The entry is not that of a drift.
    """
    if entry is None:
        return None
    drift = object_of("drift", entry)
    values = {
        name: _core.as_number(f"drift: {name}", object_of(f"drift: {name}", drift[name])["value"])
        for name in ("amplitude", "begin", "end")
    }
    time = object_of("drift: time", drift["time"])
    for name, most in (("amplitude", LARGEST), ("begin", LATEST), ("end", LATEST)):
        if not abs(values[name]) < most:
            raise ParameterError(f"drift: {name}", f"{values[name]:g}", f"a number below {most:g}")
    if values["begin"] > values["end"]:
        raise ParameterError(
            "drift: end",
            f"{values['end']:g} s",
            f"no instant before its begin, {values['begin']:g} s",
        )
    moved = object_of("drift: moved", drift.get("moved"))
    deviation = _core.as_number("drift: moved", moved["deviation"]) if moved else None
    if deviation is not None and not 0.0 <= deviation < LARGEST:
        expected = f"a deviation from 0 to {LARGEST:g}"
        raise ParameterError("drift: moved", f"{deviation:g}", expected)
    return Drift(
        deviation=deviation,
        time=time_constant("drift: time", time["value"]),
        # Files of before have no such entry.
        time_fitted=time.get("free", True) is True,
        **values,
    )
