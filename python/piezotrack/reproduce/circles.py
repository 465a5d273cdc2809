"""Fig. 15 and Table 2: circles."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..table_2 import Table2, run_table_2
from .apparatus import loop
from .tracked import PID

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..inverse import Inverse
    from .apparatus import Apparatus

__all__ = ["circles", "draw", "observe"]


def circles(apparatus: Apparatus, inverse: Inverse, *, largest: float = 1.0) -> Table2:
    """Run the nine circles, up to a radius [m], with the feedforward of x on both axes."""
    one = loop(inverse, feedback=PID)
    return run_table_2(apparatus.stage, (one, one), delay=apparatus.delay, largest=largest)


def observe(table: Table2, *, true: bool = False) -> dict[str, float]:
    """Read off what the paper publishes, SI.

    Of the readings at 50 Hz, as the paper's; with `true`, of the true positions between them too.
    """
    found = {}
    for case, run in table.cases:
        key, metrics = f"circle.{1e6 * case.radius:g}um.{case.frequency:g}Hz", run.score(true=true)
        found[f"{key}.max"] = metrics.peak_to_peak
        found[f"{key}.mean"] = metrics.mean_error
        found[f"{key}.sd"] = metrics.sd_error
    small = table.runs[0]
    found["circle.axes"] = max(axis.score(true=true).max_error for axis in (small.x, small.y))
    return found


def draw(table: Table2) -> Figure:
    """Draw circles, errors and the table as bars."""
    return table.plot()
