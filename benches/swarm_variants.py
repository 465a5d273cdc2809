"""Swarms at equal numbers of simulations, 100 runs each, on the paper's search.

Run as ``python benches/swarm_variants.py``; prints the table of benches/README.md. The cost of
the optimum is that of the descent, from which no run found a better place.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import piezotrack as pt
from piezotrack.demo import SEARCH_BOX, demo_log

RUNS = 100
NEVER = 10**6
CONSTRICTION = pt.ParticleSwarm(stall_iterations=NEVER, polish=False)
PAPER = replace(pt.ParticleSwarm.xu_li_2010(), stall_iterations=NEVER)


def variants(simulations: int) -> dict[str, pt.ParticleSwarm]:
    """Swarms that take about as many simulations."""

    def sized(swarm: pt.ParticleSwarm, particles: int, **changes: object) -> pt.ParticleSwarm:
        left = simulations - (200 if changes.get("polish") else 0)
        iterations = left // particles - 1
        return replace(swarm, particles=particles, iterations=iterations, **changes)

    return {
        "the paper's, 10": sized(PAPER, 10),
        "constriction, global, 20": sized(CONSTRICTION, 20, topology="global"),
        "constriction, ring, 20": sized(CONSTRICTION, 20),
        "constriction, ring, 64": sized(CONSTRICTION, 64),
        "the paper's, 10, then descent": sized(PAPER, 10, polish=True),
        "constriction, global, 20, then descent": sized(
            CONSTRICTION, 20, topology="global", polish=True
        ),
        "constriction, ring, 64, then descent": sized(CONSTRICTION, 64, polish=True),
    }


def main() -> None:
    """Run and print."""
    log = demo_log()[:4.0]
    stage = pt.DahlStage.xu_li_2010()
    fixed = {"a1": stage.a1, "a2": stage.a2, "b1": stage.b1}
    costs: dict[tuple[str, int], np.ndarray] = {}
    for simulations in (2000, 20000):
        for name, swarm in variants(simulations).items():
            fit = pt.identify(
                log, fixed=fixed, bounds=SEARCH_BOX, offset=False, swarm=swarm, runs=RUNS
            )
            costs[name, simulations] = 1e6 * np.array([run.cost for run in fit.runs])
    best = min(float(found.min()) for found in costs.values())
    print(f"lowest cost {best:.7f} um\n")
    print("| swarm | simulations | within 1e-4 of the best | median um | 90 % um |")
    print("| --- | --- | --- | --- | --- |")
    for (name, simulations), found in costs.items():
        near = int((found <= best * (1 + 1e-4)).sum())
        middle, high = np.quantile(found, [0.5, 0.9])
        print(f"| {name} | {simulations} | {near} of {RUNS} | {middle:.4f} | {high:.4f} |")


if __name__ == "__main__":
    main()
