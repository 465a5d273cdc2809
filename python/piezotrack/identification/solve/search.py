"""Identification of a model whose parameters are searched, by descents or a particle swarm."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from ... import _core
from ..._support.display.progress_bar import ProgressBar
from ..._support.units import of_drive
from ...errors import Interrupted
from ...stages.registry import stage_class
from ..fitted.drift import Drift
from ..fitted.estimates import Constraint, Estimate, LagRange, Progress, SearchRun, SwarmRun
from ..fitted.fitted_record import FittedRecord
from ..fitted.identification import Identification
from ..fitted.model_entries import constraint_entries, fit_entry, origin_of, provenance
from ..fitted.notes import deviation_of
from ..fitted.start import start_after
from ..methods.descents import Descents
from ..problem.objective import Objective
from .earlier_motion import starts

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from ...stages.model_info import ModelInfo
    from ..methods.particle_swarm import ParticleSwarm
    from ..problem.problem import Problem
    from ..problem.records import Record
    from .run import Run

__all__ = ["SENSOR", "details_of", "search_parameters"]

# Independent swarms by default: a swarm has to be restarted to tell whether it converged.
SWARMS = 4
# Descents after a swarm, for another history: from its best candidate and a few random places.
DESCENTS = Descents(samples=8, starts=8, rounds=1)
# Unit and symbol of what is searched beside the parameters of a model.
SENSOR = {"delay": ("s", "Td"), "voltage_before": ("V", "u0"), "drift_time": ("s", "tau")}


def search_parameters(
    problem: Problem,
    method: Descents | ParticleSwarm,
    run: Run,
    swarm: Identification | None = None,
) -> Identification:
    """Search the parameters of a model on one record or several, by descents or with a swarm.

    Parameters
    ----------
    problem : Problem
        The model, the records and what is known of the parameters.
    method : Descents or ParticleSwarm
        What searches.
    run : Run
        How it is run.
    swarm : Identification, optional
        What the swarm found on the one record as of a stage that never moved before: descents from
        there and from random places search the parameters with another history.

    Returns
    -------
    Identification
        Result with the best candidate; runs and course of the search are those of `swarm`, where it
        is given, and the descents count as its refinement.

    Raises
    ------
    ParameterError, DataError, NumericalError, Interrupted
        As for `identify`.
    """
    problem.check_data()
    info, callback = problem.info, run.callback
    searcher, runs, start = method, method.runs, None
    if swarm is not None:
        searcher, runs = DESCENTS, 1
        (start,) = starts(Objective._of(problem, run.threads), swarm).tolist()
    with ProgressBar(run.progress, f"identify: {info.name}") as bar:
        outcome = _core.identify(
            problem,
            method=searcher._core,
            seed=method.seed,
            runs=SWARMS if runs is None else runs,
            start=start,
            threads=run.threads,
            callback=None if callback is None else _reporting(info, callback),
            progress=bar.update,
            checkpoint=run.checkpoint,
        )
    if outcome is None:
        raise Interrupted("interrupted before the first cost was computed")
    fit = _identification(problem, outcome, method)
    if swarm is not None:
        fit = _after_swarm(fit, swarm)
    if not fit.success:
        raise Interrupted(
            f"interrupted after {fit.nfev} simulations, best cost {fit.cost_um:.4g} um", fit
        )
    return fit


def _reporting(info: ModelInfo, callback: Callable[[Progress], object]) -> Callable[..., bool]:
    """Convert the core's plain numbers to a `Progress` for the callback."""
    names = [one.name for one in info.parameters if not one.is_list]

    def report(
        nit: int, most: int, nfev: int, cost: float, theta: list[float], delay: float
    ) -> bool:
        parameters = dict(zip(names, theta, strict=False))
        return bool(callback(Progress(nit, most, nfev, cost, parameters, delay)))

    return report


def _after_swarm(fit: Identification, swarm: Identification) -> Identification:
    """Give the result of descents the course of the swarm that they started from."""
    ours, course = fit.search, swarm.search
    if ours is None or course is None:
        return fit
    npolish = course.npolish + fit.nfev + ours.npolish
    nfail = course.nfail + ours.nfail
    stop_reason = swarm.stop_reason if fit.success else fit.stop_reason
    entry = {
        **fit.details["fit"],
        **{name: swarm.details["fit"][name] for name in ("iterations", "simulations", "runs")},
        "polish_simulations": npolish,
        "failed_simulations": nfail,
        "stop_reason": stop_reason,
    }
    return replace(
        fit,
        nfev=swarm.nfev,
        stop_reason=stop_reason,
        details={**fit.details, "fit": entry},
        search=replace(
            ours,
            runs=course.runs,
            agreeing_runs=course.agreeing_runs,
            history=course.history,
            nit=course.nit,
            nfail=nfail,
            npolish=npolish,
        ),
    )


def _identification(
    problem: Problem, outcome: _core.Search, method: Descents | ParticleSwarm
) -> Identification:
    info, records = problem.info, problem.records
    drive_unit = records[0].data.drive_unit
    facts = {one.name: (one.unit, one.symbol) for one in info.parameters} | SENSOR
    facts = {name: (of_drive(unit, drive_unit), sign) for name, (unit, sign) in facts.items()}
    parameters = {one["name"]: _estimate(one, *facts[one["name"]]) for one in outcome.estimates}
    values = {name: [estimate.value] for name, estimate in parameters.items()}
    values["creep_weights"], values["creep_times"] = outcome.creep
    model = stage_class(info)._from(values.items())
    fitted = tuple(
        _fitted(model, one, own, facts) for one, own in zip(records, outcome.records, strict=True)
    )
    first, data = fitted[0], records[0].data
    parameters |= first.parameters
    spread = deviation_of([(one.data, one.weight) for one in records])
    constraints = tuple(Constraint(*one) for one in outcome.constraints)
    details: dict[str, Any] = {
        "parameters": {
            parameter.name: details_of(parameters[parameter.name])
            for parameter in info.parameters
            if parameter.name in parameters
        }
        | {"creep_weights": {"free": True}, "creep_times": {"free": False}},
        "delay": details_of(parameters["delay"]) if "delay" in parameters else {},
        **constraint_entries(constraints),
        "fit": {
            **fit_entry(outcome.rms, data, outcome.rms_with_priors, spread),
            "iterations": outcome.iterations,
            "simulations": sum(nfev for _, _, nfev, _ in outcome.runs),
            "polish_simulations": outcome.polish_evaluations,
            "failed_simulations": outcome.failures,
            "stop_reason": outcome.stop_reason,
            "runs": [{"cost": cost, "stop_reason": reason} for cost, _, _, reason in outcome.runs],
            "substeps": outcome.substeps,
            "order": outcome.order,
        },
        "provenance": provenance(data, seed=method.seed, **{method.name: method.settings()}),
    }
    return Identification(
        lags=None if outcome.lags is None else LagRange(*outcome.lags),
        model=model,
        start=first.start,
        delay=first.delay,
        offset=first.offset,
        offset_fitted=first.offset_fitted,
        drift=first.drift,
        scale_assumed=outcome.scale_assumed,
        stroke=max(one.stroke for one in fitted),
        records=fitted,
        details=details,
        data=data,
        parameters=parameters,
        constraints=constraints,
        cost=outcome.rms,
        nfev=sum(nfev for _, _, nfev, _ in outcome.runs),
        stop_reason=outcome.stop_reason,
        method=method,
        search=SearchRun(
            runs=tuple(SwarmRun(*run) for run in outcome.runs),
            agreeing_runs=outcome.agreeing,
            history=outcome.history,
            nit=outcome.iterations,
            nfail=outcome.failures,
            npolish=outcome.polish_evaluations,
            substeps=outcome.substeps,
            order=outcome.order,
            scales={name: one.scale for name, one in problem.parameters.items() if one.scale},
            cost_with_priors=outcome.rms_with_priors,
        ),
    )


def _estimate(entry: Mapping[str, Any], unit: str, symbol: str) -> Estimate:
    """Return what a search found of a parameter; standard deviations come with the covariance."""
    bounds, at_bound = entry["bounds"], entry["at_bound"]
    deviation = math.inf if entry["not_shown"] else None
    known = {name: entry[name] for name in ("scale", "tie", "prior")}
    value = entry["value"]
    free = bounds is not None
    return Estimate(value, unit, symbol, free, bounds, deviation, at_bound, **known)


def _fitted(
    model: Any, record: Record, entries: Mapping[str, Any], facts: Mapping[str, tuple[str, str]]
) -> FittedRecord:
    """Return what a search found of a record alone."""
    data, history = record.data, record.history or "virgin"
    estimates = {name: _estimate(entries[name], *facts[name]) for name in SENSOR}
    delay, before, time = (estimates[name] for name in SENSOR)
    if delay.value == 0.0 and not delay.free:
        del estimates["delay"]
    if history != "fit":
        del estimates["voltage_before"]
    drift = None
    if time.value:
        drift = Drift._fading(entries["drift"], time.value, data, time_fitted=time.free)
    else:
        del estimates["drift_time"]
    voltage = before.value if history == "fit" else None
    return FittedRecord(
        data=data,
        weight=record.weight,
        delay=delay.value,
        offset=entries["offset"],
        offset_fitted=record.offset,
        drift=drift,
        start=start_after(model, data, history, voltage, creeps=False),
        cost=entries["rms"],
        stroke=data.stroke,
        parameters=estimates,
        origin=origin_of(data),
    )


def details_of(estimate: Estimate) -> dict[str, Any]:
    """Entries of the file for a parameter; JSON has no infinity."""
    known = estimate.deviation is not None and math.isfinite(estimate.deviation)
    return {
        "free": estimate.free,
        "bounds": estimate.bounds,
        "standard_deviation": estimate.deviation if known else None,
        "at_bound": estimate.at_bound,
    } | {
        name: value
        for name in ("scale", "tie", "prior")
        if (value := getattr(estimate, name)) is not None
    }
