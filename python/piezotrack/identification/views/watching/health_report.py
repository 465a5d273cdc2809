"""Table and picture of what has changed of a stage."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from ...._support.display.plot_style import (
    BLUE,
    GUIDE,
    RED,
    drawing,
    heading,
    literal,
    names_beside,
    sheet,
    whole,
)
from ...._support.units import length_text
from ...watching.health import RATIOS

if TYPE_CHECKING:
    from matplotlib.figure import Figure, SubFigure

    from ...watching.health import Change, Health

__all__ = ["health_text", "plot_health"]

# Scale, unit and sign of a change for a person.
SHOWN = {"s": (1e3, " ms", "+.3g"), "m": (1e6, " um", "+.3g"), "": (100.0, " %", "+.3g")}


def health_text(health: Health) -> str:
    """Write the verdicts as a table.

    Parameters
    ----------
    health : Health
        The verdicts.

    Returns
    -------
    str
        Several lines.
    """
    changed = [one.name for one in health.changes if one.verdict == "changed"]
    verdict = f"changed: {', '.join(changed)}" if changed else _none_seen(health)
    lines = [
        f"{health.model} on {health.source or 'a record'}: {verdict}",
        f"  rms error  {length_text(health.rms, 3)}, on its own record "
        f"{length_text(health.rms_identified, 3)}; {health.effective:.0f} independent samples",
        "",
        *(_row(change) for change in health.changes),
        "intervals of 95 % for all at once, model error included",
    ]
    refit = health.refit
    if refit is not None:
        low, high = (100.0 * end for end in refit.interval)
        gain, change = 100.0 * refit.improvement, "lower"
        if gain < 0.0:
            gain, low, high, change = -gain, -high, -low, "higher"
        lines += [
            "",
            f"refit {'accepted' if refit.accepted else 'not accepted'}: rms from "
            f"{length_text(refit.rms_before, 3)} to {length_text(refit.rms_after, 3)} where not "
            f"fitted ({refit.held_out[0]:.4g} to {refit.held_out[1]:.4g} s), mean square "
            f"{gain:.3g} % {change} ({low:.3g} to {high:.3g} %)",
        ]
    return "\n".join(lines)


def _is_coarse(change: Change) -> bool:
    """Whether no change is seen, and only a large one could be."""
    return change.verdict == "unchanged" and bool(change.reason)


def _none_seen(health: Health) -> str:
    # The residual is none of the stage's properties.
    coarse = [one.name for one in health.changes[1:] if _is_coarse(one)]
    if not coarse:
        return "unchanged, as far as judged"
    return f"no change seen; of {' and '.join(coarse)} only a large one could be"


def _row(change: Change) -> str:
    head = f"{change.name:<11} {'none seen' if _is_coarse(change) else change.verdict:<10}"
    if change.value is None or change.interval is None:
        return f"{head}  {change.reason}"
    ratio = change.name in RATIOS
    scale, unit, form = (1.0, "", ".3g") if ratio else SHOWN[change.unit]
    low, high = (f"{scale * end:{form}}" for end in change.interval)
    times = "x" if ratio else ""
    reason = f", {change.reason}" if change.reason else ""
    return f"{head}  {times}{scale * change.value:{form}}{unit}  ({low} to {high}){reason}"


@drawing
def plot_health(health: Health, fig: Figure | SubFigure | None = None) -> Figure:
    """Draw each change with its interval, in half widths of the interval."""
    figure, axes = sheet(fig, (7.5, 4.0), (("changes",),), least=2.2)
    ax = axes["changes"]
    for i, change in enumerate(health.changes):
        if change.value is None or change.interval is None:
            ax.text(0.0, i, "not judged", ha="center", va="center", color="0.4")
            continue
        values = (change.value, *change.interval)
        if change.name in RATIOS:
            values = tuple(math.log(max(value, 1e-12)) for value in values)  # type: ignore[assignment]
        middle, low, high = (value / (values[2] - values[1]) * 2.0 for value in values)
        colour = RED if change.verdict == "changed" else BLUE
        ax.plot([low, high], [i, i], color=colour, linewidth=3.0, solid_capstyle="butt")
        ax.plot(middle, i, "o", color=colour)
        ax.text(1.02, i, _figure(change), transform=ax.get_yaxis_transform(), va="center",
                fontsize="small")  # fmt: skip
    ax.axvline(0.0, **GUIDE)
    if max(map(abs, ax.get_xlim())) > 8.0:
        ax.set_xscale("symlog", linthresh=3.0)
    names_beside(ax, range(len(health.changes)), [one.name for one in health.changes])
    ax.set_ylim(len(health.changes) - 0.5, -0.5)
    ax.set_xlabel("change in half widths of its interval")
    source = f" on {literal(health.source)}" if health.source else ""
    heading(ax, f"{health.model}{source}: {_none_seen(health) if health.healthy else 'changed'}")
    return whole(figure)


def _figure(change: Change) -> str:
    scale, unit, form = SHOWN[change.unit]
    if change.name in RATIOS:
        return f"x{change.value:.3g}"
    return f"{scale * (change.value or 0.0):{form}}{unit}"
