"""The C that is exported, as a safety reader sees it: its tree, calls, findings, foreign texts."""

from __future__ import annotations

import re
import shutil
import subprocess
import zipfile
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest

import piezotrack as pt
from c_exports import PARTS, PI, STRICT, checked, compiled, learner, loop, needs_gcc
from folders import ROOT
from piezotrack.export.c99.sources import c_sources
from piezotrack.export.c99.text import comment_of
from piezotrack.export.firmware.project import firmware_project
from piezotrack.export.fmu.unit import unit_header, variables
from piezotrack.export.library.calls import library_headers

export = pt.control.export_controller
# The sources of each form; the controller is that of c99 but in the form of a library.
TREES = {
    name: Path(str(files(f"piezotrack.export.{name}"))) / "source"
    for name in ("c99", "firmware", "fmu", "library")
}
TREE = TREES["c99"]
needs_arm = pytest.mark.skipif(
    shutil.which("arm-none-eabi-gcc") is None,
    reason="no cross compiler: arm-none-eabi-gcc is not installed",
)
needs_cppcheck = pytest.mark.skipif(
    shutil.which("cppcheck") is None, reason="no checker of C: cppcheck is not installed"
)
# Controllers that together have every file of the tree and each way through its conditions.
EVERY = ("all", "filters and jumps", "state space", "sliding mode, no integral", "perturbation",
         "hysteresis observer", "positive position feedback", "repetitive of the paper",
         "repetitive, part of a sample", "nothing")  # fmt: skip


def in_the_tree(name: str, folder: Path, **options: Any) -> list[str]:
    """Write the headers of what was chosen; the arguments that compile the tree with them."""
    for header, text in c_sources(loop(name), "axis", **options).headers.items():
        (folder / header).write_text(text)
    return [f"-I{folder}", str(TREE / "NAME.c")]


@needs_gcc
@pytest.mark.parametrize("name", EVERY)
def test_the_tree_compiles_as_it_is_and_gives_the_bits_of_rust(name: str, tmp_path: Path) -> None:
    """Without a word of Python between: the sources and the headers of what was chosen."""
    for options in ({"single": True}, {"fixed": True}, {}):
        arguments = in_the_tree(name, tmp_path, **options)
        compiled(tmp_path, *arguments, "-c", flags=(*STRICT, "-Wundef"))
    # The check of the joined export, around the tree.
    export(loop(name), tmp_path, name="NAME")
    for ending in ("c", "h"):
        (tmp_path / f"NAME.{ending}").unlink()
    compiled(tmp_path, "check.c", *arguments, flags=(*STRICT, f"-I{TREE}"))
    code, figures = checked(tmp_path)
    assert (code, figures["largest"], figures["flags"]) == (0, 0.0, 0.0)


def test_every_file_of_the_tree_is_in_an_export() -> None:
    titles = {}
    for file in TREE.rglob("*.c"):
        first = file.read_text(encoding="utf-8").splitlines()[0]
        if file.stem not in ("NAME", "check"):
            titles[first] = file.name
    # A title for each.
    assert len(titles) == len([*TREE.rglob("*.c")]) - 2
    table = {"Dahl": [1.0, 2.0]}
    written = ""
    for name in (*EVERY, "PID", "Dahl"):
        written += c_sources(loop(name), "axis", table=table.get(name)).files["axis.c"]
    assert {one for one in titles if one not in written} == set()


def written(headers: dict[str, str], folder: Path) -> tuple[str, ...]:
    """Write generated headers; the flags that compile a tree with them."""
    for header, text in headers.items():
        (folder / header).write_text(text)
    return (*STRICT, "-Wundef", f"-I{folder}", "-c")


@needs_gcc
@pytest.mark.parametrize("single", [False, True], ids=["double", "float"])
@pytest.mark.parametrize("name", ["filters and jumps", "Dahl", "nothing"])
def test_the_tree_of_a_firmware_compiles_as_it_is(name: str, single: bool, tmp_path: Path) -> None:
    project = firmware_project(replace(loop(name), span=(-2e-5, 1.5e-4)), "axis", single=single)
    flags = (*written(project.headers, tmp_path), f"-I{TREE}", f"-I{TREES['firmware']}")
    for file in sorted(TREES["firmware"].glob("*.c")):
        compiled(tmp_path, str(file), flags=flags)
    host = str(TREES["firmware"] / "boards" / "host.c")
    compiled(tmp_path, host, flags=(*flags, "-D_POSIX_C_SOURCE=200809L"))


@needs_gcc
@pytest.mark.parametrize(("name", "table"), [("PID", None), ("PID", [1.0, 2.0]), ("Dahl", None)])
def test_the_trees_of_unit_and_library_compile_as_they_are(
    name: str, table: list[float] | None, tmp_path: Path
) -> None:
    one = loop(name)
    sources = c_sources(one, "axis", table=table, fixed=True)
    unit = unit_header(one.dt, variables(sources.forward, "V")) + '#define UNIT_GUID "0"\n'
    flags = written(sources.headers | {"unit.h": unit}, tmp_path)
    compiled(tmp_path, str(TREES["fmu"] / "fmu.c"), flags=(*flags, f"-I{TREE}"))
    flags = written(library_headers(one, table), tmp_path)
    header = f"-I{ROOT / 'rust' / 'capi' / 'include'}"
    compiled(tmp_path, str(TREES["library"] / "NAME.c"), flags=(*flags, header))


def test_the_tree_is_in_the_wheel() -> None:
    """A change of a C file builds the wheel anew, and none of them is ignored."""
    sources = next(
        line for line in (ROOT / "Makefile").read_text().splitlines() if line.startswith("SOURCES")
    )
    assert {"'*.c'", "'*.h'", "'*.ld'", "Makefile"} <= set(sources.split())
    tree = ROOT / "python" / "piezotrack" / "export"
    ignored = subprocess.run(
        ["git", "check-ignore", "--no-index", *map(str, tree.rglob("source/**/*"))],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert ignored.stdout == ""


# Bare metal.

CORES = {
    True: ("-mcpu=cortex-m4", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard", "-mthumb"),
    False: ("-mcpu=cortex-m7", "-mfpu=fpv5-d16", "-mfloat-abi=hard", "-mthumb"),
}


@needs_arm
@pytest.mark.parametrize("single", [True, False], ids=["M4F", "M7"])
@pytest.mark.parametrize("name", ["all", "repetitive of the paper", "state space"])
def test_nothing_is_called_on_bare_metal(name: str, single: bool, tmp_path: Path) -> None:
    """No memset or memcpy of the compiler's making, no double on a unit of single precision."""
    export(loop(name), tmp_path, name="axis", single=single)
    for optimised in ("-O2", "-O3", "-Os"):
        command = ["arm-none-eabi-gcc", *CORES[single], *STRICT, optimised, "-nostdlib", "-c"]
        subprocess.run([*command, "axis.c", "-o", "axis.o"], cwd=tmp_path, check=True)
        undefined = subprocess.run(
            ["arm-none-eabi-nm", "-u", "axis.o"],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=True,
        )
        assert undefined.stdout == ""


@needs_arm
def test_a_double_is_made_of_calls_where_there_are_only_floats(tmp_path: Path) -> None:
    """On Cortex-M4F a double is arithmetic in software, by the compiler's own helpers alone."""
    export(loop("all"), tmp_path, name="axis")
    command = ["arm-none-eabi-gcc", *CORES[True], "-std=c99", "-O2", "-c", "axis.c"]
    subprocess.run(command, cwd=tmp_path, check=True)
    undefined = subprocess.run(
        ["arm-none-eabi-nm", "-u", "axis.o"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    ).stdout.split()[1::2]
    assert len(undefined) > 5
    assert all(re.fullmatch(r"__aeabi_(d\w+|f2d|u?i2d|ui2d|l\w+)", one) for one in undefined)


# MISRA C:2012, as cppcheck finds it. A page has a reason for each that is left.


def accepted(name: str) -> set[str]:
    page = (ROOT / "docs" / name).read_text(encoding="utf-8")
    table = page.partition("| rule of MISRA C:2012 |")[2].partition("\n\n")[0]
    rows = re.findall(r"^\| ([\d., ]+),", table, re.MULTILINE)
    return {rule for row in rows for rule in row.split(", ")}


def findings(folder: Path, file: str) -> str:
    command = ["cppcheck", "--addon=misra", "--std=c99", "--enable=style,warning", "-q", file]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
    return done.stderr


@needs_cppcheck
@pytest.mark.parametrize("name", ["all", "state space", "filters and jumps"])
def test_findings_of_misra_are_those_with_a_reason(name: str, tmp_path: Path) -> None:
    export(loop(name), tmp_path, name="axis")
    found = findings(tmp_path, "axis.c")
    rules = set(re.findall(r"misra-c2012-([\d.]+)", found))
    assert {"15.5", "8.9"} <= rules <= accepted("export.md")
    assert not rules & {"15.7", "14.4", "10.3", "10.4"}
    # Besides these it says only that a comparison with 0 either way is always true: not for NaN.
    others = set(re.findall(r"\[(\w+)\]$", found, re.MULTILINE))
    assert others <= {"incorrectLogicOperator", "oppositeExpression", "duplicateExpression"}


@needs_cppcheck
@pytest.mark.parametrize("file", ["firmware.c", "protocol.c", "ring.c", "text.c", "main.c"])
def test_findings_in_a_firmware_are_those_with_a_reason(file: str, tmp_path: Path) -> None:
    export(loop("filters and jumps"), tmp_path, name="axis", to="firmware")
    found = findings(tmp_path, file)
    rules = set(re.findall(r"misra-c2012-([\d.]+)", found))
    assert rules <= accepted("firmware.md")
    assert not rules & {"15.7", "14.4", "10.3", "10.4"}
    others = set(re.findall(r"\[(\w+)\]$", found, re.MULTILINE))
    # One number over itself is what is none.
    assert others <= {"duplicateExpression"}


@needs_cppcheck
@pytest.mark.parametrize("to", ["fmu", "library"])
def test_findings_in_the_other_forms_are_those_of_their_interfaces(to: Any, tmp_path: Path) -> None:
    (path, *_) = export(loop("all"), tmp_path, name="axis", to=to).files
    if to == "fmu":
        with zipfile.ZipFile(path) as unit:
            unit.extractall(tmp_path)
    found = findings(tmp_path, "sources/fmu.c" if to == "fmu" else "axis.c")
    rules = set(re.findall(r"misra-c2012-([\d.]+)", found))
    # FMI has no prototypes of a header, arguments that nobody uses, and instances behind void *.
    more = {"2.5", "2.7", "8.4", "11.5", "20.7"} if to == "fmu" else set()
    assert "15.5" in rules
    assert rules <= accepted("export.md") | more
    others = set(re.findall(r"\[(\w+)\]$", found, re.MULTILINE))
    assert others <= {"unusedStructMember"}


# Texts of the user's file.

HOSTILE = [
    "*/ int evil; /*",
    "??/\n*/ int evil; /*",
    "*??/\n/ int evil;",
    "*\\\n/ int evil;",
    "end of line \\",
    "Grüße \u2028 \x00 \x1b[2J",
    "/* /* **/ //*/",
]


@needs_gcc
@pytest.mark.parametrize("text", HOSTILE)
def test_a_text_of_the_file_does_not_leave_its_comment(text: str, tmp_path: Path) -> None:
    controller = loop("PID")
    # A file with such a text is refused; what is in memory is not looked at again.
    object.__setattr__(controller, "_provenance", {"model_sha256": text})
    export(controller, tmp_path, name="axis")
    source = (tmp_path / "axis.c").read_bytes()
    assert source.isascii()
    assert b"??" not in source
    assert b"\\\n" not in source
    compiled(tmp_path, "check.c", "axis.c", flags=STRICT)
    assert checked(tmp_path)[0] == 0
    names = subprocess.run(
        ["nm", "check"], cwd=tmp_path, capture_output=True, text=True, check=True
    ).stdout
    assert "axis_step" in names
    assert "evil" not in names


@pytest.mark.parametrize("text", HOSTILE)
def test_a_text_in_a_comment_is_one_line_of_ascii(text: str) -> None:
    line = comment_of(text)
    assert line.isascii()
    assert line.isprintable()
    assert not any(one in line for one in ("*/", "/*", "??", "\\"))
    assert comment_of(line) == line


@pytest.mark.parametrize(
    "name", ["", "1axis", "axis step", "axis*/", "axis\n", "achse_ü", "a" * 41, "damping", "_axis"]
)
def test_a_name_that_is_no_identifier_is_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(pt.ParameterError, match="name is"):
        export(loop("PID"), tmp_path / "out", name=name)
    assert not (tmp_path / "out").exists()


ROOTS = """
#include <math.h>
#include <stdio.h>
#include "axis.c"
int main(void)
{
    uint32_t seed = 1;
    long i, wrong = 0;
    for (i = 0; i < 300000; i++) {
        union { float value; uint32_t bits; } x;
        float right;
        seed = seed * 1664525u + 1013904223u;
        x.bits = (seed ^ (seed >> 13)) & 0x7fffffffu;
        if (i < 3) x.bits = (uint32_t)i;
        if (x.value != x.value) continue;
        right = sqrtf(x.value);
        wrong += square_root(x.value) != right;
    }
    printf("wrong %ld, of %ld\\n", wrong, i);
    return wrong != 0;
}
"""


@needs_gcc
def test_the_square_root_of_a_float_is_that_of_the_library(tmp_path: Path) -> None:
    export(loop("Dahl"), tmp_path, name="axis", single=True)
    (tmp_path / "roots.c").write_text(ROOTS)
    compiled(tmp_path, "roots.c", "-lm", flags=("-std=c99",))
    code, figures = checked(tmp_path)
    assert (code, figures["wrong"]) == (0, 0.0)


@needs_gcc
@pytest.mark.parametrize("name", PARTS)
def test_a_step_passes_every_warning(name: str, tmp_path: Path) -> None:
    for single in (False, True):
        export(loop(name), tmp_path, name="axis", single=single)
        compiled(tmp_path, "axis.c", "-c", flags=STRICT)
    # The header stands alone, and says what comes in and goes out.
    (tmp_path / "alone.c").write_text('#include "axis.h"\ntypedef int nothing;\n')
    compiled(tmp_path, "alone.c", "-c", flags=STRICT)


def test_the_header_says_units_ranges_and_flags(tmp_path: Path) -> None:
    controller = pt.Controller(
        dt=0.02, limits=(-5.0, 70.0), span=(-1e-5, 1.2e-4), max_jump=3e-6, feedback=PI,
        repetitive=learner(period=5.0, kq=0.3, tq=0.05),
    )  # fmt: skip
    export(controller, tmp_path, name="axis")
    header = (tmp_path / "axis.h").read_text()
    numbers = [float(one) for one in re.findall(r"-?\d+\.\d+(?:e-\d+)?|-?\d+e-\d+", header)]
    assert {0.02, -5.0, 70.0, -1e-5, 1.2e-4, 3e-6} <= set(numbers)
    for flag in ("saturated", "measurement_ok", "reference_ok"):
        assert re.search(rf"uint8_t {flag}; /\* .{{10,}} \*/", header)
