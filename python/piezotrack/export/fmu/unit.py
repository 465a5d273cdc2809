"""A controller as a co-simulation unit of FMI 2.0, with its sources and a binary for Linux."""

from __future__ import annotations

import hashlib
import io
import os
import platform
import shutil
import subprocess
import tempfile
import zipfile
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple
from xml.sax.saxutils import quoteattr

from ... import _core
from ..._support.messages import quoted
from ...errors import DataError, ParameterError
from ..c99.check import FORWARD
from ..c99.text import named_in
from ..c99.tree import choices_of, joined

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ...control.controller.controller import Controller
    from ..c99.sources import Sources

__all__ = ["FLAGS", "compiler", "fmu_bytes", "unit_header"]

# Without fused multiply-add: the same bits as of the Rust controller.
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fvisibility=hidden", "-fPIC", "-shared")
# As of all archives that are to be the same for the same controller.
LONG_AGO = (1980, 1, 1, 0, 0, 0)
LONGEST_COMPILATION = 120.0
# Value references from here on are outputs, and truth values among them.
OUTPUTS_FROM, FLAGS_FROM = 4, 10
# The third input, by where the feedforward comes from.
FORWARD_INPUT = {
    "given": ("feedforward", "Feedforward of your own, 0 for none"),
    "online": ("next", "Desired displacement one step later"),
}


class Variable(NamedTuple):
    """A variable of the unit, with its value reference."""

    number: int
    name: str
    causality: str
    unit: str
    text: str


def variables(forward: str, unit: str) -> list[Variable]:
    """List the variables; the C has their value references from `unit_header`."""
    third = []
    if forward in FORWARD_INPUT:
        name, text = FORWARD_INPUT[forward]
        third = [Variable(2, name, "input", unit if forward == "given" else "m", text)]
    report = "What the amplifier gave; 1e300 for no report"
    return [
        Variable(0, "reference", "input", "m", "Desired displacement"),
        Variable(1, "measured", "input", "m", "Measured displacement"),
        *third,
        Variable(3, "applied", "input", unit, report),
        Variable(4, "command", "output", unit, "Command, within the limits"),
        Variable(5, "unclipped", "output", unit, "The same before it was clipped"),
        Variable(6, "feedforward_part", "output", unit, "Feedforward part"),
        Variable(7, "feedback_part", "output", unit, "Feedback part"),
        Variable(8, "repetitive_part", "output", unit, "Repetitive part"),
        Variable(9, "error", "output", "m", "Tracking error"),
        Variable(FLAGS_FROM, "saturated", "output", "", "Whether it was clipped"),
        Variable(FLAGS_FROM + 1, "measurement_ok", "output", "", "Whether there was a measurement"),
        Variable(FLAGS_FROM + 2, "reference_ok", "output", "", "Whether there was a reference"),
    ]


def compiler() -> list[str]:
    """Find the C compiler: the program, and the options that CC in the environment has beside it.

    Raises
    ------
    ParameterError
        There is none, that of CC in the environment is not there, or it would not compile for
        Linux on x86-64.
    """
    system, machine = platform.system(), platform.machine()
    if (system, machine) != ("Linux", "x86_64"):
        raise ParameterError(
            f"a unit has a binary for Linux, x86-64, which is not compiled on {system}, {machine}: "
            "expected to='c99', whose sources every machine compiles",
            argument="to",
        )
    command = os.environ.get("CC", "").split()
    if command and shutil.which(command[0]) is None:
        raise ParameterError(
            "CC",
            f"{quoted(command[0])}, which cannot be run",
            "the name of a C compiler, or no CC in the environment",
        )
    if command:
        return command
    for name in ("gcc", "cc", "clang"):
        if found := shutil.which(name):
            return [found]
    raise ParameterError(
        "no C compiler was found for the binary of the unit: expected gcc, cc or clang, or CC= in "
        "the environment",
        argument="to",
    )


def fmu_bytes(controller: Controller, sources: Sources) -> bytes:
    """Make the unit: an archive of description, sources and binary.

    Parameters
    ----------
    controller : Controller
        The controller.
    sources : Sources
        The same in C.

    Returns
    -------
    bytes
        The archive.

    Raises
    ------
    ParameterError
        There is no C compiler.
    DataError
        It does not compile.
    """
    name, unit = sources.name, controller.drive_unit
    code = {key: text for key, text in sources.files.items() if key in (f"{name}.c", f"{name}.h")}
    header = unit_header(controller.dt, variables(sources.forward, unit))
    digest = hashlib.sha256("".join((*code.values(), header)).encode()).hexdigest()
    header += f'#define UNIT_GUID "{digest}"\n'
    functions = joined(
        "fmu.c", choices_of(FORWARD[sources.forward]), {"unit.h": header}, package=__package__
    )
    code["fmu.c"] = named_in(name, functions)
    files = {"modelDescription.xml": _description(controller, sources, digest, unit).encode()}
    files |= {f"sources/{key}": text.encode() for key, text in code.items()}
    files[f"binaries/linux64/{name}.so"] = _binary(name, code)
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as out:
        for key, content in files.items():
            out.writestr(zipfile.ZipInfo(key, LONG_AGO), content, zipfile.ZIP_DEFLATED)
    return archive.getvalue()


def unit_header(dt: float, listed: Sequence[Variable]) -> str:
    """Write interval, counts and value references for the C, without the identifier."""
    lines = [f"UNIT_INTERVAL {float(dt).hex()} /* of a sample, s */"]
    lines += [f"UNIT_INPUTS {OUTPUTS_FROM}u", "UNIT_NO_REPORT 1e300"]
    lines += [f"UNIT_{one.name.upper()} {one.number}u /* {one.text} */" for one in listed]
    return "".join(f"#define {line}\n" for line in lines)


def _binary(name: str, code: dict[str, str]) -> bytes:
    """Compile the shared library."""
    with tempfile.TemporaryDirectory() as folder:
        for key, text in code.items():
            Path(folder, key).write_text(text, encoding="utf-8")
        command = [*compiler(), *FLAGS, "-o", f"{name}.so", "fmu.c", f"{name}.c"]
        done = subprocess.run(
            command,
            cwd=folder,
            capture_output=True,
            text=True,
            check=False,
            timeout=LONGEST_COMPILATION,
        )
        if done.returncode != 0:
            first = next(iter(done.stderr.splitlines()), "no reason given")
            raise DataError(f"the unit does not compile with {command[0]}: {first}")
        return Path(folder, f"{name}.so").read_bytes()


def _description(controller: Controller, sources: Sources, digest: str, unit: str) -> str:
    """Write modelDescription.xml."""
    listed = variables(sources.forward, unit)
    outputs = [i for i, one in enumerate(listed, start=1) if one.causality == "output"]
    unknowns = "\n".join(f'      <Unknown index="{i}" dependencies=""/>' for i in outputs)
    scalars = "\n".join(_scalar(one) for one in listed)
    units = "\n".join(f'    <Unit name="{one}"/>' for one in sorted({"m", unit}))
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName={quoteattr(sources.name)}
  guid="{digest}" description={quoteattr(repr(controller))}
  generationTool="piezotrack {_core.__version__}" variableNamingConvention="flat"
  numberOfEventIndicators="0">
  <CoSimulation modelIdentifier={quoteattr(sources.name)}
    canHandleVariableCommunicationStepSize="false" canNotUseMemoryManagementFunctions="false">
    <SourceFiles>
      <File name="fmu.c"/>
      <File name={quoteattr(sources.name + ".c")}/>
    </SourceFiles>
  </CoSimulation>
  <UnitDefinitions>
{units}
  </UnitDefinitions>
  <DefaultExperiment stepSize="{float(controller.dt)!r}"/>
  <ModelVariables>
{scalars}
  </ModelVariables>
  <ModelStructure>
    <Outputs>
{unknowns}
    </Outputs>
    <InitialUnknowns>
{unknowns}
    </InitialUnknowns>
  </ModelStructure>
</fmiModelDescription>
"""


def _scalar(variable: Variable) -> str:
    kind = "Boolean" if variable.number >= FLAGS_FROM else "Real"
    unit = f" unit={quoteattr(variable.unit)}" if variable.unit else ""
    start = ""
    if variable.causality == "input":
        start = ' start="1e300"' if variable.name == "applied" else ' start="0"'
    return (
        f"    <ScalarVariable name={quoteattr(variable.name)} "
        f'valueReference="{variable.number}" causality="{variable.causality}" '
        'variability="discrete" '
        f"description={quoteattr(variable.text)}>\n      <{kind}{unit}{start}/>\n"
        "    </ScalarVariable>"
    )
