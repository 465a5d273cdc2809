"""Names, parameters and states of the stage models, as the core lists them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

from .. import _core

__all__ = ["LISTED", "ModelInfo", "Parameter"]

# Parameters that do not describe hysteresis.
MECHANICS = ("mass", "damping", "stiffness", "piezo_coefficient")


class Parameter(NamedTuple):
    """A parameter of a model, or a part of its state, as the core describes it.

    Attributes
    ----------
    name, symbol, unit : str
        Name in both languages, symbol in the literature, SI unit.
    carries_force : bool
        Whether it has the dimension of force: it scales with the stiffness.
    default : float or None
        Value if the caller gives none.
    held : str or None
        Why it is never searched; None if it can be.
    is_list, is_optional : bool
        Whether it is a list of numbers; whether it may be left out.
    """

    name: str
    symbol: str
    unit: str
    carries_force: bool
    default: float | None
    held: str | None
    is_list: bool
    is_optional: bool


@dataclass(frozen=True, kw_only=True)
class ModelInfo:
    """Name, title, parameters and state of a model, as the core lists it.

    Attributes
    ----------
    name : str
        Name in files and on the command line.
    title : str
        Name in tables and pictures.
    drive_unit : str
        Unit of the drive.
    searched : bool
        Whether the parameters are searched; otherwise least squares find them.
    nodes : {"thresholds", "levels", ""}
        What an identification by least squares spreads over the drive's range: thresholds of plays,
        levels, or nothing.
    parameters, state : tuple of Parameter
        The parameters, and the parts of the state.
    """

    name: str
    title: str
    drive_unit: str
    searched: bool
    nodes: str
    parameters: tuple[Parameter, ...]
    state: tuple[Parameter, ...]

    @property
    def hysteresis(self) -> tuple[str, ...]:
        """Parameters of the hysteresis of a model that are searched by default."""
        return tuple(
            parameter.name
            for parameter in self.parameters
            if self.searched
            and parameter.default is None
            and not parameter.is_list
            and parameter.name not in MECHANICS
        )

    @property
    def has_dead_zones(self) -> bool:
        """Whether dead zones may follow the plays."""
        return any(one.name == "dead_zone_weights" for one in self.parameters)

    @property
    def force_symbols(self) -> str:
        """Symbols of the parameters that scale with the stiffness, in words."""
        symbols = [
            one.symbol for one in self.parameters if one.carries_force and one.name != "stiffness"
        ]
        return " and ".join(filter(None, [", ".join(symbols[:-1]), *symbols[-1:]]))


def _listed(entry: dict[str, Any]) -> ModelInfo:
    return ModelInfo(
        name=entry["name"],
        title=entry["title"],
        drive_unit=entry["drive_unit"],
        searched=entry["searched"],
        nodes=entry["nodes"],
        parameters=tuple(Parameter(**one) for one in entry["parameters"]),
        state=tuple(Parameter(**one) for one in entry["state"]),
    )


# The models of the core, in its order.
LISTED = {entry["name"]: _listed(entry) for entry in _core.models()}
