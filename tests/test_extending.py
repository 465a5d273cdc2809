"""The page on extending: its excerpts are those of the files."""

from __future__ import annotations

import re
import tomllib

import pytest

from folders import ROOT

PAGE = (ROOT / "docs" / "extending.md").read_text(encoding="utf-8")
EXCERPTS = re.findall(r"^```(?:rust|py) (\S+)\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)


def test_the_page_has_excerpts() -> None:
    assert len(EXCERPTS) > 5


@pytest.mark.parametrize(("path", "code"), EXCERPTS)
def test_an_excerpt_is_in_its_file(path: str, code: str) -> None:
    assert code in (ROOT / path).read_text(encoding="utf-8")


@pytest.mark.parametrize(
    "trait", sorted(set(re.findall(r"^\| `([\w:]+)(?:<f64>)?` \|", PAGE, re.M)))
)
def test_a_trait_has_the_methods_that_the_page_lists(trait: str) -> None:
    row = re.search(rf"^\| `{trait}(?:<f64>)?` \| ([^|]*)\|", PAGE, re.MULTILINE)
    sources = "\n".join(
        path.read_text(encoding="utf-8") for path in (ROOT / "rust").glob("*/src/**/*.rs")
    )
    name = trait.rpartition("::")[2]
    body = re.search(rf"^pub trait {name}\b[^{{]*{{\n(.*?)^}}", sources, re.MULTILINE | re.DOTALL)
    assert row
    assert body
    found = re.findall(r"^ {4}(?:const|fn) (\w+)", body[1], re.MULTILINE)
    assert re.findall(r"`(\w+)`", row[1]) == found
    assert sum(part.islower() for part in found) <= 4


def named_in(section: str) -> str:
    text = PAGE.partition(f"\n## {section}\n")[2].partition("\n## ")[0]
    assert text
    return text


def test_the_page_names_the_file_where_a_law_is_a_variant() -> None:
    section = named_in("A controller")
    holding = [
        path.relative_to(ROOT).as_posix()
        for path in (ROOT / "rust").rglob("*.rs")
        if re.search(r"^ *pub enum Law(State)? \{", path.read_text(encoding="utf-8"), re.MULTILINE)
    ]
    assert holding
    assert all(f"`{path}`" in section for path in holding)


def test_the_page_names_every_adapter() -> None:
    section = named_in("A device")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    for value in project["entry-points"]["piezotrack.devices"].values():
        module = value.partition(":")[0].split(".")[2:]
        name = f"{module[0]}/" if len(module) > 1 else f"{module[0]}.py"
        assert name in section
