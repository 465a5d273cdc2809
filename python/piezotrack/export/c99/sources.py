"""A controller as C99: header, source, test vectors and a program that checks them."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ... import _core
from ..._support.arguments import expect
from ...errors import ParameterError
from ..vectors import STEPS, rows_of, vectors_text
from .check import check_code
from .parts import parts_of, shape_of
from .settings import places_of, settings_part
from .text import (
    Field,
    Operations,
    comment_of,
    constant_text,
    field_text,
    in_order,
    named_in,
    size_text,
    state_bytes,
)
from .tree import choices_of, choices_text, joined

if TYPE_CHECKING:
    from ...control.controller.controller import Controller
    from ...references.reference import Reference
    from .text import Part

__all__ = ["Sources", "c_sources", "checked_name"]

# With these the static functions of the C file begin.
INSIDE = (
    *("pid", "law", "sliding", "observer", "hysteresis", "repetitive", "line", "table"),
    *("inverse", "online", "readings", "filters", "is", "not", "damping"),
    "feedback",
)
# Files and functions of these names are there beside those of the controller.
BESIDE = ("check", "main", "piezotrack")
# A float has 24 bits, and an integral adds up what they leave out: the largest difference in 2000
# steps, as a share of the limits' range. In a replay, where no reading answers, an observer around
# an integral adds it up twice.
FLOAT_BOUND, FLOAT_BOUND_OBSERVER = 2e-5, 0.1
OBSERVERS = ("disturbance-observer", "perturbation-estimator", "hysteresis-observer")
# Share of the steps whose flags may differ: where the unclipped command is at the limit.
FLOAT_FLAGS = 0.01


@dataclass(frozen=True, kw_only=True)
class Sources:
    """A controller in C.

    Attributes
    ----------
    name : str
        With which its functions begin.
    files : dict
        Texts by the names of the files.
    state_bytes : int
        Bytes of the state.
    operations : Operations
        Floating-point operations of a step that does not saturate.
    forward : {"given", "table", "online"}
        Where the feedforward comes from.
    bound : float
        Largest difference to the Rust controller that `check.c` accepts; 0 for doubles.
    headers : dict
        What was chosen, and the constants, as headers with which the tree of sources compiles as
        it is.
    """

    name: str
    files: dict[str, str]
    state_bytes: int
    operations: Operations
    forward: str
    bound: float
    headers: dict[str, str]


def checked_name(name: str) -> str:
    """Check the name of an export.

    Raises
    ------
    ParameterError
        It is no identifier of C, or one that the functions inside have.
    """
    expect("name", name, str, "a text")
    if name in INSIDE:
        raise ParameterError(
            "name", f"{name!r}, as functions inside of the C file begin", "another name"
        )
    if name in BESIDE:
        raise ParameterError(
            "name", f"{name!r}, as a file or function beside the controller", "another name"
        )
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,39}", name):
        raise ParameterError(
            "name", f"{name!r}", "a letter, then letters, digits or underscores, 40 at most"
        )
    return name


def c_sources(
    controller: Controller,
    name: str,
    *,
    single: bool = False,
    fixed: bool = False,
    table: list[float] | None = None,
    reference: Reference | None = None,
) -> Sources:
    """Write a controller in C99.

    Parameters
    ----------
    controller : Controller
        The controller.
    name : str
        With which functions and files begin.
    single : bool, optional
        Numbers are floats, not doubles.
    fixed : bool, optional
        All numbers are constants: there are no settings.
    table : list of float, optional
        One period of the feedforward, which is played from it.
    reference : Reference, optional
        What the table was made for, for the test vectors.

    Returns
    -------
    Sources
        The files as texts: NAME.h, NAME.c, vectors.csv, check.c.

    Raises
    ------
    ParameterError
        A part of the controller has no form in C; a number is none that a float can have.
    """
    checked_name(name)
    shape = shape_of(controller, table)
    parts = parts_of(controller, table, single=single)
    places = places_of(parts)
    count = sum(len(one.numbers) for part in parts for one in part.settings)
    tuned = count > 0 and not fixed
    fields = [field for one in parts for field in one.fields]
    if tuned:
        parts = *parts, settings_part(controller, parts, single=single)
        fields.append(Field("settings", "settings", "those in use, sealed", count))
    size = _command_bytes(single=single) + state_bytes(fields, single=single)
    operations = sum((one.operations for one in parts), Operations())
    unit = controller.drive_unit
    rows = rows_of(controller, table, reference)
    bound, flags = _bounds(controller, shape.law, len(rows)) if single else (0.0, 0)
    if single and shape.forward == "online":
        finite = (abs(row.reference) for row in rows if math.isfinite(row.reference))
        bound += _bound_of_differences(parts, max(finite))
    choices = choices_of(name for one in parts for name in one.chooses)
    given = {
        part.file: _numbers_text(part, places, single=single, tuned=tuned) for part in parts
    } | {
        "state.h": "".join(field_text(one) for one in in_order(fields)),
        "counts.h": f"#define NAME_SETTINGS {count} /* how many numbers there are to set */\n",
    }
    pieces = {
        "@facts": _facts(controller, size, operations, single=single),
        "@ranges": _ranges(controller, unit),
        "@unit": unit,
    }
    texts = {f"{name}.{end}": joined(f"NAME.{end}", choices, given) for end in ("h", "c")}
    for key, piece in pieces.items():
        texts = {file: text.replace(key, piece) for file, text in texts.items()}
    texts["check.c"] = check_code(shape.forward, bound, flags)
    files = {file: named_in(name, text) for file, text in texts.items()}
    files["vectors.csv"] = vectors_text(rows, unit)
    return Sources(
        name=name,
        files=files,
        state_bytes=size,
        operations=operations,
        forward=shape.forward,
        bound=bound,
        headers={
            "choices.h": choices_text(choices),
            "constants.h": "".join(given[part.file] for part in parts),
            **{key: text for key, text in given.items() if key.endswith(".h")},
        },
    )


def _bounds(controller: Controller, law: str, steps: int) -> tuple[float, int]:
    """Largest difference of a float, in the unit of the drive, and how many flags may differ."""
    low, high = controller.limits
    share = FLOAT_BOUND_OBSERVER if law in OBSERVERS else FLOAT_BOUND
    return share * (high - low) * steps / STEPS, int(FLOAT_FLAGS * steps)


def _bound_of_differences(parts: tuple[Part, ...], reach: float) -> float:
    """Largest effect of a rounded reference on the online inverse, in the unit of the drive."""
    constants = (one for part in parts for one in part.constants)
    of = {one.name: one.value for one in constants if isinstance(one.value, float)}
    rounding = reach * 2.0**-24
    velocity = 2.0 * rounding / of["REFERENCE_DT"]
    acceleration = 4.0 * rounding / of["REFERENCE_DT_SQUARED"]
    drive = of["INVERSE_STIFFNESS"] * rounding + of["INVERSE_DAMPING"] * velocity
    return drive + of["INVERSE_INERTIA"] * acceleration


def _command_bytes(*, single: bool) -> int:
    """Bytes of the last command: six numbers, three flags and the padding."""
    real = 4 if single else 8
    return 7 * real


def _facts(controller: Controller, size: int, operations: Operations, *, single: bool) -> str:
    """Write what stands above both files."""
    kind = "float, rounded from the doubles of the controller" if single else "double"
    lines = [
        f"{controller!r}",
        f"Written by piezotrack {_core.__version__}, piezotrack export --to c99; do not edit.",
        f"Numbers: {kind}. State: {size} bytes. A step that does not saturate:",
        f"{operations}.",
    ]
    known = controller.provenance or {}
    if known.get("model_sha256"):
        lines.append(f"Stage of the feedforward: SHA-256 {known['model_sha256']}")
    return "\n".join(f" * {comment_of(line)}" for line in lines)


def _ranges(controller: Controller, unit: str) -> str:
    """Write the ranges of what comes in and goes out, and the interval."""
    low, high = controller.limits
    bottom, top = controller._valid
    lines = [
        f"    a step every {controller.dt!r} s",
        f"    commands from {low!r} to {high!r} {unit}",
        f"    measurements from {bottom!r} to {top!r} m, others are refused",
    ]
    if controller.max_jump is not None:
        lines.append(f"    and {controller.max_jump!r} m from sample to sample")
    return "\n".join(f" * {line}" for line in lines)


def _numbers_text(part: Part, places: dict[str, int], *, single: bool, tuned: bool) -> str:
    """Write counts, settings and constants of a part."""
    lines = [size_text(size) for size in part.sizes]
    for setting in part.settings:
        if not tuned:
            lines.append(constant_text(setting.constant, single=single))
            continue
        value = f"s->settings.value[{places[setting.name]}]"
        one = value if isinstance(setting.value, (int, float)) else f"&{value}"
        lines.append(f"#define {setting.name} ({one}) /* {setting.constant.comment} */\n")
    lines += [constant_text(constant, single=single) for constant in part.constants]
    return "".join(lines) + part.text
