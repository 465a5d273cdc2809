"""Text of a tracked motion."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..._support.statistics import ErrorStatistics
from ..on_device.latency import latency_of

if TYPE_CHECKING:
    from ..loop.tracking import Tracking
    from ..on_device.closed_loop import DeviceTracking

__all__ = ["device_tracking_text", "tracking_text"]


def tracking_text(run: Tracking) -> str:
    """Write the metrics of a run: of all of it, and period by period."""
    lines = [f"{run.reference!r} at {1.0 / run.controller.dt:g} Hz; {run.note}"]
    since = f"from {run.settled:g} s on" if run.settled else "all of it"
    lines.append(f"{since}: {run.metrics}")
    if not np.array_equal(run.measured, run.displacement):
        lines.append(f"true: {ErrorStatistics.__str__(run.score(true=True))}")
    if run.saturated.any():
        lines.append(f"clipped in {100.0 * run.saturated.mean():.1f} % of the samples")
    if run.periods:
        lines.append("period  max um  rms um  mean um")
        lines += [
            f"{i:>6}  {1e6 * figures.max_error:>6.3f}  {1e6 * figures.rms_error:>6.3f}  "
            f"{1e6 * figures.mean_error:>7.3f}"
            for i, figures in enumerate(run.periods, 1)
        ]
    return "\n".join(lines)


def device_tracking_text(run: DeviceTracking) -> str:
    """Write the metrics of a run on a device, and how late its ticks were."""
    late = latency_of(run.lateness[np.isfinite(run.lateness)])
    return f"{tracking_text(run)}\nlateness  {late}, {run.overruns} overruns"
