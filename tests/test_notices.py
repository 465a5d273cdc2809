"""The licences of the crates that are linked in go with the wheel and the C library."""

from __future__ import annotations

import importlib.util
import re
import shutil
import tomllib

import pytest

from folders import ROOT

SPEC = importlib.util.spec_from_file_location("make_notices", ROOT / "docs/make_notices.py")
assert SPEC is not None
assert SPEC.loader is not None
MADE = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(MADE)
TEXT: str = MADE.NOTICES.read_text(encoding="utf-8")
LISTED = dict(re.findall(r"^([\w-]+ \d\S*): (.+)$", TEXT, re.MULTILINE))
STALE = "THIRD-PARTY.txt is out of date: run `make notices`"


def test_what_is_listed_is_locked() -> None:
    lock = tomllib.loads((ROOT / "Cargo.lock").read_text(encoding="utf-8"))
    assert LISTED
    assert LISTED.keys() <= {f"{one['name']} {one['version']}" for one in lock["package"]}, STALE


@pytest.mark.skipif(shutil.which("cargo") is None, reason="cargo is not there")
def test_what_is_linked_is_listed(monkeypatch: pytest.MonkeyPatch) -> None:
    # For this system only: its crates were downloaded for the build.
    monkeypatch.setenv("CARGO_NET_OFFLINE", "true")
    here = {" ".join(crate) for crate in MADE.linked()}
    assert "nalgebra" in {crate.split()[0] for crate in here}
    assert here <= LISTED.keys(), STALE


def test_each_crate_has_its_text() -> None:
    _, *parts = TEXT.split("-" * 80)
    covered = {crate for part in parts for crate in part.strip().splitlines()[0].split(", ")}
    assert LISTED.keys() <= covered
    # A licence that obliges to a text and a copyright line beside it.
    numpy = next(part for part in parts if re.match(r"\s*numpy \d", part))
    assert "Redistributions in binary form must reproduce" in numpy
    assert "Copyright" in numpy


def test_the_wheel_and_the_source_distribution_have_the_file() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    for name in project["license-files"]:
        assert (ROOT / name).is_file()
    assert MADE.NOTICES.name in project["license-files"]


def test_nothing_says_where_it_was_written() -> None:
    assert not re.search(r"/(home|root|Users|tmp)/|registry|index\.crates", TEXT)
