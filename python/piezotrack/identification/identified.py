"""What all identified stages have in common, and how far one is from a record."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Generic, Literal, TypeVar

import numpy as np

from .. import _core
from .._support.files import write_document
from ..data import diagnostics
from ..data.dataset import Dataset
from ..errors import ParameterError
from ..stages.base import Response
from ..stages.prandtl_ishlinskii import PlaysResponse
from ..stages.registry import kind_of

if TYPE_CHECKING:
    import os
    from collections.abc import Collection, Mapping
    from pathlib import Path

    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike, NDArray

    from ..data.dataset import Hold
    from ..stages.inverse import Inverse

    Array = NDArray[np.float64]

__all__ = ["Fitted", "Identified", "Score"]

# What a simulation of the stage gives.
R = TypeVar("R", Response, PlaysResponse)


@dataclass(frozen=True, kw_only=True)
class Score:
    """How far a simulated displacement is from a measured one.

    Attributes
    ----------
    rms, max_error : float
        Root mean square and largest absolute deviation [m].
    stroke : float
        Stroke that the percentages refer to [m].
    offset : float
        Offset added to the simulated displacement [m].
    """

    rms: float
    max_error: float
    stroke: float
    offset: float

    @property
    def rms_percent(self) -> float:
        """`rms` in per cent of the stroke."""
        return 100.0 * self.rms / self.stroke

    @property
    def max_percent(self) -> float:
        """`max_error` in per cent of the stroke."""
        return 100.0 * self.max_error / self.stroke

    def __str__(self) -> str:
        return (
            f"rms {1e6 * self.rms:.4g} um ({self.rms_percent:.3g} % of stroke), "
            f"max {1e6 * self.max_error:.4g} um ({self.max_percent:.3g} %)"
        )


@dataclass(frozen=True, kw_only=True)
class Identified(ABC, Generic[R]):
    """A stage as identified, with what is needed to use it on a record.

    Attributes
    ----------
    model : stage
        The stage.
    offset : float
        Displacement of the sensor where the stage is at rest without drive [m].
    offset_fitted : bool
        Whether the offset was fitted; a record of its own then gets an offset of its own.
    stroke : float
        Stroke of the record identified [m]; percentages refer to it.
    details : mapping
        Everything else that is kept in the file: fit, provenance.
    """

    model: Any
    offset: float
    offset_fitted: bool
    stroke: float
    details: Mapping[str, Any] = field(default_factory=dict, repr=False)

    @property
    def delay(self) -> float:
        """Time by which the displacement is late, besides the stage's own dynamics [s]."""
        return 0.0

    @property
    def drive_range(self) -> tuple[float, float] | None:
        """Lowest and highest drive of the record identified, where the file tells them."""
        found = self._record.get("drive_range")
        return (float(found[0]), float(found[1])) if found else None

    @property
    def _record(self) -> Mapping[str, Any]:
        """What the file tells of the record identified."""
        found: Mapping[str, Any] = self.details.get("provenance", {}).get("data", {})
        return found

    @property
    @abstractmethod
    def free_count(self) -> int | None:
        """Number of values fitted, the offset with them; None where the file does not tell."""

    def fitted_on(self, data: Dataset) -> bool:
        """Tell whether a record is the one identified, sample by sample.

        Parameters
        ----------
        data : Dataset
            The record.

        Returns
        -------
        bool
            Whether window, warm-up and all numbers are the same.
        """
        return self._record.get("sha256") == data.sha256

    def window_on(self, data: Dataset) -> tuple[float, float] | None:
        """Tell which seconds of a record were fitted, as far as its name tells.

        Parameters
        ----------
        data : Dataset
            The record.

        Returns
        -------
        (float, float) or None
            The window [s] where `data` has a part of it; None where not.
        """
        window = self._record.get("window_s")
        same = data.source is not None and self._record.get("source") == data.source
        if not same or not window or window[0] > data.t[-1] or window[1] < data.t[0]:
            return None
        return float(window[0]), float(window[1])

    def inverse(
        self, *, playback: Literal["table", "online"] = "table", settle: int = 1
    ) -> Inverse:
        """Feedforward with the offset and the delay of this model, as `Inverse` describes.

        Parameters
        ----------
        playback : {"table", "online"}, optional
            Whether one settled period is played again and again, or all is computed.
        settle : int, optional
            Periods before the one of the table.

        Returns
        -------
        Inverse
            For `Controller` or on its own. That of the bare stage is ``model.inverse()``.
        """
        bare: Inverse = self.model.inverse(playback=playback, settle=settle)
        return replace(bare, offset=self.offset, delay=self.delay)

    def displacement(self, u: ArrayLike, dt: float, *, hold: Hold = "foh") -> Array:
        """Displacement that the sensor shows under a drive, from rest.

        Parameters
        ----------
        u : array_like, shape (n,)
            Drive [V].
        dt : float
            Sampling interval [s].
        hold : {"foh", "zoh"}, optional
            As for `simulate` of the stage.

        Returns
        -------
        ndarray, shape (n,)
            Displacement with offset and delay [m].
        """
        return self._shown(self.model.simulate(u, dt, hold=hold)) + self.offset

    def _shown(self, run: R) -> Array:
        """Displacement as late as the sensor shows it [m]."""
        return run.x

    def simulate(
        self, data: Dataset, *, offset: float | Literal["own"] = "own", initial: Any = None
    ) -> R:
        """Displacement that the model gives under the drive of a record.

        Parameters
        ----------
        data : Dataset
            The record. Its warm-up is simulated too.
        offset : float or "own", optional
            Added to the displacement [m]. ``"own"``: the one that fits the record's window
            best where an offset was fitted, none where not.
        initial : state, optional
            State at the first sample of the record and its warm-up, such as the `final` of the
            record before it; at rest where it is not given.

        Returns
        -------
        Response or PlaysResponse
            Motion in the window; offset and delay are in its displacement, the rest is the
            stage's own.
        """
        if not isinstance(data, Dataset):
            raise ParameterError(f"data is {type(data).__name__}: expected a Dataset")
        start = data.warmup
        run = self.model.simulate(data.full.u, data.dt, hold=data.hold, initial=initial)
        x = self._shown(run)[start:]
        signals = {
            one.name: value[start:]
            for one in fields(run)
            if isinstance(value := getattr(run, one.name), np.ndarray)
        }
        signals |= {"t": data.t, "u": data.u, "x": x + self._shift(data, x, offset)}
        windowed: R = replace(run, **signals)
        return windowed

    def score(
        self, data: Dataset, *, offset: float | Literal["own"] = "own", initial: Any = None
    ) -> Score:
        """Deviation of the model from a record, in the record's window.

        Parameters
        ----------
        data : Dataset
            The record, e.g. one that was not fitted.
        offset : float or "own", optional
            As in `simulate`.
        initial : state, optional
            As in `simulate`.

        Returns
        -------
        Score
            Percentages refer to the stroke of the record identified.
        """
        x = self.simulate(data, offset=0.0, initial=initial).x
        shift = self._shift(data, x, offset)
        error = data.y - x - shift
        return Score(
            rms=float(np.sqrt(np.mean(error**2))),
            max_error=float(np.abs(error).max()),
            stroke=self.stroke,
            offset=shift,
        )

    def _shift(self, data: Dataset, x: Array, offset: float | Literal["own"]) -> float:
        """Offset to add to a simulated displacement [m]."""
        if offset != "own":
            shift = _core.as_number("offset", offset)
            if not math.isfinite(shift):
                raise ParameterError(f"offset is {shift}: expected a finite number or 'own'")
            return shift
        return float(np.mean(data.y - x)) if self.offset_fitted else 0.0

    @abstractmethod
    def document(self) -> dict[str, Any]:
        """Content of the JSON file.

        Returns
        -------
        dict
            Of numbers, texts, lists and dicts only.
        """

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the model to a JSON file that `load` reads back bit for bit.

        Parameters
        ----------
        path : path-like
            The file. It is written beside and renamed, so a file that was there stays whole
            until then.

        Returns
        -------
        pathlib.Path
            The file written.

        Raises
        ------
        DataError
            The file cannot be written.
        ParameterError
            Offset, stroke or delay are not finite numbers.
        """
        # What load would refuse is refused now, while the fit is still there.
        numbers = {"offset": self.offset, "stroke": self.stroke, "delay": self.delay}
        for name, value in numbers.items():
            if not math.isfinite(_core.as_number(name, value)):
                raise ParameterError(f"{name} is {value}: expected a finite number")
        return write_document(path, self.document())


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Fitted(Identified[R]):
    """What a fit found, with the record that it was found on.

    Attributes
    ----------
    data : Dataset
        The record.
    cost : float
        RMS deviation in the window [m], equation (16) of Xu and Li 2010.
    """

    data: Dataset
    cost: float

    def __repr__(self) -> str:
        return (
            f"<Identification of a {kind_of(self.model).title} stage: {self.cost_um:.4g} um rms, "
            f"{self.cost_percent:.3g} % of stroke; see summary()>"
        )

    @property
    def cost_um(self) -> float:
        """The cost [um]."""
        return 1e6 * self.cost

    @property
    def cost_percent(self) -> float:
        """The cost in per cent of the stroke."""
        return 100.0 * self.cost / self.stroke

    @cached_property
    def fitted(self) -> Score:
        """Score on the record that was identified, converged in the sub-steps."""
        return self.score(self.data, offset=self.offset)

    @property
    @abstractmethod
    def notes(self) -> list[str]:
        """What a careful reader should know before using the result."""

    @abstractmethod
    def summary(self) -> str:
        """Table of the result.

        Returns
        -------
        str
            Several lines: the cost, then the parameters.
        """

    def _remarks(self, held: Collection[str]) -> list[str]:
        """Say what is odd about the record, and what the fit leaves of its loop."""
        notes = diagnostics.record_warnings(self.data)
        if self.cost_percent > 5.0:
            notes.append(
                f"the model does not follow this record: {self.cost_percent:.3g} % of stroke remain"
            )
        if self.cost_percent > diagnostics.REMAINS:
            notes += diagnostics.fit_warnings(self.data, self._followed, self.cost_percent, held)
        return notes

    @cached_property
    def _followed(self) -> Array:
        """Displacement of the model on the record [m]."""
        return self.simulate(self.data, offset=self.offset).x

    def plot(self, data: Dataset | None = None) -> Figure:
        """Loop, displacement with its error over time, and convergence where a swarm searched.

        Parameters
        ----------
        data : Dataset, optional
            Another record to show the model on.

        Returns
        -------
        matplotlib.figure.Figure
            Not yet shown or saved.
        """
        from .plot import plot_identification

        return plot_identification(self, data)
