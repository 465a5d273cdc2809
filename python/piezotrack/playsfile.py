"""Identified Prandtl-Ishlinskii stages as values and as JSON files."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from . import _core
from .dataset import Dataset
from .errors import DataError, ParameterError, PiezotrackError
from .modelfile import (
    FORMAT,
    SCHEMA_VERSION,
    Score,
    file_number,
    read_document,
    require_unit,
    write_document,
)
from .plays import PARAMETERS, VECTORS, PlaysResponse, PlaysState, PrandtlIshlinskiiStage

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import ArrayLike, NDArray

    from .dataset import Hold
    from .inverse import Inverse

    Array = NDArray[np.float64]

__all__ = ["IdentifiedPlays", "load_plays"]

MODEL = "prandtl-ishlinskii"


@dataclass(frozen=True, kw_only=True)
class IdentifiedPlays:
    """A Prandtl-Ishlinskii stage as identified, with what is needed to use it on a record.

    Attributes
    ----------
    model : PrandtlIshlinskiiStage
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

    model: PrandtlIshlinskiiStage
    offset: float
    offset_fitted: bool
    stroke: float
    details: Mapping[str, Any] = field(default_factory=dict, repr=False)

    def inverse(
        self,
        *,
        playback: Literal["table", "online"] = "table",
        settle: int = 1,
        initial: PlaysState | None = None,
    ) -> Inverse:
        """Feedforward with the offset of this model, as `PrandtlIshlinskiiStage.inverse`.

        Parameters
        ----------
        playback : {"table", "online"}, optional
            Whether one settled period is played again and again, or all is computed.
        settle : int, optional
            Periods before the one of the table.
        initial : PlaysState, optional
            What the stage remembers before the reference begins, such as the `final` of a
            response to the drive that settled it; at rest where it is not given.

        Returns
        -------
        Inverse
            For `Controller` or on its own. That of the bare stage is ``model.inverse()``.
        """
        from .inverse import Inverse

        return Inverse(
            stage=self.model,
            offset=self.offset,
            playback=playback,
            settle=settle,
            initial=initial,
        )

    def displacement(self, u: ArrayLike, dt: float, *, hold: Hold = "foh") -> Array:
        """Displacement that the sensor shows under a drive, from rest.

        Parameters
        ----------
        u : array_like, shape (n,)
            Drive [V].
        dt : float
            Sampling interval [s].
        hold : {"foh", "zoh"}, optional
            As for `PrandtlIshlinskiiStage.simulate`.

        Returns
        -------
        ndarray, shape (n,)
            Displacement with the offset [m].
        """
        return self.model.simulate(u, dt, hold=hold).x + self.offset

    def simulate(
        self,
        data: Dataset,
        *,
        offset: float | Literal["own"] = "own",
        initial: PlaysState | None = None,
    ) -> PlaysResponse:
        """Displacement that the model gives under the drive of a record.

        Parameters
        ----------
        data : Dataset
            The record. Its warm-up is simulated too.
        offset : float or "own", optional
            Added to the displacement [m]. ``"own"``: the one that fits the record's window
            best where an offset was fitted, none where not.
        initial : PlaysState, optional
            State at the first sample of the record and its warm-up, such as the `final` of the
            record before it; at rest where it is not given.

        Returns
        -------
        PlaysResponse
            Motion in the window; the offset is in its displacement.
        """
        if not isinstance(data, Dataset):
            raise ParameterError(f"data is {type(data).__name__}: expected a Dataset")
        start = data.warmup
        run = self.model.simulate(data.full.u, data.dt, hold=data.hold, initial=initial)
        x = run.x[start:]
        return PlaysResponse(
            t=data.t,
            u=data.u,
            x=x + self._shift(data, x, offset),
            hysteresis=run.hysteresis[start:],
            final=run.final,
        )

    def score(
        self,
        data: Dataset,
        *,
        offset: float | Literal["own"] = "own",
        initial: PlaysState | None = None,
    ) -> Score:
        """Deviation of the model from a record, in the record's window.

        Parameters
        ----------
        data : Dataset
            The record, e.g. one that was not fitted.
        offset : float or "own", optional
            As in `simulate`.
        initial : PlaysState, optional
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

    def document(self) -> dict[str, Any]:
        """Content of the JSON file.

        Returns
        -------
        dict
            Of numbers, texts, lists and dicts only.
        """
        return {
            "format": FORMAT,
            "schema_version": SCHEMA_VERSION,
            "model": MODEL,
            "parameters": {
                name: {"value": _plain(getattr(self.model, name)), "unit": unit, "symbol": symbol}
                for name, symbol, unit in PARAMETERS
            },
            "offset": {"value": self.offset, "unit": "m", "fitted": self.offset_fitted},
            "stroke": {"value": self.stroke, "unit": "m"},
            **dict(self.details),
        }

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the model to a JSON file that `load_plays` reads back bit for bit.

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
            Offset or stroke are not finite numbers.
        """
        # What load_plays would refuse is refused now, while the fit is still there.
        for name, value in {"offset": self.offset, "stroke": self.stroke}.items():
            if not math.isfinite(_core.as_number(name, value)):
                raise ParameterError(f"{name} is {value}: expected a finite number")
        return write_document(path, self.document())


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value


def load_plays(path: str | os.PathLike[str]) -> IdentifiedPlays:
    """Read a model file of a Prandtl-Ishlinskii stage.

    Parameters
    ----------
    path : path-like
        A file that `IdentifiedPlays.save` wrote.

    Returns
    -------
    IdentifiedPlays
        The model, its numbers as they were saved, bit for bit.

    Raises
    ------
    DataError
        The file is missing, is not of such a model, or was written by a newer version.
    """
    name, document = read_document(path)
    if document.get("model") != MODEL:
        raise DataError(f"{name} holds a model {document.get('model')!r}: expected {MODEL!r}")
    own = ("format", "schema_version", "model", "parameters", "offset", "stroke")
    try:
        parameters = document["parameters"]
        for key, _, unit in PARAMETERS:
            require_unit(key, parameters[key], unit)
        values = {key: parameters[key]["value"] for key, _, _ in PARAMETERS}
        values |= {key: tuple(values[key]) for key in VECTORS}
        return IdentifiedPlays(
            model=PrandtlIshlinskiiStage(**values),
            offset=file_number("offset", document["offset"], "m"),
            offset_fitted=_core.as_truth("offset fitted", document["offset"]["fitted"]),
            stroke=file_number("stroke", document["stroke"], "m", above=0.0),
            details={key: value for key, value in document.items() if key not in own},
        )
    except KeyError as error:
        raise DataError(f"{name}: the entry {error} is missing") from None
    except (TypeError, AttributeError):
        raise DataError(f"{name}: an entry is not of the form that 'save' writes") from None
    except PiezotrackError as error:
        raise DataError(f"{name}: {error}") from None
