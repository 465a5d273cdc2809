"""The files of a firmware project: sources that are the same for all, and a configuration."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

from ...control.laws.damping.damping_law import DampingLaw
from ...errors import ParameterError
from ..c99.check import FORWARD
from ..c99.parts import parts_of, shape_of
from ..c99.settings import layout_of
from ..c99.sources import OBSERVERS, Sources, c_sources
from ..c99.text import literal, named_in
from ..c99.tree import choices_of, joined, source_of
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

# Files of the tree that take numbers and names of the controller.
JOINED = ("configuration.h", "vectors.h")
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
    headers : dict
        Headers with which the trees of sources compile as they are.
    """

    files: dict[str, str]
    controller: Sources
    headers: dict[str, str]


def project_files(name: str) -> list[str]:
    """Return the paths of the files of a project, those of the controller first."""
    # Guards of headers are in capitals.
    if name.lower() in TAKEN:
        raise ParameterError("name", f"{name!r}, a file of the firmware", "another name")
    return [f"{name}.h", f"{name}.c", *(path for path, _ in _sources(source_of(__package__)))]


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
    law = inside.feedback
    # Of these a float is not compared where no reading answers: check.c closes the loop for them.
    compared = not (single and law is not None and law.info.name in OBSERVERS)
    headers = {
        "numbers.h": _numbers_text(inside, name, span, single=single),
        "rows.h": _rows_text(rows, sources, single=single, compared=compared),
    }
    choices = choices_of(FORWARD[sources.forward])
    for path, text in _sources(source_of(__package__)):
        texts[path] = text.replace("@NAME", name)
        if path in JOINED:
            texts[path] = named_in(name, joined(path, choices, headers, __package__))
    return Project(texts, sources, sources.headers | headers)


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
        if isinstance(controller.feedback, DampingLaw):
            raise ParameterError(
                "feedforward",
                "left to the client",
                "one with a form in C, or another law: this one damps the deviation from the "
                "reference where the board has the inverse",
            ) from error
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


def _numbers_text(
    controller: Controller, name: str, span: tuple[float, float], *, single: bool
) -> str:
    """Write name and numbers of the controller for its configuration."""
    low, high = controller.limits
    numbers = {
        "SAMPLING_INTERVAL": controller.dt,
        "LIMITS_LOW": low,
        "LIMITS_HIGH": high,
        "SAFE_VOLTS": min(max(0.0, low), high),
        "SAFE_STEP": (high - low) * min(controller.dt / RAMP, 1.0),
        "SENSOR_LOW_METRES": span[0],
        "SENSOR_HIGH_METRES": span[1],
    }
    lines = [f'INNER_NAME "{name}"', 'DRIVE_UNIT "V"', f"REAL_BYTES {4 if single else 8}u"]
    lines += [f"{key} ((real){literal(one, key, single=single)})" for key, one in numbers.items()]
    return "".join(f"#define {line}\n" for line in lines)


def _rows_text(rows: list[Row], sources: Sources, *, single: bool, compared: bool) -> str:
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
    bound = literal(sources.bound, "bound", single=single).partition(" ")[0]
    return (
        f"#define VECTORS {len(rows)}u\n"
        f"#define VECTORS_BOUND {bound}\n"
        f"#define VECTORS_APART {0 if compared else len(rows)}u\n\n"
        f"static const real vectors[VECTORS][7] = {{\n{''.join(lines)}}};\n"
    )
