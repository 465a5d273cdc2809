"""Gains from a search over simulated closed loops, under margins for a set of plants."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Literal, Unpack, overload

from ...errors import ParameterError
from ..loop.contouring import contour
from ..running.track import track
from .question import FIGURES, Question, asked
from .refusal import refusal
from .search import Answer, searched
from .tuned import Tuned, TunedPair, TuningReport

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ...identification.fitted.identified_model import IdentifiedModel
    from ...references.reference import Reference
    from ...references.xy_reference import XYReference
    from ...stages.inverse import Inverse
    from ...stages.xy import XYStage
    from ..parts.filters import LowPass, Notch
    from ..plant import Plant
    from .margins import Margins, Spread
    from .options import TuneOptions
    from .structures import LawName

__all__ = ["tune"]

# What uses up this share of what was asked for binds.
BINDS = 0.98


@overload
def tune(
    stage: XYStage, reference: XYReference | Sequence[XYReference], **options: Unpack[TuneOptions]
) -> TunedPair: ...
@overload
def tune(
    stage: Plant | IdentifiedModel | Sequence[Plant | IdentifiedModel],
    reference: Reference | Sequence[Reference] | None = None,
    **options: Unpack[TuneOptions],
) -> Tuned: ...
def tune(
    stage: Plant | IdentifiedModel | Sequence[Plant | IdentifiedModel] | XYStage,
    reference: Reference | Sequence[Reference] | XYReference | Sequence[XYReference] | None = None,
    *,
    dt: float | Sequence[float] | None = None,
    limits: tuple[float, float] | None = None,
    feedforward: Inverse | Sequence[Inverse | None] | Literal["inverse"] | None = "inverse",
    parts: Sequence[str] | str | None = None,
    filters: Sequence[LowPass | Notch] | Sequence[Sequence[LowPass | Notch]] = (),
    law: LawName = "pid",
    margins: Margins | None = None,
    spread: Spread | None = None,
    figure: Literal["rms", "largest", "effort"] = "rms",
    effort: float = 0.0,
    allowed: float = math.inf,
    slew: float = math.inf,
    clipped: float = 0.05,
    delay: float = 0.0,
    jitter: float = 0.0,
    visited: float | Sequence[float] = (),
    error: Literal["measured", "true"] = "measured",
    seeds: int = 1,
    particles: int = 40,
    iterations: int = 60,
    seed: int = 1,
    threads: int = 0,
) -> Tuned | TunedPair:
    """Find the gains of a controller, its filters and its repetitive part.

    A swarm looks at controllers in closed loop with the stage, with its noise, quantisation, delay,
    jitter, saturation and creep, and makes the error along the references small. Every controller
    keeps the margins for every plant of a set: each stage given at its lowest, middle and highest
    gain, with every end of the spread. What it keeps is checked exactly in the end. Without a
    reference the gains follow from the margins alone: the largest integral gain that keeps them
    (Panagopoulos, Astrom and Hagglund 2002, doi 10.1049/ip-cta:20020013).

    For an XY stage the error is the contour error, and each axis gets a controller of its own:
    ``controllers, report = pt.tune(xy_stage, path, ...)``, for `contour`. The search takes what
    cross-talk adds from where the other axis is to be, and knows no missed ticks; the runs of the
    report have both in full.

    Parameters
    ----------
    stage : Stage, VirtualStage, IdentifiedModel, or a sequence of them; or XYStage
        The first is simulated; the margins hold for all of them. A stage model and an identified
        one have no noise and no amplifier: ``pt.VirtualStage.of`` gives them both.
    reference : Reference or sequence of Reference, optional
        Motions along which the error counts; of an XY stage paths, as ``pt.circle(...)``.
    dt : float or sequence of float, optional
        Sampling interval [s], or those that are allowed; by default that of an identified model's
        record.
    limits : (float, float), optional
        Lowest and highest voltage [V]; by default the range of the drive of that record.
    feedforward : Inverse or (Inverse, Inverse) or "inverse" or None, optional
        By default the inverse of the first stage; of a `VirtualStage`, of which nobody knows the
        model, none. Of an XY stage one for x and one for y.
    parts : sequence of str, optional
        Some of ``"pid"``, ``"low-pass"``, ``"notch"`` and ``"repetitive"``. By default PID and
        low-pass, a notch where a mode rings below half the sampling rate, and a repetitive part
        where all references repeat more than four times with one period.
    filters : sequence of LowPass or Notch, optional
        Filters of the measurement that are there in any case; two with those of `parts`. Of an XY
        stage the same for both axes, or those of x and those of y.
    law : str, optional
        The feedback law: ``"pid"``; ``"pd"``, which needs a feedforward; ``"lead-lag"``;
        ``"sliding-mode"``, ``"disturbance-observer"`` around a PID, or
        ``"perturbation-estimator"``, an observer around sliding mode. An observer expects the
        middle plant's static gain and its time constant at low frequencies.
    margins : Margins, optional
        What every loop keeps.
    spread : Spread, optional
        What may be different from the stages.
    figure : {"rms", "largest", "effort"}, optional
        What is made small: the rms error over all references, the largest in any, or the rms change
        of the command from sample to sample, with `allowed`.
    effort : float, optional
        Error that 1 V rms of change of the command from sample to sample is worth [m/V].
    allowed : float, optional
        Largest rms error over all references [m].
    slew : float, optional
        Fastest change of the command [V/s].
    clipped : float, optional
        Largest share of the samples at which the command may be clipped, as noise does where the
        reference touches the end of the stroke. From 0.5 on the references may be beyond reach.
    delay, jitter, visited : optional
        As of `track`.
    error : {"measured", "true"}, optional
        Whether the reading of the sensor counts or the true displacement.
    seeds : int, optional
        Draws of the sensor's noise over which each reference is followed.
    particles, iterations : int, optional
        Of the swarm; it looks twice, the second time about the best place.
    seed : int, optional
        Seed of the swarm.
    threads : int, optional
        Threads, 0 for all cores. The result has the same bits for any number of them.

    Returns
    -------
    Tuned or TunedPair
        The controller and the report: ``controller, report = pt.tune(...)``; for an XY stage both
        controllers in place of one.

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
    >>> controller, report = pt.tune(stage, dt=1e-3, limits=(0.0, 75.0), parts="pid")
    >>> report.kept[-1].name, report.kept[-1].value < 2.01
    ('sensitivity', True)
    """
    question = asked(
        stage=stage,
        reference=reference,
        dt=dt,
        limits=limits,
        feedforward=feedforward,
        parts=parts,
        filters=filters,
        law=law,
        margins=margins,
        spread=spread,
        figure=figure,
        effort=effort,
        slew=slew,
        clipped=clipped,
        delay=delay,
        jitter=jitter,
        visited=visited,
        error=error,
        allowed=allowed,
        seeds=seeds,
        particles=particles,
        iterations=iterations,
        seed=seed,
        threads=threads,
    )
    answers = [searched(question, one) for one in question.intervals]
    best = min(answers, key=_rank)
    if not best.keeps:
        raise ParameterError(refusal(question, best))
    return _answered(question, best, answers)


def _rank(answer: Answer) -> tuple[bool, float, float]:
    """Any that keeps what was asked for first, then the one nearest to it."""
    nearest = 1.0 if answer.keeps else answer.excess
    return not answer.keeps, nearest, answer.found["cost"]


def _answered(question: Question, best: Answer, answers: list[Answer]) -> Tuned | TunedPair:
    """Simulate what was found in full."""
    controllers = best.controllers
    runs = tuple(_run(question, controllers, reference) for reference in question.references)
    report = TuningReport(
        figure=_figure(question),
        unit="V" if question.figure == "effort" and runs else "m",
        value=best.found["cost"] * (1.0 if runs else controllers[0].dt),
        runs=runs,
        kept=tuple(best.kept),
        margins=question.margins,
        plants=tuple(best.names),
        binding=tuple(_binding(question, best)),
        dt=controllers[0].dt,
        candidates=sum(one.found["candidates"] for one in answers),
        loops=sum(one.found["loops"] for one in answers),
        history=tuple(best.found["history"]),
    )
    if question.stage is not None:
        x, y = controllers
        return TunedPair((x, y), report)
    return Tuned(controllers[0], report)


def _figure(question: Question) -> str:
    if not question.references:
        return "integral gain from margins alone"
    words = FIGURES[question.figure]
    return words.replace("error", "contour error") if question.stage is not None else words


def _run(question: Question, controllers: Any, reference: Any) -> Any:
    options: dict[str, Any] = {
        "delay": question.delay,
        "jitter": question.jitter,
        "beyond_reach": True,
        "unstable": True,
    }
    if question.stage is not None:
        return contour(question.stage, controllers, reference, **options)
    axis = question.axes[0]
    return track(axis.stages[0], controllers[0], reference, visited=axis.visited, **options)


def _binding(question: Question, best: Answer) -> list[str]:
    """Name what forbids a smaller figure."""
    binding = [f"{one.name}, {one.plant}" for one in best.kept if one.share > BINDS]
    figures = best.found["figures"]
    if math.isfinite(question.slew) and max(one[3] for one in figures) > BINDS * question.slew:
        binding.append("slew")
    rms = math.sqrt(sum(one[0] ** 2 for one in figures) / max(len(figures), 1))
    if rms > BINDS * question.allowed:
        binding.append("allowed")
    return binding + best.edges()
