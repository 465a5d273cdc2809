"""A controller as C99: header, source, test vectors and a program that checks them."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ... import _core
from ..._support.arguments import expect
from ...errors import ParameterError
from ..vectors import STEPS, rows_of, stage_of, vectors_text
from .check import Loop, check_code
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
from .tree import choices_of, choices_text, filled, joined

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ...control.controller.controller import Controller
    from ...references.reference import Reference
    from ..vectors import Row
    from .loop import Shape
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
# steps, as a share of the limits' range.
FLOAT_BOUND = 2e-5
FLOAT_ROUNDING = 2.0**-24
# In a replay, where no reading answers, an observer around an integral would add it up twice: these
# are checked in a closed loop.
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
    bound, flags = _bounds(controller, shape, parts, rows) if single else (0.0, 0)
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
    texts = {
        f"{name}.{end}": filled(joined(f"NAME.{end}", choices, given), pieces) for end in ("h", "c")
    }
    closed = None
    if single and shape.law in OBSERVERS:
        stage = stage_of(controller)
        closed = Loop(stage.gain, stage.fresh, *controller.limits)
    texts["check.c"] = check_code(shape.forward, bound, flags, closed=closed)
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


def _bounds(
    controller: Controller, shape: Shape, parts: tuple[Part, ...], rows: Sequence[Row]
) -> tuple[float, int]:
    """Largest difference of a float, in the unit of the drive, and how many flags may differ."""
    low, high = controller.limits
    steps = len(rows)
    bound = FLOAT_BOUND * (high - low) * steps / STEPS
    reach = max(abs(row.reference) for row in rows if math.isfinite(row.reference))
    rounding = reach * FLOAT_ROUNDING
    if shape.forward == "online":
        bound += _bound_of_differences(parts, rows, rounding, reach)
    if shape.law in OBSERVERS:
        bound += _bound_of_estimate(parts, rounding)
    return bound, int(FLOAT_FLAGS * steps)


def _bound_of_differences(
    parts: tuple[Part, ...], rows: Sequence[Row], rounding: float, reach: float
) -> float:
    """Largest effect of a rounded reference on the online inverse, in the unit of the drive.

    The inverse is told x, v and a of differences, each ahead by the delay: what the reference is
    off by counts 2/Ts times in v, 4/Ts^2 times in a. The hysteresis rises with its slope along x;
    dry friction has the sign of v, which may be the other one where v is near 0.
    """
    constants = (one for part in parts for one in part.constants)
    of = {one.name: one.value for one in constants if isinstance(one.value, float)}
    dt, delay = of["REFERENCE_DT"], of.get("REFERENCE_DELAY", 0.0)
    a = 4.0 * rounding / of["REFERENCE_DT_SQUARED"]
    v = 2.0 * rounding / dt + delay * a
    x = rounding + delay * (2.0 * rounding / dt + 0.5 * delay * a)
    # The branch from rest gets no steeper than its curvature times the way on which it bends.
    ways = [abs(of["INVERSE_A1"]), math.sqrt(abs(of["INVERSE_A2"]))]
    slope = abs(of["INVERSE_GAIN"]) * min([reach, *(1.0 / one for one in ways if one > 0.0)])
    drive = abs(of["INVERSE_STIFFNESS"]) * x + abs(of["INVERSE_DAMPING"]) * v
    drive += abs(of["INVERSE_INERTIA"]) * a + 2.0 * abs(of["INVERSE_LEVEL"]) * slope * x
    if min(_speeds(rows, dt, delay), default=math.inf) <= v:
        drive += 2.0 * abs(of["INVERSE_FRICTION"]) * slope
    return drive


def _speeds(rows: Sequence[Row], dt: float, delay: float) -> list[float]:
    """Magnitudes of the velocities that the inverse is told [m/s], without those that are 0."""
    places = np.array([row.reference for row in rows])
    ahead = np.array([row.next for row in rows])[1:]
    before, now = places[:-1], places[1:]
    past = np.concatenate([before[:1], before[:-1]])
    known = np.isfinite(ahead)
    v = np.where(known, 0.5 * (ahead - before), now - before) / dt
    a = np.where(known, ahead - 2.0 * now + before, now - 2.0 * before + past) / dt**2
    speeds = np.abs(v + delay * a)
    return [float(one) for one in speeds[np.isfinite(speeds) & (speeds > 0.0)]]


def _bound_of_estimate(parts: tuple[Part, ...], rounding: float) -> float:
    """Largest effect of a rounded reading on what an observer estimates, in a closed loop.

    It divides a difference of two readings by the rise of its plant in a sample, and its estimate
    takes a share of that.
    """
    of = {one.name: one.numbers[0] for part in parts for one in part.settings}
    if "OBSERVER_INVERSE" in of:
        inverse, share = of["OBSERVER_INVERSE"], of["OBSERVER_FRESH"]
    else:
        inverse, share = 1.0 / of["OBSERVER_FRESH"], of["OBSERVER_CORRECTION"]
    return 4.0 * abs(inverse) * share * rounding


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
