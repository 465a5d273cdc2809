"""Write docs/refused-logs.md: bad logs of every format, and the sentence that each is refused with.

Run as ``make refused``, or ``python docs/make_refused_logs.py`` where the package and the libraries
of all formats are installed; a test compares the page with what this would write. The bad files
are those of tests/helpers/bad_logs.py.
"""

from __future__ import annotations

import re
import sys
import tempfile
from contextlib import nullcontext
from pathlib import Path

import piezotrack as pt

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests" / "helpers"))

from bad_logs import KINDS, Case, Kind, cases, without  # noqa: E402
from log_writers import text  # noqa: E402

__all__ = ["PAGE", "page", "section", "sentence", "start"]

PAGE = ROOT / "docs" / "refused-logs.md"
HEAD = """<!-- Made by docs/make_refused_logs.py: do not edit, run `make refused`. -->

# Bad logs, and what is said of them

Each of these files was written, and read with `pt.read`; the sentence is what was raised, as
`pt.DataError` or, where an argument is wrong, as `pt.ParameterError`. The commands print the same,
with their options in place of arguments. A sound file has the columns `time` [s], `voltage` [V] and
`position` [um], of 400 samples at 200 Hz. `N` is the length of the file in bytes, and `'...'` what
the library that reads it says. How to read what is not read as it is: [logs](logs.md).
"""
# Of any format: what is no file at all.
NOWHERE = Kind("Any format", "log.csv", text)
NO_FILE = [
    Case("there is no such file", Path.absolute, "data/log.csv"),
    Case("a folder", Path.mkdir, "data"),
]


def page() -> str:
    """Return the text of the page."""
    return "\n".join([start(), *map(section, KINDS)])


def start() -> str:
    """Return what is before the tables of the formats."""
    return f"{HEAD}\n{_table(NOWHERE, NO_FILE)}"


def section(kind: Kind) -> str:
    """Return the table of one format."""
    return _table(kind, cases(kind))


def _table(kind: Kind, bad: list[Case]) -> str:
    rows = [f"| {case.wrong} | {_code(sentence(kind, case))} |" for case in bad]
    return "\n".join(
        [f"## {kind.name}\n", "| wrong input | what is said |", "| --- | --- |", *rows, ""]
    )


def sentence(kind: Kind, case: Case) -> str:
    """Return what is said of a bad file, without what another version of a library may change."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, case.file or kind.file)
        case.make(path)
        with without(case.missing) if case.missing else nullcontext():
            try:
                pt.read(path, **dict(case.arguments))
            except pt.PiezotrackError as error:
                said = str(error)
            else:
                raise SystemExit(f"{kind.name}: {case.wrong}: is read, expected it to be refused")
        size = path.stat().st_size if path.is_file() else 0
    said = said.replace(f"{folder}/", "")
    said = re.sub(r"(, or is cut off) \(.*\)$", r"\1 ('...')", said)
    if size:
        said = re.sub(rf"\b{200 * size} at most, as measured", "200 N at most, as measured", said)
        said = re.sub(rf"\b{size} bytes", "N bytes", said)
    return said


def _code(text: str) -> str:
    """Write a sentence as code in a cell of a table."""
    marks = "``" if "`" in text else "`"
    return f"{marks}{text}{marks}".replace("|", "\\|")


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
    print(PAGE)
