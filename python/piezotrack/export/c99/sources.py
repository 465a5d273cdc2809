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
from .text import Operations, constant_text, field_text, in_order, named_in, state_bytes

if TYPE_CHECKING:
    from ...control.controller.controller import Controller
    from ...references.reference import Reference
    from .text import Part

__all__ = ["Sources", "c_sources", "checked_name"]

# With these the static functions of the C file begin.
INSIDE = (
    *("pid", "law", "sliding", "observer", "hysteresis", "repetitive", "line", "table"),
    *("inverse", "online", "readings", "filters", "is", "not"),
)
# Files and functions of these names are there beside those of the controller.
BESIDE = ("check", "main", "piezotrack")
# A float has 24 bits, and an integral adds up what they leave out: the largest difference in 2000
# steps, as a share of the limits' range. In a replay, where no reading answers, an observer around
# an integral adds it up twice.
FLOAT_BOUND, FLOAT_BOUND_OBSERVER = 2e-5, 0.1
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
    """

    name: str
    files: dict[str, str]
    state_bytes: int
    operations: Operations
    forward: str
    bound: float


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
    fields = [field for one in parts for field in one.fields]
    size = _command_bytes(single=single) + state_bytes(fields, single=single)
    operations = sum((one.operations for one in parts), Operations())
    facts = _facts(controller, size, operations, single=single)
    unit = controller.drive_unit
    rows = rows_of(controller, table, reference)
    bound, flags = _bounds(controller, shape.law, len(rows)) if single else (0.0, 0)
    if single and shape.forward == "online":
        finite = (abs(row.reference) for row in rows if math.isfinite(row.reference))
        bound += _bound_of_differences(parts, max(finite))
    texts = {
        f"{name}.h": _header(parts, facts, shape.forward, unit, single=single),
        f"{name}.c": _source(parts, facts, single=single),
        "check.c": check_code(shape.forward, bound, flags),
    }
    files = {file: named_in(name, text) for file, text in texts.items()}
    files["vectors.csv"] = vectors_text(rows, unit)
    return Sources(
        name=name,
        files=files,
        state_bytes=size,
        operations=operations,
        forward=shape.forward,
        bound=bound,
    )


def _bounds(controller: Controller, law: str, steps: int) -> tuple[float, int]:
    """Largest difference of a float, in the unit of the drive, and how many flags may differ."""
    low, high = controller.limits
    share = FLOAT_BOUND_OBSERVER if law == "observer" else FLOAT_BOUND
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
    return "\n".join(f" * {line}" for line in lines).replace("*/", "* /")


def _header(parts: tuple[Part, ...], facts: str, forward: str, unit: str, *, single: bool) -> str:
    fields = "".join(field_text(f) for f in in_order(f for one in parts for f in one.fields))
    pieces = {
        "@facts": facts,
        "@inverse": INVERSE_STRUCT if forward == "online" else "",
        "@fields": fields,
        "@real": "float" if single else "double",
        "@step": STEP_TEXT[forward],
        "@unit": unit,
    }
    text = HEADER_TEXT
    for key, piece in pieces.items():
        text = text.replace(key, piece)
    return text


def _source(parts: tuple[Part, ...], facts: str, *, single: bool) -> str:
    sections = []
    for part in parts:
        constants = "".join(constant_text(c, single=single) for c in part.constants)
        between = "\n" if constants and part.code else ""
        sections.append(f"/* ---- {part.title} ---- */\n\n{constants}{between}{part.code}")
    return SOURCE_TEXT.replace("@facts", facts) + "\n".join(sections)


HEADER_TEXT = """\
/*
@facts
 *
 * Displacements in m, commands in @unit, times in s. Call NAME_init once, and NAME_step in each
 * sampling interval. Nothing is allocated, no library function is called. Several states may run
 * side by side, each of them in one context only: a step that is interrupted by another step of
 * the same state is not safe.
 */
#ifndef @GUARD_H
#define @GUARD_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef @real NAME_real;

/* The command of a step, with its parts. */
typedef struct {
    NAME_real volts; /* the command, within the limits, @unit */
    NAME_real unclipped; /* the same before it was clipped, @unit */
    NAME_real feedforward; /* its feedforward part, @unit */
    NAME_real feedback; /* its feedback part, @unit */
    NAME_real repetitive; /* its repetitive part, @unit */
    NAME_real error; /* reference less filtered measurement, m */
    uint8_t saturated; /* whether it was clipped */
    uint8_t measurement_ok; /* 0: not finite, outside of the span, or a jump; the last is held */
    uint8_t reference_ok; /* 0: reference or feedforward could not be used; the last is held */
} NAME_command;
@inverse
/* The state: plain numbers, which may be copied to keep it over a restart. */
typedef struct {
    NAME_command last; /* the last command */
@fields} NAME_state;

/* Begins at 0 @unit (or the limit nearest to it). */
void NAME_init(NAME_state *s);

/* Begins without a bump at the command `present` that is there now; returns 0, and changes nothing,
   where that is outside of the limits. In place of NAME_init. */
int NAME_start(NAME_state *s, NAME_real present);

@step
/* Reports what the amplifier gave for the last command, where it differs from it: for the
   antiwindup. Returns 0 for what is not finite; that, and a report further outside of the limits
   than their range, is ignored. */
int NAME_applied(NAME_state *s, NAME_real volts);

/* Forgets errors, readings and what was learnt, and goes on from the command that is there. */
void NAME_reset(NAME_state *s);

#ifdef __cplusplus
}
#endif

#endif
"""

INVERSE_STRUCT = """
/* State of the inverse of the stage. */
typedef struct {
    NAME_real x; /* the last displacement, m */
    NAME_real w; /* its velocity times the sampling interval, m */
    NAME_real force; /* hysteresis q1 */
    NAME_real slope; /* its slope q2 along the path */
    uint8_t begun; /* whether there was a sample */
} NAME_inverse;
"""

STEP_TEXT = {
    "given": """\
/* The command for this sample: reference and measurement in m, and a feedforward of your own in
   @unit, 0 for none. NaN is allowed for each of them: see NAME_command. */
NAME_real NAME_step(
    NAME_state *s, NAME_real reference, NAME_real measured, NAME_real feedforward);
""",
    "table": """\
/* The command for this sample: reference and measurement in m. NaN is allowed for each of them:
   see NAME_command. The feedforward is played from its table: the first step after NAME_init is
   the beginning of a period, and NAME_reset does not shift it. */
NAME_real NAME_step(NAME_state *s, NAME_real reference, NAME_real measured);
""",
    "online": """\
/* The command for this sample: the reference, that of the next sample (NaN where it is not known,
   then the feedforward comes half a sample late), and the measurement, in m. NaN is allowed for
   each of them: see NAME_command. After a feedforward beyond the limits, and in NAME_applied, the
   inverse is evaluated again, 42 times at most and some 8 times mostly. */
NAME_real NAME_step(NAME_state *s, NAME_real reference, NAME_real next, NAME_real measured);
""",
}

SOURCE_TEXT = """\
/*
@facts
 *
 * The equations and their sources: docs/export.md and the Rust crate piezotrack-control, which this
 * follows operation by operation. Compiled without fused multiply-add it gives the same bits.
 */
#include "@file.h"

#ifdef __FAST_MATH__
#error "compile without -ffast-math: a reading that is NaN would pass for a measurement"
#endif

typedef NAME_real real;

"""
