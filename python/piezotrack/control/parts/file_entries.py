"""Parts of a controller as entries of a file: the names of their numbers, with their units."""

from __future__ import annotations

import math
from dataclasses import fields
from typing import TYPE_CHECKING, Any

from ... import _core
from ..._support.arguments import as_numbers
from ..._support.files.json_text import object_of
from ..._support.messages import quoted
from ...errors import ParameterError
from ...identification.fitted.model_entries import parameter_entries
from ...identification.fitted.model_file import stage_of as stage_of_parameters
from ...stages.registry import model_named
from .part import Part, part_class

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from ...stages.base import Stage
    from ...stages.inverse import InvertibleStage
    from .part_info import Number

__all__ = ["only", "part_entry", "part_of", "stage_entry", "stage_of"]

INFINITE = "inf"


def part_entry(part: Part, drive: str) -> dict[str, Any]:
    """Entry of a part: its name as kind, and its numbers with their units in their names.

    Parameters
    ----------
    part : Part
        A part of a controller.
    drive : str
        Unit of the drive.

    Returns
    -------
    dict
        Of numbers, texts, lists and dicts only, in the order of the fields of its class.
    """
    values = part._values
    return {"kind": part.info.name} | {
        one.key(drive): _written(one.form, values[one.name], drive) for one in _ordered(type(part))
    }


def _ordered(made: type[Part]) -> list[Number]:
    """Return the numbers of a part in the order of the fields of its class."""
    numbers = {one.name: one for one in made.info.numbers}
    return [numbers[one.name] for one in fields(made) if one.name in numbers]


def _written(form: str, value: Any, drive: str) -> Any:
    if value is None or form in ("truth", "word", "matrix"):
        return value
    match form:
        case "part":
            return part_entry(value, drive)
        case "parts":
            return [part_entry(one, drive) for one in value]
        case "stage":
            return stage_entry(value, drive)
        case "numbers":
            return [float(one) for one in value]
        case "count":
            return int(value)
    number = float(value)
    return INFINITE if math.isinf(number) else number


def stage_entry(stage: InvertibleStage, drive: str) -> dict[str, Any]:
    """Entry of a stage: its model, and its parameters with their units."""
    return {"model": stage.info.name, "parameters": parameter_entries(stage, drive)}


def stage_of(place: str, entry: Any, drive: str) -> Stage:
    """Read a stage; arguments and errors as of `part_of`."""
    stage = object_of(place, entry)
    only(place, stage, ("model", "parameters"))
    info = model_named(stage["model"])
    parameters = object_of(f"{place}: parameters", stage["parameters"])
    only(f"{place}: parameters", parameters, [one.name for one in info.parameters])
    for name, one in parameters.items():
        only(f"{place}: {name}", object_of(name, one), ("value", "unit", "symbol"))
    return stage_of_parameters(info, parameters, drive)


def part_of(place: str, entry: Any, kinds: Iterable[str], drive: str) -> Any:
    """Read a part.

    Parameters
    ----------
    place : str
        Where the entry is, for messages.
    entry : object
        What the file has there; null for no part.
    kinds : iterable of str
        Those that may be there.
    drive : str
        Unit of the drive.

    Returns
    -------
    object
        The part; None for no part.

    Raises
    ------
    ParameterError
        The entry is not that of such a part; the message names key, value and what was expected.
    """
    if entry is None:
        return None
    known = list(kinds)
    kind = entry.get("kind") if isinstance(entry, dict) else None
    if kind not in known:
        subject, value = ("kind", kind) if isinstance(entry, dict) else ("it", entry)
        expected = f"one of {', '.join(map(repr, known))}"
        raise ParameterError(f"{place}: {subject}", quoted(value), expected)
    made = part_class(kind)
    keys = {one.key(drive): one for one in _ordered(made)}
    only(place, entry, ["kind", *keys])
    values = {
        one.name: _read(f"{place}: {key}", one, entry[key], drive) for key, one in keys.items()
    }
    try:
        return made(**values)
    except ParameterError as error:
        raise error.of(place) from None


def only(place: str, entry: Mapping[str, Any], keys: Iterable[str]) -> None:
    """Refuse keys that are not known, and those that are missing.

    Parameters
    ----------
    place : str
        Where the entry is, for messages; empty for the file itself.
    entry : mapping
        What the file has there.
    keys : iterable of str
        All keys that it has to have.

    Raises
    ------
    ParameterError
        There is another, or one is not there.
    """
    known, before = list(keys), f"{place}: " if place else ""
    missing = [key for key in known if key not in entry]
    for key, value in entry.items():
        if key not in known:
            expected = ", ".join(map(repr, missing or known))
            raise ParameterError(f"{before}{quoted(key)}", quoted(value), expected)
    if missing:
        raise ParameterError(f"{before}{missing[0]!r}", "missing", f"all of {known}")


def _read(place: str, number: Number, value: Any, drive: str) -> Any:
    match number.form:
        case "part":
            return part_of(place, value, number.choices, drive)
        case "parts":
            listed = value if isinstance(value, list) else [value]
            return [
                part_of(f"{place}[{i}]", p, number.choices, drive) for i, p in enumerate(listed)
            ]
        case "stage":
            return stage_of(place, value, drive)
        case "numbers":
            return None if value is None else as_numbers(place, value)
        case "matrix":
            rows = value if isinstance(value, list) else [value]
            return [as_numbers(f"{place}[{i}]", row) for i, row in enumerate(rows)]
        case "count":
            return _core.as_count(place, value)
        case "truth":
            return _core.as_truth(place, value)
        case "word":
            return value
    return _number(place, value)


def _number(place: str, value: Any) -> float | None:
    """Take a number, the text "inf", or null for a default."""
    if value is None:
        return None
    if value == INFINITE:
        return math.inf
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise ParameterError(place, quoted(value), "a number, or 'inf'")
    return float(value)
