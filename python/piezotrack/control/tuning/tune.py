"""Gains from a search over simulated closed loops, under margins for a set of plants."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Literal, TypedDict

from ...references.reference import Reference
from ...response.response_data import FrequencyResponse
from ..loop.contouring import contour
from ..loop.stability import check_loop
from ..running.track import track
from .goal import MINIMISED
from .measured_response import tune_on_response
from .model_set.other_kind import tried_on_other_kind
from .problem import TuningProblem
from .refusal import refusal
from .search import Solution, search_at
from .structures import damps
from .tuned import Tuned

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ...identification.fitted.identified_model import IdentifiedModel
    from ...references.xy_reference import XYReference
    from ...stages.inverse import Inverse
    from ...stages.xy import XYStage
    from ..parts.filters import LowPass, Notch
    from ..plant import Plant
    from ..timing import Timing
    from .goal import Goal, TuningSearch
    from .margins import Margins, Spread
    from .model_set.other_kind import OtherKind
    from .structures import LawName

__all__ = ["TuneOptions", "tune"]

# A bound of which this share is used up is active.
ACTIVE = 0.98


class TuneOptions(TypedDict, total=False):
    """Arguments of `tune` beside stage and reference, as types; see there."""

    dt: float | Sequence[float] | None
    limits: tuple[float, float] | None
    feedforward: Inverse | Sequence[Inverse | None] | Literal["inverse"] | None
    law: LawName
    parts: Sequence[str] | str | None
    filters: Sequence[LowPass | Notch] | Sequence[Sequence[LowPass | Notch]]
    margins: Margins | None
    spread: Spread | None
    goal: Goal | None
    timing: Timing | None
    search: TuningSearch | None
    threads: int


def tune(
    stage: Plant
    | IdentifiedModel
    | Sequence[Plant | IdentifiedModel]
    | XYStage
    | FrequencyResponse,
    reference: Reference
    | XYReference
    | str
    | Sequence[Reference | str]
    | Sequence[XYReference | str]
    | None = None,
    *,
    dt: float | Sequence[float] | None = None,
    limits: tuple[float, float] | None = None,
    feedforward: Inverse | Sequence[Inverse | None] | Literal["inverse"] | None = "inverse",
    law: LawName = "pid",
    parts: Sequence[str] | str | None = None,
    filters: Sequence[LowPass | Notch] | Sequence[Sequence[LowPass | Notch]] = (),
    margins: Margins | None = None,
    spread: Spread | None = None,
    goal: Goal | None = None,
    timing: Timing | None = None,
    search: TuningSearch | None = None,
    threads: int = 0,
) -> Tuned:
    """Find the gains of a controller, its filters and its repetitive part.

    Searches from several sides evaluate controllers in closed loop with the stages, with noise,
    quantisation, delay, jitter, saturation and creep, and make the error along the references
    small: that of the worst stage. All stages follow with the feedforward of the first, which is
    off by an offset that drifts, ``Spread(offset=...)``. There are four searches, and two more
    where none ends within 2 % of the best; one begins with Skogestad's rule (2003, doi
    10.1016/S0959-1524(02)00062-8) and with the gains from margins alone. Each is by differential
    evolution (Tanabe and Fukunaga 2014, doi 10.1109/CEC.2014.6900380), refined by CMA-ES (Hansen
    2016, arXiv 1604.00772).

    Every controller keeps the margins for every plant of a set: each stage given at its lowest,
    middle and highest gain, with every end of the spread. Of many stages and plants a search sees
    those that are farthest from each other; what it finds is checked exactly on all, and where
    another is beyond or follows worse by 2 %, it is repeated with that. Without a reference the
    gains follow from the margins alone: the largest integral gain that keeps them (Panagopoulos,
    Astrom and Hagglund 2002, doi 10.1049/ip-cta:20020013); of a law that damps the least of
    ``|P S / w|`` at its largest, which at low frequencies is 1 over that gain.

    For an XY stage the error is the contour error, and each axis gets a controller of its own:
    ``x, y = pt.tune(xy_stage, path, ...).controllers``, for `contour`. The search takes what
    cross-talk adds from where the other axis is to be, and knows no missed ticks; the runs of the
    result have both in full.

    Parameters
    ----------
    stage : Stage, VirtualStage, IdentifiedModel, or a sequence of them; XYStage; FrequencyResponse
        All are simulated, from the zero of the first and with its feedforward, and the margins hold
        for all. The first has no noise and no amplifier where it is a model: ``pt.VirtualStage.of``
        gives it both. Other models have those of the first. Of a response the modes fitted to it
        are the stage, and the sensitivity holds at each of its lines, within its band.
    reference : Reference, str or sequence of them, optional
        Motions along which the error counts; of an XY stage paths, as ``pt.circle(...)``. A text or
        a file is taken as by the command line: ``"triangle:1Hz,5..42um"``.
    dt : float or sequence of float, optional
        Sampling interval [s], or those that are allowed; by default that of an identified model's
        record.
    limits : (float, float), optional
        Lowest and highest voltage [V]; by default the range of the drive of that record.
    feedforward : Inverse or (Inverse, Inverse) or "inverse" or None, optional
        By default the inverse of the first stage; of a `VirtualStage`, of which nobody knows the
        model, none. Of an XY stage one for x and one for y.
    law : str, optional
        The feedback law: ``"pid"``; ``"pi"``; ``"pd"``, which needs a feedforward; ``"lead-lag"``;
        ``"sliding-mode"``, ``"disturbance-observer"`` around a PID, or
        ``"perturbation-estimator"``, an observer around sliding mode. An observer expects the
        middle plant's static gain and its time constant at low frequencies. A PI law with damping
        of the first mode: ``"integral-resonant"``, ``"positive-position"`` or
        ``"positive-velocity-position"``.
    parts : sequence of str, optional
        Some of ``"pid"``, ``"low-pass"``, ``"notch"`` and ``"repetitive"``. By default PID and
        low-pass, a notch where a mode rings below half the sampling rate, and a repetitive part
        where all references repeat more than four times with one period.
    filters : sequence of LowPass or Notch, optional
        Filters of the measurement that are there in any case; two with those of `parts`. Of an XY
        stage the same for both axes, or those of x and those of y.
    margins : Margins, optional
        What every loop keeps.
    spread : Spread, optional
        What may be different from the stages.
    goal : Goal, optional
        What is made small along the references, and bounds beside the margins; by default the rms
        of the measured error.
    timing : Timing, optional
        Delay and jitter of the loop, and the voltages before a run.
    search : TuningSearch, optional
        Budget and seed of the searches, and draws of the noise.
    threads : int, optional
        Threads, 0 for all cores. The result has the same bits for any number of them.

    Returns
    -------
    Tuned
        The controller, of an XY stage both, with its runs, its margins and what limits it.

    Raises
    ------
    ParameterError
        An argument cannot be used; a reference is beyond the reach of the stage; no gains keep the
        margins, with which one forbids it and how far the nearest are off.

    Examples
    --------
    >>> import piezotrack as pt
    >>> stage = pt.stages.PrandtlIshlinskiiStage(
    ...     linear=1e-6, thresholds=[10.0], weights=[0.2e-6], frequency=200.0, damping_ratio=0.05
    ... )
    >>> tuned = pt.tune(stage, dt=1e-3, limits=(0.0, 75.0), parts="pid")
    >>> tuned.kept[-1].name, tuned.kept[-1].value < 2.01
    ('sensitivity', True)
    """
    if isinstance(stage, FrequencyResponse):
        return tune_on_response(
            stage,
            lambda fitted, interval, kept: tune(
                fitted,
                reference,
                dt=interval,
                limits=limits,
                feedforward=feedforward,
                law=law,
                parts=parts,
                filters=filters,
                margins=kept,
                spread=spread,
                goal=goal,
                timing=timing,
                search=search,
                threads=threads,
            ),
            dt,
            margins,
        )
    problem = TuningProblem.checked(
        stage=stage,
        reference=reference,
        dt=dt,
        limits=limits,
        feedforward=feedforward,
        law=law,
        parts=parts,
        filters=filters,
        margins=margins,
        spread=spread,
        goal=goal,
        timing=timing,
        search=search,
        threads=threads,
    )
    solutions = [search_at(problem, interval) for interval in problem.intervals]
    best = min(solutions, key=_rank)
    if not best.feasible:
        raise refusal(problem, best)
    return _simulated(problem, best, solutions)


def _rank(solution: Solution) -> tuple[bool, float, float]:
    """Order feasible solutions by their cost, before others by their distance from that."""
    nearest = 1.0 if solution.feasible else solution.excess
    return not solution.feasible, nearest, solution.outcome["cost"]


def _simulated(problem: TuningProblem, best: Solution, solutions: list[Solution]) -> Tuned:
    """Simulate the best controllers in full."""
    controllers = best.controllers
    runs = tuple(_run(problem, controllers, reference) for reference in problem.references)
    return Tuned(
        controllers=tuple(controllers),
        minimised=_minimised(problem),
        unit="V" if problem.goal.minimise == "effort" and runs else "m",
        value=best.outcome["cost"] * (1.0 if runs else controllers[0].dt),
        runs=runs,
        kept=tuple(best.kept),
        margins=problem.margins,
        plants=tuple(best.names),
        active_constraints=tuple(_active_constraints(problem, best)),
        candidates=sum(one.outcome["candidates"] for one in solutions),
        loops=sum(one.outcome["loops"] for one in solutions),
        history=tuple(best.outcome["history"]),
        searches=best.outcome["searches"],
        agreeing=best.outcome["agreeing"],
        spread=tuple(best.outcome["spread"]),
        other_kind=_on_other_kind(problem, best),
        bandwidths=tuple(
            check_loop(axis.stages[0], controller, delay=axis.timing.delay).middle.bandwidth
            for axis, controller in zip(problem.axes, controllers, strict=True)
        ),
    )


def _on_other_kind(problem: TuningProblem, best: Solution) -> OtherKind | None:
    """Try the gains on a stage of another kind, of the same record."""
    references = [one for one in problem.references if isinstance(one, Reference)]
    return tried_on_other_kind(problem.axes[0], best.controllers[0], references)


def _minimised(problem: TuningProblem) -> str:
    if not problem.references:
        what = "answer to disturbances" if damps(problem.law) else "integral gain"
        return f"{what} from margins alone"
    words = MINIMISED[problem.goal.minimise]
    if problem.goal.tolerances and problem.goal.minimise == "rms":
        words += ", each motion in shares of its tolerance"
    return words.replace("error", "contour error") if problem.stage is not None else words


def _run(problem: TuningProblem, controllers: Any, reference: Any) -> Any:
    options: dict[str, Any] = {
        "timing": problem.timing,
        "beyond_reach": True,
        "unstable": True,
    }
    if problem.stage is not None:
        return contour(problem.stage, controllers, reference, **options)
    return track(problem.axes[0].stages[0], controllers[0], reference, **options)


def _active_constraints(problem: TuningProblem, best: Solution) -> list[str]:
    """Name what forbids a smaller value."""
    active = [f"{one.name}, {one.plant}" for one in best.kept if one.share > ACTIVE]
    goal, figures = problem.goal, best.outcome["figures"]
    if math.isfinite(goal.slew) and max(one[3] for one in figures) > ACTIVE * goal.slew:
        active.append("slew")
    if best.rms_error > ACTIVE * goal.largest_error:
        active.append("largest_error")
    return active + best.edges()
