"""Problem of a tuning: its arguments, checked."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

from ... import _core
from ..._support.arguments import expect, given_or, number_pair, one_of
from ..._support.arrays import check_dt
from ..._support.messages import quoted
from ...errors import ParameterError
from ...identification.fitted.identified_model import IdentifiedModel
from ...references.parse import path_of, reference_of
from ...references.reference import Reference
from ...references.xy_reference import XYReference
from ...stages.base import Stage
from ...stages.inverse import Inverse
from ...stages.xy import XYStage
from ..loop.preconditions import check_delay
from ..parts.filters import Filter, LowPass, Notch
from ..plant import plant_of, timing_on
from .box import parts_named
from .goal import Goal, TuningSearch
from .margins import Margins, Spread
from .structures import SOUGHT

if TYPE_CHECKING:
    from ..plant import Plant
    from ..timing import Timing

__all__ = ["Axis", "TuningProblem"]


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
    timing : Timing
        Timing of its loop, with the voltages before a run.
    filters : tuple of LowPass or Notch
        Those that are there in any case.
    """

    name: str
    stages: list[Plant | IdentifiedModel]
    feedforward: Inverse | None
    timing: Timing
    filters: tuple[LowPass | Notch, ...]

    @property
    def prefix(self) -> str:
        """The axis before a text, or nothing."""
        return f"{self.name}: " if self.name else ""


@dataclass(frozen=True, kw_only=True, eq=False)
class TuningProblem:
    """Problem that is searched at each sampling interval.

    Attributes
    ----------
    axes : tuple of Axis
        One, or x and y of an XY stage.
    stage : XYStage or None
        The XY stage.
    references : list of Reference or of XYReference
        Motions along which the error counts.
    intervals : list of float
        Sampling intervals [s].
    limits : (float, float)
        Lowest and highest voltage, in the unit of the drive.
    drive_unit : str
        Unit of the drive, SI.
    parts : tuple of str or None
        Parts of the controller; None for those that stage and references ask for.
    law : str
        Feedback law.
    margins, spread, goal, search : Margins, Spread, Goal, TuningSearch
        As of `tune`.
    timing : Timing
        As given to `tune`; that of an axis has the voltages before a run.
    threads : int
        Threads, 0 for all cores.
    """

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
    goal: Goal
    timing: Timing | None
    search: TuningSearch
    threads: int

    @classmethod
    def checked(
        cls,
        *,
        stage: Any,
        reference: Any,
        dt: Any,
        limits: Any,
        feedforward: Any,
        law: Any,
        parts: Any,
        filters: Any,
        margins: Any,
        spread: Any,
        goal: Any,
        timing: Any,
        search: Any,
        threads: Any,
    ) -> TuningProblem:
        """Check the arguments of `tune`."""
        both = stage if isinstance(stage, XYStage) else None
        stages = [stage.x] if both else _stages(stage)
        references = _references(reference, XYReference if both else Reference)
        one_of("law", law, SOUGHT)
        _check_has_integral_part(law, references)
        goal = given_or("goal", goal, Goal())
        if goal.largest_error < math.inf and not references:
            raise ParameterError(
                "largest_error",
                f"{1e6 * goal.largest_error:g} um without a reference",
                "one to follow",
            )
        model = stages[0] if isinstance(stages[0], IdentifiedModel) else None
        intervals = _intervals(dt, model)
        unit = model.drive_unit if model is not None else "V"
        limits = _limits(limits, model, unit)
        if both is None:
            inverse = _inverse_of(stages[0], feedforward)
            starts = timing_on(plant_of(stages[0]), timing, limits)
            axes: tuple[Axis, ...] = (Axis("", stages, inverse, starts, _filters(filters)),)
        else:
            axes = _axes(both, feedforward, filters, timing, limits)
        for axis in axes:
            check_delay(plant_of(axis.stages[0]), axis.timing.delay, min(intervals))
            _check_feedforward(law, axis)
        return cls(
            axes=axes,
            stage=both,
            references=references,
            intervals=intervals,
            limits=limits,
            drive_unit=unit,
            parts=parts_named(parts),
            law=law,
            margins=given_or("margins", margins, Margins()),
            spread=given_or("spread", spread, Spread()),
            goal=goal,
            timing=timing,
            search=given_or("search", search, TuningSearch()),
            threads=_core.as_count("threads", threads),
        )


def _axes(
    stage: XYStage, feedforward: Any, filters: Any, timing: Any, limits: tuple[float, float]
) -> tuple[Axis, ...]:
    """Return both axes, each with its own inverse and filters."""
    inverses = _of_both("feedforward", feedforward, not isinstance(feedforward, (str, Inverse)))
    apart = isinstance(filters, Sequence) and any(isinstance(one, Sequence) for one in filters)
    known = _of_both("filters", filters, apart)
    both = zip("xy", (stage.x, stage.y), inverses, known, strict=True)
    return tuple(
        Axis(
            name=name,
            stages=[plant],
            feedforward=_inverse_of(plant, inverse),
            timing=timing_on(plant, timing, limits),
            filters=_filters(its_filters),
        )
        for name, plant, inverse, its_filters in both
    )


def _of_both(name: str, given: Any, apart: bool) -> list[Any]:
    """Return what is given for x and for y: the same where it is not given apart."""
    pair = list(given) if apart and isinstance(given, Sequence) else [given] * 2
    if len(pair) != 2:
        raise ParameterError(name, f"{len(pair)} entries", "that of x and of y", verb="has")
    return pair


def _stages(stage: Any) -> list[Plant | IdentifiedModel]:
    stages = list(stage) if isinstance(stage, Sequence) else [stage]
    if not stages:
        raise ParameterError("stage", "empty", "a stage or more")
    for one in stages:
        plant_of(one)
    return stages


def _references(reference: Any, kind: type) -> list[Any]:
    given = [] if reference is None else reference
    several = isinstance(given, Sequence) and not isinstance(given, str)
    references = [_made(one, kind) for one in (given if several else [given])]
    if kind is XYReference and not references:
        raise ParameterError(
            "reference",
            "missing",
            "a path; gains from margins alone are tuned for one axis after the other",
        )
    return references


def _made(path: Any, kind: type) -> Any:
    """Return a reference or a path, or make it of a text."""
    if not isinstance(path, str):
        expect("reference", path, kind, f"pt.{kind.__name__} or a text")
        return path
    if kind is Reference:
        return reference_of(path)
    try:
        return path_of(path)
    except ParameterError as error:
        raise error.of("reference", argument="reference") from None


def _check_has_integral_part(law: str, references: list[Reference]) -> None:
    if not references and "ki" not in SOUGHT[law]:
        raise ParameterError(
            "law",
            f"{law!r} without a reference",
            "one with an integral part, whose gain is made large then",
        )


def _check_feedforward(law: str, axis: Axis) -> None:
    if law == "pd" and axis.feedforward is None:
        raise ParameterError(
            f"{axis.prefix}law",
            "'pd' without feedforward",
            "feedforward=, for nothing else brings the stage to where it is to be, or a law with "
            "an integral part",
        )


def _limits(limits: Any, model: IdentifiedModel | None, unit: str) -> tuple[float, float]:
    known = limits
    if known is None and model is not None:
        known = model.drive_range
    if known is None:
        raise ParameterError("limits", "missing", "(low, high) in V", verb="are")
    return number_pair("limits", known, unit)


def _filters(filters: Any) -> tuple[LowPass | Notch, ...]:
    listed = tuple(filters) if isinstance(filters, Sequence) else None
    if listed is None or not all(isinstance(one, Filter) for one in listed):
        raise ParameterError("filters", f"{filters!r}", "a list of pt.LowPass and pt.Notch")
    return listed


def _intervals(dt: Any, model: IdentifiedModel | None) -> list[float]:
    if dt is None:
        if model is None or model.dt is None:
            raise ParameterError("dt", "missing", "the sampling interval of the loop in s")
        dt = model.dt
    several = list(dt) if isinstance(dt, Sequence) else [dt]
    if not several:
        raise ParameterError("dt", "empty", "a sampling interval in s or more")
    return [check_dt(one) for one in several]


def _inverse_of(stage: Plant | IdentifiedModel, feedforward: Any) -> Inverse | None:
    if feedforward is None or isinstance(feedforward, Inverse):
        return feedforward
    if feedforward != "inverse":
        raise ParameterError("feedforward", quoted(feedforward), "'inverse', a pt.Inverse or None")
    if isinstance(stage, (IdentifiedModel, Stage)):
        return stage.inverse()
    return None
