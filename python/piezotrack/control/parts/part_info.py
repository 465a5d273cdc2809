"""Names and numbers of the parts of a controller, as the core lists them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

from ... import _core

__all__ = ["LISTED", "Number", "PartInfo", "names_of"]


class Number(NamedTuple):
    """A number of a part, as the core describes it.

    Attributes
    ----------
    name, symbol, unit : str
        Name in both languages, symbol in the literature, SI unit for a drive in volts.
    form : str
        What it is: a number, a count, a truth value, a word, numbers, a matrix, a part, parts, or a
        stage.
    choices : list of str
        The words, the names of parts or of models that it is one of.
    default : float or None
        Value if the caller gives none; of a word its place in `choices`.
    is_optional : bool
        Whether it may be None.
    """

    name: str
    symbol: str
    unit: str
    form: str
    choices: list[str]
    default: float | None
    is_optional: bool

    def key(self, drive: str) -> str:
        """Return the key of the entry in a file, as kp_V_per_m."""
        unit = self.unit.replace("V", drive).replace("/", "_per_").replace(" ", "_")
        return f"{self.name}_{unit}" if unit else self.name


@dataclass(frozen=True, kw_only=True)
class PartInfo:
    """Name, title and numbers of a part, as the core lists it.

    Attributes
    ----------
    name : str
        Name in files, of arguments and in C.
    title : str
        Name in sentences and pictures.
    role : {"law", "filter", "repetitive", "smoothing"}
        Where it stands in a controller.
    numbers : tuple of Number
        Its numbers, in the order in which the core takes them.
    """

    name: str
    title: str
    role: str
    numbers: tuple[Number, ...]


def _listed(entry: dict[str, Any]) -> PartInfo:
    numbers = tuple(Number(**one) for one in entry["numbers"])
    return PartInfo(name=entry["name"], title=entry["title"], role=entry["role"], numbers=numbers)


# The parts of the core, in its order.
LISTED = {entry["name"]: _listed(entry) for entry in _core.parts()}


def names_of(role: str) -> tuple[str, ...]:
    """Return the names of all parts with a role, as ``"law"``."""
    return tuple(one.name for one in LISTED.values() if one.role == role)
