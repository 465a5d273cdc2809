"""Fingerprints of searches, to be compared between processes."""

from __future__ import annotations

import hashlib
import sys
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

import piezotrack as pt

T = np.arange(200) / 100.0
U = 30.0 * (1.0 - np.cos(np.pi * T)) * (0.6 + 0.1 * T)
UPDATES: Any = ("classic", "hypersphere", "hypersphere-radial")
TOPOLOGIES: Any = ("ring", "global", "random")
PLAYS = ("prandtl-ishlinskii", "generalised-prandtl-ishlinskii")
SEARCHED = ("dahl", "bouc-wen", "first-order-dahl", "parallel-dahl", "bouc-wen-oscillator")


def digests(threads: int) -> list[str]:
    """One line for each search: every kind of stage, every kind of swarm."""
    data = pt.Dataset(u=U, y=pt.VirtualStage.xu_li_2010(seed=2).record(U, 0.01).y, dt=0.01)
    small = pt.ParticleSwarm(particles=16, iterations=12)
    lines = []
    for kind, runs in product(SEARCHED, (1, 3)):
        fit = pt.identify(
            data,
            kind,
            method=replace(small, seed=9, runs=runs),
            threads=threads,
            delay=kind == "dahl",
        )
        lines.append(f"{kind} {runs} {digest(fit)}")
    lines += [f"{kind} {digest(pt.identify(data, kind))}" for kind in PLAYS]
    for update, topology in product(UPDATES, TOPOLOGIES):
        swarm = pt.ParticleSwarm(particles=9, iterations=8, update=update, topology=topology)
        fit = pt.identify(data, "dahl", method=replace(swarm, seed=3, runs=2), threads=threads)
        lines.append(f"{update} {topology} {digest(fit)}")
    return lines


def digest(fit: Any) -> str:
    course = fit.search.history.tobytes() if fit.search else b""
    content = repr((fit.document(), course))
    return hashlib.sha256(content.encode()).hexdigest()[:16]


if __name__ == "__main__":
    print("\n".join(digests(int(sys.argv[1]))))
