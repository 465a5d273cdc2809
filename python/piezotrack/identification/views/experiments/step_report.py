"""The table of a step response."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...._support.display.table import Column, Table
from ...._support.units import drive_text, of_drive, shown_unit

if TYPE_CHECKING:
    from ...experiments.step_response import StepResult

__all__ = ["step_text"]

# Name, value, unit, equation.
COLUMNS = (
    Column(width=17, left=True),
    Column(width=14, before=0),
    Column(width=17, left=True),
    Column(before=0, left=True),
)


def step_text(step: StepResult) -> str:
    """Write a result as a table.

    Parameters
    ----------
    step : StepResult
        Result of a step response.

    Returns
    -------
    str
        Several lines.
    """
    read, trace = step.readings, step.trace
    peaks = ", ".join(f"{1e6 * peak:.4f}" for peak in read.peaks[:4])
    more = f", ... ({len(read.peaks)} of them)" if len(read.peaks) > 4 else ""
    where = "readings entered by hand"
    if trace is not None:
        where = f"{trace.data.source or 'a record'}, step at {trace.step_time:.4g} s"
    unit = "V" if trace is None else trace.data.drive_unit
    per_drive, scale = shown_unit(of_drive("m/V", unit))
    units = {"a1": ("1/m", "(9), (13)"), "a2": ("1/m^2", "(10)"), "b1": ("N/m^2", "(11)")}
    units["b0"] = ("N/m", "(12)")
    gains = f"{scale * read.static_gain:.4f}, {scale * read.resonance_gain:.4f}"
    ratio = step.ratios
    lines = [
        f"Step response of {where}: {drive_text(read.voltage, unit)}",
        *(f"note  {note}" for note in step.notes),
        "",
        "readings",
        *_rows(
            ("steady state", f"{1e6 * read.steady_state:.4f}", "um"),
            ("overshoot peaks", peaks + more, "um"),
            ("overshoot ratio", f"{100 * step.overshoot_ratio:.1f}", "% of the steady state"),
            ("period Td", f"{1e3 * read.period:.4g}", f"ms, {1 / read.period:.4g} Hz"),
            ("resonance", f"{read.frequency:.4g}", "Hz"),
            ("gains", gains, f"{per_drive}, static and at the resonance"),
        ),
        "",
        "the mode",
        *_rows(
            ("wn", f"{step.natural_angular_frequency:.5g}", "rad/s", "(5)"),
            ("zeta", f"{step.damping_ratio:.4g}", "by the gains", "(4)"),
            ("", f"{step.damping_by_decrement:.4g}", "by the logarithmic decrement"),
            ("tau", f"{1e3 * step.time_constant:.4g}", "ms", "(6)"),
        ),
        "",
        "the Dahl operator, read in time and used along the displacement, as the paper does",
        *_rows(*((name, f"{x:.7g}", *units[name]) for name, x in step.hysteresis.items())),
        "",
        "ratios that one step determines",
        *_rows(
            ("K/M", f"{ratio['K/M']:.5g}", "1/s^2"),
            ("D/M", f"{ratio['D/M']:.5g}", "1/s"),
            ("T/K", f"{scale * ratio['T/K']:.5g}", per_drive),
        ),
        "",
        *_absolute(step),
        "",
        step.advice[0].upper() + step.advice[1:] + ".",
    ]
    return "\n".join(lines)


def _absolute(step: StepResult) -> list[str]:
    """List mass, damping, stiffness and piezo coefficient, or how to fix their scale."""
    values = (
        ("K", step.stiffness, "N/m"),
        ("T", step.piezo_coefficient, "N/V"),
        ("M", step.mass, "kg"),
        ("D", step.damping, "N s/m"),
    )
    known = [(name, value, unit) for name, value, unit in values if value is not None]
    if not known:
        return [
            "One step does not determine K, T, M and D: give a known stiffness or mass, or a",
            "second static level with b1 as the scale.",
        ]
    return [
        f"with {step.scale}",
        *_rows(*((name, f"{value:.5g}", unit) for name, value, unit in known)),
    ]


def _rows(*rows: tuple[str, ...]) -> list[str]:
    """Write rows of name, value, unit and, where there is one, the number of the equation."""
    return Table(COLUMNS, [(*row, "")[:4] for row in rows]).lines(heads=False)
