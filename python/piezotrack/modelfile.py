"""Identified models as values and as JSON files."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from . import _core
from .dataset import Dataset
from .errors import DataError, ParameterError, PiezotrackError
from .files import replacing
from .kinds import Kind, kind_named, kind_of
from .models import Response

if TYPE_CHECKING:
    import os

    from numpy.typing import ArrayLike, NDArray

    from .inverse import Inverse

__all__ = ["IdentifiedModel", "Score", "load"]

FORMAT = "piezotrack-model"
SCHEMA_VERSION = 1


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
class IdentifiedModel:
    """A stage as identified, with what is needed to use it on a record.

    Attributes
    ----------
    model : DahlStage or BoucWenStage
        The stage.
    offset : float
        Displacement of the sensor where the stage is at rest without drive [m].
    offset_fitted : bool
        Whether the offset was fitted; a record of its own then gets an offset of its own.
    delay : float
        Time by which the displacement is late, in the amplifier or the reading of the sensor
        [s].
    scale_assumed : bool
        Whether the stiffness is nominal: only ratios of mass, damping, stiffness, piezo
        coefficient and b1 are then known.
    stroke : float
        Stroke of the record identified [m]; percentages refer to it.
    details : mapping
        Everything else that is kept in the file: fit, provenance.
    """

    model: Any
    offset: float
    offset_fitted: bool
    scale_assumed: bool
    stroke: float
    delay: float = 0.0
    details: Mapping[str, Any] = field(default_factory=dict, repr=False)

    @property
    def drive_range(self) -> tuple[float, float] | None:
        """Lowest and highest drive of the record identified, where the file tells them."""
        provenance = self.details.get("provenance", {})
        found = provenance.get("data", {}).get("drive_range")
        return (float(found[0]), float(found[1])) if found else None

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
        from .inverse import Inverse

        return Inverse(
            stage=self.model,
            offset=self.offset,
            delay=self.delay,
            playback=playback,
            settle=settle,
        )

    def displacement(
        self, u: ArrayLike, dt: float, *, hold: Literal["foh", "zoh"] = "foh"
    ) -> NDArray[np.float64]:
        """Displacement that the sensor shows under a drive, from rest.

        Parameters
        ----------
        u : array_like, shape (n,)
            Drive [V].
        dt : float
            Sampling interval [s].
        hold : {"foh", "zoh"}, optional
            As for `DahlStage.simulate`.

        Returns
        -------
        ndarray, shape (n,)
            Displacement with offset and delay [m].
        """
        run = self.model.simulate(u, dt, hold=hold)
        return _core.delayed(run.x, run.v, dt, self.delay) + self.offset

    def simulate(self, data: Dataset, *, offset: float | Literal["own"] = "own") -> Response:
        """Displacement that the model gives under the drive of a record.

        Parameters
        ----------
        data : Dataset
            The record. Its warm-up is simulated too, from rest.
        offset : float or "own", optional
            Added to the displacement [m]. ``"own"``: the one that fits the record's window
            best where an offset was fitted, none where not.

        Returns
        -------
        Response
            Motion in the window; offset and delay are in its displacement, `v`, `hysteresis`
            and `final` are the stage's own.
        """
        if not isinstance(data, Dataset):
            raise ParameterError(f"data is {type(data).__name__}: expected a Dataset")
        full, start = data.full, data.warmup
        run = self.model.simulate(full.u, data.dt, hold=data.hold)
        x = _core.delayed(run.x, run.v, data.dt, self.delay)[start:]
        return Response(
            t=data.t,
            u=data.u,
            x=x + self._shift(data, x, offset),
            v=run.v[start:],
            hysteresis=run.hysteresis[start:],
            final=run.final,
            substeps=run.substeps,
            difference=run.difference,
            well_posed=run.well_posed,
        )

    def score(self, data: Dataset, *, offset: float | Literal["own"] = "own") -> Score:
        """Deviation of the model from a record, in the record's window.

        Parameters
        ----------
        data : Dataset
            The record, e.g. one that was not fitted.
        offset : float or "own", optional
            As in `simulate`.

        Returns
        -------
        Score
            Percentages refer to the stroke of the record identified.
        """
        if not isinstance(data, Dataset):
            raise ParameterError(f"data is {type(data).__name__}: expected a Dataset")
        x = self.simulate(data, offset=0.0).x
        shift = self._shift(data, x, offset)
        error = data.y - x - shift
        return Score(
            rms=float(np.sqrt(np.mean(error**2))),
            max_error=float(np.abs(error).max()),
            stroke=self.stroke,
            offset=shift,
        )

    def _shift(
        self, data: Dataset, x: NDArray[np.float64], offset: float | Literal["own"]
    ) -> float:
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
        details, kind = dict(self.details), kind_of(self.model)
        found = details.pop("parameters", {})
        delay = dict(details.pop("delay", {}))
        parameters = {
            name: {"value": getattr(self.model, name), "unit": unit, "symbol": symbol}
            | dict(found.get(name, {}))
            for name, symbol, unit in kind.parameters
        }
        return {
            "format": FORMAT,
            "schema_version": SCHEMA_VERSION,
            "model": kind.name,
            "parameters": parameters,
            "scale_assumed": self.scale_assumed,
            "offset": {"value": self.offset, "unit": "m", "fitted": self.offset_fitted},
            "stroke": {"value": self.stroke, "unit": "m"},
            "delay": {"value": self.delay, "unit": "s"} | delay,
            **details,
        }

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


def write_document(path: str | os.PathLike[str], document: Mapping[str, Any]) -> Path:
    """Write a model file, whole or not at all; arguments and errors as of `save`."""
    import json

    text = json.dumps(_finite(document), indent=2, allow_nan=False)
    with replacing(path) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")
    return Path(path)


def load(path: str | os.PathLike[str]) -> IdentifiedModel:
    """Read a model file.

    Parameters
    ----------
    path : path-like
        A file that `IdentifiedModel.save` wrote.

    Returns
    -------
    IdentifiedModel
        The model, its numbers as they were saved, bit for bit.

    Raises
    ------
    DataError
        The file is missing, is not a model file, or was written by a newer version.

    Examples
    --------
    >>> import piezotrack as pt
    >>> model = pt.IdentifiedModel(
    ...     model=pt.DahlStage.xu_li_2010(),
    ...     offset=0.0,
    ...     offset_fitted=False,
    ...     scale_assumed=False,
    ...     stroke=119e-6,
    ... )
    >>> import os, tempfile
    >>> path = model.save(os.path.join(tempfile.mkdtemp(), "dahl.json"))
    >>> pt.load(path).model == model.model
    True
    """
    name, document = read_document(path)
    try:
        kind = kind_named(document.get("model"))
    except ParameterError as error:
        raise DataError(f"{name} holds a {str(error).replace(' is', '', 1)}") from None
    return _identified(name, document, kind)


def read_document(path: str | os.PathLike[str]) -> tuple[str, dict[str, Any]]:
    """Read a model file of any kind of stage.

    Parameters
    ----------
    path : path-like
        The file.

    Returns
    -------
    name : str
        Of the file, for messages.
    document : dict
        Its content.

    Raises
    ------
    DataError
        The file is missing, is not a model file, or was written by a newer version.
    """
    import json

    try:
        file = Path(path)
    except TypeError:
        raise ParameterError(f"path is {path!r}: expected the name of a file") from None
    try:
        document = json.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise DataError(f"{file.name}: {(error.strerror or str(error)).lower()}") from None
    except RecursionError:
        raise DataError(f"{file.name} is not a piezotrack model: it is nested too deep") from None
    except UnicodeDecodeError:
        raise DataError(f"{file.name} is not a text file: expected a model in JSON") from None
    except json.JSONDecodeError as error:
        raise DataError(f"{file.name}:{error.lineno}: not JSON: {error.msg}") from None
    except ValueError as error:
        raise DataError(f"{file.name} cannot be read: {error}") from None
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise DataError(f"{file.name} is not a piezotrack model: its 'format' is not '{FORMAT}'")
    version = document.get("schema_version")
    if version != SCHEMA_VERSION:
        raise DataError(
            f"{file.name} has schema_version {version!r}: this version of piezotrack reads "
            f"{SCHEMA_VERSION}"
        )
    return file.name, document


def _identified(name: str, document: dict[str, Any], kind: Kind) -> IdentifiedModel:
    own = {"format", "schema_version", "model", "parameters"}
    own |= {"scale_assumed", "offset", "stroke", "delay"}
    try:
        parameters = document["parameters"]
        values = {key: parameters[key]["value"] for key, _, _ in kind.parameters}
        details = {key: value for key, value in document.items() if key not in own}
        extra = {
            key: {k: v for k, v in entry.items() if k not in ("value", "unit", "symbol")}
            for key, entry in parameters.items()
        }
        for key, _, unit in kind.parameters:
            require_unit(key, parameters[key], unit)
        # Files of version 0.1.0 have no delay.
        late = document.get("delay", {"value": 0.0, "unit": "s"})
        delay = {k: v for k, v in late.items() if k not in ("value", "unit")}
        return IdentifiedModel(
            model=kind.stage(**values),
            offset=file_number("offset", document["offset"], "m"),
            offset_fitted=_core.as_truth("offset fitted", document["offset"]["fitted"]),
            scale_assumed=_core.as_truth("scale_assumed", document["scale_assumed"]),
            stroke=file_number("stroke", document["stroke"], "m", above=0.0),
            delay=file_number("delay", late, "s", least=0.0),
            details={"parameters": extra, "delay": delay, **details},
        )
    except KeyError as error:
        raise DataError(f"{name}: the entry {error} is missing") from None
    except (TypeError, AttributeError):
        raise DataError(f"{name}: an entry is not of the form that 'save' writes") from None
    except PiezotrackError as error:
        raise DataError(f"{name}: {error}") from None


def require_unit(name: str, entry: Mapping[str, Any], unit: str) -> None:
    if entry.get("unit") != unit:
        raise ParameterError(f"the unit of {name} is {entry.get('unit')!r}: expected {unit!r}")


def file_number(
    name: str,
    entry: Mapping[str, Any],
    unit: str,
    *,
    above: float = -math.inf,
    least: float = -math.inf,
) -> float:
    """Take a length or a time from the file."""
    require_unit(name, entry, unit)
    value = _core.as_number(name, entry["value"])
    if not math.isfinite(value) or value <= above or value < least:
        limit = " above 0" if above == 0.0 else ", 0 or above" if least == 0.0 else ""
        raise ParameterError(f"{name} is {value} {unit}: expected a finite number{limit}")
    return value


def _finite(value: Any) -> Any:
    """Replace what JSON cannot say, NaN and infinity, by null."""
    if isinstance(value, Mapping):
        return {key: _finite(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(entry) for entry in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
