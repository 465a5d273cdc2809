"""Text of a tracked motion."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..._support.statistics import ErrorStatistics
from ..on_device.latency import latency_of

if TYPE_CHECKING:
    from ..loop.settling import Settling
    from ..loop.tracking import Tracking
    from ..on_device.closed_loop import DeviceTracking

__all__ = ["clipped_text", "device_tracking_text", "tracking_text"]


def tracking_text(run: Tracking) -> str:
    """Write the metrics of a run: of all of it, and period by period."""
    lines = [f"{run.reference!r} at {1.0 / run.controller.dt:g} Hz; {run.note}"]
    since = f"from {run.settled:g} s on" if run.settled else "all of it"
    lines.append(f"{since}: {run.metrics}")
    if not np.array_equal(run.measured, run.displacement):
        lines.append(f"true: {ErrorStatistics.__str__(run.score(true=True))}")
    if moves := run.settling():
        lines.append(_settled(moves))
    if run.saturated.any():
        lines.append(clipped_text(run))
    if run.periods:
        lines.append("period  max um  rms um  mean um")
        lines += [
            f"{i:>6}  {1e6 * figures.max_error:>6.3f}  {1e6 * figures.rms_error:>6.3f}  "
            f"{1e6 * figures.mean_error:>7.3f}"
            for i, figures in enumerate(run.periods, 1)
        ]
    return "\n".join(lines)


def clipped_text(run: Tracking) -> str:
    """Write the share of the samples at which the command was clipped to the limits."""
    return f"clipped in {100.0 * run.saturated.mean():.1f} % of the samples"


def _settled(moves: list[Settling]) -> str:
    """Write when the moves of a run have settled, and how far they go beyond."""
    times, travels = ([getattr(one, name) for one in moves] for name in ("time", "travel"))
    words = f"settled to 2 % of a move {1e3 * float(np.median(times)):.3g} ms after its start"
    if not np.isfinite(np.median(times)):
        words = "not settled to 2 % of a move while it is held"
    if len(moves) > 1:
        late = sum(not np.isfinite(one) for one in times)
        words += f" (median of {len(moves)}, {f'{late} never' if late else _longest(times)})"
    beyond = 100.0 * max(one.overshoot for one in moves)
    return f"{words}; {1e3 * float(np.median(travels)):.3g} ms of travel, overshoot {beyond:.2g} %"


def _longest(times: list[float]) -> str:
    return f"longest {1e3 * max(times):.3g} ms"


def device_tracking_text(run: DeviceTracking) -> str:
    """Write the metrics of a run on a device, and how late its ticks were."""
    late = latency_of(run.lateness[np.isfinite(run.lateness)])
    return f"{tracking_text(run)}\nlateness  {late}, {run.overruns} overruns"
