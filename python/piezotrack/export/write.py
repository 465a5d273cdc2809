"""Export of a controller: C99, firmware, calls of the C library, coefficients in JSON, FMI 2.0."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from .. import _core
from .._support.arguments import expect, one_of, positive
from .._support.files.writing import make_folder, replacing, result_set, write_document
from .._support.units import shown_unit
from ..control.controller.controller import Controller
from ..errors import ParameterError
from ..references.reference import Reference
from .c99.instructions import check_clock, instructions_of
from .c99.parts import feedforward_table
from .c99.sources import c_sources, checked_name
from .firmware.project import firmware_project, project_files
from .fmu.unit import compiler, fmu_bytes
from .json_form import coefficients_document
from .library.calls import library_sources

if TYPE_CHECKING:
    import os
    from pathlib import Path

    from numpy.typing import ArrayLike

__all__ = ["Exported", "export_controller", "export_files"]

To = Literal["c99", "firmware", "library", "json", "fmu"]
FORMS = ("c99", "firmware", "library", "json", "fmu")
LEFT_OUT = (
    "without the feedforward, whose inverse is no filter: reference= or table= writes it as a table"
)
# What takes the place of an online inverse that is too slow.
REMEDIES = {
    "c99": "; reference= plays a table in place of the online inverse",
    "fmu": "; reference= plays a table in place of the online inverse",
    "firmware": "; without a feedforward it takes voltages from its client as a table",
}


@dataclass(frozen=True, kw_only=True)
class Exported:
    """Files that an export has written.

    Attributes
    ----------
    files : tuple of pathlib.Path
        The files.
    to : {"c99", "firmware", "library", "json", "fmu"}
        The form.
    state_bytes : int or None
        Bytes of the state in C; None for coefficients and for calls of the library.
    additions, multiplications, divisions : int or None
        Floating-point operations of a step that does not saturate; None as above.
    instructions, most_instructions : int or None
        Bounds of the instructions of a step within the limits and of any step, on a Cortex-M with a
        floating-point unit for its numbers; None as above.
    bound : float or None
        Largest difference to the Rust controller that ``check.c`` accepts, in the unit of the
        drive: 0 for doubles. None for coefficients.
    note : str
        What a person should know; empty for nothing.
    """

    files: tuple[Path, ...]
    to: To
    state_bytes: int | None = None
    additions: int | None = None
    multiplications: int | None = None
    divisions: int | None = None
    instructions: int | None = None
    most_instructions: int | None = None
    bound: float | None = None
    note: str = ""

    def __str__(self) -> str:
        if self.state_bytes is None:
            text = "coefficients" if self.to == "json" else "calls libpiezotrack"
            return f"{text}; {self.note}" if self.note else text
        text = f"state {self.state_bytes} bytes; a step has {self.additions} additions, "
        text += f"{self.multiplications} multiplications, {self.divisions} divisions"
        numbers = "doubles" if self.bound == 0.0 else "floats"
        text += (
            f"; at most {self.instructions} instructions on a Cortex-M with a unit for {numbers}"
        )
        if self.most_instructions != self.instructions:
            text += f", {self.most_instructions} beyond the limits"
        text += "" if self.bound == 0.0 else f"; within {self.bound:.3g} of the doubles"
        return f"{text}; {self.note}" if self.note else text


def export_files(to: To, name: str) -> list[str]:
    """Return the names of the files that an export writes."""
    checked_name(name)
    names = {
        "c99": [f"{name}.h", f"{name}.c", "check.c", "vectors.csv"],
        "library": [f"{name}.h", f"{name}.c", "check.c", "vectors.csv"],
        "json": [f"{name}.json"],
        "fmu": [f"{name}.fmu"],
    }
    one_of("to", to, FORMS)
    return project_files(name) if to == "firmware" else names[to]


def export_controller(
    controller: Controller,
    folder: str | os.PathLike[str],
    *,
    to: To = "c99",
    name: str = "controller",
    single: bool = False,
    fixed: bool = False,
    reference: Reference | None = None,
    table: ArrayLike | None = None,
    clock: float | None = None,
    beyond_reach: bool = False,
) -> Exported:
    """Write a controller for firmware or for another program.

    ``"c99"`` writes NAME.h and NAME.c, which allocate nothing and call no library, with test
    vectors and a program that checks them: doubles give the same bits as `Controller`. The gains
    change without compiling, by ``NAME_retune`` (see `settings_of`).
    ``"firmware"`` writes a project around them that builds for a board and for this computer.
    ``"library"`` writes the same functions for a program that is linked with libpiezotrack: every
    controller has this form, with the inverse of any stage sample by sample. ``"json"`` writes the
    linear parts as coefficients. ``"fmu"`` compiles the C into a unit for co-simulation (FMI 2.0,
    Linux x86-64), with its sources.

    Parameters
    ----------
    controller : Controller
        The controller.
    folder : path-like
        Folder of the files; files of the same names are replaced.
    to : {"c99", "firmware", "library", "json", "fmu"}, optional
        The form.
    name : str, optional
        Of the files and functions: an identifier of C.
    single : bool, optional
        Numbers are floats, not doubles.
    fixed : bool, optional
        The gains are constants of the C99, not settings that ``NAME_retune`` changes.
    reference : Reference, optional
        Motion that repeats: the feedforward is then played from a table of one settled period.
        C99 and FMU need it for every feedforward other than that of a Dahl stage.
    table : array_like, shape (n,), optional
        One period of a feedforward of your own, as `Learning.table`, in the unit of the drive: a
        sample for each interval of the controller. It takes the place of the controller's own.
    clock : float, optional
        Clock of the processor [Hz], of C99 and firmware: a step that could take longer than its
        interval is refused, at an instruction a cycle on a Cortex-M with a floating-point unit for
        its numbers.
    beyond_reach : bool, optional
        Whether `reference` may exceed the reach of the stage of the feedforward, as of `track`; its
        table is clipped to the limits.

    Returns
    -------
    Exported
        The files, bytes of the state, operations of a step.

    Raises
    ------
    ParameterError
        A part of the controller has no such form; the message names it. The reference exceeds the
        reach of the stage. A unit is asked for
        where there is no C compiler, or not on Linux, x86-64.
    DataError
        A file cannot be written; `table` has a voltage that is not finite or beyond the limits.
    ShapeError
        `table` is no table.

    Examples
    --------
    >>> import piezotrack as pt
    >>> loop = pt.Controller(dt=0.02, limits=(0.0, 75.0), feedback=pt.Pid.xu_li_2010())
    >>> done = pt.control.export_controller(loop, "firmware", name="axis")
    >>> done.state_bytes, done.instructions
    (168, 186)
    """
    expect("controller", controller, Controller, "pt.Controller")
    expect("reference", reference, (Reference, type(None)), "a Reference, as pt.sine(...)")
    single = _core.as_truth("single", single)
    fixed = _core.as_truth("fixed", fixed)
    if fixed and to not in ("c99", "firmware"):
        raise ParameterError("fixed", f"True with to={to!r}", "False, that is of C99 and firmware")
    names = export_files(to, name)
    free = _core.as_truth("beyond_reach", beyond_reach)
    played = feedforward_table(controller, reference, table, beyond_reach=free)
    note = _clipped(controller, played or [])
    if to == "json":
        if single:
            raise ParameterError("single", "True with to='json'", "False, JSON has doubles")
        document = coefficients_document(controller, played)
        path = write_document(make_folder(folder) / names[0], document)
        left_out = controller.feedforward is not None and played is None
        return Exported(files=(path,), to=to, note=LEFT_OUT if left_out else note)
    if to == "library":
        if single:
            raise ParameterError(
                "single", "True with to='library'", "False, the library has doubles"
            )
        texts = library_sources(controller, name, table=played, reference=reference)
        paths = _written({key: text.encode() for key, text in texts.items()}, folder)
        return Exported(files=paths, to=to, bound=0.0, note=note)
    chosen: dict[str, bool] = {"single": single, "fixed": fixed}
    if to == "firmware":
        if played is not None:
            raise ParameterError(
                "reference or table",
                "given with to='firmware'",
                "neither: tables are loaded over its link",
            )
        project = firmware_project(controller, name, **chosen)
        texts, sources = project.files, project.controller
    else:
        if to == "fmu":
            compiler()
            # A unit has no way to be told other settings.
            chosen["fixed"] = True
        sources = c_sources(controller, name, table=played, reference=reference, **chosen)
        texts = sources.files
    bounds = instructions_of(sources, repeats=controller.repetitive is not None)
    if clock is not None:
        check_clock(bounds, controller.dt, positive("clock", clock, "Hz"), REMEDIES[to])
    files = {key: text.encode() for key, text in texts.items()}
    if to == "fmu":
        files = {names[0]: fmu_bytes(controller, sources)}
    additions, multiplications, divisions = sources.operations
    return Exported(
        files=_written(files, folder),
        to=to,
        state_bytes=sources.state_bytes,
        additions=additions,
        multiplications=multiplications,
        divisions=divisions,
        instructions=bounds.usual,
        most_instructions=bounds.most,
        bound=sources.bound,
        note=note,
    )


def _clipped(controller: Controller, table: list[float]) -> str:
    """Say by how much a table is beyond the limits; empty where it is not."""
    low, high = controller.limits
    beyond = sum(not low <= volts <= high for volts in table)
    if not beyond:
        return ""
    unit, scale = shown_unit(controller.drive_unit)
    least, most, bottom, top = (f"{scale * one:.4g}" for one in (min(table), max(table), low, high))
    return (
        f"the table of the feedforward goes from {least} to {most} {unit}, and is clipped to the "
        f"limits, {bottom} to {top} {unit}, in {beyond} of {len(table)} samples: expected a motion "
        "that the stage can follow"
    )


def _written(files: dict[str, bytes], folder: str | os.PathLike[str]) -> tuple[Path, ...]:
    """Write the files in one go."""
    paths = []
    with result_set(make_folder(folder)) as there:
        for key, content in files.items():
            with replacing(there / key) as temporary:
                temporary.write_bytes(content)
            paths.append(there / key)
    return tuple(paths)
