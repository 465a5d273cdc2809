"""A stage in a line: what its repr shows."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .base import Stage

__all__ = ["stage_text"]


def stage_text(stage: Stage) -> str:
    """Write the gain, the hysteresis and the dynamics of a stage, in um and ms.

    Parameters
    ----------
    stage : Stage
        The stage.

    Returns
    -------
    str
        Such as ``PrandtlIshlinskiiStage(12.6 um/V, 10 plays, lag 1.2 ms)``. All parameters are
        attributes of the stage, and ``dataclasses.asdict(stage)`` has them in a dict.
    """
    parts = _with_mass(stage) if hasattr(stage, "stiffness") else _at_the_input(stage)
    if creep := len(stage.creep_times):  # type: ignore[attr-defined]
        parts.append(_count(creep, "creep time"))
    return f"{type(stage).__name__}({', '.join(parts)})"


def _at_the_input(stage: Any) -> list[str]:
    parts = []
    thresholds = getattr(stage, "thresholds", None)
    if thresholds is not None:
        # With an envelope or a polynomial the slope depends on the voltage.
        if hasattr(stage, "linear") and not hasattr(stage, "scale"):
            parts.append(f"{1e6 * _mean_slope(stage):.3g} um/V")
        parts.append(_count(len(thresholds), "play"))
    for name, thing in (("dead_zone_weights", "dead zone"), ("levels", "level")):
        if count := len(getattr(stage, name, ())):
            parts.append(_count(count, thing))
    if hasattr(stage, "low"):
        parts.append(f"{stage.low:.4g} V to {stage.high:.4g} V")
    if stage.time_constant is not None:
        parts.append(f"lag {1e3 * stage.time_constant:.3g} ms")
    if stage.frequency is not None:
        parts.append(f"mode {stage.frequency:.4g} Hz")
    if modes := len(stage.mode_frequencies):
        parts.append(_count(modes, "further mode"))
    return parts


def _mean_slope(stage: Any) -> float:
    """Travel per volt of the settled loop over a drive for which all plays are meant [m/V]."""
    widest = 2.0 * max(stage.thresholds, default=0.0)
    # A play follows the drive but for twice its threshold.
    plays = zip(stage.thresholds, stage.weights, strict=True)
    moved = (weight * (1.0 - 2.0 * r / widest if widest else 1.0) for r, weight in plays)
    return float(stage.linear + math.fsum(moved))


def _with_mass(stage: Any) -> list[str]:
    parts = []
    if stage.info.drive_unit == "V":
        per_volt = stage.piezo_coefficient
        in_metres = next(one.unit == "m/V" for one in stage.info.parameters
                         if one.name == "piezo_coefficient")  # fmt: skip
        parts.append(f"{1e6 * (per_volt if in_metres else per_volt / stage.stiffness):.3g} um/V")
    else:
        parts.append(f"{1e6 / stage.stiffness:.3g} um/N")
    frequency = math.sqrt(stage.stiffness / stage.mass) / (2.0 * math.pi)
    parts.append(f"natural frequency {frequency:.4g} Hz")
    parts.append(f"lag {1e3 * stage.damping / stage.stiffness:.3g} ms")
    return parts


def _count(number: int, thing: str) -> str:
    return f"{number} {thing}{'' if number == 1 else 's'}"
