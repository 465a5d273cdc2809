"""Why no controller was found: which constraint forbids it, and how far the nearest is off."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from .question import Question

__all__ = ["refusal"]

# The search ranks an unstable loop before a stable one whose gain margin is short by a larger
# factor than about this.
RANKED = 1e3
# So much more gain margin is asked for where that is kept.
STEP = 10.0


class _Short(NamedTuple):
    """A margin that the nearest gains do not have: value, plant, what was asked for, and how."""

    name: str
    value: float
    plant: int
    bound: float
    unit: str = ""
    least: bool = True

    @property
    def factor(self) -> float:
        """How far it is off: above 1 where it is short."""
        if self.least:
            return self.bound / max(self.value, 1e-9)
        return self.value / self.bound

    def sentence(self, names: Sequence[str]) -> str:
        """Say what was asked for, and what the nearest gains have."""
        side = "more" if self.least else "less"
        off = f", {self.factor:.4g} times too {'low' if self.least else 'high'}"
        bound = f"{_number(self.bound)}{self.unit}"
        return (
            f"margins.{self.name} is {bound}: expected one that some gains can keep; where {bound} "
            f"or {side} was asked for, the nearest have {self.value:.6g}{self.unit} "
            f"({names[self.plant]}){off if self.factor > 1.1 else ''}"
        )


def _number(value: float) -> str:
    """Write a number in six digits where it has no more."""
    short = f"{value:.6g}"
    return short if float(short) == value else f"{value:.9g}"


def refusal(question: Question, found: Mapping[str, Any], names: Sequence[str]) -> str:
    """Say which constraint forbids any controller, and how far the nearest one is off."""
    robustness, figures = found["robustness"], found["figures"]
    if _unstable(robustness):
        nearest = _stable(question)
        if nearest is None:
            return (
                f"models: no gains in the search make all {len(names)} plants stable, the nearest "
                f"leave {names[robustness[0][1]]} unstable: expected a smaller spread, or plants "
                "nearer to each other"
            )
        robustness, figures = nearest, []
    if not figures:
        shorts = _shorts(question, robustness)
        return max(shorts, key=lambda one: one.factor).sentence(names)
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


def _unstable(robustness: Sequence[tuple[float, int]]) -> bool:
    return robustness[0][0] > 0.0


def _shorts(question: Question, robustness: Sequence[tuple[float, int]]) -> list[_Short]:
    margins = question.margins
    _, gain, phase, sensitivity, learning = robustness
    return [
        _Short("gain", *gain, margins.gain),
        _Short("phase", *phase, margins.phase, " rad"),
        _Short("sensitivity", *sensitivity, margins.sensitivity, least=False),
        _Short("learning", *learning, margins.learning, least=False),
    ]


def _stable(question: Question) -> Sequence[tuple[float, int]] | None:
    """Search once more, with gain margins that the search can rank: the nearest stable gains."""
    # Not at the top: `tune` says its refusals by this file.
    from .tune import _searched

    nearest, bound = None, RANKED
    while bound < question.margins.gain:
        milder = question._replace(margins=replace(question.margins, gain=bound))
        answers = [_searched(milder, one).found for one in question.intervals]
        found = min(answers, key=lambda one: float(one["excess"]))
        if _unstable(found["robustness"]):
            break
        nearest = found["robustness"]
        if found["excess"] > 1.0:
            break
        bound *= STEP
    return nearest
