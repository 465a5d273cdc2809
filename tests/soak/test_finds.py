"""What the fuzzers have found, replayed: `finds/README.md` says how a find is added."""

from __future__ import annotations

import ast
import json
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from file_readers import READERS, faults_of_file
from shells import faults_of_command
from soak import NAMES, REFUSED, not_finite, verdict_of

FINDS = Path(__file__).parent / "finds"


def named(pattern: str) -> list[Any]:
    found = sorted(FINDS.glob(pattern))
    return [pytest.param(path, id=str(path.relative_to(FINDS))) for path in found]


@pytest.mark.parametrize("path", named("calls/*.txt"))
def test_calls(path: Path) -> None:
    names: dict[str, Any] = dict(NAMES)
    refused: set[str] = set()
    for statement in ast.parse(path.read_text(encoding="utf-8")).body:
        named_here = [node for node in ast.walk(statement) if isinstance(node, ast.Name)]
        made = {node.id for node in named_here if isinstance(node.ctx, ast.Store)}
        if refused & {node.id for node in named_here}:
            refused |= made
            continue
        code = compile(ast.Module([statement], []), path.name, "exec")
        faults, value = verdict_of(partial(exec, code, names))
        assert faults == [], ast.unparse(statement)[:300]
        if value is REFUSED:
            refused |= made
        elif isinstance(statement, ast.Assign) and "(" in ast.unparse(statement):
            value = names.get(ast.unparse(statement.targets[0]))
            is_new = ast.unparse(statement.value).startswith("pt.")
            assert is_new or not list(not_finite(value)), ast.unparse(statement)[:300]


@pytest.mark.parametrize("path", [p for kind in READERS for p in named(f"{kind}/*")])
def test_files(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    faults, _ = faults_of_file(path.parent.name, path.read_bytes())
    assert faults == []


@pytest.mark.parametrize("path", named("commands/*.json"))
def test_commands(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    find = json.loads(path.read_text(encoding="utf-8"))
    for name, content in find["files"].items():
        Path(name).write_text(content, encoding="utf-8")
    assert faults_of_command(find["arguments"])[0] == []
