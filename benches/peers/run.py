"""The same identifications by other people's tools and by piezotrack: writes the table and picture.

Run as ``python benches/peers/run.py``, on an idle machine: half an hour. With ``--quick`` two
seeds and few simulations show in a few minutes that everything works. Results go to
``results.json``, from which ``--draw`` makes the table and the picture again.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import time
import warnings
from contextlib import chdir, suppress
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numba
import numpy as np
from entries import KERNELS, MANY, OWN, OWN_MANY, PEERS, SIMULATIONS, Own, Peer
from meter import Meter, SpentError
from problems import Problem, measured, paper
from report import write

import piezotrack as pt

HERE = Path(__file__).resolve().parent
QUICK_FOLDER = HERE.parent.parent / "target" / "peers-quick"
PACKAGES = ("piezotrack", "numpy", "scipy", "numba", "pyswarms", "pymoo", "fcmaes", "pints")

Row = dict[str, Any]


def search(problem: Problem, peer: Peer, seed: int, budget: int, patience: float) -> Meter:
    """One search of a peer; the meter knows how it went."""
    meter = Meter(problem, KERNELS[peer.kernel], budget, patience)
    with suppress(SpentError):
        peer.search(meter, seed)
    meter.ended = meter.seconds
    return meter


def of_peer(problem: Problem, peer: Peer, options: argparse.Namespace) -> Row:
    """All searches of a peer on one problem."""
    row: Row = {"problem": problem.name, "name": peer.name, "whole": peer.whole, "own": False}
    if not peer.available:
        return {**row, "missing": peer.package}
    extrapolated = np.isfinite(peer.patience)
    # Imports and compilation are not counted.
    search(problem, peer, 0, 2 if extrapolated else 200, np.inf)
    row["threads"] = 1 if extrapolated else threads_for(problem, peer, options.threads)
    runs: list[Row] = []
    best = Meter(problem)
    for seed in range(options.seeds):
        patience = min(peer.patience, options.patience)
        meter = search(problem, peer, seed, options.simulations, patience)
        run = {
            "seed": seed,
            "seconds": meter.ended,
            "simulations": meter.simulations,
            "diverged": meter.diverged,
            "cost": meter.best,
            "course": meter.course,
        }
        if extrapolated or (peer.whole and meter.simulations < SIMULATIONS):
            # One process runs solve_ivp; as many as there are threads are taken to be as fast each.
            share = options.threads if peer.kernel == "solve_ivp" else 1
            run["extrapolated"] = meter.ended / meter.simulations / share * SIMULATIONS
        runs.append(run)
        if meter.best < best.best:
            best = meter
    row |= {"runs": runs, "extrapolated": "extrapolated" in runs[0]}
    return row | accuracy(problem, *motion(best), options)


def motion(meter: Meter) -> tuple[Any, Any]:
    """Best stage of a search and its motion in the window, by the peer's own integration."""
    problem = meter.problem
    stages = problem.stages(meter.where[np.newaxis])
    _, y, first, _ = problem.record
    if meter.kernel is None:
        return stages[0], problem.displacement(stages[0], *problem.quick)[first:]
    return stages[0], problem.deviations(stages, meter.kernel)[:, 0] + y[first:]


def threads_for(problem: Problem, peer: Peer, most: int) -> int:
    """One thread or all: what takes less time for a population of 16."""
    points = np.random.default_rng(0).random((16, problem.size))
    took = {}
    for threads in {1, most}:
        numba.set_num_threads(threads)
        meter = Meter(problem, KERNELS[peer.kernel])
        rounds = []
        for _ in range(9):
            before = meter.seconds
            meter.costs(points)
            rounds.append(meter.seconds - before)
        took[threads] = float(np.median(rounds))
    best = min(took, key=took.__getitem__)
    numba.set_num_threads(best)
    return best


def accuracy(problem: Problem, stage: Any, x: Any, options: argparse.Namespace) -> Row:
    """Error of a motion at the parameters found, and their cost without it."""
    method, rtol = problem.exact
    # What is quicker than 1 ms, as few candidates of a broken-off search are, is stiff.
    if problem.light and stage[2] > 1e3 * stage[1]:
        method = "Radau"
    exact = problem.displacement(stage, method, max(rtol, options.rtol))
    error = float(np.abs(x - exact[problem.record[2] :]).max())
    return {"error_nm": 1e9 * error, "exact_cost": problem.cost(exact)}


def identify(problem: Problem, own: Own, seed: int, threads: int) -> tuple[Row, pt.Identification]:
    """One call of piezotrack, with its course."""
    course: list[tuple[float, int, float]] = []
    began = time.perf_counter()

    def follow(progress: pt.Progress) -> None:
        # A call that weighs several histories begins again with each.
        if not course or 1e6 * progress.cost < course[-1][2]:
            course.append((time.perf_counter() - began, progress.nfev, 1e6 * progress.cost))

    arguments = {"method": pt.Descents(), **problem.arguments, **own.arguments}
    arguments["method"] = replace(arguments["method"], seed=seed)
    fit = pt.identify(
        problem.log,
        threads=threads,
        progress=False,
        callback=follow,
        **arguments,
    )
    seconds = time.perf_counter() - began
    simulations = fit.nfev + fit.search.npolish
    course.append((seconds, simulations, fit.cost_um))
    row = {
        "seed": seed,
        "seconds": seconds,
        "simulations": simulations,
        "diverged": fit.search.nfail,
        "cost": fit.cost_um,
        "course": course,
    }
    return row, fit


def of_own(problem: Problem, own: Own, options: argparse.Namespace) -> Row:
    """All calls of piezotrack on one problem."""
    found = [identify(problem, own, seed, options.threads) for seed in range(options.seeds)]
    best = min((fit for _, fit in found), key=lambda fit: fit.cost)
    u, _, first, dt = problem.record
    stage = best.model
    x = stage.simulate(u, dt, initial=stage.equilibrium(u[0])).x[first:]
    row = {"problem": problem.name, "name": own.name, "whole": own.whole, "own": True}
    row |= {"runs": [run for run, _ in found], "extrapolated": False}
    return row | accuracy(problem, problem.row(stage), x, options)


def machine() -> Row:
    """What ran where, and what else ran."""
    found = {}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    if found["piezotrack"] == "not installed":
        found["piezotrack"] = pt.__version__
    lines = (
        Path("/proc/cpuinfo").read_text().splitlines() if os.path.exists("/proc/cpuinfo") else []
    )
    models = [line.split(":")[1].strip() for line in lines if line.startswith("model name")]
    return {
        "processor": models[0] if models else platform.processor(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "versions": found,
        "load": os.getloadavg()[0],
    }


def run(options: argparse.Namespace) -> Row:
    """Everything that was asked for."""
    results: Row = {"machine": machine(), "seeds": options.seeds, "threads": options.threads}
    results |= {"quick": options.quick, "rows": [], "many": []}
    wanted = [one for one in (*OWN, *PEERS) if not options.only or options.only in one.name]
    for problem in (paper(), measured()):
        for one in wanted:
            if problem.name not in one.problems:
                continue
            do = of_own if isinstance(one, Own) else of_peer
            row = do(problem, one, options)
            results["rows"].append(row)
            costs = [r["cost"] for r in row.get("runs", [])]
            seconds = np.median([r["seconds"] for r in row.get("runs", [])] or [np.nan])
            print(
                f"{problem.name:6} {one.name:32} {seconds:8.3f} s",
                *np.round(costs, 5)[:3],
                flush=True,
            )
        if problem.name == "paper" and not options.only:
            for one in OWN_MANY:
                each = [
                    identify(problem, one, seed, options.threads)[0]["seconds"]
                    for seed in range(1 if options.quick else 3)
                ]
                results["many"].append({"name": one.name, "searches": MANY, "seconds": each})
    return results


def main() -> None:
    """Read the options, run and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="few seeds, few simulations")
    parser.add_argument("--draw", action="store_true", help="from the results that are there")
    parser.add_argument("--only", default="", help="those whose name has this; changes no file")
    parser.add_argument("--seeds", type=int, default=0)
    parser.add_argument("--threads", type=int, default=2)
    options = parser.parse_args()
    quick = options.quick
    options.seeds = options.seeds or (2 if quick else 10)
    options.simulations = 4000 if quick else SIMULATIONS
    options.patience = 2.0 if quick else np.inf
    options.rtol = 1e-9 if quick else 0.0
    # Of numba's layers the one that loses least where other programs run.
    numba.config.THREADING_LAYER = "workqueue"
    warnings.simplefilter("ignore")
    folder = QUICK_FOLDER if quick else HERE
    file = folder / "results.json"
    if options.draw:
        results = json.loads(file.read_text())
    else:
        with TemporaryDirectory() as scratch, chdir(scratch):  # pyswarms leaves a log where it runs
            results = run(options)
        if not options.only:
            folder.mkdir(parents=True, exist_ok=True)
            part = file.with_suffix(".part")
            part.write_text(json.dumps(results) + "\n")
            part.replace(file)
    if not options.only:
        write(results, folder)


if __name__ == "__main__":
    main()
