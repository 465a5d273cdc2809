"""Controllers side by side: on the virtual stage of Xu and Li 2010, and on one of measured logs.

    python benches/controllers.py [FOLDER]

writes controllers_*.png and, as controllers_*.md, the tables of benches/controllers.md into
the folder.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Any

import matplotlib as mpl

import piezotrack as pt
from piezotrack.control.views.comparison_table import grids

mpl.use("Agg")


def published() -> tuple[Any, Any, dict[str, Any]]:
    """The virtual stage, and models of a record of it: six tones for 20 s."""
    stage = pt.VirtualStage.xu_li_2010(seed=1)
    tones = [0.35, 0.8, 1.7, 3.1, 5.3, 9.1]
    drive = pt.multisine(frequencies=tones, duration=20.0, low=5e-6, high=70e-6, seed=3)
    # The motion in um is taken for a voltage; it begins with a jump, after which the mode rings.
    record = stage.record(1e6 * drive.sample(1e-3).x, 1e-3, hold="zoh")[2.0:]
    model = pt.identify(record, "prandtl-ishlinskii")
    models = {name: pt.identify(record, name) for name in ("dahl", "bouc-wen")}
    return stage, model, {"models": models, "record": record, "dt": 1e-3, "limits": (0.0, 75.0)}


def measured() -> tuple[Any, Any, dict[str, Any]]:
    """A stage identified from one measured log, its model from the other one."""
    tracking, training = pt.datasets.dbo_tracking(), pt.datasets.dbo_training()
    noise = pt.identify(tracking, "prandtl-ishlinskii")
    stage = pt.VirtualStage.of(noise, noise=5e-9, seed=1)
    model = pt.identify(training, "prandtl-ishlinskii")
    models = {name: pt.identify(training, name) for name in ("dahl", "bouc-wen")}
    low, high = noise.drive_range
    found = {"models": models, "record": tracking, "dt": noise.dt, "limits": (low, high)}
    return (
        stage,
        model,
        {**found, "rates": (0.5, 2.0, 8.0), "search": pt.TuningSearch(particles=24, iterations=30)},
    )


def markdown(found: pt.control.ControllerComparison) -> str:
    """The tables of a comparison as a page has them."""
    pages = []
    for grid in grids(found):
        head = ["", *grid.heads]
        lines = [head, ["---"] * len(head), *([name, *cells] for name, cells in grid.rows)]
        table = "\n".join(f"| {' | '.join(cells)} |" for cells in lines)
        pages.append(f"{grid.title}\n\n{table}\n")
    return "\n".join(pages)


def main() -> None:
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
    for name, make in (("published", published), ("measured", measured)):
        stage, model, options = make()
        started = time.perf_counter()
        found = pt.compare_controllers(stage, model, **options)
        print(f"{name}: {time.perf_counter() - started:.0f} s\n{found}\n", flush=True)
        (folder / f"controllers_{name}.md").write_text(markdown(found), encoding="utf-8")
        found.plot().savefig(folder / f"controllers_{name}.png", dpi=110)


if __name__ == "__main__":
    main()
