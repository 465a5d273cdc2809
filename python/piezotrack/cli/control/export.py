"""``piezotrack export``: a controller for firmware or for another program."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from ...errors import ParameterError
from ..command import Argument, Option, command, refuse_without_effect
from ..option_groups import Motion
from ..options import of_file
from ..output import Output
from ..values import FREQUENCY
from .controller_files import only_controller
from .loop_options import BeyondReach

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ...export.write import Exported

__all__ = ["export_command"]


@command()
def export_command(
    controller: Annotated[
        Path, Argument("Controller file in JSON, as `tune` writes it", "CONTROLLER")
    ],
    reference: Annotated[
        str | None,
        Argument(
            "Motion that repeats, as of `track`: its feedforward becomes a table of one period",
            "REFERENCE",
        ),
    ] = None,
    to: Annotated[
        Literal["c99", "firmware", "library", "json", "fmu"],
        Option(
            "C99 alone, a firmware project, C with libpiezotrack, coefficients, or a co-simulation "
            "unit (FMI 2.0)"
        ),
    ] = "c99",
    name: Annotated[
        str | None,
        Option("Name of files and functions; default that of CONTROLLER", metavar="NAME"),
    ] = None,
    single: Annotated[bool, Option("Numbers of 4 bytes in place of 8", names=("--float",))] = False,
    fixed: Annotated[bool, Option("Gains that are constants, not settings of NAME_retune")] = False,
    table: Annotated[
        Path | None,
        Option("One period of a feedforward to play, as `learn` writes it", metavar="FILE"),
    ] = None,
    clock: Annotated[
        float | None,
        Option("Clock of the processor: refused where a step does not fit the interval", FREQUENCY),
    ] = None,
    beyond_reach: BeyondReach = False,
    *,
    motion: Motion,
    output: Output,
) -> None:
    """Write a controller as C code, firmware, coefficients or an FMU."""
    from ...export.write import export_controller, export_files

    chosen = controller.stem.replace("-", "_") if name is None else name
    try:
        names = export_files(to, chosen)
    except ParameterError as error:
        if name is not None:
            raise
        raise ParameterError(f"{error}; --name gives one", argument="--name") from None
    if single and to in ("json", "library"):
        raise ParameterError("--float", f"no effect with --to {to}", "it left out", verb="has")
    if to not in ("c99", "firmware"):
        refuse_without_effect(("clock", "fixed"), f"with --to {to}")
    if reference is None:
        refuse_without_effect(("duration", "period", "beyond_reach"), "without REFERENCE")
    known = only_controller(controller, "`piezotrack tune` writes one of a model")
    values = None if table is None else _table(table, known.dt, known.drive_unit)
    desired = None if reference is None else motion.of(reference)
    output.will_write(names)
    done: list[Exported] = []

    def save(place: Path) -> list[Path]:
        options: dict[str, Any] = {"to": to, "name": chosen, "clock": clock}
        options |= {"single": single, "fixed": fixed, "beyond_reach": beyond_reach}
        done.append(export_controller(known, place, reference=desired, table=values, **options))
        return list(done[0].files)

    with of_file(controller):
        written = output.write(save)
    output.show(f"{known!r}\n{done[0]}", _document(done[0]), written)


def _table(file: Path, dt: float, unit: str) -> NDArray[np.float64]:
    """Read one period of a feedforward, with a sample for each interval."""
    from ...data.reader import drive_dataset

    record = drive_dataset(file)
    if abs(record.dt - dt) > 1e-6 * dt:
        raise ParameterError(
            f"--table {file} has samples every {1e3 * record.dt:g} ms: expected those of the "
            f"controller, every {1e3 * dt:g} ms"
        )
    if record.drive_unit != unit:
        raise ParameterError(
            f"--table {file} has a drive in {record.drive_unit}: expected {unit}, as the controller"
        )
    return record.u


def _document(done: Exported) -> dict[str, Any]:
    return {
        "state_bytes": done.state_bytes,
        "additions": done.additions,
        "multiplications": done.multiplications,
        "divisions": done.divisions,
        "instructions": done.instructions,
        "most_instructions": done.most_instructions,
        "bound": done.bound,
        "note": done.note,
    }
