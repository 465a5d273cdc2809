"""All sentences that the program can print, one a line, to be read in one sitting.

Helps, notes, errors and summaries: texts of three words and more in the Python sources, and those
in the Rust sources, without comments, docstrings and tests.

    python .ci/sentences.py > target/sentences.txt
"""

from __future__ import annotations

import ast
import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

ROOT = Path(__file__).parent.parent
WORDS = re.compile(r"[A-Za-z]{2,}[^\w]+(?:[\w{}.%-]+[^\w]+){1,}[\w{}]+")
RUST = re.compile(r'//[^\n]*|"((?:[^"\\]|\\.)*)"|\'(?:[^\'\\]|\\.)\'', re.DOTALL)


def of_python(file: Path) -> Iterator[tuple[int, str]]:
    """Yield the texts of a module, and the docstrings of commands, which are their helps."""
    tree = ast.parse(file.read_text("utf-8"))
    scopes = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    docs = {
        id(node.body[0].value)
        for node in ast.walk(tree)
        if isinstance(node, scopes) and node.body and isinstance(node.body[0], ast.Expr)
        and not (isinstance(node, ast.FunctionDef) and node.name.endswith("_command"))
    }  # fmt: skip
    within: set[int] = set()
    for node in ast.walk(tree):
        if id(node) in docs or id(node) in within:
            continue
        if isinstance(node, ast.JoinedStr):
            within |= {id(part) for part in ast.walk(node)}
            parts = (
                str(part.value) if isinstance(part, ast.Constant) else "{}" for part in node.values
            )
            yield node.lineno, "".join(parts)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.lineno, node.value


def of_rust(file: Path) -> Iterator[tuple[int, str]]:
    """Yield the texts of a module before its tests."""
    source = file.read_text("utf-8").partition("#[cfg(test)]")[0]
    for found in RUST.finditer(source):
        if found[1]:
            line = source.count("\n", 0, found.start()) + 1
            yield line, re.sub(r"\\\n\s*", "", found[1])


def main() -> None:
    """Print all sentences, in the order of the files."""
    files = [(of_python, one) for one in sorted((ROOT / "python/piezotrack").rglob("*.py"))]
    files += [
        (of_rust, one)
        for one in sorted((ROOT / "rust").glob("*/src/**/*.rs"))
        if "tests" not in one.stem
    ]
    for read, file in files:
        for line, text in read(file):
            flat = " ".join(text.split())
            if WORDS.search(flat):
                sys.stdout.write(f"{file.relative_to(ROOT)}:{line}: {flat}\n")


if __name__ == "__main__":
    main()
