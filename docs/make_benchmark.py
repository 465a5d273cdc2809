"""Put the tables and the picture of ``piezotrack benchmark`` into docs/evidence.md.

Run as ``make benchmark``, or ``python docs/make_benchmark.py FOLDER`` with the folder that the
command wrote. The words around the tables are written by hand.
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

DOCS = Path(__file__).parent
BEGIN, END = "<!-- Tables of piezotrack benchmark. -->", "<!-- End of the tables. -->"


def main() -> None:
    """Replace what stands between the two marks."""
    if len(sys.argv) != 2:
        raise SystemExit("usage: python docs/make_benchmark.py FOLDER")
    folder, page = Path(sys.argv[1]), DOCS / "evidence.md"
    tables = (folder / "benchmark.md").read_text(encoding="utf-8").strip()
    text = page.read_text(encoding="utf-8")
    head, begin, rest = text.partition(BEGIN)
    _, end, tail = rest.partition(END)
    if not begin or not end:
        raise SystemExit(f"{page}: expected the lines {BEGIN} and {END}")
    page.write_text(f"{head}{BEGIN}\n\n{tables}\n\n{END}{tail}", encoding="utf-8")
    shutil.copyfile(folder / "benchmark.png", DOCS / "benchmark.png")


if __name__ == "__main__":
    main()
