"""What is compared: the peers, and piezotrack beside them. A new one is a new line."""

from __future__ import annotations

import importlib.util
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import peers
from kernels import exponential_costs, lane_costs, rk4_costs

import piezotrack as pt

if TYPE_CHECKING:
    from collections.abc import Callable

    from meter import Meter

PAPER, LOG = "paper", "log"
SIMULATIONS = peers.PARTICLES * (peers.ITERATIONS + 1)
KERNELS = {
    "RK4": rk4_costs,
    "exponential": exponential_costs,
    "lanes": lane_costs,
    "solve_ivp": None,
}
# The paper's swarm with nothing that stops it early.
PAPER_SWARM = replace(pt.ParticleSwarm.xu_li_2010(), stall_iterations=10**6)


@dataclass(frozen=True)
class Peer:
    """A search of somebody else's, with one of the simulations."""

    name: str
    package: str
    search: Callable[[Meter, int], None]
    kernel: str = "lanes"
    problems: tuple[str, ...] = (PAPER, LOG)
    # It does all iterations of the paper's search: what "one search of the paper" compares.
    whole: bool = False
    # Seconds after which a search is broken off, and its length extrapolated to `SIMULATIONS`.
    patience: float = np.inf

    @property
    def available(self) -> bool:
        """Whether its package is installed."""
        return importlib.util.find_spec(self.package) is not None


@dataclass(frozen=True)
class Own:
    """A call of `pt.identify`, with these arguments besides those of the problem."""

    name: str
    arguments: dict[str, Any] = field(default_factory=dict)
    problems: tuple[str, ...] = (PAPER, LOG)
    whole: bool = False


OWN = (
    Own(
        "piezotrack, paper's swarm", {"method": replace(PAPER_SWARM, runs=1)}, (PAPER,), whole=True
    ),
    Own("piezotrack, default call"),
    Own("piezotrack, default swarm, one run", {"method": pt.ParticleSwarm(runs=1)}),
    Own("piezotrack, history not given", {"history": None}, (LOG,)),
)

# Searches side by side in one call, against as many of a peer's one after the other.
MANY = 32
OWN_MANY = (
    Own("piezotrack, paper's swarm", {"method": replace(PAPER_SWARM, runs=MANY)}, (PAPER,)),
    Own("piezotrack, default", {"method": pt.Descents(runs=MANY)}, (PAPER,)),
)

PEERS = (
    Peer(
        "solve_ivp + pyswarms",
        "pyswarms",
        peers.paper_swarm,
        "solve_ivp",
        (PAPER,),
        whole=True,
        patience=10.0,
    ),
    Peer("numba RK4 + pyswarms", "pyswarms", peers.paper_swarm, "RK4", (PAPER,), whole=True),
    Peer(
        "numba exponential + pyswarms",
        "pyswarms",
        peers.paper_swarm,
        "exponential",
        (PAPER,),
        whole=True,
    ),
    Peer("numba lanes + pyswarms", "pyswarms", peers.paper_swarm, "lanes", (PAPER,), whole=True),
    Peer("solve_ivp + pyswarms", "pyswarms", peers.pyswarms, "solve_ivp", (LOG,), patience=20.0),
    Peer("numba RK4 + pyswarms", "pyswarms", peers.pyswarms, "RK4", (LOG,)),
    Peer("numba lanes + pyswarms", "pyswarms", peers.pyswarms, "lanes", (LOG,)),
    Peer("numba lanes + pymoo", "pymoo", peers.pymoo),
    Peer("numba RK4 + fcmaes", "fcmaes", peers.fcmaes, "RK4"),
    Peer("numba lanes + fcmaes", "fcmaes", peers.fcmaes),
    Peer("numba lanes + SciPy DE", "scipy", peers.scipy_de),
    Peer("numba lanes + PINTS", "pints", peers.pints),
    Peer("numba RK4 + least_squares", "scipy", peers.many_starts, "RK4"),
    Peer("numba lanes + least_squares", "scipy", peers.many_starts),
)
