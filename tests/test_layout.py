"""Folders of sources: each is small enough to be read at a glance."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from folders import ROOT

if TYPE_CHECKING:
    from pathlib import Path

MOST_FILES = 12
# The modules of the crate for firmware are public: their paths are its interface.
FLAT = ROOT / "rust" / "control" / "src"
SOURCES = [*(ROOT / "python/piezotrack").rglob("*.py"), *ROOT.glob("rust/*/src/**/*.rs")]


@pytest.mark.parametrize(
    "folder", sorted({file.parent for file in SOURCES} - {FLAT}), ids=lambda one: one.name
)
def test_a_folder_has_twelve_source_files_at_most(folder: Path) -> None:
    files = [one for one in SOURCES if one.parent == folder]
    # What introduces a folder is not counted.
    assert len({one.stem for one in files} - {"__init__", "mod", "lib"}) <= MOST_FILES


def test_the_tests_that_take_long_are_there() -> None:
    for line in (ROOT / "tests" / "long_tests.txt").read_text(encoding="utf-8").splitlines():
        path, _, test = line.partition("::")
        name = test.partition("[")[0]
        assert f"def {name}" in (ROOT / path).read_text(encoding="utf-8"), line
