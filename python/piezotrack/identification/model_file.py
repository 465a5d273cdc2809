"""Identified models as values and as JSON files."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from .. import _core
from .model_file import FORMAT, SCHEMA_VERSION, entries_of, file_number, read_document, require_unit
from ..errors import DataError, ParameterError
from .identified import Identified
from ..stages.registry import Kind, kind_named, kind_of
from ..stages.base import Response
from .model_file import IdentifiedPlays, plays_of

if TYPE_CHECKING:
    import os

    import numpy as np
    from numpy.typing import NDArray

__all__ = ["IdentifiedModel", "load"]


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
