"""Picture of the demonstration: the loop of actual over desired displacement, before and after."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import matplotlib.pyplot as plt
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from .tracking import Tracking

__all__ = ["plot_before_and_after"]

# The run without compensation, that in between, and the last.
STYLES: tuple[dict[str, Any], ...] = (
    {"color": "#b3400a", "linewidth": 1.4},
    {"color": "#e0a030", "linewidth": 1.2},
    {"color": "#1b6ca8", "linewidth": 1.4},
)


def plot_before_and_after(runs: Mapping[str, Tracking]) -> Figure:
    """Draw actual over desired displacement of the first and the last run, and all errors.

    Parameters
    ----------
    runs : mapping of str to Tracking
        Three runs along the same reference, by what compensates the hysteresis.

    Returns
    -------
    matplotlib.figure.Figure
        Three panels.
    """
    figure = plt.figure(figsize=(10.0, 7.4), layout="constrained")
    grid = figure.add_gridspec(2, 2, height_ratios=[1.75, 1.0])
    names = list(runs)
    left = figure.add_subplot(grid[0, 0])
    right = figure.add_subplot(grid[0, 1], sharex=left, sharey=left)
    _plot_loop(left, "Before", names[0], runs[names[0]], STYLES[0])
    _plot_loop(right, "After", names[-1], runs[names[-1]], STYLES[-1])
    below = figure.add_subplot(grid[1, :])
    for name, style in zip(names, STYLES, strict=True):
        run, part = runs[name], _settled(runs[name])
        label = f"{name}: {1e6 * run.metrics.rms_error:.2f} um rms"
        below.plot(run.t[part], 1e6 * run.error[part], **style, label=label)
    below.axhline(0.0, color="0.7", linewidth=0.8, zorder=0)
    below.set(xlabel="time [s]", ylabel="tracking error [um]")
    below.margins(x=0.0)
    # Room for the legend above the lines.
    low, high = below.get_ylim()
    below.set_ylim(top=high + 0.25 * (high - low))
    below.legend(loc="upper center", ncols=3, frameon=False)
    return figure


def _settled(run: Tracking) -> NDArray[np.bool_]:
    return run.part(run.t, None, None)


def _plot_loop(ax: Axes, when: str, name: str, run: Tracking, style: Mapping[str, Any]) -> None:
    part = _settled(run)
    ends = 1e6 * np.array([run.desired.min(), run.desired.max()])
    ax.plot(ends, ends, color="0.72", linewidth=4.0, label="desired")
    ax.plot(1e6 * run.desired[part], 1e6 * run.measured[part], **style, label="actual")
    ax.set(
        xlabel="desired displacement [um]",
        ylabel="actual displacement [um]",
        title=f"{when}: {name}, largest error {1e6 * run.metrics.max_error:.2g} um",
    )
    ax.legend(loc="upper left", frameon=False)
