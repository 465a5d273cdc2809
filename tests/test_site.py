"""The site's own code: every public name has a place, and nothing is loaded from a network."""

from __future__ import annotations

import importlib.util
from typing import TYPE_CHECKING

import pytest

import piezotrack as pt
from folders import ROOT

if TYPE_CHECKING:
    from types import ModuleType


def extension(name: str) -> ModuleType:
    pytest.importorskip("sphinx")
    found = importlib.util.spec_from_file_location(name, ROOT / f"docs/extensions/{name}.py")
    assert found is not None
    assert found.loader is not None
    module = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    return module


def test_every_public_name_has_a_place() -> None:
    reference = extension("reference_pages")
    places = reference.places()
    for room in reference.ROOMS:
        for name in vars(getattr(pt, room))["__all__"]:
            ends = (f"piezotrack.{name}", f"piezotrack.{room}.{name}")
            # A package within a room, as `datasets`, has a place for each of its names.
            assert any(one in places for one in ends) or any(
                one.startswith(f"{ends[1]}.") for one in places
            ), name
    rooms = {*reference.ROOMS, "datasets", "__version__"}
    assert {f"piezotrack.{name}" for name in set(vars(pt)["__all__"]) - rooms} <= set(places)


def test_the_commands_page_has_the_options_of_a_command() -> None:
    page = extension("reference_pages").pages()["commands"]
    identify = page.partition("\n## identify\n")[2].partition("\n## ")[0]
    assert "--window" in identify
    assert "--model" in identify


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ('<script defer src="https://host/x.js"></script>', ["https://host/x.js"]),
        ('<link href="//host/x.css" rel="stylesheet">', ["//host/x.css"]),
        ("@font-face { src: url('https://host/f.woff2') }", ["https://host/f.woff2"]),
        ('@import "https://host/a.css";', ["https://host/a.css"]),
        ('<img alt="" src="http://host/p.png">', ["http://host/p.png"]),
        ('<a href="https://doi.org/10.1115/1.4001712">', []),
        ('<script src="_static/x.js"></script><img src="p.png">', []),
        ('<link rel="canonical" href="https://host/page.html">', []),
    ],
)
def test_what_is_loaded_from_a_network_is_found(text: str, found: list[str]) -> None:
    assert extension("offline").foreign(text) == found
