"""The files of a firmware project: sources that are the same for all, and a configuration."""

from __future__ import annotations

import math
from dataclasses import replace
from importlib.resources import files
from typing import TYPE_CHECKING, NamedTuple

from ...errors import ParameterError
from ..c99.parts import parts_of, shape_of
from ..c99.settings import layout_of
from ..c99.sources import OBSERVERS, Sources, c_sources
from ..c99.text import literal
from ..vectors import range_of, rows_of

if TYPE_CHECKING:
    from collections.abc import Iterator
    from importlib.resources.abc import Traversable

    from ...control.controller.controller import Controller
    from ..vectors import Row

__all__ = [
    "Project",
    "firmware_project",
    "layout_on_board",
    "project_files",
    "sensor_span",
    "without_table",
]

# Files of the project beside the controller and its configuration; NAME-dependent is the Makefile.
SOURCE = files(__package__) / "source"
GENERATED = ("configuration.h", "vectors.h")
# Names of files and functions that the firmware has itself.
TAKEN = (
    *("board", "configuration", "count", "firmware", "host", "inner", "main", "mps2"),
    *("mps2_startup", "protocol", "real", "ring", "text", "vectors"),
)
# Time of the way from one limit to the other when the output is led to the safe voltage [s].
RAMP = 0.5
# Share of the reach by which the sensor shows more, where the controller has no span.
MARGIN = 0.25
VECTORS = 2000


class Project(NamedTuple):
    """A firmware project as texts.

    Attributes
    ----------
    files : dict
        Texts by the paths of the files.
    controller : Sources
        The controller inside.
    """

    files: dict[str, str]
    controller: Sources


def project_files(name: str) -> list[str]:
    """Return the paths of the files of a project, those of the controller first."""
    # Guards of headers are in capitals.
    if name.lower() in TAKEN:
        raise ParameterError("name", f"{name!r}, a file of the firmware", "another name")
    own = [f"{name}.h", f"{name}.c", *GENERATED]
    return own + [path for path, _ in _sources(SOURCE)]


def firmware_project(
    controller: Controller, name: str, *, single: bool = False, fixed: bool = False
) -> Project:
    """Write a firmware project around a controller.

    Parameters
    ----------
    controller : Controller
        The controller. A feedforward that has no form in C sample by sample is left to the client,
        who loads its voltages.
    name : str
        With which functions and files of the controller begin.
    single : bool, optional
        Numbers are floats, not doubles.
    fixed : bool, optional
        All numbers are constants: there are no settings.

    Returns
    -------
    Project
        The texts.

    Raises
    ------
    ParameterError
        A part has no form in C; the controller commands no voltage, or the range of its sensor is
        not known.

    Examples
    --------
    >>> import piezotrack as pt
    >>> from piezotrack.export.firmware.project import firmware_project
    >>> loop = pt.Controller(
    ...     dt=1e-3, limits=(0.0, 75.0), span=(-1e-5, 1.3e-4), feedback=pt.Pid.xu_li_2010()
    ... )
    >>> sorted(firmware_project(loop, "axis").files)[:3]
    ['Makefile', 'README.md', 'axis.c']
    """
    if controller.drive_unit != "V":
        raise ParameterError(
            "controller", f"in {controller.drive_unit}", "V, which a DAC puts out", verb="commands"
        )
    span = sensor_span(controller)
    inside = without_table(controller)
    sources = c_sources(inside, name, single=single, fixed=fixed)
    rows = rows_of(inside)[:VECTORS]
    texts = {path: text for path, text in sources.files.items() if path.startswith(f"{name}.")}
    texts["configuration.h"] = _configuration(inside, sources, span, single=single)
    law = inside.feedback
    # Of these a float is not compared where no reading answers: check.c closes the loop for them.
    compared = not (single and law is not None and law.info.name in OBSERVERS)
    texts["vectors.h"] = _vectors(rows, sources, single=single, compared=compared)
    for path, text in _sources(SOURCE):
        texts[path] = text.replace("@NAME", name)
    return Project(texts, sources)


def _sources(folder: Traversable) -> Iterator[tuple[str, str]]:
    """Yield the files below a folder, by their names alone: a project is one folder."""
    for one in sorted(folder.iterdir(), key=lambda one: one.name):
        if one.is_dir():
            yield from _sources(one)
        else:
            yield one.name, one.read_text(encoding="utf-8")


def without_table(controller: Controller) -> Controller:
    """Leave a feedforward that has no form in C sample by sample to the client."""
    if controller.feedforward is None:
        return controller
    try:
        shape_of(controller, None)
    except ParameterError as error:
        if error.argument != "feedforward":
            raise
        return replace(controller, feedforward=None, span=sensor_span(controller))
    return controller


def layout_on_board(controller: Controller, *, single: bool) -> int:
    """Compute the hash of which numbers the settings of a firmware are; see `layout_of`.

    Parameters
    ----------
    controller : Controller
        The controller.
    single : bool
        Whether numbers are floats.

    Returns
    -------
    int
        The hash.
    """
    inside = without_table(controller)
    return layout_of(inside, parts_of(inside, None, single=single), single=single)


def sensor_span(controller: Controller) -> tuple[float, float]:
    """Return the displacements at both ends of the ADC [m]."""
    if controller.span is not None:
        return controller.span
    if controller.feedforward is None:
        raise ParameterError(
            "controller",
            "no span",
            "span=(LOW, HIGH), the displacements at both ends of the ADC",
            verb="has",
        )
    bottom, top = range_of(controller)
    more = MARGIN * (top - bottom)
    return bottom - more, top + more


def _configuration(
    controller: Controller, sources: Sources, span: tuple[float, float], *, single: bool
) -> str:
    """Write the header that joins firmware and controller."""
    low, high = controller.limits
    safe = min(max(0.0, low), high)
    step = (high - low) * min(controller.dt / RAMP, 1.0)

    def number(value: float, name: str) -> str:
        return f"((real){literal(value, name, single=single)})"

    pieces = {
        "@dt": number(controller.dt, "dt"),
        "@low": number(low, "limits"),
        "@high": number(high, "limits"),
        "@safe": number(safe, "safe voltage"),
        "@step": number(step, "ramp"),
        "@bottom": number(span[0], "span"),
        "@top": number(span[1], "span"),
        "@bytes": "4u" if single else "8u",
        "@call": CALLS[sources.forward],
        "@takes": "1" if sources.forward == "given" else "0",
    }
    text = CONFIGURATION
    for key, piece in pieces.items():
        text = text.replace(key, piece)
    return text.replace("@CAPITALS", sources.name.upper()).replace("@NAME", sources.name)


def _vectors(rows: list[Row], sources: Sources, *, single: bool, compared: bool) -> str:
    """Write inputs and commands of the controller itself, for a board that counts and compares."""

    def entry(value: float) -> str:
        if not math.isfinite(value):
            return "NOT_FINITE" if math.isnan(value) else f"{'-' * (value < 0)}INFINITE"
        return literal(value, "vectors", single=single).partition(" ")[0]

    lines = []
    for row in rows:
        inputs = (row.reference, row.next, row.measured, row.feedforward, float(row.reset))
        entries = map(entry, (*inputs, row.applied, row.command))
        lines.append("    {" + ", ".join(entries) + "},\n")
    pieces = {
        "@count": str(len(rows)),
        "@bound": literal(sources.bound, "bound", single=single).partition(" ")[0],
        "@apart": f"{0 if compared else len(rows)}u",
        "@rows": "".join(lines),
    }
    text = VECTORS_TEXT
    for key, piece in pieces.items():
        text = text.replace(key, piece)
    return text


CALLS = {
    "given": """\
    (void)next;
    return @NAME_step(loop, reference, reading, volts);""",
    "online": """\
    (void)volts;
    return @NAME_step(loop, reference, next, reading);""",
}
CONFIGURATION = """\
/*
 * What the firmware of @NAME is made with. Edit converters, sizes and times for your board.
 */
#ifndef CONFIGURATION_H
#define CONFIGURATION_H

#include <stdbool.h>

#include "@NAME.h"

typedef @NAME_real real;

/* Converters: code 0 and the highest code. The DAC reaches at least from limit to limit. */
#ifndef DAC_BITS
#define DAC_BITS 20u
#define DAC_LOW_VOLTS LIMITS_LOW
#define DAC_HIGH_VOLTS LIMITS_HIGH
#endif
#ifndef ADC_BITS
#define ADC_BITS 20u
#define ADC_LOW_METRES @bottom
#define ADC_HIGH_METRES @top
#endif

/* Samples of the tables, and samples that are kept for the client. */
#ifndef TABLE_SAMPLES
#define TABLE_SAMPLES 4096u
#endif
#ifndef RING_SAMPLES
#define RING_SAMPLES 4096u
#endif
/* Sampling intervals of one sample of a table, at most. */
#define DIVIDER_MOST 65535u

/* Faults: samples in a row that took too long or had no reading, and times without a line over the
   link or without a sample. */
#ifndef OVERRUNS_MOST
#define OVERRUNS_MOST 3u
#endif
#ifndef INVALID_MOST
#define INVALID_MOST 20u
#endif
#ifndef LINK_TIMEOUT_MS
#define LINK_TIMEOUT_MS 1000u
#endif
#ifndef SAMPLING_TIMEOUT_MS
#define SAMPLING_TIMEOUT_MS 500u
#endif

/* From here on: what belongs to the controller. Do not edit. */
#define INNER_NAME "@NAME"
#define DRIVE_UNIT "V"
#define REAL_BYTES @bytes
#define SAMPLING_INTERVAL @dt
#define LIMITS_LOW @low
#define LIMITS_HIGH @high
#define SAFE_VOLTS @safe
#define SAFE_STEP @step

#define CODE_MOST(bits) ((real)(0xFFFFFFFFu >> (32u - (bits))))
#define DAC_ZERO_VOLTS DAC_LOW_VOLTS
#define DAC_CODE_MOST CODE_MOST(DAC_BITS)
#define DAC_CODES_PER_VOLT (DAC_CODE_MOST / (DAC_HIGH_VOLTS - DAC_LOW_VOLTS))
#define ADC_ZERO_METRES ADC_LOW_METRES
#define ADC_CODE_MOST CODE_MOST(ADC_BITS)
#define ADC_METRES_PER_CODE ((ADC_HIGH_METRES - ADC_LOW_METRES) / ADC_CODE_MOST)

/* What the converters of a simulated stage are told at the start, REAL_BYTES before them. */
#define CONVERTERS_SCALE \
    {SAMPLING_INTERVAL, DAC_ZERO_VOLTS, DAC_CODES_PER_VOLT, ADC_ZERO_METRES, ADC_METRES_PER_CODE, \
     ADC_CODE_MOST, SAFE_VOLTS}
#define CONVERTERS_NUMBERS 7

/* Whether a step takes a feedforward of the client. */
#define INNER_TAKES_VOLTS @takes

typedef @NAME_state inner_state;

static inline void inner_init(inner_state *loop)
{
    @NAME_init(loop);
}

static inline bool inner_start(inner_state *loop, real present)
{
    return @NAME_start(loop, present) != 0;
}

static inline real inner_step(
    inner_state *loop, real reference, real next, real reading, real volts)
{
@call
}

static inline bool inner_applied(inner_state *loop, real volts)
{
    return @NAME_applied(loop, volts) != 0;
}

static inline void inner_reset(inner_state *loop)
{
    @NAME_reset(loop);
}

static inline bool inner_saturated(const inner_state *loop)
{
    return loop->last.saturated != 0u;
}

static inline bool inner_reading_ok(const inner_state *loop)
{
    return loop->last.measurement_ok != 0u;
}

#define INNER_SETTINGS @CAPITALS_SETTINGS
#if INNER_SETTINGS > 0
#define inner_setting_list @NAME_setting_list

typedef @NAME_settings inner_settings;

static inline void inner_settings_default(inner_settings *settings)
{
    @NAME_settings_default(settings);
}

static inline void inner_settings_seal(inner_settings *settings)
{
    @NAME_settings_seal(settings);
}

static inline bool inner_retune(inner_state *loop, const inner_settings *settings)
{
    return @NAME_retune(loop, settings) != 0;
}
#endif

#endif
"""
VECTORS_TEXT = """\
/*
 * Steps of the controller of piezotrack: reference, the next one, reading, feedforward, whether it
 * is reset before, what is reported after it, and the command.
 */
#include <stdint.h>

#define VECTORS @countu
#define VECTORS_BOUND @bound
#define VECTORS_APART @apart
#define NOT_FINITE ((real)(0.0f / 0.0f))
#define INFINITE ((real)(1.0f / 0.0f))

static const real vectors[VECTORS][7] = {
@rows};
"""
