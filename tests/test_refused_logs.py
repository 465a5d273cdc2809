"""The sentences of docs/refused-logs.md are those that bad logs are refused with."""

from __future__ import annotations

import importlib.util
import re
import tempfile

import pytest

from bad_logs import KINDS, Kind
from folders import ROOT

SPEC = importlib.util.spec_from_file_location(
    "make_refused_logs", ROOT / "docs" / "make_refused_logs.py"
)
assert SPEC is not None
assert SPEC.loader is not None
MADE = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(MADE)
TEXT: str = MADE.PAGE.read_text(encoding="utf-8")
ROWS = re.findall(r"^\| ([^|]+) \| `(.+)` \|$", TEXT, re.MULTILINE)
# Beside "expected": what a person has to do, or what a field is not.
REMEDIES = (
    "expected",
    "no such file",
    "name it with",
    "choose one with",
    "units=",
    "the columns are",
    "is not a",
)


@pytest.mark.parametrize("kind", KINDS, ids=[kind.name for kind in KINDS])
def test_the_table_of_a_format_is_up_to_date(kind: Kind) -> None:
    for library in (kind.library, "hdf5storage" if kind.name == "MAT v7.3" else ""):
        if library:
            pytest.importorskip(library)
    same = MADE.section(kind) in TEXT
    assert same, f"docs/refused-logs.md is out of date for {kind.name}: run `make refused`"


def test_nothing_else_is_on_the_page() -> None:
    titles = re.findall(r"^## (.*)$", TEXT, re.MULTILINE)
    assert titles == [MADE.NOWHERE.name, *(kind.name for kind in KINDS)]
    assert TEXT.startswith(MADE.start())


def test_every_format_that_is_read_has_a_table() -> None:
    from piezotrack.data.formats import FORMATS

    files = [said.partition(":")[0] for _, said in ROWS]
    for known in FORMATS:
        assert not known.endings or any(one.endswith(known.endings) for one in files), known.name


@pytest.mark.parametrize(("wrong", "message"), ROWS)
def test_a_sentence_names_the_file_and_what_was_expected(wrong: str, message: str) -> None:
    file, colon, rest = message.partition(": ")
    assert colon, wrong
    assert re.fullmatch(r"[\w.-]+(:\d+)?", file)
    assert any(remedy in rest for remedy in REMEDIES), message
    # No folder of the machine that the page was made on.
    assert tempfile.gettempdir() not in message
    assert str(ROOT) not in message
