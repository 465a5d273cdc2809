"""Identified models as values and as JSON files, with a sentence for what is wrong in a file."""

from __future__ import annotations

import math
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from .. import _core
from ..errors import DataError, ParameterError, PiezotrackError
from ..stages.base import Response
from ..stages.prandtl_ishlinskii import (
    PARAMETERS,
    VECTORS,
    PlaysResponse,
    PlaysState,
    PrandtlIshlinskiiStage,
)
from ..stages.registry import Kind, kind_named, kind_of
from .identified import Identified

if TYPE_CHECKING:
    import os
    from collections.abc import Iterator, Mapping

    import numpy as np
    from numpy.typing import NDArray

    from ..data.dataset import Dataset
    from ..stages.inverse import Inverse

__all__ = ["IdentifiedModel", "IdentifiedPlays", "load", "provenance"]

FORMAT = "piezotrack-model"
SCHEMA_VERSION = 1
MODEL = "prandtl-ishlinskii"


@dataclass(frozen=True, kw_only=True)
class IdentifiedModel(Identified[Response]):
    """A stage as identified, with what is needed to use it on a record.

    Attributes
    ----------
    model : DahlStage or BoucWenStage
        The stage.
    delay : float
        Time by which the displacement is late, in the amplifier or the reading of the sensor
        [s].
    scale_assumed : bool
        Whether the stiffness is nominal: only ratios of mass, damping, stiffness, piezo
        coefficient and b1 are then known.
    """

    scale_assumed: bool
    delay: float = 0.0

    @property
    def free_count(self) -> int | None:
        """Number of values fitted, the offset with them; None where the file does not tell."""
        found = self.details.get("parameters")
        if not found:
            return None
        free = [entry.get("free", False) for entry in found.values()]
        late = self.details.get("delay", {}).get("free", False)
        return sum(map(bool, [*free, late, self.offset_fitted]))

    def _shown(self, run: Response) -> NDArray[np.float64]:
        dt = float(run.t[1]) if run.t.size > 1 else 1.0
        return _core.delayed(run.x, run.v, dt, self.delay)

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


def load(path: str | os.PathLike[str]) -> IdentifiedModel | IdentifiedPlays:
    """Read a model file of any kind of stage.

    Parameters
    ----------
    path : path-like
        A file that `save` of an identified model wrote.

    Returns
    -------
    IdentifiedModel or IdentifiedPlays
        The model, its numbers as they were saved, bit for bit; the latter where it is a
        Prandtl-Ishlinskii stage.

    Raises
    ------
    DataError
        The file is missing, is not a model file, or was written by a newer version.

    Examples
    --------
    >>> import piezotrack as pt
    >>> model = pt.identification.IdentifiedModel(
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
    return _identified(name, document, kind) if kind.searched else plays_of(name, document)


def _identified(name: str, document: dict[str, Any], kind: Kind) -> IdentifiedModel:
    own = {"format", "schema_version", "model", "parameters"}
    own |= {"scale_assumed", "offset", "stroke", "delay"}
    with entries_of(name):
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


@dataclass(frozen=True, kw_only=True)
class IdentifiedPlays(Identified[PlaysResponse]):
    """A Prandtl-Ishlinskii stage as identified, with what is needed to use it on a record.

    Attributes
    ----------
    model : PrandtlIshlinskiiStage
        The stage.
    """

    @property
    def free_count(self) -> int:
        """Number of values fitted, the offset with them.

        Thresholds, corners and the time constants of the creep are chosen beforehand and do not
        count; a weight that came out as 0 does.
        """
        model = self.model
        vectors = len(model.weights) + len(model.bends) + len(model.creep_shares)
        dynamics = (model.time_constant, model.frequency, model.damping_ratio)
        lumped = sum(value is not None for value in dynamics)
        return 1 + vectors + lumped + self.offset_fitted

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
        inverse = super().inverse(playback=playback, settle=settle)
        return replace(inverse, initial=initial)

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


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value


def plays_of(name: str, document: dict[str, Any]) -> IdentifiedPlays:
    """Take a model from the content of the file `name`; errors as of `load`."""
    own = ("format", "schema_version", "model", "parameters", "offset", "stroke")
    with entries_of(name):
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


@contextmanager
def entries_of(name: str) -> Iterator[None]:
    """Say of which file an entry is missing or not as `save` writes it."""
    try:
        yield
    except KeyError as error:
        raise DataError(f"{name}: the entry {error} is missing") from None
    except (TypeError, AttributeError):
        raise DataError(f"{name}: an entry is not of the form that 'save' writes") from None
    except PiezotrackError as error:
        raise DataError(f"{name}: {error}") from None


def provenance(data: Dataset, **settings: Any) -> dict[str, Any]:
    """Say in a file which version and which record a model comes from, and how."""
    return {
        "package": "piezotrack",
        "version": _core.__version__,
        **settings,
        "data": {
            "source": data.source,
            "sha256": data.sha256,
            "samples": len(data),
            "warmup_samples": data.warmup,
            "window_s": [float(data.t[0]), float(data.t[-1])],
            "dt_s": data.dt,
            "drive_range": [float(data.full.u.min()), float(data.full.u.max())],
            "drive_unit": data.drive_unit,
            "hold": data.hold,
        },
    }


def require_unit(name: str, entry: Mapping[str, Any], unit: str) -> None:
    """Refuse an entry that is in another unit than the one that is written."""
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
