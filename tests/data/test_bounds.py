"""Logs beyond any logger's: refused in a moment and in few words, or read in linear time."""

from __future__ import annotations

import re
import time
from typing import TYPE_CHECKING

import pytest

import piezotrack as pt
from piezotrack._support.messages import listed, quoted
from piezotrack._support.units import split_unit

if TYPE_CHECKING:
    from pathlib import Path

HEADER = "time_s,voltage_V,displacement_um\n"
ROWS = "0,0,0\n1,10,1\n2,20,3\n"


def refusal(folder: Path, text: str) -> str:
    path = folder / "log.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(pt.DataError) as caught:
        pt.read(path)
    message = str(caught.value)
    assert len(message) < 700, len(message)
    assert message.startswith("log.csv")
    return message


def test_a_line_longer_than_any_of_a_log_is_refused_by_its_number(tmp_path: Path) -> None:
    commas = "," * 3_000_000
    for line, text in ((1, commas + "\n" + ROWS), (3, HEADER + "0,0,0\n" + commas)):
        found = refusal(tmp_path, text)
        assert found.startswith(f"log.csv:{line}: this line has 3000000 characters and begins with")
        assert found.endswith("expected 1000000 at most")


def test_more_columns_than_any_log_has_are_refused(tmp_path: Path) -> None:
    found = refusal(tmp_path, "a," * 20_000 + "b\n" + ROWS)
    assert found == (
        "log.csv:1: this line has 20001 fields, the first 'a': expected 10000 columns at most"
    )


def test_ten_thousand_columns_are_read(tmp_path: Path) -> None:
    path = tmp_path / "wide.csv"
    more = "".join(f",c{k}" for k in range(9_997))
    rows = [row + ",1" * 9_997 for row in ROWS.split()]
    path.write_text("\n".join([HEADER.strip() + more, *rows]), encoding="utf-8")
    assert len(pt.read(path).columns) == 9_997


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (HEADER + "0,0,0\n1,10," + "z" * 500_000 + "\n2,3,4\n", r"log.csv:3: 'z+'\.\.\. in column"),
        (HEADER + '0,0,0\n1,10,"' + "1" * 200_000 + '"\n2,3,4\n', r"log.csv:3: "),
        (HEADER.replace("_um", "_um" * 100_000) + ROWS, r"log.csv:1: "),
        ("t;" * 3_000 + "u_V\n" + "0;" * 3_000 + "0\n", r"log.csv:1: several columns .* more;"),
        (HEADER + ROWS + "3" * 900_000 + "\n", r"log.csv:5: this line has 1 fields"),
        (HEADER.replace("_V", f" ({'V' * 90_000})") + ROWS, r"log.csv:1: "),
    ],
    ids=["field", "quoted", "title", "titles", "row", "unit"],
)
def test_what_a_message_quotes_of_a_file_is_short(tmp_path: Path, text: str, said: str) -> None:
    assert re.match(said, refusal(tmp_path, text))


@pytest.mark.parametrize(
    "title",
    [
        "x" + "_" * 900_000 + "!",
        "_" * 900_000,
        "(" * 450_000 + ")" * 450_000,
        "x" + " (" * 450_000 + "]",
        "a_" * 450_000,
        "a " * 450_000 + "!",
        ", _" * 300_000 + "um",
    ],
    ids=["underscores", "only those", "brackets", "unclosed", "pairs", "blanks", "mixed"],
)
def test_a_title_is_divided_in_linear_time(title: str) -> None:
    """With time as the square of the length these take from minutes to hours."""
    began = time.monotonic()
    name, unit = split_unit(title)
    assert time.monotonic() - began < 5.0
    assert len(name) + len(unit) <= len(title)


@pytest.mark.parametrize(
    ("title", "parts"),
    [
        ("x_um", ("x", "um")),
        ("x__,_um", ("x", "um")),
        ("__um", ("_", "um")),
        ("_um", ("_um", "")),
        ("a_b c um", ("a_b c", "um")),
        ("x _ [um]", ("x", "um")),
        ("(um)", ("", "um")),
        ("x (a) (um)", ("x (a)", "um")),
        ("x (a)um)", ("x (a)um)", "")),
        ("x (um", ("x (um", "")),
        ("x [um)", ("x", "um")),
        ("", ("", "")),
    ],
)
def test_a_title_is_divided_at_its_unit(title: str, parts: tuple[str, str]) -> None:
    assert split_unit(title) == parts


def test_values_in_messages_are_short() -> None:
    class Wordless:
        def __repr__(self) -> str:
            raise LookupError

    assert quoted("x" * 10**6) == f"{'x' * 100!r}..."
    assert quoted(b"x" * 10**6) == f"{b'x' * 100!r}..."
    assert quoted(list(range(10**5))).endswith("...")
    assert quoted(10**9999) == "an unprintable int"
    assert quoted(Wordless()) == "an unprintable Wordless"
    assert quoted("\x1b[31m") == repr("\x1b[31m")
    assert listed(["a"] * 30).endswith("'a' and 10 more")
