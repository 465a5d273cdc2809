"""Ten tunings by the default call of `pt.tune` and ten seeds, against the best known values.

python benches/tuning [--cases 0,3] [--seeds 10] [--before FOLDER]
python benches/tuning --best [--cases 0,3]

``--before`` has the Python folder of another version, whose default call is then run with the same
seeds right after: the CPU times of both are of the same minutes. ``--best`` searches with ten times
the budget by differential evolution and CMA-ES (requirements.txt), and by `pt.tune` itself, and
writes what is better than before to best_known.json; that takes an hour.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from cases import CASES
from others import METHODS, Cost

import piezotrack as pt

HERE = Path(__file__).parent
KNOWN = HERE / "best_known.json"
BUDGET = 48_000  # ten times the 4800 candidates of the default call until 2026
GOAL = 1.03


def best_known() -> dict[str, Any]:
    known: dict[str, Any] = json.loads(KNOWN.read_text("utf-8")) if KNOWN.exists() else {}
    return known


def find_best(numbers: list[int], seeds: list[int]) -> None:
    warnings.simplefilter("ignore")
    for number in numbers:
        case = CASES[number]
        cost = Cost(case)
        results: dict[str, list[float]] = {}
        for name, method in METHODS.items():
            for seed in seeds:
                cost.evaluated, cost.best = 0, np.inf
                method(cost, BUDGET, seed)
                results.setdefault(name, []).append(float(cost.best))
        stage, reference, options = case.make()
        for seed in seeds:
            search = pt.TuningSearch(particles=100, iterations=150, seed=seed)
            tuned = pt.tune(stage, reference, search=search, **options)
            results.setdefault("pt.tune", []).append(tuned.value)
        known = best_known()
        before = known.get(case.name, {"best_m": np.inf})["best_m"]
        entry: dict[str, Any] = {
            "best_m": min(before, *(min(values) for values in results.values()))
        }
        entry |= {name: [round(1e9 * one, 2) for one in sorted(v)] for name, v in results.items()}
        known[case.name] = entry
        ordered = {one.name: known[one.name] for one in CASES if one.name in known}
        KNOWN.write_text(json.dumps(ordered, indent=2) + "\n", "utf-8")
        print(case.name, entry, flush=True)


def tuned(number: int, seeds: list[int], python: str | None = None) -> list[dict[str, Any]]:
    """Tune in a process of its own; `python` is the folder of another version."""
    environment = dict(os.environ)
    if python is not None:
        environment["PYTHONPATH"] = python
    command = [sys.executable, str(HERE / "seeds.py"), str(number), ",".join(map(str, seeds))]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, check=True)
    return [json.loads(line) for line in done.stdout.splitlines()]


def columns(rows: list[dict[str, Any]], best: float) -> list[str]:
    ratios = [row["figure"] / best for row in rows]
    cpu = np.median([row["cpu"] for row in rows])
    candidates = np.median([row["candidates"] for row in rows])
    return [f"{np.median(ratios):.3f}", f"{max(ratios):.3f}", f"{candidates:.0f}", f"{cpu:.2f}"]


def compare(numbers: list[int], seeds: list[int], before: str | None) -> None:
    heads = ["tuning", "best known nm", "median", "worst", "candidates", "CPU s", "agree"]
    if before is not None:
        heads += ["median before", "worst before", "candidates before", "CPU s before", "CPU ratio"]
    print(
        f"Figures over {len(seeds)} seeds, relative to the best known; CPU of one thread, median.\n"
    )
    print(f"| {' | '.join(heads)} |\n|{' --- |' * len(heads)}")
    known, kept = best_known(), 0
    for number in numbers:
        name = CASES[number].name
        best = known[name]["best_m"]
        rows = tuned(number, seeds)
        cells = [name, f"{1e9 * best:.1f}", *columns(rows, best)]
        agree = sorted(tuple(row["agree"]) for row in rows)
        agreeing, searches = agree[len(agree) // 2]
        cells.append(f"{agreeing} of {searches}")
        kept += max(row["figure"] for row in rows) <= GOAL * best
        if before is not None:
            old = tuned(number, seeds, before)
            ratio = sum(row["cpu"] for row in rows) / sum(row["cpu"] for row in old)
            cells += [*columns(old, best), f"{ratio:.2f}"]
        print(f"| {' | '.join(cells)} |", flush=True)
    print(f"\n{kept} of {len(numbers)} within {100.0 * (GOAL - 1.0):.0f} % for every seed")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--cases", help="numbers from 0, by default all")
    parser.add_argument("--seeds", type=int, help="how many, by default 10, of --best 3")
    parser.add_argument("--before", metavar="FOLDER", help="Python folder of another version")
    parser.add_argument("--best", action="store_true", help="search for best known values")
    given = parser.parse_args()
    numbers = (
        [int(one) for one in given.cases.split(",")] if given.cases else list(range(len(CASES)))
    )
    if given.best:
        find_best(numbers, list(range(1, (given.seeds or 3) + 1)))
    else:
        compare(numbers, list(range(1, (given.seeds or 10) + 1)), given.before)


if __name__ == "__main__":
    main()
