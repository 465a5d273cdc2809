"""A controller that calls the C library of piezotrack, with the functions of its form in C99."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from .. import _core
from ..control.laws.neural_network import NETWORK, NetworkInverse
from .c99.check import check_code
from .c99.sources import checked_name
from .c99.text import array_lines, comment_of, literal, named_in
from .vectors import rows_of, vectors_text

if TYPE_CHECKING:
    from collections.abc import Iterable

    from ..control.controller.controller import Controller
    from ..references.reference import Reference

__all__ = ["library_sources"]

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
    forward = "given" if controller.feedforward is None else "online"
    forward = forward if table is None else "table"
    written = (
        f"Written by piezotrack {_core.__version__}, piezotrack export --to library; do not edit."
    )
    facts = "\n".join(f" * {comment_of(line)}" for line in (repr(controller), written))
    pieces = {
        "@facts": facts,
        "@unit": controller.drive_unit,
        "@declaration": DECLARATIONS[forward],
        "@settings": _settings_text(controller, table),
        "@step": STEPS[forward],
    }
    texts = {
        f"{name}.h": HEADER,
        f"{name}.c": SOURCE,
        "check.c": check_code(forward, 0.0, 0, link=" -lpiezotrack"),
    }
    for key, piece in pieces.items():
        texts = {file: text.replace(key, piece) for file, text in texts.items()}
    files = {file: named_in(name, text) for file, text in texts.items()}
    rows = rows_of(controller, table, reference)
    files["vectors.csv"] = vectors_text(rows, controller.drive_unit)
    return files


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


HEADER = """\
/*
@facts
 *
 * Displacements in m, commands in @unit, times in s. Call NAME_init once, NAME_step in each
 * sampling interval, NAME_free at the end. The controller is one of libpiezotrack, which is linked
 * with it; a step does not allocate. The functions are those of piezotrack export --to c99.
 */
#ifndef NAME_H
#define NAME_H

#include "piezotrack.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef double NAME_real;
typedef piezotrack_command NAME_command;

typedef struct {
    piezotrack_controller *controller;
    NAME_command last; /* the last command */
    uint32_t place; /* next sample of the table, where there is one */
} NAME_state;

/* Begins at 0 @unit (or the limit nearest to it). Returns 0 where there is no memory, or a library
   of another version refuses the settings. */
int NAME_init(NAME_state *s);

/* Begins without a bump at the command `present` that is there now, in place of NAME_init; returns
   0 where that is outside of the limits. */
int NAME_start(NAME_state *s, NAME_real present);

@declaration
/* Reports what the amplifier gave for the last command, where it differs from it: for the
   antiwindup. Returns 0 for what is not finite. */
int NAME_applied(NAME_state *s, NAME_real volts);

/* Forgets errors, readings and what was learnt, and goes on from the command that is there. */
void NAME_reset(NAME_state *s);

void NAME_free(NAME_state *s);

#ifdef __cplusplus
}
#endif

#endif
"""

SOURCE = """\
/*
@facts
 */
#include <math.h>

#include "NAME.h"

@settings
int NAME_init(NAME_state *s)
{
    s->controller = piezotrack_new(&settings, NULL, 0);
    s->place = 0;
    s->last = piezotrack_last(s->controller);
    return s->controller != NULL;
}

int NAME_start(NAME_state *s, NAME_real present)
{
    if (!NAME_init(s)) {
        return 0;
    }
    if (!piezotrack_start(s->controller, present)) {
        NAME_free(s);
        return 0;
    }
    s->last = piezotrack_last(s->controller);
    return 1;
}

@step
int NAME_applied(NAME_state *s, NAME_real volts)
{
    return piezotrack_applied(s->controller, volts);
}

void NAME_reset(NAME_state *s)
{
    piezotrack_reset(s->controller);
    s->last = piezotrack_last(s->controller);
}

void NAME_free(NAME_state *s)
{
    piezotrack_free(s->controller);
    s->controller = NULL;
}
"""

DECLARATIONS = {
    "given": """\
/* The command for this sample: reference and measurement in m, and a feedforward of your own in
   @unit, 0 for none. NaN is allowed for each of them. */
NAME_real NAME_step(
    NAME_state *s, NAME_real reference, NAME_real measured, NAME_real feedforward);
""",
    "table": """\
/* The command for this sample: reference and measurement in m. NaN is allowed for each of them. The
   feedforward is played from its table: the first step after NAME_init is the beginning of a
   period, and NAME_reset does not shift it. */
NAME_real NAME_step(NAME_state *s, NAME_real reference, NAME_real measured);
""",
    "online": """\
/* The command for this sample: the reference, that of the next sample (NaN where it is not known),
   and the measurement, in m. NaN is allowed for each of them. */
NAME_real NAME_step(NAME_state *s, NAME_real reference, NAME_real next, NAME_real measured);
""",
}
STEPS = {
    "given": """\
NAME_real NAME_step(
    NAME_state *s, NAME_real reference, NAME_real measured, NAME_real feedforward)
{
    const double volts = piezotrack_step_given(s->controller, reference, measured, feedforward);
    s->last = piezotrack_last(s->controller);
    return volts;
}
""",
    "table": """\
NAME_real NAME_step(NAME_state *s, NAME_real reference, NAME_real measured)
{
    const double feedforward = table[s->place];
    const double volts = piezotrack_step_given(s->controller, reference, measured, feedforward);
    s->place = (s->place + 1) % (sizeof table / sizeof table[0]);
    s->last = piezotrack_last(s->controller);
    return volts;
}
""",
    "online": """\
NAME_real NAME_step(NAME_state *s, NAME_real reference, NAME_real next, NAME_real measured)
{
    const double volts = piezotrack_step(s->controller, reference, next, measured);
    s->last = piezotrack_last(s->controller);
    return volts;
}
""",
}
