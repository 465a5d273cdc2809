"""Refusal where no controller is feasible: its reason, and how far the nearest is off."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from ...errors import ParameterError
from .tuned import MARGIN_UNITS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from .problem import TuningProblem
    from .search import Solution

__all__ = ["refusal"]


class _Short(NamedTuple):
    """Margin that the nearest gains do not have: value, plant, bound, its unit and its side."""

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

    def refusal(self, names: Sequence[str]) -> ParameterError:
        """Name the bound, and the margin of the nearest gains."""
        side = "more" if self.least else "less"
        bound, nearest = _number(self.bound), f"{self.value:.6g}"
        plain = bound
        unit, shown = MARGIN_UNITS.get(f"{self.name} margin", ("", float))
        off = f"{self.factor:.4g} times too {'low' if self.least else 'high'}"
        if unit:
            bound, nearest = (f"{shown(one):.6g} {unit}" for one in (self.bound, self.value))
            plain = f"{bound}, {self.unit.format(_number(self.bound))}"
            off = f"{shown(self.bound) - shown(self.value):.4g} {unit} too low"
        return ParameterError(
            f"margins.{self.name}",
            plain,
            f"one that some gains can keep; for {bound} or {side}, the nearest gains "
            f"reach {nearest} ({names[self.plant]}){f', {off}' if self.factor > 1.1 else ''}",
        )


def _number(value: float) -> str:
    """Write a number in six digits where it has no more."""
    short = f"{value:.6g}"
    return short if float(short) == value else f"{value:.9g}"


def refusal(problem: TuningProblem, nearest: Solution) -> ParameterError:
    """Say which constraint forbids any controller, and how far the nearest one is off."""
    goal, outcome, names = problem.goal, nearest.outcome, nearest.searched_names
    robustness, figures = outcome["robustness"], outcome["figures"]
    if outcome["excess"] <= 1.0:
        worst = max(nearest.kept, key=lambda one: one.share)
        return ParameterError(
            f"margins: the search found no gains whose exact margins are as required; the "
            f"nearest have {worst}: expected a milder margin, more particles or more iterations",
            argument="margins",
        )
    if robustness[0][0] > 0.0:
        return ParameterError(
            f"models: no gains in the search make all {len(nearest.names)} plants stable, the "
            f"nearest leave {names[robustness[0][1]]} unstable: expected a smaller spread, or "
            "plants nearer to each other",
            argument="models",
        )
    if not figures:
        shorts = _shorts(problem, robustness)
        return max(shorts, key=lambda one: one.factor).refusal(names)
    fastest, share = max(one[3] for one in figures), max(one[4] for one in figures)
    if fastest > goal.slew:
        return ParameterError(
            "slew",
            f"{goal.slew:.4g} V/s",
            f"{fastest:.4g} V/s, which the slowest controller needs along these references",
        )
    if (error := nearest.rms_error) > goal.largest_error:
        return ParameterError(
            "largest_error",
            f"{1e6 * goal.largest_error:.4g} um",
            f"{1e6 * error:.4g} um or more, the least rms error that was found along these "
            "references",
        )
    return ParameterError(
        "largest_saturation",
        f"{goal.largest_saturation:.3g}",
        f"{share:.3g} at least, the share of the samples at which every controller is clipped "
        "along these references",
    )


def _shorts(problem: TuningProblem, robustness: Sequence[tuple[float, int]]) -> list[_Short]:
    margins = problem.margins
    _, gain, phase, sensitivity, learning = robustness
    return [
        _Short("gain", *gain, margins.gain, "a factor of {}"),
        _Short("phase", *phase, margins.phase, "{} rad"),
        _Short("sensitivity", *sensitivity, margins.sensitivity, least=False),
        _Short("learning", *learning, margins.learning, least=False),
    ]
