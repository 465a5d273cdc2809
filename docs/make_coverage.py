"""Put into docs/coverage.md how much of the code the tests reach, as ``make coverage`` counted it.

Run as ``python docs/make_coverage.py FOLDER``, where ``python.json`` of coverage.py and
``rust.lcov`` are. It writes there, into ``missed.txt``, the lines of each file that none reaches.
The reasons on the page are written by hand. Where three statements of Python in a row are not
reached and the page does not name the file, they are printed; the run ends with an error if that
is so where hardware or files are handled.
"""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "coverage.md"
BEGIN, END = "<!-- Table of make coverage. -->", "<!-- End of the table. -->"
PACKAGE = "python/piezotrack/"
# Statements in a row that need a test or a reason, and where the run ends without.
BLOCK = 3
STRICT = ("_support/files/", "adapters/", "control/on_device/", "data/formats/", "hardware/")


@dataclass
class Counts:
    """Lines with code and ends of branches, and those of them that were reached."""

    reached: set[int] = field(default_factory=set)
    missed: set[int] = field(default_factory=set)
    ends: int = 0
    taken: int = 0

    def blocks(self) -> Iterator[list[int]]:
        """Yield the lines that were not reached, those in a row together."""
        row: list[int] = []
        for line in [*sorted(self.reached | self.missed), -1]:
            if line in self.missed:
                row.append(line)
            elif row:
                yield row
                row = []


def of_python(text: str) -> dict[str, Counts]:
    """Read what coverage.py counted, by file."""
    return {
        name.replace("\\", "/"): Counts(
            set(one["executed_lines"]),
            set(one["missing_lines"]),
            one["summary"]["num_branches"],
            one["summary"]["covered_branches"],
        )
        for name, one in json.loads(text)["files"].items()
    }


def of_rust(text: str) -> dict[str, Counts]:
    """Read lcov's format, by file; tests and examples are left out."""
    files: dict[str, Counts] = {}
    one = Counts()
    for line in text.splitlines():
        key, _, value = line.partition(":")
        if key == "SF":
            path = Path(value)
            name = path.relative_to(ROOT).as_posix() if path.is_relative_to(ROOT) else ""
            one = Counts()
            if name.startswith("rust/") and "/src/" in name:
                files[name] = one
        elif key == "DA":
            number, count = map(int, value.split(",")[:2])
            (one.reached if count else one.missed).add(number)
        elif key == "BRDA":
            one.ends += 1
            one.taken += value.split(",")[3] not in ("0", "-")
    return files


def place(name: str) -> str:
    """Name the room of a Python file, or the crate and folder of a Rust file."""
    parts = name.split("/")
    if name.startswith(PACKAGE):
        return parts[2] if len(parts) > 3 else "piezotrack"
    return "/".join([parts[1], *parts[3:-1][:1]])


def share(part: int, whole: int) -> str:
    """Write a share in per cent, or a dash where there is nothing."""
    return f"{100 * part / whole:.1f}" if whole else "-"


def row(name: str, files: Iterable[Counts]) -> str:
    """Write the row of some files."""
    files = list(files)
    reached, missed = sum(len(f.reached) for f in files), sum(len(f.missed) for f in files)
    ends, taken = sum(f.ends for f in files), sum(f.taken for f in files)
    lines = f"{reached + missed} | {share(reached, reached + missed)}"
    return f"| {name} | {lines} | {ends} | {share(taken, ends)} |"


def table(python: dict[str, Counts], rust: dict[str, Counts]) -> str:
    """Write one row for each room of Python, and for each folder of Rust."""
    rows = ["| | lines | reached, % | branches | taken, % |", "| --- " * 5 + "|"]
    for title, files in (("Python", python), ("Rust", rust)):
        rows.append(row(f"**{title}**", files.values()))
        for one in sorted({place(name) for name in files}):
            rows.append(row(f"`{one}`", (c for name, c in files.items() if place(name) == one)))
    return "\n".join(rows)


def main() -> None:
    """Write the table into the page, print it, and look for what has no reason there."""
    folder = Path(sys.argv[1])
    python = of_python((folder / "python.json").read_text("utf-8"))
    rust = of_rust((folder / "rust.lcov").read_text("utf-8"))
    missed = [
        f"{name}:{block[0]}-{block[-1]}\t{len(block)}"
        for name, counts in sorted({**python, **rust}.items())
        for block in counts.blocks()
    ]
    (folder / "missed.txt").write_text("\n".join(missed) + "\n", "utf-8")
    page = PAGE.read_text("utf-8")
    before, _, rest = page.partition(BEGIN)
    text = table(python, rust)
    after = rest.partition(END)[2]
    PAGE.write_text(f"{before}{BEGIN}\n\n{text}\n\n{END}{after}", "utf-8")
    print(text)
    unnamed = [
        f"{name.removeprefix(PACKAGE)}:{block[0]}-{block[-1]}"
        for name, counts in sorted(python.items())
        for block in counts.blocks()
        if len(block) >= BLOCK and f"`{name.removeprefix(PACKAGE)}`" not in page
    ]
    print("\n".join(["", f"Without a test or a reason: {len(unnamed)}", *unnamed]))
    if strict := [one for one in unnamed if one.startswith(STRICT)]:
        sys.exit("\n".join(["", "Where hardware or files are handled:", *strict]))


if __name__ == "__main__":
    main()
