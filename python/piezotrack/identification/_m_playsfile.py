"""Identified Prandtl-Ishlinskii stages as values and as JSON files."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

from .. import _core
from .model_file import FORMAT, SCHEMA_VERSION, entries_of, file_number, require_unit
from .identified import Identified
from ..stages.prandtl_ishlinskii import PARAMETERS, VECTORS, PlaysResponse, PlaysState, PrandtlIshlinskiiStage

if TYPE_CHECKING:
    from ..stages.inverse import Inverse

__all__ = ["IdentifiedPlays", "plays_of"]

MODEL = "prandtl-ishlinskii"


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
