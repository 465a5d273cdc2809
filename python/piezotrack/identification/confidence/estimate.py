"""The covariance of what an identification fitted, from its records."""

from __future__ import annotations

import math
from dataclasses import replace
from statistics import NormalDist
from typing import TYPE_CHECKING, Any

import numpy as np

from ... import _core
from ...errors import PiezotrackError
from ..fitted.covariance import Covariance, NoiseShares
from ..solve.selection import period_of
from .sensitivity import DELAY, Value, fitted_values, moved, sensitivity

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...data.dataset import Dataset
    from ..fitted.estimates import Estimate
    from ..fitted.identification import Identification
    from .sensitivity import Sensitivity

    Array = NDArray[np.float64]

__all__ = ["covariance_of", "with_covariance"]

# Most samples of a record; of more, means of neighbours.
MOST, MOST_RESAMPLED = 2**16, 2**12
# Noises that are resampled, and the seed.
DRAWS, SEED = 199, 1
# Level at which intervals are widened, and fewest whole periods that tell noise from model error.
LEVEL, PERIODS = 0.95, 3


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
    try:
        covariance = covariance_of(fit)
    except PiezotrackError:
        covariance = None
    parameters = {
        name: estimate._replace(deviation=_deviation(fit, covariance, name, estimate))
        for name, estimate in fit.parameters.items()
    }
    entries = dict(fit.details.get("parameters", {}))
    for name, estimate in parameters.items():
        if name in entries:
            known = estimate.deviation is not None and math.isfinite(estimate.deviation)
            deviation = estimate.deviation if known else None
            entries[name] = {**entries[name], "standard_deviation": deviation}
    details: dict[str, Any] = {**fit.details, "parameters": entries}
    if DELAY in parameters and fit.details.get(DELAY):
        deviation = parameters[DELAY].deviation
        known = deviation is not None and math.isfinite(deviation)
        details[DELAY] = {**fit.details[DELAY], "standard_deviation": deviation if known else None}
    return replace(fit, covariance=covariance, parameters=parameters, details=details)


def _deviation(
    fit: Identification, covariance: Covariance | None, name: str, estimate: Estimate
) -> float | None:
    """Return the standard deviation of a parameter of a search."""
    if covariance is not None and name in covariance.names:
        return covariance.deviation(name)
    if estimate.tie is not None and covariance is not None:
        return covariance.reach(_gradient(fit, name), level=0.6826894921370859)
    # What a search found without effect, or between its own bounds alone, stays as it was.
    if estimate.free and covariance is not None and name not in (DELAY, *_sensor_names(fit)):
        return None if estimate.at_bound else estimate.deviation
    return estimate.deviation


def _sensor_names(fit: Identification) -> tuple[str, ...]:
    return tuple(fit.records[0].parameters)


def _gradient(fit: Identification, name: str) -> Array:
    """Change of a tied parameter with each value."""
    values, slopes = fitted_values(fit), []
    for value in values:
        size = 1e-4 * abs(value.of(fit))
        ends = [moved(fit, [value], np.array([way * size])) for way in (1.0, -1.0)]
        up, down = (math.nan if one is None else Value(name).of(one) for one in ends)
        slopes.append((up - down) / (2.0 * size) if size else 0.0)
    return np.asarray(np.nan_to_num(np.array(slopes, dtype=np.float64)))


def covariance_of(fit: Identification) -> Covariance | None:
    """Return the covariance of what was fitted; None where nothing was.

    Parameters
    ----------
    fit : Identification
        With its records.

    Returns
    -------
    Covariance or None
        Of the values of `fitted_values`.

    Raises
    ------
    DataError
        The records have too few samples.
    """
    values = fitted_values(fit)
    if not values:
        return None
    sizes = np.array([abs(value.of(fit)) or fit.data.dt for value in values])
    records = [
        _Linear(sensitivity(fit, one.data, values), one.data, one.weight, sizes)
        for one in fit.records
        if one.data is not None
    ]
    precision = np.diag(_precision(fit, values) * sizes**2).tolist()
    longest = max(record.samples for record in records)
    short = longest <= MOST_RESAMPLED
    found = _core.linearised_covariance(
        [record.thinned(MOST) for record in records], precision, DRAWS if short else 0, SEED
    )
    resampled = found[4]
    if not short:
        few = [record.thinned(MOST_RESAMPLED) for record in records]
        resampled = _core.linearised_covariance(few, precision, DRAWS, SEED)[4]
    quantiles = np.quantile(np.array(resampled), LEVEL, axis=0)
    return Covariance(
        names=tuple(str(value) for value in values),
        values=np.array([value.of(fit) for value in values]),
        matrix=np.array(found[0]) * np.outer(sizes, sizes),
        determined=np.array(found[1]),
        independent=np.sqrt(np.array(found[2])) * sizes,
        widening=np.maximum(quantiles / NormalDist().inv_cdf(0.5 + 0.5 * LEVEL), 1.0),
        shifts=np.array(found[3]) * sizes[:, None],
        samples=sum(record.samples for record in records),
        orders=tuple(found[5]),
        shares=records[0].shares,
    )


def _precision(fit: Identification, values: list[Value]) -> Array:
    """Inverse squares of the widths of the priors, SI; 0 without one."""
    priors = [fit.parameters[str(v)].prior if str(v) in fit.parameters else None for v in values]
    return np.array(
        [0.0 if prior is None else prior[1] ** -2 for prior in priors], dtype=np.float64
    )


class _Linear:
    """A record that is linearised, its values in shares of their size."""

    def __init__(self, linear: Sensitivity, data: Dataset, weight: float, sizes: Array) -> None:
        self.columns, self.nuisance = linear.columns * sizes[:, None], linear.nuisance
        self.residual, self.weight = linear.residual, weight
        self.noise, self.shares = _without_repeated(linear.residual, data)

    @property
    def samples(self) -> int:
        return self.residual.size

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


def _without_repeated(residual: Array, data: Dataset) -> tuple[Array, NoiseShares | None]:
    """Noise of a residual: what does not repeat with the drive; and both shares."""
    period = period_of(data)
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
