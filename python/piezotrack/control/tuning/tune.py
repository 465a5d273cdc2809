"""Gains from a search over simulated closed loops, under margins for a set of plants."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from ... import _core
from ...errors import ParameterError
from ..checks import check_drive_unit, check_within_reach
from ..controller import Controller
from ..plant import plant_of, stepped
from ..tracking import can_be_learnt, feedforward_of, first_counted, track
from .box import Box, box_of, resonance
from .margins import Margins, NamedPlant, Spread, plants_of
from .question import FIGURES, Question, asked
from .refusal import refusal
from .tuned import Kept, Tuned, TuningReport

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ...identification.identified import IdentifiedModel
    from ...references.reference import Reference, SampledReference
    from ...stages.inverse import Inverse
    from ...stages.virtual import VirtualStage
    from ..components import LowPass, Notch
    from ..plant import Plant
    from .structures import LawName

__all__ = ["tune"]

# A margin that uses up this share of what was asked for binds.
BINDS = 0.98
# The grid of the search is accurate to this; what the exact check finds beyond is asked again.
SLACK = 0.003


class _Answer(NamedTuple):
    """Settings found at one sampling interval."""

    found: dict[str, Any]
    box: Box
    base: Controller
    plants: list[NamedPlant]


def tune(
    stage: Plant | IdentifiedModel | Sequence[Plant | IdentifiedModel],
    reference: Reference | Sequence[Reference] | None = None,
    *,
    dt: float | Sequence[float] | None = None,
    limits: tuple[float, float] | None = None,
    feedforward: Inverse | Literal["inverse"] | None = "inverse",
    parts: Sequence[str] | str | None = None,
    filters: Sequence[LowPass | Notch] = (),
    law: LawName = "pid",
    margins: Margins | None = None,
    spread: Spread | None = None,
    figure: Literal["rms", "largest"] = "rms",
    effort: float = 0.0,
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
) -> Tuned:
    """Find the gains of a controller, its filters and its repetitive part.

    A swarm looks at controllers in closed loop with the stage, with its noise, quantisation, delay,
    jitter, saturation and creep, and makes the error along the references small. Every controller
    keeps the margins for every plant of a set: each stage given at its lowest, middle and highest
    gain, with every end of the spread. What it keeps is checked exactly in the end. Without a
    reference the gains follow from the margins alone: the largest integral gain that keeps them
    (Panagopoulos, Astrom and Hagglund 2002, doi 10.1049/ip-cta:20020013).

    Parameters
    ----------
    stage : Stage, VirtualStage, IdentifiedModel, or a sequence of them
        The first is simulated; the margins hold for all of them. A stage model and an identified
        one have no noise and no amplifier: ``pt.VirtualStage.of`` gives them both.
    reference : Reference or sequence of Reference, optional
        Motions along which the error counts.
    dt : float or sequence of float, optional
        Sampling interval [s], or those that are allowed; by default that of an identified model's
        record.
    limits : (float, float), optional
        Lowest and highest voltage [V]; by default the range of the drive of that record.
    feedforward : Inverse or "inverse" or None, optional
        By default the inverse of the first stage; of a `VirtualStage`, of which nobody knows the
        model, none.
    parts : sequence of str, optional
        Some of ``"pid"``, ``"low-pass"``, ``"notch"`` and ``"repetitive"``. By default PID and
        low-pass, a notch where a mode rings below half the sampling rate, and a repetitive part
        where all references repeat more than four times with one period.
    filters : sequence of LowPass or Notch, optional
        Filters of the measurement that are there in any case; two with those of `parts`.
    law : str, optional
        The feedback law: ``"pid"``; ``"pd"``, which needs a feedforward; ``"lead-lag"``;
        ``"sliding mode"``, ``"disturbance observer"`` around a PID, or
        ``"perturbation estimation"``, an observer around sliding mode. An observer expects the
        middle plant's static gain and its time constant at low frequencies.
    margins : Margins, optional
        What every loop keeps.
    spread : Spread, optional
        What may be different from the stages.
    figure : {"rms", "largest"}, optional
        Which error is made small: the rms over all references, or the largest in any.
    effort : float, optional
        Error that 1 V rms of change of the command from sample to sample is worth [m/V].
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
    Tuned
        The controller and the report: ``controller, report = pt.tune(...)``.

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
    question, intervals = asked(
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
        seeds=seeds,
        particles=particles,
        iterations=iterations,
        seed=seed,
        threads=threads,
    )
    answers = [_searched(question, one) for one in intervals]
    best = min(answers, key=lambda one: (max(1.0, one.found["excess"]), one.found["cost"]))
    if best.found["excess"] > 1.0 + 1e-9:
        names = [one.name for one in best.plants]
        raise ParameterError(refusal(question, best.found, names))
    return _answered(question, best, answers)


def _searched(question: Question, dt: float) -> _Answer:
    """Search at one sampling interval; where the exact margins are beyond, with some in reserve."""
    named = plants_of(question.stages, question.limits, question.delay, question.spread)
    plants = [one.plant for one in named]
    parts = question.parts or _usual_parts(question, plants, dt)
    of_parts = sum(one in parts for one in ("low-pass", "notch"))
    if len(question.filters) + of_parts > 2:
        raise ParameterError(
            f"filters has {len(question.filters)} beside {of_parts} of the parts: expected 2 in all"
        )
    periods = {one.period for one in question.references}
    if "repetitive" in parts and len(periods) > 1:
        listed = ", ".join(f"{one:g} s" if one else "none" for one in sorted(periods, key=str))
        raise ParameterError(
            f"references have periods of {listed}: expected one period for the repetitive part"
        )
    period = next(iter(periods), None)
    box = box_of(parts, plants, dt, period, question.limits, question.law)
    base = Controller(
        dt=dt,
        limits=question.limits,
        feedforward=question.feedforward,
        filters=question.filters,
        drive_unit=question.drive_unit,
    )
    tasks = _tasks(question, base, "repetitive" in parts)
    reserve = 1.0
    for _ in range(4):
        found = _core.tune(
            controller=base._core,
            period=box.period,
            sign=box.sign,
            law=(box.law, *box.nominal),
            sought=box.ranges,
            tasks=tasks,
            plants=plants,
            required=_required(question, reserve),
            aim=question.figure if tasks else "disturbance",
            effort=question.effort,
            particles=question.particles,
            iterations=question.iterations,
            seed=question.seed,
            threads=question.threads,
        )
        answer = _Answer(found, box, base, named)
        if found["excess"] > 1.0:
            return answer
        beyond = max(one.share for one in _kept(question, answer))
        if beyond <= 1.0 + SLACK:
            return answer
        reserve *= 1.0 + 1.2 * (beyond - 1.0)
    return answer


def _required(
    question: Question, reserve: float
) -> tuple[float, float, float, float, float, float]:
    """Return what is asked for, with a factor in reserve for what the grid does not show."""
    margins = question.margins
    gain = 1.0 + (margins.gain - 1.0) * reserve
    sensitivity = 1.0 + (margins.sensitivity - 1.0) / reserve
    learning = margins.learning * (1.0 + 1e-9)
    phase = min(margins.phase * reserve, 0.999 * math.pi)
    return gain, phase, sensitivity, learning, question.slew, question.clipped


def _usual_parts(question: Question, plants: list[_core.LoopPlant], dt: float) -> tuple[str, ...]:
    parts = ["pid", "low-pass"]
    if resonance(plants, dt) is not None:
        parts.append("notch")
    periods = {one.period for one in question.references}
    rising = all(plant.static_gain > 0.0 for plant in plants)
    if len(periods) == 1 and rising and all(can_be_learnt(one) for one in question.references):
        parts.append("repetitive")
    return tuple(parts)


def _tasks(question: Question, base: Controller, repeats: bool) -> list[_core.Task]:
    """Make the motions that the controllers are judged by."""
    tasks = []
    plant = plant_of(question.stages[0])
    check_drive_unit(question.stages[0], base)
    for reference in question.references:
        samples = reference.sample(base.dt)
        if question.clipped < 0.5:
            _check_reach(question, samples)
        voltage = feedforward_of(base, reference, samples).voltage
        first = first_counted(reference, samples, learns=repeats)
        for k in range(question.seeds):
            sensor = replace(plant.sensor, seed=plant.sensor.seed + k)
            seeded: VirtualStage = stepped(replace(plant, sensor=sensor), base)
            task = _core.Task(
                stage=seeded._core,
                visited=question.visited,
                dt=base.dt,
                delay=question.delay,
                jitter=question.jitter,
                reference=samples.x,
                feedforward=voltage,
                first=first,
                measured=question.measured,
            )
            tasks.append(task)
    return tasks


def _check_reach(question: Question, samples: SampledReference) -> None:
    """Refuse a reference beyond the reach of a model, with the argument that allows it here."""
    for i, stage in enumerate(question.stages, 1):
        try:
            check_within_reach(plant_of(stage), question.limits, samples, question.drive_unit)
        except ParameterError as error:
            words = str(error).replace("or beyond_reach=True", "or clipped=0.5 or more")
            which = f"model {i}: " if len(question.stages) > 1 else ""
            raise ParameterError(f"{which}{words}") from None


def _kept(question: Question, answer: _Answer) -> list[Kept]:
    """Check the margins of what was found, exactly, over all plants."""
    controller = _controller(answer)
    margins = question.margins
    bounds = {
        "gain margin": margins.gain,
        "phase margin": margins.phase,
        "learning": margins.learning,
        "sensitivity": margins.sensitivity,
    }
    worst: dict[str, Kept] = {}
    for name, plant in answer.plants:
        check = _core.check_loop(controller._core, plant)
        values = {
            "gain margin": check["gain_margin"] or math.inf,
            "phase margin": math.pi if check["phase_margin"] is None else check["phase_margin"],
            "learning": check["small_gain"] or 0.0,
            "sensitivity": check["sensitivity"],
        }
        if not check["stable"]:
            values["sensitivity"] = math.inf
        for key, value in values.items():
            one = Kept(key, value, bounds[key], name)
            if key not in worst or one.share > worst[key].share:
                worst[key] = one
    if controller.repetitive is None:
        del worst["learning"]
    return list(worst.values())


def _controller(answer: _Answer) -> Controller:
    parts = answer.box.parts(dict(answer.found["settings"]))
    return replace(
        answer.base,
        feedback=parts.feedback,
        filters=(*answer.base.filters, *parts.filters),
        repetitive=parts.repetitive,
    )


def _answered(question: Question, best: _Answer, answers: list[_Answer]) -> Tuned:
    """Check and simulate what was found in full."""
    controller = _controller(best)
    runs = tuple(
        track(
            question.stages[0],
            controller,
            reference,
            delay=question.delay,
            jitter=question.jitter,
            visited=question.visited,
            beyond_reach=True,
            unstable=True,
        )
        for reference in question.references
    )
    kept = _kept(question, best)
    binding = [f"{one.name}, {one.plant}" for one in kept if one.share > BINDS]
    figures = best.found["figures"]
    if math.isfinite(question.slew) and max(one[3] for one in figures) > BINDS * question.slew:
        binding.append("slew")
    binding += best.box.edges(dict(best.found["settings"]))
    report = TuningReport(
        figure=FIGURES[question.figure] if runs else "integral gain from margins alone",
        value=best.found["cost"] * (1.0 if runs else controller.dt),
        runs=runs,
        kept=tuple(kept),
        margins=question.margins,
        plants=tuple(one.name for one in best.plants),
        binding=tuple(binding),
        dt=controller.dt,
        candidates=sum(one.found["candidates"] for one in answers),
        loops=sum(one.found["loops"] for one in answers),
        history=tuple(best.found["history"]),
    )
    return Tuned(controller, report)
