"""The site's own code: every public name has a place, and nothing is loaded from a network."""

from __future__ import annotations

import re

import gallery
import offline
import pytest
import reference_pages

import piezotrack as pt


def test_every_public_name_has_a_place() -> None:
    places = reference_pages.places()
    for room in reference_pages.ROOMS:
        for name in vars(getattr(pt, room))["__all__"]:
            ends = (f"piezotrack.{name}", f"piezotrack.{room}.{name}")
            # A package within a room, as `datasets`, has a place for each of its names.
            assert any(one in places for one in ends) or any(
                one.startswith(f"{ends[1]}.") for one in places
            ), name
    rooms = {*reference_pages.ROOMS, "datasets", "__version__"}
    assert {f"piezotrack.{name}" for name in set(vars(pt)["__all__"]) - rooms} <= set(places)


def test_the_commands_page_has_the_options_of_a_command() -> None:
    page = reference_pages.commands()
    identify = page.partition("\n## identify\n")[2].partition("\n## ")[0]
    assert "--window" in identify
    assert "--model" in identify


def test_every_script_of_the_gallery_has_its_place_and_a_picture() -> None:
    scripts = {path.name: path.read_text("utf-8") for path in gallery.SCRIPTS.glob("*.py")}
    assert sorted(gallery.ORDER) == sorted(scripts)
    drawn = re.compile(r"\.plot\w*\(|subplots\(")
    assert [name for name, text in scripts.items() if not drawn.search(text)] == []


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
    assert offline.foreign(text) == found
