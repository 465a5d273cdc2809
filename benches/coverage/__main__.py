"""Share of 95 % intervals that cover the truth, by model and noise.

python benches/coverage [--records 200] [--seed 1] [--cases "plays;Dahl"] [--noises "white;AR 0.8"]
                        [--out target/coverage]

Cells are kept in OUT.json and are not measured again; OUT.md is the table of all of them.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

import numpy as np
from cells import measured
from noises import NOISES, RICHER, seed_of
from truths import CASES

# Least share of the records in which a value has an interval, to be listed.
OFTEN = 0.2


def mean(cell: dict[str, Any], what: str) -> float:
    """Share of all intervals of a cell [%]."""
    values = cell["values"].values()
    given = [value["given"] for value in values]
    return 100.0 * float(np.average([value[what] for value in values], weights=given))


def line(cell: dict[str, Any]) -> str:
    """Row of the table of a cell."""
    values = cell["values"]
    often = {name: value for name, value in values.items() if value["given"] >= OFTEN}
    lowest = min(often, key=lambda name: often[name]["covered"])
    ratios = [value["ratio"] for value in often.values()]
    without = [f"{n} {100 * (1 - v['given']):.0f}" for n, v in values.items() if v["given"] < 1.0]
    each = (
        cell["case"],
        cell["noise"],
        f"{mean(cell, 'covered'):.1f}",
        f"{mean(cell, 'independent'):.1f}",
        f"{lowest} {100 * values[lowest]['covered']:.1f}",
        f"{np.median(ratios):.2f}",
        f"{min(ratios):.2f} to {max(ratios):.2f}",
        ", ".join(without),
        str(seed_of(cell["case"], cell["noise"], cell["seed"])),
    )
    return f"| {' | '.join(each)} |"


def richer_line(cell: dict[str, Any]) -> str:
    """Row of the table of a cell whose stage is richer than the model."""
    count = cell["records"]
    error, noise = cell["model error"], cell["rest"]
    repeated = "" if error is None else f"{1e9 * error:.0f}, {1e9 * noise:.0f}"
    causes = sorted(cell["causes"].items(), key=lambda pair: -pair[1])
    each = (
        cell["case"],
        "" if CASES[cell["case"]].foreign else f"{mean(cell, 'real'):.0f}",
        f"{mean(cell, 'covered'):.0f}",
        repeated,
        f"{100 * cell['repeats'] / count:.0f}",
        f"{100 * cell['decided'] / count:.0f}",
        f"{100 * cell['coloured'] / count:.0f}",
        ", ".join(f"{name} {100 * number / count:.0f}" for name, number in causes),
        str(seed_of(cell["case"], cell["noise"], cell["seed"])),
    )
    return f"| {' | '.join(each)} |"


def table(cells: list[dict[str, Any]]) -> str:
    """Tables of all cells, in Markdown."""
    plain = [cell for cell in cells if cell["noise"] != RICHER]
    richer = [cell for cell in cells if cell["noise"] == RICHER]
    head = (
        "| stage | noise | covered [%] | independent [%] | least [%] | stated / actual | of values "
        "| no interval [%] | seed |"
    )
    rows = [head, "| --- " * 9 + "|", *(line(cell) for cell in plain)]
    if richer:
        head = (
            "| stage | true values covered [%] | values without noise [%] "
            "| model error, noise [nm] | repeats [%] | decided by the model [%] | not white [%] "
            "| cause [%] | seed |"
        )
        rows += ["", head, "| --- " * 9 + "|", *(richer_line(cell) for cell in richer)]
    return "\n".join(rows) + "\n"


def main() -> None:
    """Measure the cells and write their table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--records", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--cases", default=";".join(CASES))
    parser.add_argument("--noises", default=";".join(NOISES))
    parser.add_argument("--out", type=Path, default=Path("target/coverage"))
    options = parser.parse_args()
    kept = options.out.with_suffix(".json")
    cells: dict[str, Any] = json.loads(kept.read_text()) if kept.exists() else {}
    for noise in options.noises.split(";"):
        for case in options.cases.split(";"):
            key = f"{case}|{noise}|{options.records}|{options.seed}"
            if key in cells or (CASES[case].foreign and noise != RICHER):
                continue
            begun = time.process_time()
            cells[key] = cell = measured(case, noise, options.records, options.seed)
            cell["seconds"] = round(time.process_time() - begun, 1)
            print((richer_line if noise == RICHER else line)(cell), flush=True)
            kept.parent.mkdir(parents=True, exist_ok=True)
            kept.write_text(json.dumps(cells, indent=1))
    order = {name: k for k, name in enumerate(CASES)}
    listed = sorted(cells.values(), key=lambda cell: (order[cell["case"]], cell["noise"]))
    options.out.with_suffix(".md").write_text(table(listed))


if __name__ == "__main__":
    main()
