"""Docstrings: every example runs, every parameter is documented."""

from __future__ import annotations

import ast
import doctest
import importlib
import inspect
import pkgutil
import re
import subprocess
import sys
import types
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt
from folders import ROOT

if TYPE_CHECKING:
    from types import ModuleType

MODULES = sorted(
    {"piezotrack"}
    | {
        module.name
        for module in pkgutil.walk_packages(pt.__path__, "piezotrack.")
        if module.name != "piezotrack._core"
    }
)

# Modules and scripts whose examples search with full budgets.
SLOW = {
    "piezotrack.xu_li_2010.reproduction",
    *("bouc_wen_benchmark.py", "calibrate_virtual_stage.py", "hundred_cycles.py"),
    *("compare_models.py", "track_virtual_stage.py", "trace_circle.py", "learn_raster.py"),
    "tune_gains.py",
}


# Examples.


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[pytest.mark.slow] if name in SLOW else []) for name in MODULES],
)
def test_the_examples_in_docstrings_run(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    result = doctest.testmod(importlib.import_module(name))
    assert result.failed == 0


# Docstrings.

ROOMS = [pt, pt.control, pt.data, pt.identification, pt.references, pt.stages, pt.xu_li_2010]


def listed(room: ModuleType) -> list[tuple[str, str | None]]:
    """The names that the stub of a package exports, each with the name behind "as"."""
    assert room.__file__ is not None
    stub = Path(room.__file__).with_suffix(".pyi").read_text(encoding="utf-8")
    return [
        (imported.name, imported.asname)
        for line in ast.parse(stub).body
        if isinstance(line, ast.ImportFrom)
        for imported in line.names
    ]


# A union of types, as pt.control.Plant, cannot have a docstring of its own.
PUBLIC = {
    name: value
    for room in ROOMS
    for name, _ in listed(room)
    if name != "__version__"
    and not inspect.ismodule(value := getattr(room, name))
    and not isinstance(value, types.UnionType)
}
DOC = re.compile(r" *//[/!] ?(.*)")
CLASSES = {name: value for name, value in PUBLIC.items() if inspect.isclass(value)}


def members() -> dict[str, Any]:
    """The public functions, classes and methods, by the names they are used with."""
    all_members = dict(PUBLIC)
    for owner, value in CLASSES.items():
        for name, member in inspect.getmembers(value):
            module = getattr(
                inspect.unwrap(getattr(member, "fget", None) or member), "__module__", ""
            )
            if not name.startswith("_") and str(module).startswith("piezotrack"):
                all_members[f"{owner}.{name}"] = member
    return all_members


MEMBERS = members()


def documented(value: Any, *sections: str) -> set[str]:
    """The names that numpydoc sections of a docstring explain."""
    lines = (inspect.getdoc(value) or "").splitlines()
    names: set[str] = set()
    section = ""
    for line, below in zip(lines, [*lines[1:], ""], strict=True):
        if line and set(below) == {"-"}:
            section = line
        elif section in sections and line and not line.startswith((" ", "-")):
            names.update(name.strip(" *") for name in line.partition(" : ")[0].split(","))
    return names


def parameters(value: Any) -> set[str]:
    return {name.lstrip("*") for name in inspect.signature(value).parameters} - {"self", "cls"}


def doc_openings(path: Path) -> list[tuple[int, str]]:
    """The first line of each doc comment of a Rust source, with its number."""
    lines = [DOC.match(line) for line in path.read_text(encoding="utf-8").splitlines()]
    return [
        (number, line[1])
        for number, (above, line) in enumerate(pairwise([None, *lines]), 1)
        if line and not above
    ]


def test_no_docstring_opens_with_a_question() -> None:
    defined = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    assert not [
        f"{path.relative_to(ROOT)}:{getattr(node, 'lineno', 1)}"
        for path in sorted((ROOT / "python").rglob("*.py"))
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, defined) and (ast.get_docstring(node) or "").startswith("What ")
    ]


def test_no_doc_comment_of_rust_opens_with_a_question() -> None:
    assert not [
        f"{path.relative_to(ROOT)}:{number}"
        for path in sorted((ROOT / "rust").rglob("*.rs"))
        for number, line in doc_openings(path)
        if line.startswith("What ")
    ]


@pytest.mark.parametrize("name", MEMBERS)
def test_every_public_name_has_a_docstring(name: str) -> None:
    text = inspect.getdoc(MEMBERS[name])
    assert text
    first = text.splitlines()[0]
    assert first.endswith("."), first


FUNCTIONS = [name for name in MEMBERS if inspect.isroutine(MEMBERS[name])]


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_parameter_of_a_function_is_documented(name: str) -> None:
    assert documented(MEMBERS[name], "Parameters") == parameters(MEMBERS[name])


@pytest.mark.parametrize("name", FUNCTIONS)
def test_what_a_function_returns_is_documented(name: str) -> None:
    returned = inspect.signature(MEMBERS[name]).return_annotation
    if returned not in (None, "None"):
        assert (
            documented(MEMBERS[name], "Returns", "Yields")
            or "Return" in (inspect.getdoc(MEMBERS[name]) or "").partition("\n")[0]
        )


@pytest.mark.parametrize("name", CLASSES)
def test_every_field_of_a_class_is_documented(name: str) -> None:
    value = CLASSES[name]
    if issubclass(value, BaseException):
        fields = {"partial"} if value is pt.Interrupted else set()
    else:
        fields = parameters(value)
    explained: set[str] = set()
    for base in value.__mro__:
        if base.__module__.startswith("piezotrack"):
            explained |= documented(base, "Parameters", "Attributes")
    assert fields <= explained, fields - explained
    assert documented(value, "Parameters", "Attributes") <= fields | {"partial", "argument"}


@pytest.mark.parametrize(
    "example",
    [
        pytest.param(path, marks=[pytest.mark.slow] if path.name in SLOW else [], id=path.name)
        for path in sorted((ROOT / "python" / "examples").glob("*.py"))
    ],
)
def test_the_examples_run(example: Path, tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-W", "error", str(example)],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=600.0,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    written = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert written
    for path in written:
        if path.suffix == ".json" and path.name != "campaign.json":
            assert np.isfinite(pt.load(path).model.simulate([0.0, 1.0], 0.01).x).all()


@pytest.mark.parametrize("room", ROOMS, ids=lambda room: room.__name__)
def test_every_public_name_is_there_and_listed(room: ModuleType) -> None:
    names = [name for name, _ in listed(room)]
    # A name is exported to type checkers only where it is repeated behind "as".
    assert [shown for _, shown in listed(room)] == names
    # What runs and what type checkers see.
    assert vars(room)["__all__"] == sorted(names)
    assert len(set(names)) == len(names)
    for name in names:
        assert getattr(room, name) is not None
    assert set(names) <= set(dir(room))
    with pytest.raises(AttributeError, match="'Bogus'"):
        room.Bogus  # noqa: B018


def test_a_name_at_the_top_is_that_of_its_room() -> None:
    for name, _ in listed(pt):
        homes = [room for room in ROOMS[1:] if name in vars(room)["__all__"]]
        for room in homes:
            assert getattr(room, name) is getattr(pt, name)
