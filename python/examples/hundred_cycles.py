"""A hundred cycles of the second-order and of the classic first-order Dahl stage.

Prints where the displacement is lowest in some of the cycles, and draws the loops:

    python python/examples/hundred_cycles.py docs

writes drift.png there, or here where no folder is given.
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib import pyplot as plt

import piezotrack as pt

RATE, CYCLES = 250, 100
SHOWN = (1, 2, 11, 36, 100)
STYLES = ("-", "--", "-.", ":", "-")
SHADES = ("0.7", "0.55", "0.4", "0.2", "black")


def stages() -> dict[str, pt.DahlStage | pt.FirstOrderDahlStage]:
    """Table 1 of the paper, and first-order friction fitted to its second cycle."""
    second = pt.DahlStage.xu_li_2010()
    u = drive(2)
    log = pt.Dataset(u=u, y=second.simulate(u, 1 / RATE).x, dt=1 / RATE)
    fit = pt.identify(
        log[4.0:],
        "first-order-dahl",
        parameters={"stiffness": second.stiffness},
        method=pt.Descents(seed=1),
        history="settled",
    )
    print(fit.summary(), end="\n\n")
    return {"second order, Table 1": second, "first order": fit.model}


def drive(cycles: int) -> np.ndarray:
    """0.25 Hz, 0 to 75 V."""
    t = np.arange(4 * RATE * cycles) / RATE
    return 37.5 * (1 - np.cos(2 * np.pi * 0.25 * t))


def main(folder: Path) -> None:
    """Simulate both, print and draw."""
    u = drive(CYCLES)
    figure, axes = plt.subplots(1, 3, figsize=(11, 4.0), layout="constrained")
    print("lowest displacement of a cycle [µm]")
    print("  cycle" + " " * 19 + "".join(f"{cycle:>10}" for cycle in SHOWN))
    for (name, stage), ax, marker in zip(stages().items(), axes, "os", strict=False):
        x = 1e6 * stage.simulate(u, 1 / RATE).x.reshape(CYCLES, -1)
        low = x.min(axis=1)
        print(f"  {name:<24}" + "".join(f"{low[cycle - 1]:>10.4f}" for cycle in SHOWN))
        for cycle, style, shade in zip(SHOWN, STYLES, SHADES, strict=True):
            ax.plot(u[: 4 * RATE], x[cycle - 1], style, color=shade, lw=1.2, label=f"cycle {cycle}")
        ax.set(title=name, xlabel="drive [V]", ylabel="displacement [µm]")
        ax.legend(frameon=False, fontsize="small")
        axes[2].plot(
            np.arange(1, CYCLES + 1),
            low - low[1],
            color="black",
            marker=marker,
            markevery=12,
            mfc="white",
            lw=1,
            label=name,
        )
    axes[2].set(
        title="drift of the loop",
        xlabel="cycle",
        ylabel="lowest displacement - that of cycle 2 [µm]",
    )
    axes[2].legend(frameon=False, fontsize="small")
    figure.savefig(folder / "drift.png", dpi=150)


if __name__ == "__main__":
    mpl.use("Agg")
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "."))
