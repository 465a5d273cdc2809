"""Slow drift of a sensor's reading along one record."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from .. import _core
from .._support.arguments import positive
from .._support.json_text import object_of
from .._support.messages import quoted
from ..errors import ParameterError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..data.dataset import Dataset
    from .asked import Asked

    Array = NDArray[np.float64]

__all__ = ["Drift", "asked_drift", "drift_entry", "drift_of", "drift_of_asked"]


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
    """

    amplitude: float
    time: float
    begin: float
    end: float

    @classmethod
    def _falling(cls, fallen: float, time: float, data: Dataset) -> Self:
        """Of a part of the reading that fades along the window of a record [m]."""
        begin, end = float(data.t[0]), float(data.t[-1])
        amplitude = fallen / -float(np.expm1((begin - end) / time))
        return cls(amplitude=amplitude, time=time, begin=begin, end=end)

    @property
    def moved(self) -> float:
        """Change of the reading along the window [m]."""
        return self.amplitude * float(np.expm1((self.begin - self.end) / self.time))

    def __str__(self) -> str:
        return (
            f"a drift of {1e6 * self.moved:.3g} um along the window fitted, "
            f"time constant {self.time:.3g} s"
        )

    def at(self, t: Array) -> Array:
        """Value at some instants of the record.

        Parameters
        ----------
        t : ndarray, shape (n,)
            Times of the record [s].

        Returns
        -------
        ndarray, shape (n,)
            Part of the reading [m].
        """
        last = np.exp((self.begin - self.end) / self.time)
        x: Array = self.amplitude * (np.exp((self.begin - np.asarray(t)) / self.time) - last)
        return x

    def of_another(self, t: Array, rest: Array, *, centred: bool) -> Array:
        """Drift of another record of the same sensor, by least squares with this time constant.

        Parameters
        ----------
        t : ndarray, shape (n,)
            Times of that record [s].
        rest : ndarray, shape (n,)
            What the stage leaves of its readings [m].
        centred : bool
            Whether an offset is taken off besides.

        Returns
        -------
        ndarray, shape (n,)
            Part of its readings [m].
        """
        fading = np.exp((t[0] - t) / self.time) - np.exp((t[0] - t[-1]) / self.time)
        shape = fading - fading.mean() if centred else fading
        size = float(shape @ shape)
        found: Array = fading * (float(shape @ rest) / size if size > 0.0 else 0.0)
        return found


def asked_drift(drift: object) -> float | None:
    """Check what is asked of the drift of a record.

    Parameters
    ----------
    drift : object
        Argument of the caller: True or ``"auto"`` for what the record shows, False for none, or
        a time constant [s].

    Returns
    -------
    float or None
        The time constant [s]; 0 for none, None for what the record shows.

    Raises
    ------
    ParameterError
        It is none of these.
    """
    if drift is None or drift is True or (isinstance(drift, str) and drift == "auto"):
        return None
    return 0.0 if drift is False else positive("drift", drift, "s")


def drift_of_asked(one: Asked, *, searched: bool) -> float | None:
    """Time constant of the drift of a record, as the core takes it.

    Parameters
    ----------
    one : Asked
        The record, and what is asked of it.
    searched : bool
        Whether the model is searched: such a one has no drift where nobody asks for it.

    Returns
    -------
    float or None
        As for `asked_drift`.

    Raises
    ------
    ParameterError
        The drift is none of what `identify` takes, or is asked for without an offset.
    """
    given = one.drift not in (None, False)
    if given and not one.offset:
        raise ParameterError(
            f"drift is {quoted(one.drift)}: expected none with offset=False, a sensor that "
            "shows what there is"
        )
    if not one.offset or (searched and not given):
        return 0.0
    return asked_drift(one.drift)


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
    return {
        "drift": {
            "amplitude": {"value": drift.amplitude, "unit": "m"},
            "time": {"value": drift.time, "unit": "s"},
            "begin": {"value": drift.begin, "unit": "s"},
            "end": {"value": drift.end, "unit": "s"},
        }
    }


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
    found = object_of("drift", entry)
    values = {
        name: _core.as_number(f"drift: {name}", object_of(f"drift: {name}", found[name])["value"])
        for name in ("amplitude", "begin", "end")
    }
    time = object_of("drift: time", found["time"])["value"]
    return Drift(time=positive("drift: time", time, "s"), **values)
