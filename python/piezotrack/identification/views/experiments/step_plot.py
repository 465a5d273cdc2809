"""Pictures of a step response: the step with its peaks, the spectrum with its resonance."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...._support.arguments import expect
from ...._support.display.plot_style import (
    LEVEL,
    MARKS,
    RECORDED,
    axes_or_new,
    drawing,
    heading,
    literal,
    sheet,
    whole,
)
from ...._support.units import best_length_unit, drive_text, shown_unit
from ....errors import ParameterError
from ...experiments.step_response import StepResult

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

    from ...experiments.step_response import StepTrace

__all__ = ["plot_spectrum", "plot_step", "plot_step_result"]

# Time constants that are shown, and samples at most.
SHOWN, MOST_POINTS = 8.0, 20000
MARGIN = 0.06


@drawing
def plot_step(step: StepResult, ax: Axes | None = None) -> Axes:
    """Draw the displacement after the step, with the peaks and the level it ends at."""
    trace, (ax,) = _trace(step), axes_or_new(ax, 1)
    read = step.readings
    unit, scale = best_length_unit(max(abs(peak) for peak in read.peaks))
    until = trace.peak_times[-1] + 2.0 * read.period
    until = min(max(until, trace.step_time + SHOWN * step.time_constant), trace.end_time)
    since = trace.step_time - MARGIN * (until - trace.step_time)
    t = trace.data.t
    shown = np.flatnonzero((t >= since) & (t <= until))
    shown = shown[:: max(1, shown.size // MOST_POINTS)]
    ms = 1e3 * (t[shown] - trace.step_time)
    ax.plot(ms, scale * (trace.data.y[shown] - trace.rest), **RECORDED)
    steady = scale * read.steady_state
    ax.axhline(steady, **LEVEL, zorder=0, label=f"steady state, {steady:.4g} {unit}")
    times = [1e3 * (time - trace.step_time) for time in trace.peak_times]
    ax.plot(times, [scale * peak for peak in read.peaks], **MARKS, label="overshoot peaks")
    for time, peak in list(zip(times, read.peaks, strict=True))[:2]:
        ax.annotate(
            f"{scale * peak:.4g}",
            (time, scale * peak),
            xytext=(6, 3),
            textcoords="offset points",
            fontsize="small",
            color="black",
        )
    ax.set(xlabel="time after the step [ms]", ylabel=f"displacement [{unit}]")
    height = literal(drive_text(read.voltage, trace.data.drive_unit))
    source = f"{literal(trace.data.source)}: step" if trace.data.source else "Step"
    heading(
        ax,
        f"{source} of {height}, Td = {1e3 * read.period:.4g} ms, "
        f"overshoot {100 * step.overshoot_ratio:.3g} %",
    )
    ax.margins(x=0.0, y=0.08)
    ax.legend(loc="lower right" if steady > 0.0 else "upper right", frameon=False)
    return ax


@drawing
def plot_spectrum(step: StepResult, ax: Axes | None = None) -> Axes:
    """Draw the gain over the frequency, with the resonance and the static gain."""
    trace, (ax,) = _trace(step), axes_or_new(ax, 1)
    read = step.readings
    unit, scale = best_length_unit(abs(read.steady_state))
    drive, times = shown_unit(trace.data.drive_unit)
    per_volt, scale = f"{unit}/{literal(drive)}", scale / times
    static, resonance = scale * abs(read.static_gain), scale * abs(read.resonance_gain)
    # The curve may step over a narrow peak; the peak itself is known.
    places = np.append(trace.frequencies, read.frequency)
    gains = np.append(trace.gains, abs(read.resonance_gain))
    order = np.argsort(places)
    ax.plot(places[order], scale * gains[order], **RECORDED)
    ax.axhline(static, **LEVEL, zorder=0)
    ax.plot([read.frequency], [resonance], **MARKS)
    ax.set_yscale("log")
    low, high = ax.get_ylim()
    ax.set_ylim(max(low, 1e-3 * resonance), 1.6 * max(high, resonance))
    right = float(trace.frequencies[-1])
    ax.annotate(
        f"resonance {read.frequency:.4g} Hz,\n{resonance:.4g} {per_volt}",
        (read.frequency, resonance),
        xytext=(10, -2),
        textcoords="offset points",
        fontsize="small",
        va="center",
        color="black",
    )
    ax.annotate(
        f"static gain {static:.4g} {per_volt}",
        (right, static),
        xytext=(-4, 4),
        textcoords="offset points",
        fontsize="small",
        ha="right",
        color="0.3",
    )
    ax.set(xlabel="frequency [Hz]", ylabel=f"gain [{per_volt}]")
    heading(
        ax,
        f"Spectrum: damping ratio {step.damping_ratio:.3g} (gains), "
        f"{step.damping_by_decrement:.3g} (decrement)",
    )
    ax.set_xlim(0.0, right)
    return ax


@drawing
def plot_step_result(step: StepResult, fig: Figure | SubFigure | None = None) -> Figure:
    """Put step and spectrum on one sheet."""
    _trace(step)
    figure, axes = sheet(fig, (11.0, 4.4), (("step", "spectrum"),))
    plot_step(step, axes["step"])
    plot_spectrum(step, axes["spectrum"])
    return whole(figure)


def _trace(step: StepResult) -> StepTrace:
    expect("step", step, StepResult, "what pt.identify_step returns")
    if step.trace is None:
        raise ParameterError("step", "of readings entered by hand", "a record to draw")
    return step.trace
