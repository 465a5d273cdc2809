"""The table and the picture from the results."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from peers import ITERATIONS, PARTICLES
from problems import NEAR

if TYPE_CHECKING:
    from pathlib import Path

Row = dict[str, Any]
BEGIN, END = "<!-- results: written by run.py -->", "<!-- end of results -->"
TITLES = {
    "paper": "The paper's search",
    "log": "The measured log",
}
COLOURS = {
    "pyswarms": "tab:blue",
    "pymoo": "tab:orange",
    "fcmaes": "tab:green",
    "SciPy DE": "tab:purple",
    "PINTS": "tab:brown",
    "least_squares": "tab:pink",
}
WHOLE = PARTICLES * (ITERATIONS + 1)
OWN_STYLES = ("-", "--", ":")


def write(results: Row, folder: Path) -> None:
    """Table into README.md, or into table.md where there is none; picture into peers.png."""
    text = "\n".join(tables(results))
    readme = folder / "README.md"
    if readme.exists():
        before, rest = readme.read_text().split(BEGIN)
        whole = f"{text}\n\n![Cost of the best so far against wall time](peers.png)"
        readme.write_text(f"{before}{BEGIN}\n\n{whole}\n\n{END}{rest.split(END)[1]}")
    else:
        (folder / "table.md").write_text(text + "\n")
    print(text)
    draw(results, folder / "peers.png")


def lowest(rows: list[Row]) -> float:
    """Lowest cost that any search found [um]."""
    return min(run["cost"] for row in rows for run in row["runs"])


def seconds(row: Row) -> float:
    """Median time of a whole search."""
    return float(np.median([run.get("extrapolated", run["seconds"]) for run in row["runs"]]))


def arrival(run: Row, target: float) -> float:
    """Time at which a search came below a cost; infinite where it never did."""
    return next((t for t, _, cost in run["course"] if cost <= target), np.inf)


def expected(row: Row, target: float) -> float:
    """Expected time to the target when a search that misses it is followed by another.

    Time of all searches, those that arrived counted until then, over the number that arrived.
    """
    times = [arrival(run, target) for run in row["runs"]]
    spent = sum(min(t, run["seconds"]) for t, run in zip(times, row["runs"], strict=True))
    hits = int(np.isfinite(times).sum())
    return spent / hits if hits else np.inf


def tables(results: Row) -> list[str]:
    """Lines of Markdown."""
    machine = results["machine"]
    versions = ", ".join(f"{k} {v}" for k, v in machine["versions"].items())
    lines = [
        f"{machine['cores']} cores of {machine['processor']}, {results['threads']} threads, "
        f"Python {machine['python']}, {versions}; {results['seeds']} seeds. "
        f"Load of the machine in the minute before: {machine['load']:.1f}.",
    ]
    if machine["load"] > 0.5:
        lines += ["", "**Other programs ran just before: take the ratios, not the times.**"]
    if results["quick"]:
        lines += ["", "**`--quick`: too few seeds and simulations to be quoted.**"]
    lines += ["", "### Ratios"]
    lines += ratios(results)
    for name, title in TITLES.items():
        if rows := [row for row in results["rows"] if row["problem"] == name]:
            lines += ["", f"### {title}", "", *table(rows)]
    return lines


def ratios(results: Row) -> list[str]:
    """How many times longer the peers take."""
    present = [row for row in results["rows"] if "runs" in row]
    lines: list[str] = []
    paper = [row for row in present if row["problem"] == "paper"]
    peers = {
        row["name"] + ", extrapolated" * row["extrapolated"]: seconds(row)
        for row in paper
        if row["whole"] and not row["own"]
    }
    own = {
        row["name"]: seconds(row)
        for row in paper
        if row["own"] and (row["whole"] or "default" in row["name"])
    }
    lines += ratio_table("One search of the paper, the peers' with all 2000 iterations", peers, own)
    if results["many"]:
        count = results["many"][0]["searches"]
        many = {one["name"]: float(np.median(one["seconds"])) for one in results["many"]}
        each = {f"{name}, {count} times": count * each for name, each in peers.items()}
        title = f"{count} searches of the paper, the peers' one after the other (extrapolated)"
        lines += ratio_table(title, each, many)
    for problem, title in TITLES.items():
        rows = [row for row in present if row["problem"] == problem]
        if not rows:
            continue
        target = lowest(rows) * (1.0 + NEAR)
        times = {row["name"]: (row["own"], expected(row, target)) for row in rows}
        peers = {k: t for k, (own_row, t) in times.items() if not own_row and np.isfinite(t)}
        own = {k: t for k, (own_row, t) in times.items() if own_row and np.isfinite(t)}
        lines += ratio_table(f"{title}: expected time to the lowest cost", peers, own)
    return lines


def ratio_table(title: str, peers: dict[str, float], own: dict[str, float]) -> list[str]:
    """Rows are peers, columns are calls of piezotrack."""
    if not peers or not own:
        return []
    heads = [f"{name.removeprefix('piezotrack, ')}: {amount(each)} s" for name, each in own.items()]
    lines = ["", f"| {title} | | {' | '.join(heads)} |", "| --- | --- |" + " --- |" * len(own)]
    for name, each in sorted(peers.items(), key=lambda item: item[1]):
        parts = " | ".join(f"{amount(each / mine)} times" for mine in own.values())
        lines.append(f"| {name} | {amount(each)} s | {parts} |")
    return lines


def table(rows: list[Row]) -> list[str]:
    """One row a peer."""
    present = [row for row in rows if "runs" in row]
    least = lowest(present)
    lines = [
        f'The lowest cost is {least:.6f} um; "reached" is at most {100 * NEAR:g} % above it.',
        "",
        "| | simulations | seconds | final cost, median and worst | reached | expected s to it "
        "| integration error | diverged |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for row in rows:
        if "missing" in row:
            lines.append(f"| {row['name']} | not available here: {row['missing']} | | | | | | |")
            continue
        runs = row["runs"]
        costs = [run["cost"] for run in runs]
        hits = sum(np.isfinite(arrival(run, least * (1.0 + NEAR))) for run in runs)
        time = expected(row, least * (1.0 + NEAR))
        simulations = int(np.median([run["simulations"] for run in runs]))
        took, cost = amount(seconds(row)), f"{np.median(costs):.5f}, {max(costs):.5f} um"
        if row["extrapolated"]:
            took += f" (extrapolated from {simulations} simulations)"
            simulations, cost = WHOLE, f"after {simulations}: {np.median(costs):.2f} um"
        lines.append(
            f"| {row['name']} | {simulations} | {took} | {cost} | {hits} of {len(runs)} "
            f"| {amount(time) if np.isfinite(time) else '-'} | {small(row['error_nm'])} nm "
            f"| {sum(run['diverged'] for run in runs)} |"
        )
    return lines


def amount(value: float) -> str:
    """Two or three digits, without an exponent."""
    if value >= 100.0:
        return f"{value:.0f}"
    return f"{value:.3g}"


def small(value: float) -> str:
    """One digit, without an exponent."""
    return f"{float(f'{value:.1g}'):.10f}".rstrip("0").rstrip(".")


def median_course(row: Row, times: np.ndarray) -> np.ndarray:
    """Median over the seeds of the best cost so far; NaN before half of them have one."""
    courses = []
    for run in row["runs"]:
        at, _, costs = np.array(run["course"]).T
        place = np.searchsorted(at, times, side="right")
        courses.append(np.where(place > 0, costs[np.maximum(place - 1, 0)], np.inf))
    middle = np.median(courses, axis=0)
    over = np.median([run["seconds"] for run in row["runs"]])
    return np.where(np.isfinite(middle) & (times <= 1.02 * over), middle, np.nan)


def draw(results: Row, file: Path) -> None:
    """Cost against wall time, median over the seeds."""
    panels = {
        name: [row for row in results["rows"] if row["problem"] == name and "runs" in row]
        for name in TITLES
    }
    figure, axes = plt.subplots(len(panels), 1, figsize=(10.5, 9.5), layout="constrained")
    for ax, (name, rows) in zip(axes, panels.items(), strict=True):
        if rows:
            panel(ax, TITLES[name], rows)
    figure.savefig(file, dpi=130)
    plt.close(figure)


def panel(ax: Any, title: str, rows: list[Row]) -> None:
    """One problem."""
    least = lowest(rows)
    target = least * (1.0 + NEAR)
    times = np.geomspace(1e-4, 1.1 * max(run["seconds"] for r in rows for run in r["runs"]), 2000)
    own = 0
    for row in sorted(rows, key=lambda row: expected(row, target)):
        hits = sum(np.isfinite(arrival(run, target)) for run in row["runs"])
        if row["own"]:
            style = {"color": "black", "linewidth": 2.4, "linestyle": OWN_STYLES[own % 3]}
            own += 1
        else:
            colour = next(c for key, c in COLOURS.items() if key in row["name"])
            plain = {"RK4": "--", "exponential": "-.", "solve_ivp": ":"}
            line = next((s for key, s in plain.items() if key in row["name"]), "-")
            style = {"color": colour, "linewidth": 1.4, "linestyle": line}
        label = f"{row['name']}: {hits} of {len(row['runs'])}"
        if row["extrapolated"]:
            label = f"{row['name']}: first simulations only"
        course = median_course(row, times)
        ax.plot(times, course, label=label, **style)
        arrivals = [arrival(run, target) for run in row["runs"]]
        when = float(np.median(arrivals))
        if np.isfinite(when):
            ax.plot(when, target, "o", color=style["color"], markersize=6, zorder=5)
    ax.axhline(least, color="0.6", linewidth=0.8)
    ax.annotate(
        f"lowest, {least:.4f} um",
        (0.01, least),
        xycoords=("axes fraction", "data"),
        xytext=(0, -13),
        textcoords="offset points",
        color="0.4",
        fontsize=9,
    )
    ax.set(xscale="log", yscale="log", title=title, xlabel="wall time [s]")
    ax.set_ylabel("rms deviation of the best so far [um]")
    ax.set_ylim(0.7 * least, 60.0)
    first = min(run["course"][0][0] for row in rows for run in row["runs"])
    ax.set_xlim(0.8 * first, times[-1])
    ax.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    ax.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    ax.grid(which="major", color="0.9", linewidth=0.6)
    ax.legend(
        loc="center left",
        bbox_to_anchor=(1.01, 0.5),
        fontsize=9,
        frameon=False,
        title="soonest first; reached the lowest (dots):",
        title_fontsize=9,
        alignment="left",
    )
