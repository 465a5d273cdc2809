"""Put a table and the picture of ``piezotrack benchmark`` into docs/evidence.md.

Run as ``make benchmark``, or ``python docs/make_benchmark.py FOLDER`` with the folder that the
command wrote. The words around the table are written by hand.
"""

from __future__ import annotations

import json
import math
import shutil
import sys
from pathlib import Path
from typing import Any

DOCS = Path(__file__).parent
BEGIN, END = "<!-- Table of piezotrack benchmark. -->", "<!-- End of the table. -->"
# Headings of the columns: records are named as in the package.
SHORT = {
    "bouc-wen-benchmark": "Bouc-Wen",
    "asymmetry": "asym.",
    "rate-0.1hz": "0.1 Hz",
    "rate-1hz": "1 Hz",
    "rate-10hz": "10 Hz",
    "rate-three": "all rates",
}


def error(result: dict[str, Any] | None) -> float:
    """Return the error on the last part of a record, in per cent of the stroke."""
    return result["parts"][-1]["rms_percent"] if result and result["parts"] else math.inf


def table(results: list[dict[str, Any]]) -> str:
    """Write one row for each model, one column for each record, the measured one first."""
    records = list(dict.fromkeys(one["record"] for one in results))
    by = {(one["model"], one["record"]): one for one in results}
    models = sorted(
        dict.fromkeys(one["model"] for one in results),
        key=lambda model: error(by.get((model, records[0]))),
    )
    lines = [
        f"| model | {' | '.join(SHORT.get(name, name) for name in records)} |",
        "| --- " * (len(records) + 1) + "|",
    ]
    for model in models:
        title = (
            "default"
            if model == "auto"
            else next(one["title"] for one in results if one["model"] == model)
        )
        errors = (error(by.get((model, record))) for record in records)
        cells = ("-" if math.isinf(value) else f"{value:.2g}" for value in errors)
        lines.append(f"| {title} | {' | '.join(cells)} |")
    return "\n".join(lines)


def main() -> None:
    """Replace what stands between the two marks."""
    if len(sys.argv) != 2:
        raise SystemExit("usage: python docs/make_benchmark.py FOLDER")
    folder, page = Path(sys.argv[1]), DOCS / "evidence.md"
    results = json.loads((folder / "benchmark.json").read_text(encoding="utf-8"))["results"]
    text = page.read_text(encoding="utf-8")
    head, begin, rest = text.partition(BEGIN)
    _, end, tail = rest.partition(END)
    if not begin or not end:
        raise SystemExit(f"{page}: expected the lines {BEGIN} and {END}")
    page.write_text(f"{head}{BEGIN}\n\n{table(results)}\n\n{END}{tail}", encoding="utf-8")
    shutil.copyfile(folder / "benchmark.png", DOCS / "benchmark.png")


if __name__ == "__main__":
    main()
