"""A controller that calls the C library of piezotrack, with the functions of its form in C99."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from ... import _core
from ...control.laws.neural_network import NETWORK, NetworkInverse
from ..c99.check import FORWARD, check_code
from ..c99.sources import checked_name
from ..c99.text import array_lines, comment_of, literal, named_in
from ..c99.tree import choices_of, choices_text, filled, joined
from ..vectors import rows_of, vectors_text

if TYPE_CHECKING:
    from collections.abc import Iterable

    from ...control.controller.controller import Controller
    from ...references.reference import Reference

__all__ = ["library_headers", "library_sources"]

Numbers = tuple[str, list[float]]


def library_sources(
    controller: Controller,
    name: str,
    *,
    table: list[float] | None = None,
    reference: Reference | None = None,
) -> dict[str, str]:
    """Write the settings of a controller for the C library.

    Parameters
    ----------
    controller : Controller
        The controller; every one has this form.
    name : str
        With which functions and files begin.
    table : list of float, optional
        One period of the feedforward, which is played from it.
    reference : Reference, optional
        What the table was made for, for the test vectors.

    Returns
    -------
    dict
        Texts by the names of the files: NAME.h, NAME.c, vectors.csv, check.c.

    Raises
    ------
    ParameterError
        `name` is no identifier of C.
    """
    checked_name(name)
    forward = _forward(controller, table)
    choices, headers = choices_of(FORWARD[forward]), library_headers(controller, table)
    written = (
        f"Written by piezotrack {_core.__version__}, piezotrack export --to library; do not edit."
    )
    facts = "\n".join(f" * {comment_of(line)}" for line in (repr(controller), written))
    pieces = {"@facts": facts, "@unit": controller.drive_unit}
    texts = {
        f"{name}.{end}": filled(joined(f"NAME.{end}", choices, headers, __package__), pieces)
        for end in ("h", "c")
    }
    texts["check.c"] = check_code(forward, 0.0, 0, link=" -lpiezotrack")
    files = {file: named_in(name, text) for file, text in texts.items()}
    rows = rows_of(controller, table, reference)
    files["vectors.csv"] = vectors_text(rows, controller.drive_unit)
    return files


def library_headers(controller: Controller, table: list[float] | None = None) -> dict[str, str]:
    """Write the headers with which the tree of sources compiles as it is.

    Parameters
    ----------
    controller : Controller
        The controller.
    table : list of float, optional
        One period of the feedforward.

    Returns
    -------
    dict
        What was chosen, and the settings, by the names of the headers.
    """
    choices = choices_of(FORWARD[_forward(controller, table)])
    return {
        "choices.h": choices_text(choices),
        "settings.h": _settings_text(controller, table),
    }


def _forward(controller: Controller, table: list[float] | None) -> str:
    if table is not None:
        return "table"
    return "given" if controller.feedforward is None else "online"


def _settings_text(controller: Controller, table: list[float] | None) -> str:
    """Write the arrays of the settings, and the settings."""
    arrays: list[str] = []
    low, high = controller.limits
    least, most = controller._valid
    fields = [
        ("dt", _number(controller.dt)),
        ("low", _number(low)),
        ("high", _number(high)),
        ("span_low", _number(least)),
        ("span_high", _number(most)),
    ]
    if controller.max_jump is not None:
        fields.append(("max_jump", _number(controller.max_jump)))
    if controller.feedback is not None:
        fields.append(("law", _entry(arrays, "law", controller.feedback._settings)))
    if controller.repetitive is not None:
        part = controller.repetitive._settings
        fields.append(("repetitive", _entry(arrays, "repetitive", part)))
    filters = [one._settings for one in controller.filters]
    fields += _list(arrays, "filters", "filter", filters)
    inverse = controller.feedforward
    if inverse is not None and table is None:
        network = isinstance(inverse, NetworkInverse)
        model = "neural network" if network else inverse.stage.info.name
        given = _network(inverse) if isinstance(inverse, NetworkInverse) else inverse.stage._named
        state = inverse.initial
        initial = [] if state is None else inverse.stage._checked(state)._named
        fields.append(("model", f'"{model}"'))
        fields += _list(arrays, "parameters", "parameter", given)
        fields += _list(arrays, "initial", "initial", initial)
        fields += [("offset", _number(inverse.offset)), ("delay", _number(inverse.delay))]
    if table is not None:
        arrays.append(_array("table", table))
    body = "".join(f"    .{name} = {value},\n" for name, value in fields)
    settings = f"static const piezotrack_settings settings = {{\n{body}}};\n"
    return "\n".join([*arrays, settings])


def _network(inverse: NetworkInverse) -> list[Numbers]:
    """Names and numbers of a network."""
    lists = (one if isinstance(one, (list, tuple)) else [one] for one in inverse.numbers)
    return [(name, [*map(float, one)]) for name, one in zip(NETWORK, lists, strict=True)]


def _list(
    arrays: list[str], field: str, count: str, entries: Iterable[Numbers]
) -> list[tuple[str, str]]:
    """Write a list of names with numbers; the fields that it takes in the settings."""
    lines = [_entry(arrays, f"{count}_{i}", one) for i, one in enumerate(entries)]
    if not lines:
        return []
    body = "".join(f"    {line},\n" for line in lines)
    arrays.append(f"static const piezotrack_numbers {field}[] = {{\n{body}}};\n")
    return [(field, field), (f"{count}_count", str(len(lines)))]


def _entry(arrays: list[str], array: str, part: Numbers) -> str:
    """Write the numbers of a part; the entry that names them."""
    name, numbers = part
    if not numbers:
        return f'{{"{name}", NULL, 0}}'
    arrays.append(_array(array, numbers))
    return f'{{"{name}", {array}, {len(numbers)}}}'


def _array(name: str, numbers: list[float]) -> str:
    return f"static const double {name}[] = {{\n{array_lines(map(_number, numbers))}\n}};\n"


def _number(value: float) -> str:
    if math.isnan(value):
        return "NAN"
    if math.isinf(value):
        return "INFINITY" if value > 0.0 else "-INFINITY"
    return literal(value, "", single=False)
