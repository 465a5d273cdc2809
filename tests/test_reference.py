"""The reference in docs/reference is that of the commands and docstrings."""

from __future__ import annotations

import importlib.util

import pytest

from folders import ROOT

SPEC = importlib.util.spec_from_file_location("make_reference", ROOT / "docs/make_reference.py")
assert SPEC is not None
assert SPEC.loader is not None
MADE = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(MADE)
WANTED: dict[str, str] = MADE.pages()


@pytest.mark.parametrize("name", WANTED)
def test_a_page_is_up_to_date(name: str) -> None:
    page = ROOT / "docs" / "reference" / name
    there = page.read_text(encoding="utf-8") if page.exists() else ""
    # Not `==` in the assertion, whose report of thousands of lines would hide what to do.
    same = there == WANTED[name]
    assert same, f"docs/reference/{name} is out of date: run `make reference`"


def test_no_other_page_is_there() -> None:
    there = {path.name for path in (ROOT / "docs" / "reference").iterdir()}
    assert there == set(WANTED)


def test_an_option_and_a_parameter_are_there() -> None:
    assert "| `--window A:B` |" in WANTED["commands.md"]
    assert "## pt.identify\n" in WANTED["identification.md"]
    assert "| `data : Dataset` | The record." in WANTED["identification.md"]
    assert "[pt.track](control.md#pttrack)" in WANTED["index.md"]
