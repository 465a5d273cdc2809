"""The covariance of what an identification fitted, from its records."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import replace
from statistics import NormalDist
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from ... import _core
from ...errors import DataError, PiezotrackError
from ..fitted.certainty.covariance import Covariance, NoiseShares, is_hidden, left_open
from ..linearised.sensitivity import STEP, LinearisedRecord, gradient, sensitivity
from ..linearised.values import (
    DELAY,
    Value,
    entries_of,
    fitted_values,
    free_values,
    moved,
    sizes_of,
)
from ..solve.judging import SAME_PERIOD, period_of
from ..solve.search import details_of
from .held_out import held_out

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from ...data.dataset import Dataset
    from ..fitted.estimates import Estimate
    from ..fitted.identification import Identification
    from ..fitted.identified_model import IdentifiedModel
    from ..linearised.sensitivity import Sensitivity

    Array = NDArray[np.float64]
    Records = Sequence[tuple[Dataset, float]]
    Noise = Literal["not repeated", "residual"]

__all__ = ["covariance_of", "with_covariance", "without_repeated"]

# Most samples of a record; of more, means of neighbours.
MOST, MOST_RESAMPLED = 2**16, 2**12
# Noises that are resampled, and the seed.
DRAWS, SEED = 199, 1
# Level at which intervals are widened, and fewest whole periods that tell noise from model error.
LEVEL, PERIODS = 0.95, 3
# Deviations of a value that is held beyond which it is what the model lacks: a search takes a mass
# that is.
MOST_HELD = 5.0


def with_covariance(fit: Identification) -> Identification:
    """Return an identification with its covariance, and the standard deviations of its parameters.

    Parameters
    ----------
    fit : Identification
        As solved.

    Returns
    -------
    Identification
        With `Identification.covariance`; None there, and no deviations, where the record is too
        short or nothing was fitted.
    """
    records = [(one.data, one.weight) for one in fit.records if one.data is not None]
    covariance: Covariance | None = None
    known: list[dict[str, float]] = [{} for _ in fit.records]
    with suppress(PiezotrackError):
        linear = _linearised(fit, records)
        covariance = _covariance(fit, records, linear, "not repeated")
        known = _of_each_record(fit, records, linear, covariance)
    parameters = {
        name: estimate._replace(deviation=_deviation(fit, covariance, name, estimate, known[0]))
        for name, estimate in fit.parameters.items()
    }
    several = tuple(
        replace(
            one,
            parameters=_of_record(one.parameters, own),
            drift=one.drift and replace(one.drift, deviation=own.get("drift")),
        )
        for one, own in zip(fit.records, known, strict=True)
    )
    entries = dict(fit.details.get("parameters", {}))
    entries |= {name: details_of(parameters[name]) for name in set(entries) & set(parameters)}
    details: dict[str, Any] = {**fit.details, "parameters": entries}
    if DELAY in parameters:
        details[DELAY] = details_of(parameters[DELAY])
    return replace(
        fit,
        covariance=covariance,
        parameters=parameters,
        records=several,
        drift=several[0].drift,
        details=details,
    )


def _of_record(
    estimates: Mapping[str, Estimate], known: Mapping[str, float]
) -> dict[str, Estimate]:
    return {n: one._replace(deviation=known.get(n, one.deviation)) for n, one in estimates.items()}


def _deviation(
    fit: Identification,
    covariance: Covariance | None,
    name: str,
    estimate: Estimate,
    known: Mapping[str, float],
) -> float | None:
    """Return the standard deviation of a parameter of a search."""
    if covariance is not None and name in covariance.names:
        return covariance.deviation(name)
    if estimate.tie is not None and covariance is not None:
        return covariance.reach(gradient(fit, Value(name).of), level=0.6826894921370859)
    return known.get(name, estimate.deviation)


def _of_each_record(
    fit: Identification,
    records: Records,
    linear: list[Sensitivity],
    covariance: Covariance,
) -> list[dict[str, float]]:
    """Return the standard deviations of what was fitted to each record alone."""
    free = [
        {name for name, one in record.parameters.items() if one.free and not one.at_bound}
        for record in fit.records
    ]
    known: list[dict[str, float]] = [{} for _ in free]
    if len(free) == 1 and DELAY in free[0] and DELAY in covariance.names:
        known[0][DELAY] = covariance.deviation(DELAY)
        free[0].remove(DELAY)
    for own, record in zip(free, fit.records, strict=True):
        own |= set(record.drift.slopes) if record.drift else set()
    if not any(free):
        return known
    values = fitted_values(fit)
    rows = [(r, name) for r, one in enumerate(linear) for name in one.alone if name in free[r]]
    of_rows = [linear[r].sizes[linear[r].alone.index(name)] or 1.0 for r, name in rows]
    sizes = np.append(sizes_of(fit, values, records[0][0].dt), of_rows)
    extended = [
        _Linear(_with_rows(one, r, rows), data, weight, sizes)
        for r, (one, (data, weight)) in enumerate(zip(linear, records, strict=True))
    ]
    precision = np.append(_precision(fit, values), np.zeros(len(rows))) * sizes**2
    matrix, determined, *_, hidden = _core.linearised_covariance(
        [record.thinned(MOST) for record in extended], np.diag(precision).tolist(), 0, SEED
    )
    for k, (r, name) in enumerate(rows, start=len(values)):
        known[r][name] = sizes[k] * math.sqrt(matrix[k][k]) if determined[k] else math.inf
    unseen = np.array(hidden).reshape(-1, sizes.size)
    for r, record in enumerate(fit.records):
        if record.drift:
            slopes = record.drift.slopes
            here = [slopes[name] if at == r and name in slopes else 0.0 for at, name in rows]
            slope = sizes * np.append(np.zeros(len(values)), here)
            known[r]["drift"] = (
                math.inf
                if is_hidden(unseen, slope)
                else math.sqrt(max(float(slope @ np.array(matrix) @ slope), 0.0))
            )
    return known


def _with_rows(linear: Sensitivity, record: int, rows: list[tuple[int, str]]) -> Sensitivity:
    """Take what belongs to records alone for values, 0 in the other records."""
    mine = dict(zip(linear.alone, zip(linear.nuisance, linear.sizes, strict=True), strict=True))
    none = np.zeros(linear.residual.size)
    added = [mine.pop(name)[0] if r == record else none for r, name in rows]
    return replace(
        linear,
        columns=np.concatenate([linear.columns, added]),
        nuisance=np.array([column for column, _ in mine.values()]).reshape(-1, none.size),
        alone=tuple(mine),
        sizes=np.array([size for _, size in mine.values()]),
    )


def covariance_of(
    model: IdentifiedModel,
    records: Records,
    *,
    noise: Noise = "not repeated",
) -> Covariance:
    """Return the covariance of what was fitted to records.

    Parameters
    ----------
    model : IdentifiedModel
        With values that were fitted.
    records : sequence of (Dataset, float)
        The records with their weights.
    noise : {"not repeated", "residual"}, optional
        Whether what repeats with the drive is model error, or all of the residual is noise.

    Returns
    -------
    Covariance
        Of the values of `fitted_values`.

    Raises
    ------
    DataError
        The records have too few samples, or no value was fitted.
    """
    return _covariance(model, records, _linearised(model, records), noise)


def _linearised(model: IdentifiedModel, records: Records) -> list[Sensitivity]:
    """Return each record about a model."""
    values = fitted_values(model)
    if not values:
        raise DataError("no value was fitted: expected one or more")
    return [sensitivity(model, data, values) for data, _ in records]


def _covariance(
    model: IdentifiedModel, records: Records, at: list[Sensitivity], noise: Noise
) -> Covariance:
    """Return the covariance of what was fitted to records that are linearised."""
    values = fitted_values(model)
    sizes = sizes_of(model, values, records[0][0].dt)
    linear = [
        _Linear(one, data, weight, sizes, noise)
        for one, (data, weight) in zip(at, records, strict=True)
    ]
    # Least squares end within 0.3 % of the least cost.
    aside = getattr(model, "lags", None) is not None and model.model.info.searched
    precision = np.diag(_precision(model, values) * sizes**2).tolist()
    longest = max(record.samples for record in linear)
    short = longest <= MOST_RESAMPLED
    found = _core.linearised_covariance(
        [record.thinned(MOST) for record in linear], precision, DRAWS if short else 0, SEED
    )
    rows, determined, independent, shifts, steps, resampled, orders, hidden = found
    if not short:
        few = [record.thinned(MOST_RESAMPLED) for record in linear]
        *_, resampled, _, _ = _core.linearised_covariance(few, precision, DRAWS, SEED)
    quantiles = np.quantile(np.array(resampled), LEVEL, axis=0)
    # Independent residuals have the variance of all that is left, not of the noise alone.
    powers = [sum(one.power_of(part) for one in linear) for part in ("noise", "residual")]
    with np.errstate(all="ignore"):
        factors = np.diag(np.array(rows)) / np.array(independent) * powers[0] / powers[1]
    return Covariance(
        names=tuple(str(value) for value in values),
        values=np.array([value.of(model) for value in values]),
        matrix=np.array(rows) * np.outer(sizes, sizes),
        determined=np.array(determined),
        independent=np.sqrt(np.array(independent)) * sizes,
        factors=np.where(np.isfinite(factors), factors, 1.0),
        widening=np.maximum(quantiles / NormalDist().inv_cdf(0.5 + 0.5 * LEVEL), 1.0),
        shifts=np.array(shifts) * sizes[:, None],
        to_least_cost=sizes * (np.array(steps) if aside else 0.0),
        by_held=_by_held(model, records, at, sizes, (np.array(steps), np.sqrt(np.diag(rows)))),
        samples=sum(record.samples for record in linear),
        orders=tuple(orders),
        hidden=np.array(hidden).reshape(-1, sizes.size) * sizes,
        predicted=held_out(model, records, at).quantile(LEVEL),
        shares=linear[0].shares,
    )


def _by_held(
    model: IdentifiedModel,
    records: Records,
    at: list[Sensitivity],
    sizes: Array,
    found: tuple[Array, Array],
) -> Array:
    """Return `Covariance.by_held`: of several values, of the one that leaves the others most open.

    `found`: steps to the least cost, and standard deviations, both in sizes.
    """
    steps, own = found
    freed = [np.zeros((steps.size, 2))]
    for value, step in _held(model):
        ratio, free = _freed(value, step, model, records, at, sizes)
        if ratio != 0.0:
            freed.append(np.outer((free - steps) / ratio, [min(ratio, MOST_HELD), 1.0]))
    shares = np.divide(1.0, own, out=np.zeros_like(own), where=own > 0.0)
    most = max(freed, key=lambda one: float(np.linalg.norm(shares * left_open(one))))
    return sizes[:, None] * most


def _held(model: IdentifiedModel) -> list[tuple[Value, float]]:
    """List what is held, with a step to where it may be.

    A mass without effect, weights of creep at 0, and what a search ended with on a bound.
    """
    entries = entries_of(model)
    mass = getattr(model, "parameters", {}).get("mass")
    values = [Value("mass")] if mass is not None and not mass.free and mass.deviation else []
    free = entries.get("creep_weights", {}).get("free", False)
    weights = model.model.creep_weights if free else ()
    values += [Value("creep_weights", k) for k, weight in enumerate(weights) if weight == 0.0]
    # The step of `sensitivity`, in a mass without effect, is one of rounding.
    held = [(value, value.size_in(model)) for value in values]
    bounded = {name: one["bounds"] for name, one in entries.items() if one.get("at_bound", False)}
    for value in free_values(model.model, bounded):
        low, high = bounded[value.parameter]
        held.append((value, STEP * (low + high - 2.0 * value.of(model))))
    return held


def _freed(
    value: Value,
    step: float,
    model: IdentifiedModel,
    records: Records,
    at: list[Sensitivity],
    sizes: Array,
) -> tuple[float, Array]:
    """Fit a value that is held too: its best one in its deviations, and the steps of the others.

    0 deviations where it has no effect of its own.
    """
    none = 0.0, np.zeros(sizes.size)
    other = moved(model, [value], np.array([step]))
    if other is None:
        return none
    known = [LinearisedRecord(model, data) for data, _ in records]
    extended = [
        _Linear(
            replace(one, columns=np.vstack([one.columns, of.begun(other) - of.begun(model)])),
            data,
            weight,
            np.append(sizes, 1.0),
        )
        for one, of, (data, weight) in zip(at, known, records, strict=True)
    ]
    precision = np.append(_precision(model, fitted_values(model)) * sizes**2, 0.0)
    matrix, determined, _, _, found, *_ = _core.linearised_covariance(
        [record.thinned(MOST) for record in extended], np.diag(precision).tolist(), 0, SEED
    )
    if not determined[-1]:
        return none
    return found[-1] / math.sqrt(matrix[-1][-1]), np.array(found[:-1])


def _precision(model: IdentifiedModel, values: list[Value]) -> Array:
    """Inverse squares of the widths of the priors, SI; 0 without one."""
    entries = entries_of(model)
    priors = [entries.get(value.parameter, {}).get("prior") for value in values]
    return np.array(
        [0.0 if prior is None else prior[1] ** -2 for prior in priors], dtype=np.float64
    )


class _Linear:
    """A record that is linearised, its values in shares of their size."""

    def __init__(
        self,
        linear: Sensitivity,
        data: Dataset,
        weight: float,
        sizes: Array,
        noise: Noise = "not repeated",
    ) -> None:
        self.columns, self.nuisance = linear.columns * sizes[:, None], linear.nuisance
        self.residual, self.weight = linear.residual, weight
        self.noise, self.shares = without_repeated(linear.residual, data)
        if noise == "residual":
            self.noise = linear.residual

    @property
    def samples(self) -> int:
        return self.residual.size

    def power_of(self, part: Literal["noise", "residual"]) -> float:
        """Weighted sum of squares of a part."""
        values = self.noise if part == "noise" else self.residual
        return self.weight * float(values @ values)

    def thinned(self, most: int) -> tuple[list[Array], list[Array], Array, Array, float]:
        """Means of neighbours, so many samples at most."""
        width = -(-self.samples // most)

        def means(signal: Array) -> Array:
            if width == 1:
                return signal
            whole = signal[: signal.size // width * width]
            return np.asarray(whole.reshape(-1, width).mean(axis=1))

        return (
            [means(column) for column in self.columns],
            [means(column) for column in self.nuisance],
            means(self.residual),
            means(self.noise),
            self.weight,
        )


def _period(data: Dataset) -> int | None:
    """Period of a drive that repeats, be it of several amplitudes."""
    period = period_of(data)
    if period is not None:
        return period
    u = data.u
    turns = _core.turns(u, 0.5 * float(np.ptp(u)))
    near = SAME_PERIOD * float(np.std(u))
    for turn in turns[2::2]:
        for after in (turn - turns[0] - 1, turn - turns[0], turn - turns[0] + 1):
            if after * PERIODS <= u.size and float(np.std(u[after:] - u[:-after])) <= near:
                return int(after)
    return None


def without_repeated(residual: Array, data: Dataset) -> tuple[Array, NoiseShares | None]:
    """Return the noise of a residual: what does not repeat with the drive; and both shares.

    Parameters
    ----------
    residual : ndarray, shape (n,)
        Measured less simulated displacement, of the readings that count [m].
    data : Dataset
        The record.

    Returns
    -------
    noise : ndarray, shape (n,)
        The noise [m]; all of the residual where there are fewer than three whole periods.
    shares : NoiseShares or None
        Model error and noise, where there are three or more.
    """
    period = _period(data)
    if period is None or residual.size != data.u.size:
        return residual, None
    count = residual.size // period
    if count < PERIODS:
        return residual, None
    last = residual[-count * period :].reshape(count, period)
    mean = last.mean(axis=0)
    phase = (np.arange(residual.size) - residual.size) % period
    noise = (residual - mean[phase]) * math.sqrt(count / (count - 1))
    power = float(np.mean(noise**2))
    repeated = max(float(np.mean(mean**2)) - power / count, 0.0)
    return noise, NoiseShares(model_error=math.sqrt(repeated), noise=math.sqrt(power))
