"""Success of methods of search against simulations: ``python benches/search/run.py``.

Writes ``search.json``, ``search.md`` and ``search.png`` into the folder that is given, by default
``build/search``; ``--draw`` makes table and picture again from ``search.json``.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from methods import METHODS
from problems import PROBLEMS

import piezotrack as pt

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

NEAR = 1e-3
# Descents from which the lowest cost is known.
REFERENCE = 2000


def lowest_cost(objective: pt.identification.Objective) -> float:
    """Lowest cost of many descents from random places [m]."""
    random = np.random.default_rng(99)
    size = (100, len(objective.ranges))
    rounds = (objective.descend(random.random(size))[1] for _ in range(REFERENCE // 100))
    return min(float(costs.min()) for costs in rounds)


def measure(
    name: str, methods: list[str], seeds: int, most: int, before: dict[str, Any] | None
) -> Iterator[dict[str, Any]]:
    """Run the methods on a problem; the course of the best cost of every seed.

    What was measured ``before`` with as many seeds and simulations is kept.
    """
    problem = PROBLEMS[name]
    objective = pt.identification.Objective(
        problem.record(), problem.model, history="virgin", **problem.arguments
    )
    if before is not None and (before["seeds"], before["most"]) == (seeds, most):
        lowest, courses = before["lowest"], dict(before["courses"])
    else:
        lowest, courses = lowest_cost(objective), {}
    print(f"{name}: lowest of {REFERENCE} descents {1e6 * lowest:.6f} um", flush=True)
    goal = lowest * (1.0 + NEAR)
    for method in methods:
        if method in courses:
            continue
        began = time.perf_counter()
        courses[method] = [METHODS[method](objective, seed, goal, most) for seed in range(seeds)]
        low = min(course[-1][1] for course in courses[method] if course)
        done = sum(bool(course) and course[-1][1] <= goal for course in courses[method])
        spent = time.perf_counter() - began
        print(f"{name}: {method}: {done} of {seeds}, {spent:.0f} s", flush=True)
        if low < lowest * (1.0 - NEAR):
            print(f"{name}: {method} found less: {1e6 * low:.6f} um", flush=True)
        yield {
            "title": problem.title,
            "coordinates": len(objective.ranges),
            "lowest": lowest,
            "most": most,
            "seeds": seeds,
            "courses": courses,
        }


def successes(found: dict[str, Any]) -> dict[str, NDArray[np.float64]]:
    """Simulations after which each seed was within a thousandth of the lowest cost known."""
    near = found["lowest"] * (1.0 + NEAR)
    return {
        method: np.array(
            [next((used for used, cost in course if cost <= near), math.inf) for course in runs]
        )
        for method, runs in found["courses"].items()
    }


def for_99(times: NDArray[np.float64], most: int) -> float:
    """Simulations for 99 % success: of the tries at the best length to begin anew after."""
    best = math.inf
    for length in [*np.sort(times[np.isfinite(times)]), most]:
        share = float(np.mean(times <= length))
        if share > 0.0:
            tries = 1.0 if share >= 0.99 else math.log(0.01) / math.log(1.0 - share)
            best = min(best, float(length) * tries)
    return best


def table(results: dict[str, Any]) -> str:
    """Rows of the methods, columns of the problems."""
    lines = ["| method | " + " | ".join(one["title"] for one in results.values()) + " |"]
    lines.append("| --- |" + " --- |" * len(results))
    times = {name: successes(one) for name, one in results.items()}
    for method in METHODS:
        row = []
        for name, one in results.items():
            if method not in times[name]:
                row.append("")
                continue
            found = times[name][method]
            share = int(np.isfinite(found).sum())
            needed = for_99(found, one["most"])
            text = "never" if math.isinf(needed) else f"{float(f'{needed:.2g}'):,.0f}"
            row.append(f"{text} ({share} of {found.size})")
        lines.append(f"| {method} | " + " | ".join(row) + " |")
    return "\n".join(lines) + "\n"


def draw(results: dict[str, Any], path: Path) -> None:
    """One panel a problem: share of the seeds that succeeded within so many simulations."""
    mpl.use("Agg")
    import matplotlib.pyplot as plt

    columns = min(3, len(results))
    rows = math.ceil(len(results) / columns)
    size = (4.7 * columns, 1.2 + 3.7 * rows)
    figure, axes = plt.subplots(
        rows, columns, figsize=size, sharey=True, squeeze=False, layout="constrained"
    )
    for ax in axes.flat[len(results) :]:
        ax.set_axis_off()
    colours = plt.get_cmap("tab20").colors  # type: ignore[attr-defined]
    for ax, one in zip(axes.flat, results.values(), strict=False):
        for k, (method, times) in enumerate(successes(one).items()):
            done = np.sort(times[np.isfinite(times)])
            share = 100.0 * np.arange(1, done.size + 1) / times.size
            own = method.startswith(("descents", "swarm cut", "scatter"))
            ax.step(
                [*done, one["most"]],
                [*share, share[-1] if share.size else 0.0],
                where="post",
                label=method,
                color=colours[k],
                linestyle="-" if own else "--",
            )
        ax.set(title=one["title"], xscale="log", xlabel="simulations", ylim=(-2, 102))
        ax.grid(alpha=0.3)
    for ax in axes[:, 0]:
        ax.set_ylabel("seeds within 0.1 % of the lowest cost [%]")
    handles, labels = axes.flat[0].get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="outside lower center", ncols=min(5, 2 * columns), fontsize="small"
    )
    figure.savefig(path, dpi=110)


def main() -> None:
    """Measure, and write what was found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("build/search"))
    parser.add_argument("--seeds", type=int, default=50)
    parser.add_argument("--most", type=int, default=50_000, help="simulations of a run")
    parser.add_argument("--problems", default=",".join(PROBLEMS))
    parser.add_argument("--methods", default=",".join(METHODS).replace(", ", "; "))
    parser.add_argument("--draw", action="store_true", help="from what was measured")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    path = given.out / "search.json"
    results: dict[str, Any] = json.loads(path.read_text()) if path.exists() else {}
    methods = [one.replace("; ", ", ") for one in given.methods.split(",")]
    for name in [] if given.draw else given.problems.split(","):
        for one in measure(name, methods, given.seeds, given.most, results.get(name)):
            results[name] = one
            path.write_text(json.dumps(results))
    results = {name: results[name] for name in PROBLEMS if name in results}
    (given.out / "search.md").write_text(table(results))
    draw(results, given.out / "search.png")
    print(table(results))


if __name__ == "__main__":
    main()
