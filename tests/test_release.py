"""The version is written once; what has to repeat it agrees."""

from __future__ import annotations

import re
import tomllib
from typing import Any

import piezotrack as pt
from folders import ROOT
from piezotrack.hardware.addresses import schemes


def toml(name: str) -> dict[str, Any]:
    return tomllib.loads((ROOT / name).read_text(encoding="utf-8"))


VERSION: str = toml("Cargo.toml")["workspace"]["package"]["version"]


def test_the_package_has_the_version_of_the_workspace() -> None:
    assert pt.__version__ == VERSION


def test_the_locks_have_the_version_of_the_workspace() -> None:
    # With another one, --locked refuses to build.
    tests = {"piezotrack-no-std", "piezotrack-fuzz", "piezotrack-fuzz-c"}
    for lock in ("Cargo.lock", "tests/no_std/Cargo.lock", "tests/fuzz/Cargo.lock"):
        own = [package for package in toml(lock)["package"] if "source" not in package]
        versions = {p["name"]: p["version"] for p in own if p["name"] not in tests}
        assert versions
        assert set(versions.values()) == {VERSION}, lock


def test_the_citation_and_the_changelog_have_the_version_and_one_date() -> None:
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    newest = re.search(r"^## \[(\d[^]]*)\] - (\d{4}-\d{2}-\d{2})$", changes, re.MULTILINE)
    assert newest is not None
    assert newest[1] == VERSION
    assert f"\nversion: {VERSION}\ndate-released: {newest[2]}\n" in citation


def test_the_recipe_has_the_version_and_the_dependencies_of_the_package() -> None:
    recipe = (ROOT / "packaging" / "conda" / "recipe.yaml").read_text(encoding="utf-8")
    assert f'\n  version: "{VERSION}"\n' in recipe
    project = toml("pyproject.toml")
    run = recipe.partition("  run:\n")[2].partition("\n\n")[0]
    listed = {line.strip(" -").replace(" ", "") for line in run.splitlines()}
    # Without its programs with windows, which conda packs apart.
    needed = {
        one.replace("matplotlib", "matplotlib-base") for one in project["project"]["dependencies"]
    }
    assert listed == {*needed, f"python{project['project']['requires-python']}"}
    assert f"maturin {project['build-system']['requires'][0].removeprefix('maturin')}" in recipe
    assert set(
        re.findall(r"^    - (\S+)$", recipe.partition("license_file:")[2], re.MULTILINE)
    ) == set(project["project"]["license-files"])


def test_each_kind_of_device_has_an_extra_and_what_imports_nothing_installs_nothing() -> None:
    """`pip install 'piezotrack[gcs]'` is what somebody types who has such a controller."""
    extras = toml("pyproject.toml")["project"]["optional-dependencies"]
    # A virtual stage is no device that one buys.
    devices = {*schemes(), "epics"} - {"virtual"}
    assert devices <= extras.keys()
    assert {name for name in devices if not extras[name]} == {"gcs", "scpi"}
