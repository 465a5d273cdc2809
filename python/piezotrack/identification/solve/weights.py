"""Identification by least squares, for models that are linear in the weights of their plays."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from ... import _core
from ...stages.registry import stage_class
from ..fitted.drift import Drift, asked_drift, drift_of_asked
from ..fitted.estimates import LagRange
from ..fitted.fitted_record import FittedRecord
from ..fitted.identification import Identification
from ..fitted.model_entries import fit_entry, origin_of, provenance
from ..fitted.notes import deviation_of
from ..fitted.start import start_of_fit
from ..problem.problem import delay_bounds
from ..problem.records import of_record

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from ...stages.model_info import ModelInfo
    from ..methods.least_squares import LeastSquares
    from ..problem.records import Asked

__all__ = ["solve_least_squares"]

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
    "creep_times",
)


def solve_least_squares(
    records: Sequence[Asked], info: ModelInfo, settings: LeastSquares, threads: int = 0
) -> Identification:
    """Identify a stage by least squares.

    Parameters
    ----------
    records : sequence of Asked
        The records, each with what is asked of it alone. The drive before a window is warm-up:
        simulated, not scored.
    info : ModelInfo
        The model.
    settings : LeastSquares
        Settings.
    threads : int, optional
        All cores where it is 0.

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
        What is asked of a record cannot be used.
    """
    data = records[0].data
    longest = max((one.data for one in records), key=lambda one: one.duration)
    found = _core.identify_weights(
        [_asked(one) for one in records],
        model=info.name,
        count=settings.count,
        thresholds=settings._places(info),
        zones=settings._zones(info),
        creep_times=settings._times(longest),
        dynamics=settings.dynamics or "none",
        threads=threads,
    )
    model = stage_class(info)
    both = zip(records, found.records, strict=True)
    fitted = tuple(_fitted(model, info, one, own) for one, own in both)
    spread = deviation_of([(one.data, one.weight) for one in records])
    first = fitted[0]
    details: dict[str, Any] = {
        "parameters": {
            one.name: {"free": one.name not in CHOSEN and one.held is None}
            for one in info.parameters
        },
        "delay": {"free": True} if _is_searched(records[0]) else {},
        "fit": {
            **fit_entry(found.rms, data, None, spread),
            "simulations": found.evaluations,
            "at_bound": found.at_bound,
            "lag_range": {"value": found.lag_range, "unit": "s"},
        },
        "provenance": provenance(data, least_squares=asdict(settings)),
    }
    return Identification(
        model=model._from(found.parameters),
        offset=first.offset,
        offset_fitted=first.offset_fitted,
        drift=first.drift,
        delay=first.delay,
        stroke=max(one.stroke for one in fitted),
        records=fitted,
        details=details,
        data=data,
        cost=found.rms,
        nfev=found.evaluations,
        stop_reason="solved",
        least_squares=settings,
        at_bound=any(name in DYNAMICS for name in found.at_bound),
        lags=_lags(found.lag_range),
        start=first.start,
    )


def _asked(one: Asked) -> dict[str, Any]:
    """Return a record and what is asked of it, as the core takes it."""
    data = one.data
    with of_record(one.label):
        delay = delay_bounds(one.delay)
        drift = drift_of_asked(one.drift, offset=one.offset, searched=False)
    return {
        "u": data.full.u,
        "y": data.full.y,
        "dt": data.dt,
        "hold_name": data.hold,
        "start": data.warmup,
        "history": one.history,
        "offset": one.offset,
        "drift": drift,
        "delay": delay,
        "label": one.label,
        "weight": one.weight,
    }


def _is_searched(one: Asked) -> bool:
    bounds = delay_bounds(one.delay)
    return bounds is None or bounds[0] < bounds[1]


def _fitted(model: Any, info: ModelInfo, one: Asked, own: Mapping[str, Any]) -> FittedRecord:
    """Return what was found of a record alone."""
    data = one.data
    drift, offset = None, own["offset"]
    if own["drift"] is not None:
        amplitude, time = own["drift"]
        begin, end = float(data.t[0]), float(data.t[-1])
        fitted = asked_drift(one.drift) is None
        drift = Drift(amplitude=amplitude, time=time, begin=begin, end=end, time_fitted=fitted)
        # What the sensor shows at rest at the end of the window.
        offset += amplitude * math.exp((begin - end) / time)
    return FittedRecord(
        data=data,
        weight=one.weight,
        delay=own["delay"],
        offset=offset,
        offset_fitted=one.offset,
        drift=drift,
        start=start_of_fit(data, own["history"], model._state._from(own["start"], info.state)),
        cost=own["rms"],
        stroke=data.stroke,
        origin=origin_of(data),
    )


def _lags(found: tuple[float, float] | None) -> LagRange | None:
    """Lags that fit as well, where the record does not show the dynamics."""
    return None if found is None else LagRange(*found, from_zero=found[0] == 0.0)
