"""Picture of a loop's stability: open loop, sensitivity, learning."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING

import matplotlib.pyplot as plt
import numpy as np

from .._support.plot_style import above

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from .stability import LoopReport

__all__ = ["plot_loop_report"]


def plot_loop_report(report: LoopReport) -> Figure:
    """Plot open loop, sensitivity and, with a repetitive part, the error left by a period.

    Parameters
    ----------
    report : LoopReport
        The report.

    Returns
    -------
    matplotlib.figure.Figure
        Not yet shown or saved.
    """
    curves = report.response()
    f = curves.frequency
    figure = plt.figure(figsize=(7.0, 7.0), layout="constrained")
    size, phase, parts = figure.subplots(3, 1, sharex=True)
    size.loglog(f, np.abs(curves.open_loop), color="C0")
    size.axhline(1.0, color="0.7", linewidth=0.8)
    size.set(ylabel="open loop |L|")
    phase.semilogx(f, np.degrees(np.angle(curves.open_loop)), color="C0")
    phase.set(ylabel="phase of L [deg]", ylim=(-190, 190), yticks=(-180, -90, 0, 90, 180))
    parts.loglog(f, np.abs(curves.sensitivity), color="C3", label="sensitivity |S|")
    parts.loglog(f, np.abs(curves.complementary), color="C0", label="complementary |T|")
    if np.any(curves.learning):
        parts.loglog(f, curves.learning, color="C2", label="left by a period")
    parts.axhline(1.0, color="0.7", linewidth=0.8)
    parts.set(xlabel="frequency [Hz]", ylabel="closed loop")
    parts.set_ylim(bottom=max(1e-3, parts.get_ylim()[0]))
    above(parts)
    figure.suptitle("\n".join(textwrap.wrap(str(report.middle), 75)), fontsize="medium")
    return figure
