"""Thirty foreign stages, identified by the default call from records with flaws.

python benches/records [--cases 3,7] [--seed 1] [--limit SECONDS] [--json FILE]
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import flaws
import numpy as np
from cases import CASES, plan

NOISES = 3.0  # a residual within so many times the noise is good
OTHER = 0.5  # another motion within so much is good [% of the stroke of the record]
GOALS = {"solved or named": 28, "another motion within 0.5 %": 22}
WIDTH = 110


def run(seed: int, number: int, limit: float) -> dict[str, Any]:
    """Judge a case in a process of its own."""
    command = [sys.executable, str(Path(__file__).with_name("judge.py")), str(seed), str(number)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=limit, check=False)
    except subprocess.TimeoutExpired:
        return {"notes": [], "failure": f"no answer in {limit:g} s"}
    if done.returncode:
        return {"notes": [], "failure": done.stderr.strip().rpartition("\n")[2]}
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def verdict(found: dict[str, Any], flaw: str, record: str) -> str:
    """Return "solved", "named", "doubted" or "silent"; "refused" or "failed" without a model.

    Solved: the residual is within three times the noise. Named: a sentence has the true cause.
    Doubted: another sentence says that the model may not hold. Silent: the residual or another
    motion is not good, and no sentence says so.
    """
    notes = found["notes"]
    if "failure" in found:
        return "failed"
    if "model" not in found:
        return "named" if flaws.names(flaw, notes) else "refused"
    solved = found["residual_noises"] <= NOISES
    good = solved and found["other_percent"] <= OTHER
    causes = [flaw, "jump"] if record == "sine with jump" else [flaw]
    named = any(flaws.names(cause, notes) for cause in causes)
    if not good and not named and not flaws.doubts(notes):
        return "silent"
    return "solved" if solved else "named" if named else "doubted"


def line(row: dict[str, Any]) -> str:
    """Return the line of a case, and under it what was said."""
    first = (
        f"{row['case']:>4}  {row['stage']:<20}  {row['record']:<18}  {row['flaw']:<9}  "
        f"{row.get('samples', ''):>7}  {row.get('model', row.get('failure', 'refused')):<24}"
    )
    if "model" in row:
        first += (
            f"  {row['cpu_s']:>5.1f}  {row['wall_s']:>6.1f}  {row['residual_noises']:>8.3g}"
            f"  {row['other_percent']:>7.2f}  {row['other_noises']:>7.3g}"
        )
    else:
        first += " " * 43
    notes = [note if len(note) <= WIDTH else f"{note[: WIDTH - 3]}..." for note in row["notes"]]
    return "\n".join([f"{first}  {row['verdict']}", *(f"      - {note}" for note in notes)])


HEAD = (
    "                                                                                          "
    "seconds        residual  another motion\n"
    "case  stage                 record              flaw       samples  model                 "
    "     CPU    wall   / noise        %  / noise  verdict"
)


def summary(rows: list[dict[str, Any]]) -> str:
    """Return the goals and what was reached, medians and the seconds of all."""
    judged = [row for row in rows if "model" in row]
    verdicts = [row["verdict"] for row in rows]
    reached = {
        "solved or named": verdicts.count("solved") + verdicts.count("named"),
        "another motion within 0.5 %": sum(row["other_percent"] <= OTHER for row in judged),
    }
    lines = [f"{'':<30}  reached  goal of {CASES}"]
    lines += [f"{name:<30}  {reached[name]:>7}  {goal:>10}" for name, goal in GOALS.items()]
    lines.append(f"{'silent':<30}  {verdicts.count('silent'):>7}  {0:>10}")
    parts = {
        kind: verdicts.count(kind) for kind in ("solved", "named", "doubted", "refused", "failed")
    }
    lines.append(", ".join(f"{kind} {count}" for kind, count in parts.items()))
    if judged:
        middle = {
            key: float(np.median([row[key] for row in judged]))
            for key in ("residual_noises", "other_percent", "other_noises", "cpu_s", "wall_s")
        }
        lines.append(
            f"medians of {len(judged)}: residual {middle['residual_noises']:.3g} x noise, another "
            f"motion {middle['other_percent']:.2f} % or {middle['other_noises']:.3g} x noise, "
            f"{middle['cpu_s']:.1f} s of CPU, {middle['wall_s']:.1f} s"
        )
    cpu, wall = (sum(row[key] for row in judged) for key in ("cpu_s", "wall_s"))
    lines.append(f"identifications that answered: {cpu:.0f} s of CPU, {wall:.0f} s")
    return "\n".join(lines)


def written(path: Path, seed: int, rows: list[dict[str, Any]]) -> None:
    """Write the rows; the file is there whole or not at all."""
    part = path.with_name(f"{path.name}.part")
    part.write_text(json.dumps({"seed": seed, "cases": rows}, indent=1) + "\n")
    os.replace(part, path)


def main() -> None:
    """Run the cases one after another and print a line for each."""
    parser = argparse.ArgumentParser(prog="python benches/records", description=__doc__)
    parser.add_argument("--cases", default="", help="numbers, as 3,7; all by default")
    parser.add_argument("--seed", type=int, default=1, help="another makes thirty others")
    parser.add_argument("--limit", type=float, default=120.0, help="seconds for a case")
    parser.add_argument("--json", type=Path, help="file for the rows with all notes")
    options = parser.parse_args()
    numbers = [int(n) for n in options.cases.split(",") if n] or list(range(1, CASES + 1))
    if any(not 1 <= number <= CASES for number in numbers):
        parser.error(f"--cases: there are cases 1 to {CASES}")
    kinds, rows = plan(options.seed), []
    print(HEAD, flush=True)
    for number in numbers:
        kind = kinds[number - 1]
        found = run(options.seed, number, options.limit)
        row = {
            "case": number,
            "stage": kind.stage,
            "record": kind.record,
            "flaw": kind.flaw,
            **found,
            "verdict": verdict(found, kind.flaw, kind.record),
        }
        rows.append(row)
        print(line(row), flush=True)
        if options.json:
            written(options.json, options.seed, rows)
    print(f"\n{summary(rows)}")


if __name__ == "__main__":
    main()
