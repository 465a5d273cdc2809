"""Why no controller was found: which constraint forbids it, and how far the nearest is off."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from .question import Question

__all__ = ["refusal"]


def refusal(question: Question, found: Mapping[str, Any], names: Sequence[str]) -> str:
    """Say which constraint forbids any controller, and how far the nearest one is off."""
    unstable, gain, phase, sensitivity, learning = found["robustness"]
    margins = question.margins
    if unstable[0] > 0.0:
        return (
            f"models: no gains in the search make all {len(names)} plants stable, the nearest "
            f"leave {names[unstable[1]]} unstable: expected a smaller spread, or plants nearer to "
            "each other"
        )
    ratios = {
        "gain": (margins.gain / gain[0], gain, margins.gain, "or more", ""),
        "phase": (margins.phase / max(phase[0], 1e-9), phase, margins.phase, "or more", " rad"),
        "sensitivity": (
            sensitivity[0] / margins.sensitivity,
            sensitivity,
            margins.sensitivity,
            "or less",
            "",
        ),
        "learning": (learning[0] / margins.learning, learning, margins.learning, "or less", ""),
    }
    name, (_, (value, plant), bound, side, unit) = max(ratios.items(), key=lambda item: item[1][0])
    figures = found["figures"]
    if not figures:
        return (
            f"margins.{name} is {bound:.6g}{unit}: expected one that some gains can keep; where "
            f"{bound:.6g}{unit} {side} was asked for, the nearest have {value:.6g}{unit} "
            f"({names[plant]})"
        )
    fastest, share = max(one[3] for one in figures), max(one[4] for one in figures)
    if fastest > question.slew:
        return (
            f"slew is {question.slew:.4g} V/s: expected {fastest:.4g} V/s, which the slowest "
            "controller needs along these references"
        )
    return (
        f"clipped is {question.clipped:.3g}: expected {share:.3g} at least, the share of the "
        "samples at which every controller is clipped along these references"
    )
