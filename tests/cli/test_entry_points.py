"""Commands of other packages, by their entry points."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import pytest

from commands import ran, run
from distributions import install

if TYPE_CHECKING:
    from pathlib import Path

CODE = """\
def area(width_um: float, height_um: float = 2.0) -> None:
    "Multiply two lengths."
    print(f"{width_um * height_um:g} um2")
"""


@pytest.fixture(autouse=True)
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "their_commands", raising=False)
    return tmp_path


def declare(folder: Path, name: str) -> None:
    install(
        folder,
        CODE,
        group="piezotrack.commands",
        name=name,
        module="their_commands",
        function="area",
    )


def test_a_command_of_another_package_is_listed_and_runs(site: Path) -> None:
    declare(site, "area")
    assert "Multiply two lengths." in ran("--help")
    assert ran("area", "3", "--height-um", "4").strip() == "12 um2"
    assert run("area", "wide").exit_code == 2


def test_no_package_replaces_a_command(site: Path) -> None:
    declare(site, "info")
    assert "Multiply" not in ran("info", "--help")
