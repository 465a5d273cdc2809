"""Identification by least squares, for models that are linear in the weights of their plays."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import chain
from typing import TYPE_CHECKING, Any

from ... import _core
from ..._support.messages import quoted
from ...errors import DataError, ParameterError
from ...stages.registry import stage_class
from ..fitted.drift import Drift
from ..fitted.estimates import LagRange
from ..fitted.fitted_record import FittedRecord
from ..fitted.identification import Identification
from ..fitted.model_entries import fit_entry, origin_of, provenance
from ..fitted.notes import deviation_of
from ..fitted.start import start_of_fit

if TYPE_CHECKING:
    from collections.abc import Mapping

    from ...data.dataset import Dataset
    from ...stages.model_info import ModelInfo
    from ..methods.least_squares import LeastSquares
    from ..problem.problem import Problem
    from ..problem.records import Record
    from .run import Run

__all__ = ["Structure", "solve_least_squares"]

MOST_RELAXATIONS = 8
DYNAMICS = ("time_constant", "frequency", "damping_ratio")
# Parameters that the settings and the record fix beforehand.
CHOSEN = (
    "thresholds",
    "concave_thresholds",
    "convex_thresholds",
    "levels",
    "low",
    "high",
    "dead_zone_thresholds",
    "slip_displacements",
    "creep_times",
)


@dataclass(frozen=True)
class Structure:
    """Structure of a fit beside its signals, from which that of another fit begins."""

    histories: list[str]
    drifts: list[float | None]
    delayed: list[bool]
    creep_times: list[float]
    dynamics: list[float]
    # Residual that the other fit leaves without a jump of the drive to the first sample [m].
    cost: float = math.inf
    # Whether that fit is kept, and not only judged beside others.
    kept: bool = False

    @classmethod
    def of(cls, fit: Identification, *, kept: bool = False) -> Structure:
        """Return that of a fit by least squares."""
        model: Any = fit.model
        creep = zip(model.creep_weights, model.creep_times, strict=True)
        modes = zip(
            model.mode_weights, model.mode_frequencies, model.mode_damping_ratios, strict=True
        )
        jumped = any(one.start and one.start.history == "rest" for one in fit.records)
        main = (model.time_constant, model.frequency, model.damping_ratio)
        return cls(
            histories=[
                one.start.history if one.start and one.start.history != "rest" else "virgin"
                for one in fit.records
            ],
            drifts=[one.drift.time if one.drift else None for one in fit.records],
            delayed=[one.delay != 0.0 for one in fit.records],
            creep_times=[time for weight, time in creep if weight > 0.0],
            dynamics=[*(one for one in main if one is not None), *chain(*modes)],
            cost=math.inf if jumped else fit.cost,
            kept=kept,
        )


def solve_least_squares(
    problem: Problem, settings: LeastSquares, run: Run, start: Structure | None = None
) -> Identification:
    """Identify a stage by least squares.

    Parameters
    ----------
    problem : Problem
        The model and the records. The drive before a window is warm-up: simulated, not scored.
    settings : LeastSquares
        Settings.
    run : Run
        How it is run.
    start : Structure, optional
        Structure to begin with, where nothing of it is given.

    Returns
    -------
    Identification
        The stage, and the residual of the fit.

    Raises
    ------
    DataError
        A record does not determine the weights: its drive or its displacement is constant, the
        drive never reverses, or the window is too short.
    ParameterError
        A setting or what is fitted of a record cannot be used.
    """
    info, records = problem.info, problem.records
    data = records[0].data
    longest = max((one.data for one in records), key=lambda one: one.duration)
    solution = _core.identify_weights(
        problem,
        count=settings.count,
        thresholds=_nodes(settings, info),
        zones=_zones(settings, info),
        creep_times=_times(settings, longest),
        dynamics=settings.dynamics or "none",
        start=start if settings._resumes else None,
        threads=run.threads,
        stopped=run.stopped,
    )
    model = stage_class(info)
    both = zip(records, solution.records, strict=True)
    fitted = tuple(_fitted(model, info, one, own) for one, own in both)
    spread = deviation_of([(one.data, one.weight) for one in records])
    first = fitted[0]
    details: dict[str, Any] = {
        "parameters": {
            parameter.name: {"free": parameter.name not in CHOSEN and parameter.held is None}
            for parameter in info.parameters
        },
        "delay": {"free": True} if records[0].fits_delay else {},
        "fit": {
            **fit_entry(solution.rms, data, None, spread),
            "simulations": solution.evaluations,
            "at_bound": solution.at_bound,
            "lag_range": {"value": solution.lag_range, "unit": "s"},
        },
        "provenance": provenance(data, least_squares=settings.settings()),
    }
    return Identification(
        model=model._from(solution.parameters),
        offset=first.offset,
        offset_fitted=first.offset_fitted,
        drift=first.drift,
        delay=first.delay,
        stroke=max(one.stroke for one in fitted),
        records=fitted,
        details=details,
        data=data,
        cost=solution.rms,
        nfev=solution.evaluations,
        stop_reason="solved",
        method=settings,
        at_bound=any(name in DYNAMICS for name in solution.at_bound),
        lags=_lags(solution.lag_range),
        start=first.start,
    )


def _nodes(settings: LeastSquares, info: ModelInfo) -> list[float] | None:
    """Thresholds or levels that are given, whichever the model has."""
    nodes = None
    for name, given in (("thresholds", settings.thresholds), ("levels", settings.levels)):
        if given is not None and name != info.nodes:
            raise ParameterError(name, quoted(given), f"None, as {info.title} has no {name}")
        nodes = nodes if given is None else list(given)
    return nodes


def _zones(settings: LeastSquares, info: ModelInfo) -> int:
    """Return the number of dead zones."""
    if settings.dead_zones is True:
        return 2 if info.has_dead_zones else 0
    return int(settings.dead_zones)


def _times(settings: LeastSquares, data: Dataset) -> list[float] | None:
    """Time constants of the creep [s]; None where the record shows them."""
    if isinstance(settings.creep, str):
        return None
    if not isinstance(settings.creep, bool):
        return list(settings.creep)
    if not settings.creep:
        return []
    shortest, longest = 5.0 * data.dt, 0.5 * data.duration
    decades = [10.0**k for k in range(-9, 10) if shortest <= 10.0**k <= longest]
    if not decades:
        raise DataError(
            f"the window of {data.duration:.4g} s is too short to show creep: expected at "
            f"least {20.0 * shortest:.4g} s, or creep=False"
        )
    return decades[-MOST_RELAXATIONS:]


def _fitted(
    model: Any, info: ModelInfo, record: Record, entries: Mapping[str, Any]
) -> FittedRecord:
    """Return what was found of a record alone."""
    data = record.data
    drift, offset = None, entries["offset"]
    if entries["drift"] is not None:
        amplitude, time = entries["drift"]
        begin, end = float(data.t[0]), float(data.t[-1])
        fitted = record.fits_drift_time
        drift = Drift(amplitude=amplitude, time=time, begin=begin, end=end, time_fitted=fitted)
        # What the sensor shows at rest at the end of the window.
        offset += amplitude * math.exp((begin - end) / time)
    return FittedRecord(
        data=data,
        weight=record.weight,
        delay=entries["delay"],
        offset=offset,
        offset_fitted=record.offset,
        drift=drift,
        start=start_of_fit(
            data, entries["history"], model._state._from(entries["start"], info.state)
        ),
        cost=entries["rms"],
        stroke=data.stroke,
        origin=origin_of(data),
    )


def _lags(found: tuple[float, float] | None) -> LagRange | None:
    """Lags that fit as well, where the record does not show the dynamics."""
    return None if found is None else LagRange(*found, from_zero=found[0] == 0.0)
