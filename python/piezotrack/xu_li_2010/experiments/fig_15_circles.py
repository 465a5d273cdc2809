"""Fig. 15 and Table 2: circles."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..apparatus import loop
from .fig_12_14_tracking import PID
from .table_2 import Table2, run_table_2

if TYPE_CHECKING:
    from ...control.loop.tracking import Tracking
    from ...stages.inverse import Inverse
    from ...stages.xy import XYStage
    from ..apparatus import Apparatus

__all__ = ["circles", "observe"]


def circles(
    apparatus: Apparatus, inverse: Inverse, *, largest: float = 1.0, checked: bool = True
) -> Table2:
    """Run the nine circles, up to a radius [m], with the feedforward of x on both axes."""
    one = loop(inverse, feedback=PID)
    return run_table_2(
        apparatus.stage, (one, one), timing=apparatus.timing, largest=largest, checked=checked
    )


def observe(table: Table2, stage: XYStage, *, true: bool = False) -> dict[str, float]:
    """Compute the published quantities, SI.

    From the readings at 50 Hz, as in the paper; with `true`, from the true positions between them
    too. The errors of an axis are those of its controller, which samples y later than x; where it
    misses ticks, their true values are not known from the record.
    """
    values = {}
    for case, run in table.cases:
        key, metrics = case.key, run.score(true=true)
        values[f"{key}.max"] = metrics.peak_to_peak
        values[f"{key}.mean"] = metrics.mean_error
        values[f"{key}.sd"] = metrics.sd_error
        values[f"{key}.ratio"] = metrics.peak_to_peak / metrics.sd_error
    small, lag = table.runs[0], stage.lag
    if not true or stage.missed_ticks == 0.0:
        values["circle.axes"] = max(
            _largest(small.x, small.settled, 0.0, true), _largest(small.y, small.settled, lag, true)
        )
    return values


def _largest(axis: Tracking, settled: float, lag: float, true: bool) -> float:
    """Largest error of a controller, or the true error at its samples [m]."""
    if not true:
        return float(np.abs(axis.loop_error[axis.t >= settled + lag]).max())
    seen = np.interp(axis.t + lag, axis.fine_t, axis.fine_displacement)
    part = (axis.t >= settled) & (axis.t + lag <= axis.t[-1])
    return float(np.abs(axis.desired - seen)[part].max())
