"""What a search for gains is asked, checked."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from ... import _core
from ..._support.arguments import not_negative, number_pair, one_of
from ..._support.arrays import check_dt
from ..._support.messages import quoted
from ...errors import ParameterError
from ...identification.fitted.identified_model import IdentifiedModel
from ...references.reference import Reference
from ...references.xy_reference import XYReference
from ...stages.base import Stage
from ...stages.inverse import Inverse
from ...stages.xy import XYStage
from ..loop.preconditions import check_delay
from ..parts.filters import Filter, LowPass, Notch
from ..plant import Plant, plant_of, voltages_before
from .box import parts_named
from .margins import Margins, Spread
from .structures import SOUGHT

__all__ = ["FIGURES", "Axis", "Question", "asked"]

FIGURES = {
    "rms": "rms error",
    "largest": "largest error",
    "effort": "rms change of the command from sample to sample",
}


class Axis(NamedTuple):
    """An axis, and what is known of it.

    Attributes
    ----------
    name : str
        ``"x"`` or ``"y"``; empty where there is one.
    stages : list
        The stage that is simulated, and others for which the margins hold too.
    feedforward : Inverse or None
        Feedforward of its controller.
    visited : tuple of float
        Voltages before a run [V].
    filters : tuple of LowPass or Notch
        Those that are there in any case.
    """

    name: str
    stages: list[Plant | IdentifiedModel]
    feedforward: Inverse | None
    visited: tuple[float, ...]
    filters: tuple[LowPass | Notch, ...]

    @property
    def of(self) -> str:
        """The axis before a text, or nothing."""
        return f"{self.name}: " if self.name else ""


class Question(NamedTuple):
    """What is common to the searches at all sampling intervals."""

    axes: tuple[Axis, ...]
    stage: XYStage | None
    references: list[Reference] | list[XYReference]
    intervals: list[float]
    limits: tuple[float, float]
    drive_unit: str
    parts: tuple[str, ...] | None
    law: str
    margins: Margins
    spread: Spread
    figure: str
    effort: float
    slew: float
    clipped: float
    delay: float
    jitter: float
    measured: bool
    allowed: float
    seeds: int
    particles: int
    iterations: int
    seed: int
    threads: int


def asked(
    *,
    stage: Any,
    reference: Any,
    dt: Any,
    limits: Any,
    feedforward: Any,
    parts: Any,
    filters: Any,
    law: Any,
    margins: Any,
    spread: Any,
    figure: Any,
    effort: float,
    slew: float,
    clipped: float,
    delay: float,
    jitter: float,
    visited: Any,
    error: Any,
    allowed: float,
    seeds: int,
    particles: int,
    iterations: int,
    seed: int,
    threads: int,
) -> Question:
    """Check all arguments of `tune`."""
    both = stage if isinstance(stage, XYStage) else None
    stages = [stage.x] if both else _stages(stage)
    references = _references(reference, XYReference if both else Reference)
    one_of("law", law, SOUGHT)
    _check_has_integral_part(law, references)
    _check_kind("margins", margins, Margins)
    _check_kind("spread", spread, Spread)
    one_of("figure", figure, tuple(FIGURES))
    one_of("error", error, ("measured", "true"))
    model = stages[0] if isinstance(stages[0], IdentifiedModel) else None
    intervals = _intervals(dt, model)
    unit = model.drive_unit if model is not None else "V"
    limits = _limits(limits, model, unit)
    delay = not_negative("delay", delay, "s")
    for one in (stage.x, stage.y) if both else stages[:1]:
        check_delay(plant_of(one), delay, min(intervals))
    _check_allowed(figure, _core.as_number("allowed", allowed), references)
    if both is None:
        inverse = _inverse_of(stages[0], feedforward)
        before = voltages_before(plant_of(stages[0]), visited, limits)
        axes: tuple[Axis, ...] = (Axis("", stages, inverse, before, _filters(filters)),)
    else:
        axes = _axes(both, (feedforward, filters), visited, limits)
    for axis in axes:
        _check_feedforward(law, axis)
    return Question(
        axes=axes,
        stage=both,
        references=references,
        intervals=intervals,
        limits=limits,
        drive_unit=unit,
        seeds=_seeds(seeds),
        slew=_slew(slew),
        parts=parts_named(parts),
        law=law,
        margins=margins or Margins(),
        spread=spread or Spread(),
        figure=figure,
        effort=not_negative("effort", effort, "m/V"),
        clipped=_core.as_number("clipped", clipped),
        delay=delay,
        jitter=not_negative("jitter", jitter, "s"),
        measured=error == "measured",
        allowed=allowed,
        particles=_core.as_count("particles", particles),
        iterations=_core.as_count("iterations", iterations),
        seed=_core.as_count("seed", seed),
        threads=_core.as_count("threads", threads),
    )


def _axes(
    stage: XYStage, given: tuple[Any, Any], visited: Any, limits: tuple[float, float]
) -> tuple[Axis, ...]:
    """Return both axes, each with its own inverse and filters."""
    feedforward, filters = given
    inverses = _of_both("feedforward", feedforward, not isinstance(feedforward, (str, Inverse)))
    apart = isinstance(filters, Sequence) and any(isinstance(one, Sequence) for one in filters)
    known = _of_both("filters", filters, apart)
    both = zip("xy", (stage.x, stage.y), inverses, known, strict=True)
    return tuple(
        Axis(
            name=name,
            stages=[one],
            feedforward=_inverse_of(one, inverse),
            visited=voltages_before(one, visited, limits),
            filters=_filters(own),
        )
        for name, one, inverse, own in both
    )


def _of_both(name: str, given: Any, apart: bool) -> list[Any]:
    """Return what is given for x and for y: the same where it is not given apart."""
    found = list(given) if apart and isinstance(given, Sequence) else [given] * 2
    if len(found) != 2:
        raise ParameterError(f"{name} has {len(found)} entries: expected that of x and of y")
    return found


def _check_allowed(figure: str, allowed: float, references: Sequence[Any]) -> None:
    if not allowed > 0.0:
        raise ParameterError(f"allowed is {allowed:g} m: expected an error above 0")
    if allowed < math.inf and not references:
        raise ParameterError(
            f"allowed is {1e6 * allowed:g} um without a reference: expected one to follow"
        )
    if figure == "effort" and references and allowed == math.inf:
        raise ParameterError(
            "figure is 'effort' without allowed: expected allowed=, the largest rms error in m, "
            "for the least effort is none"
        )


def _stages(stage: Any) -> list[Plant | IdentifiedModel]:
    stages = list(stage) if isinstance(stage, Sequence) else [stage]
    if not stages:
        raise ParameterError("stage is empty: expected a stage or more")
    for one in stages:
        plant_of(one)
    return stages


def _references(reference: Any, kind: type) -> list[Any]:
    given = [] if reference is None else reference
    references = list(given) if isinstance(given, Sequence) else [given]
    for one in references:
        if not isinstance(one, kind):
            raise ParameterError(f"reference is {type(one).__name__}: expected pt.{kind.__name__}")
    if kind is XYReference and not references:
        raise ParameterError(
            "reference is missing: expected a path; gains from margins alone are tuned for one "
            "axis after the other"
        )
    return references


def _check_has_integral_part(law: str, references: list[Reference]) -> None:
    if not references and "ki" not in SOUGHT[law]:
        raise ParameterError(
            f"law is {law!r} without a reference: expected one with an integral part, whose gain "
            "is made large then"
        )


def _check_feedforward(law: str, axis: Axis) -> None:
    if law == "pd" and axis.feedforward is None:
        raise ParameterError(
            f"{axis.of}law is 'pd' without feedforward: expected feedforward=, for nothing else "
            "brings the stage to where it is to be, or a law with an integral part"
        )


def _limits(limits: Any, model: IdentifiedModel | None, unit: str) -> tuple[float, float]:
    known = limits
    if known is None and model is not None:
        known = model.drive_range
    if known is None:
        raise ParameterError("limits are missing: expected (low, high) in V")
    return number_pair("limits", known, unit)


def _seeds(seeds: int) -> int:
    if not 1 <= _core.as_count("seeds", seeds) <= 100:
        raise ParameterError(f"seeds is {seeds}: expected 1 to 100")
    return seeds


def _slew(slew: float) -> float:
    if not _core.as_number("slew", slew) > 0.0:
        raise ParameterError(f"slew is {slew} V/s: expected above 0")
    return slew


def _filters(filters: Any) -> tuple[LowPass | Notch, ...]:
    listed = tuple(filters) if isinstance(filters, Sequence) else None
    if listed is None or not all(isinstance(one, Filter) for one in listed):
        raise ParameterError(f"filters is {filters!r}: expected a list of pt.LowPass and pt.Notch")
    return listed


def _check_kind(name: str, value: object, kind: type) -> None:
    if value is not None and not isinstance(value, kind):
        raise ParameterError(f"{name} is {type(value).__name__}: expected pt.{kind.__name__}")


def _intervals(dt: Any, model: IdentifiedModel | None) -> list[float]:
    if dt is None:
        if model is None or model.dt is None:
            raise ParameterError("dt is missing: expected the sampling interval of the loop in s")
        dt = model.dt
    several = list(dt) if isinstance(dt, Sequence) else [dt]
    if not several:
        raise ParameterError("dt is empty: expected a sampling interval in s or more")
    return [check_dt(one) for one in several]


def _inverse_of(stage: Plant | IdentifiedModel, feedforward: Any) -> Inverse | None:
    if feedforward is None or isinstance(feedforward, Inverse):
        return feedforward
    if feedforward != "inverse":
        raise ParameterError(
            f"feedforward is {quoted(feedforward)}: expected 'inverse', a pt.Inverse or None"
        )
    if isinstance(stage, (IdentifiedModel, Stage)):
        return stage.inverse()
    return None
