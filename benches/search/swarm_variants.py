"""Swarms at equal numbers of simulations, 100 runs each.

Run as ``python benches/search/swarm_variants.py``; prints the rows of benches/README.md. The first
is the paper's search, where the cost of the optimum is that of the descent, from which no run found
a better place. The others have all parameters free on stages richer than the model, every swarm
followed by the descent: they decide the default. Takes half an hour or more.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from problems import paper as paper_log
from problems import plays, swelling

import piezotrack as pt
from piezotrack.xu_li_2010.experiments.procedure import SEARCH_BOX

RUNS = 100
NEVER = 10**6
CONSTRICTION = pt.ParticleSwarm(stall_iterations=NEVER, polish=False)
PAPER = replace(pt.ParticleSwarm.xu_li_2010(), stall_iterations=NEVER)
SPSO = replace(pt.ParticleSwarm.spso_2011(), stall_iterations=NEVER)
RADIAL = replace(SPSO, update="hypersphere-radial")


def sized(
    swarm: pt.ParticleSwarm, particles: int, simulations: int, **changes: object
) -> pt.ParticleSwarm:
    """Change a swarm to take about as many simulations, some 200 of them by the descent."""
    left = simulations - (200 if changes.get("polish") else 0)
    return replace(swarm, particles=particles, iterations=left // particles - 1, **changes)


def papers(simulations: int) -> dict[str, pt.ParticleSwarm]:
    """Swarms on the paper's search."""
    plain = {
        "the paper's, 10": (PAPER, 10),
        "constriction, global, 20": (replace(CONSTRICTION, topology="global"), 20),
        "constriction, ring, 20": (CONSTRICTION, 20),
        "constriction, ring, 64": (CONSTRICTION, 64),
        "SPSO-2011, 20": (SPSO, 20),
        "SPSO-2011, 40": (SPSO, 40),
        "SPSO-2011 radial, 40": (RADIAL, 40),
    }
    found = {name: sized(swarm, size, simulations) for name, (swarm, size) in plain.items()}
    for name, (swarm, size) in plain.items():
        if name != "constriction, ring, 20":  # the ring of 64 stands for it
            found[f"{name}, then descent"] = sized(swarm, size, simulations, polish=True)
    return found


def all_free(simulations: int) -> dict[str, pt.ParticleSwarm]:
    """Swarms for all parameters, each followed by the descent."""
    plain = {
        "the paper's, 10": (PAPER, 10),
        "constriction, global, 64": (replace(CONSTRICTION, topology="global"), 64),
        "constriction, random, 64": (replace(CONSTRICTION, topology="random"), 64),
        "constriction, ring, 20": (CONSTRICTION, 20),
        "constriction, ring, 40": (CONSTRICTION, 40),
        "constriction, ring, 64": (CONSTRICTION, 64),
        "constriction, ring, 128": (CONSTRICTION, 128),
        "SPSO-2011, 20": (SPSO, 20),
        "SPSO-2011, 40": (SPSO, 40),
        "SPSO-2011, 64": (SPSO, 64),
        "SPSO-2011 radial, 20": (RADIAL, 20),
        "SPSO-2011 radial, 40": (RADIAL, 40),
        "SPSO-2011 on a ring, 64": (replace(SPSO, topology="ring"), 64),
        "SPSO-2011 radial on a ring, 64": (replace(RADIAL, topology="ring"), 64),
        "SPSO-2011 radial on a ring, 128": (replace(RADIAL, topology="ring"), 128),
    }
    return {n: sized(swarm, size, simulations, polish=True) for n, (swarm, size) in plain.items()}


def two_tones() -> pt.Dataset:
    """0.25 Hz and 1 Hz together, 0 to 75 V, 500 samples a second: small loops in a large one."""
    t = np.arange(6001) / 500.0
    u = 37.5 - 25.0 * np.cos(0.5 * np.pi * t) - 12.5 * np.cos(2.0 * np.pi * t)
    x = 1.3e-6 * u + 0.03e-6 * plays(u, np.linspace(2.0, 25.0, 10))
    noise = np.random.default_rng(1).normal(0.0, 0.097e-6, t.size)
    return pt.Dataset(u=u, y=x + noise, dt=1 / 500.0)


def run_costs(log: pt.Dataset, swarm: pt.ParticleSwarm, **arguments: object) -> np.ndarray:
    """Cost of each run [um]."""
    fit = pt.identify(log, method=replace(swarm, runs=RUNS), **arguments)
    return 1e6 * np.array([run.cost for run in fit.search.runs])


def show(title: str, found: dict[tuple[str, int], np.ndarray]) -> None:
    """Print one table."""
    best = min(float(costs.min()) for costs in found.values())
    print(f"\n{title}; lowest cost {best:.7f} um\n")
    print("| swarm | simulations | within 1e-4 of the best | median um | 90 % um |")
    print("| --- | --- | --- | --- | --- |")
    for (name, simulations), costs in found.items():
        near = int((costs <= best * (1 + 1e-4)).sum())
        middle, high = np.quantile(costs, [0.5, 0.9])
        print(f"| {name} | {simulations} | {near} of {RUNS} | {middle:.4f} | {high:.4f} |")


def main() -> None:
    """Run and print."""
    log = paper_log()
    stage = pt.DahlStage.xu_li_2010()
    held = {"a1": stage.a1, "a2": stage.a2, "b1": stage.b1}
    paper = {"parameters": {**SEARCH_BOX, **held}, "offset": False}
    show(
        "The paper's search",
        {
            (name, simulations): run_costs(log, swarm, **paper)
            for simulations in (2000, 20000)
            for name, swarm in papers(simulations).items()
        },
    )
    for title, log, budgets in (
        ("All parameters free, two tones", two_tones(), (3250, 13000)),
        ("All parameters free, swelling", swelling(), (3250, 13000)),
    ):
        show(
            title,
            {
                (name, simulations): run_costs(log, swarm)
                for simulations in budgets
                for name, swarm in all_free(simulations).items()
            },
        )


if __name__ == "__main__":
    main()
