"""The quantities of a stage and of its record, as the summary of a fit begins with them."""

from __future__ import annotations

import math
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from ..._support.units import length_text, of_drive, shown_unit
from ...errors import NumericalError
from ...stages.slow_loop import SlowLoop
from ..fitted.certainty.covariance import normal_reach
from ..fitted.notes import start_notes
from ..linearised.sensitivity import gradient

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from ...data.dataset import Dataset
    from ..fitted.drift import Drift
    from ..fitted.fitted_record import FittedRecord
    from ..fitted.identification import Identification
    from ..fitted.identified_model import IdentifiedModel

__all__ = ["errors_of", "errors_of_file", "of_sensor", "of_stage", "predicted", "rows"]

Row = tuple[str, str]

# Ratio of a time constant to its record from which on a drift is a straight line.
STRAIGHT = 5.0
# Share of the travel from which on a loop is wide enough to show.
CLOSED = 1e-6
# Half of an interval over its value from which on the value is not known at all.
UNKNOWN = 10.0
# Level of the intervals that are written.
LEVEL = 0.95


def rows(quantities: Iterable[Row], indent: int = 2) -> list[str]:
    """Write quantities below each other.

    Parameters
    ----------
    quantities : iterable of (str, str)
        Name, and value with its unit.
    indent : int, optional
        Blanks before each.

    Returns
    -------
    list of str
        One line each.
    """
    return [f"{'':<{indent}}{name:<10} {value}" for name, value in quantities]


def of_stage(model: IdentifiedModel) -> list[Row]:
    """Return gain, hysteresis, creep and lag of a stage, those that it has.

    Parameters
    ----------
    model : IdentifiedModel
        The model.

    Returns
    -------
    list of (str, str)
        Name, and value with its unit.
    """
    stage = model.model
    rows = [*_loop(model), *_creep(model)]
    if lag := 1e3 * _lag(stage):
        half = 1e3 * _half_width(model, _lag)
        known = half < UNKNOWN * lag or math.isinf(half)
        certainty = _half(half) + " ms" if known else " ms, not determined by this record"
        rows.append(("lag", f"{lag:.3g}{certainty}"))
    if getattr(stage, "frequency", None) is not None:
        modes = [stage.frequency, *stage.mode_frequencies]
        rows.append(("mode", f"{', '.join(f'{one:.4g}' for one in modes)} Hz"))
    return rows


def of_sensor(sensor: FittedRecord | IdentifiedModel, data: Dataset | None = None) -> list[Row]:
    """Return delay, drift, offset and beginning of a record, those that it has.

    Parameters
    ----------
    sensor : FittedRecord or IdentifiedModel
        What belongs to the record.
    data : Dataset, optional
        The record, where it is there.

    Returns
    -------
    list of (str, str)
        Name, and value with its unit.
    """
    rows: list[Row] = []
    if sensor.delay or "delay" in getattr(sensor, "parameters", {}):
        rows.append(("delay", _delay(sensor)))
    if sensor.drift:
        rows.append(("drift", _drift(sensor.drift)))
    if sensor.offset_fitted:
        rows.append(("offset", f"{1e6 * sensor.offset:.5g} um, fitted"))
    if data is not None and (begun := start_notes(sensor.start, data)):
        rows.append(("start", begun))
    return rows


def errors_of(fit: Identification, i: int) -> list[Row]:
    """Return rms and largest error of a fit on one of its records, and its noise.

    Parameters
    ----------
    fit : Identification
        The fit.
    i : int
        Which of its records.

    Returns
    -------
    list of (str, str)
        One row, and one of the share of the motion where there is one record.
    """
    record, score = fit.records[i], fit.scores[i]
    several = len(fit.records) > 1
    return _errors(
        record.cost,
        record.stroke,
        (score.max_error, score.max_error_time),
        fit.noises[i],
        math.nan if several else fit.fit_percent,
    )


def errors_of_file(model: IdentifiedModel) -> list[Row]:
    """Return rms and largest error of a model that was read from a file, and its noise.

    Parameters
    ----------
    model : IdentifiedModel
        The model.

    Returns
    -------
    list of (str, str)
        As of a fit, or none where the file has no rms error.
    """
    entries = model.details.get("fit")

    def number(name: str) -> float:
        entry: Any = entries.get(name) if isinstance(entries, dict) else None
        value = entry.get("value") if isinstance(entry, dict) else None
        return float(value) if isinstance(value, (int, float)) else math.nan

    if math.isnan(cost := number("cost")):
        return []
    largest = number("max_error"), number("max_error_time")
    rows = _errors(cost, model.stroke, largest, number("noise"), number("fit_percent"))
    return [*rows, *predicted(model)]


def predicted(model: IdentifiedModel) -> list[Row]:
    """Return the error that is expected on another cycle, and whether model or sensor limits it.

    Parameters
    ----------
    model : IdentifiedModel
        The model.

    Returns
    -------
    list of (str, str)
        Two rows; the second where the drive repeats, and none where nothing is known.
    """
    if (covariance := model.covariance) is None:
        return []
    within = f"within {length_text(covariance.predicted, 3)} (95 %) on another cycle like these"
    if (shares := covariance.shares) is None:
        return [("predicted", within)]
    noise = f"part that does not repeat {length_text(shares.noise, 3)}"
    repeats = f"repeatable error {length_text(shares.model_error, 3)}"
    model_limits = shares.model_error > shares.noise
    limit = f"the model: {repeats}; {noise}" if model_limits else f"the sensor: {noise}; {repeats}"
    return [("predicted", within), ("limit", limit)]


def _loop(model: IdentifiedModel) -> list[Row]:
    """Gain and hysteresis of the slow loop over the drive identified."""
    loop = None
    with suppress(NumericalError):
        loop = model.slow_loop
    if loop is None or not math.isfinite(loop.gain):
        return []
    per = of_drive("V", model.drive_unit) if model.drive_unit != "N" else "N"
    unit, scale = shown_unit(f"m/{per}")
    if unit == "m/N":
        unit, scale = "um/N", 1e6
    ends = model.drive_range or (0.0, 0.0)

    def gain_and_width(stage: Any) -> tuple[float, float]:
        near = SlowLoop.of(stage, *ends)
        return near.gain, near.width_percent

    of_gain, of_width = _half_widths(model, gain_and_width, 2)
    gain, width = _half(scale * of_gain), _half(of_width)
    rows = [("gain", f"{scale * loop.gain:.4g}{gain} {unit}")]
    if loop.width > CLOSED * abs(loop.travel):
        share = f"{loop.width_percent:.3g}{width} % of the travel"
        rows.append(("hysteresis", f"{share}, {length_text(loop.width, 3)}"))
    return rows


def _half_width(model: IdentifiedModel, quantity: Callable[[Any], float]) -> float:
    """Return half of the 95 % interval of a quantity of the stage, infinite where not known."""
    (half,) = _half_widths(model, lambda stage: (quantity(stage),), 1)
    return half


def _half_widths(
    model: IdentifiedModel, quantities: Callable[[Any], tuple[float, ...]], count: int
) -> list[float]:
    """Return the same of so many quantities."""
    covariance = model.covariance
    if covariance is None or model.drive_range is None:
        return [math.inf] * count
    slopes = gradient(model, lambda near: quantities(near.model))
    return [float(covariance.reach(column, LEVEL)) for column in slopes.reshape(-1, count).T]


def _lag(stage: Any) -> float:
    """Time constant of the first-order lag of a stage [s]."""
    if hasattr(stage, "stiffness"):
        return float(stage.damping / stage.stiffness)
    return float(stage.time_constant or 0.0)


def _creep(model: IdentifiedModel) -> list[Row]:
    """Share and time constant of each relaxation that is not 0."""
    stage: Any = model.model
    parts = [(w, t) for w, t in zip(stage.creep_weights, stage.creep_times, strict=True) if w]
    if not parts:
        return []
    each = ", ".join(f"{100.0 * w:.2g} % in {t:.3g} s" for w, t in parts)
    reach = _half(100.0 * _half_width(model, lambda stage: math.fsum(stage.creep_weights)))
    whole = f"{100.0 * math.fsum(w for w, _ in parts):.2g}{reach} %"
    return [("creep", f"{whole}: {each}" if len(parts) > 1 else f"{whole} in {parts[0][1]:.3g} s")]


def _drift(drift: Drift) -> str:
    moved = f"{1e6 * drift.moved:.3g}{_interval(drift.deviation, 1e6)} um over the record"
    lasting = drift.end - drift.begin
    if lasting > 0.0 and drift.time > STRAIGHT * lasting:
        return f"{1e6 * drift.moved / lasting:.3g} um/s, {moved}"
    return f"{moved}, time constant {drift.time:.3g} s"


def _delay(own: FittedRecord | IdentifiedModel) -> str:
    estimate = getattr(own, "parameters", {}).get("delay")
    deviation = None if estimate is None else estimate.deviation
    return f"{1e3 * own.delay:.4g}{_interval(deviation, 1e3)} ms"


def _interval(deviation: float | None, scale: float) -> str:
    """Write half of the 95 % interval of a standard deviation, where it is known."""
    return "" if deviation is None else _half(scale * normal_reach(LEVEL) * deviation)


def _half(reach: float) -> str:
    return f" +- {reach:.1g}" if math.isfinite(reach) else ""


def _errors(
    rms: float, stroke: float, largest: tuple[float, float], noise: float, fit: float
) -> list[Row]:
    """Rms and largest error side by side with the noise."""
    most, when = largest
    text = f"{length_text(rms, 3)} ({100.0 * rms / stroke:.3g} % of stroke)"
    if not (math.isnan(most) or math.isnan(when)):
        text += f", largest {length_text(most, 3)} at {when:.6g} s"
    if noise > 0.0:
        text += f", noise {length_text(noise, 3)}"
    found = [("rms error", text)]
    return found if math.isnan(fit) else [*found, ("fit", f"{fit:.4g} % of the motion")]
