"""The band of a prediction, from the covariance of a fit and its errors where it was not fitted."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..._support.arguments import expect
from ..._support.arrays import check_dt, signal_of
from ..._support.statistics import sample_noise
from ...data.checks.diagnostics import amplitudes
from ...data.dataset import Dataset
from ...errors import ParameterError, ShapeError
from ..fitted.certainty.covariance import normal_reach
from ..fitted.certainty.prediction_band import PredictionBand
from ..fitted.identified_model import IdentifiedModel
from ..linearised.sensitivity import changes, sensitivity
from ..linearised.values import fitted_values
from .estimate import covariance_of
from .held_out import held_out

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from ..fitted.certainty.covariance import Covariance
    from ..linearised.sensitivity import Sensitivity

    Array = NDArray[np.float64]

__all__ = ["prediction_band"]

# Fewest samples of a drive.
FEWEST = 8


def prediction_band(
    model: IdentifiedModel,
    u: ArrayLike | Dataset,
    dt: float | None = None,
    *,
    level: float = 0.95,
    records: Sequence[Dataset] | None = None,
) -> PredictionBand:
    """Predict the displacement under a drive with its band, see `IdentifiedModel.prediction_band`.

    Parameters
    ----------
    model : IdentifiedModel
        The model.
    u : array_like, shape (n,), or Dataset
        The drive [V], or a record.
    dt : float, optional
        Sampling interval [s], of a drive that is no record.
    level : float, optional
        Probability.
    records : sequence of Dataset, optional
        Records on which the errors are found.

    Returns
    -------
    PredictionBand
        The displacement and its band.

    Raises
    ------
    ParameterError, ShapeError, DataError
        As of the method.
    """
    expect("model", model, IdentifiedModel, "a pt.IdentifiedModel")
    normal = normal_reach(level)
    pairs = _records(model, records)
    values = fitted_values(model)
    linear = [
        sensitivity(model, data, values) if values and model._fitted_share(data) > 0.0 else None
        for data, _ in pairs
    ]
    errors = held_out(model, pairs, linear)
    covariance = model.covariance
    if covariance is None and values:
        covariance = covariance_of(model, pairs)
    if isinstance(u, Dataset):
        known = [at for (data, _), at in zip(pairs, linear, strict=True) if data is u and at]
        of = _of_record(model, u, known[0] if known else sensitivity(model, u, values))
    else:
        of = _of_drive(model, u, dt)
    rate = np.abs(np.gradient(of.u, of.t))
    widths = errors.at(amplitudes(of.u), rate, level, _noise(model, pairs))
    reach = 0.0 if covariance is None else normal * _deviations(covariance, of.columns)
    return PredictionBand(
        t=of.t,
        u=of.u,
        x=of.x,
        level=float(level),
        noise=widths.noise,
        parameters=np.broadcast_to(reach, of.x.shape),
        model_error=widths.model_error,
        unlike=widths.unlike,
        cycles=errors.cycles(),
        measured=of.measured,
        drive_unit=model.drive_unit,
    )


class _Motion(NamedTuple):
    """Displacement under a drive, and its change with each value that was fitted (p, n)."""

    t: Array
    u: Array
    x: Array
    columns: Array
    measured: Array | None = None


def _records(
    model: IdentifiedModel, records: Sequence[Dataset] | None
) -> list[tuple[Dataset, float]]:
    """Return the records on which errors are found, with their weights."""
    if records is None:
        pairs = [(one.data, one.weight) for one in model.records if one.data is not None]
        if not pairs:
            raise ParameterError(
                "records", "none", "records of the stage, as a model from a file has none"
            )
        return pairs
    if isinstance(records, Dataset):
        raise ParameterError("records", "one Dataset", "a list of records, as [log]")
    for i, one in enumerate(records):
        expect(f"records[{i}]", one, Dataset, "a Dataset")
        if one.drive_unit != model.drive_unit:
            raise ParameterError(
                f"records[{i}]",
                f"a drive in {one.drive_unit}",
                f"one in {model.drive_unit}, as that of the model",
                verb="has",
            )
    if not records:
        raise ParameterError("records", "an empty list", "one record or more")
    return [(one, 1.0) for one in records]


def _of_drive(model: IdentifiedModel, u: ArrayLike, dt: float | None) -> _Motion:
    """Motion from rest under a drive."""
    drive = signal_of("u", u)
    if drive.size < FEWEST:
        raise ShapeError("u", f"{drive.size} samples", f"{FEWEST} or more", verb="has")
    if dt is None:
        raise ParameterError("dt", "None", "the sampling interval of u [s]")
    interval = check_dt(dt)

    def motion(near: IdentifiedModel) -> Array:
        return near.displacement(drive, interval)

    return _Motion(
        t=np.asarray(interval * np.arange(drive.size), dtype=np.float64),
        u=drive,
        x=motion(model),
        columns=changes(model, fitted_values(model), motion, interval),
    )


def _of_record(model: IdentifiedModel, data: Dataset, linear: Sensitivity) -> _Motion:
    """Motion on a record, whose offset and drift follow from its readings."""
    data = data.without_faulty_readings()
    basis = linear.nuisance.T
    columns = linear.columns.T
    columns = columns - basis @ np.linalg.lstsq(basis, columns, rcond=1e-12)[0]
    # Between the readings that count the change is interpolated.
    t, counted = data.t, data.counted(data.t)
    return _Motion(
        t=t,
        u=data.u,
        x=model.simulate(data).x,
        columns=np.array([np.interp(t, counted, one) for one in columns.T]),
        measured=data.y if data.left_out is None else np.where(data.left_out, np.nan, data.y),
    )


def _deviations(covariance: Covariance, columns: Array) -> Array:
    """Return standard deviations of a displacement for the covariance of the values (n,) [m].

    In the directions that have no effect on the records a value is known to within its own size.
    """
    unknown = np.sum((covariance.hidden @ columns) ** 2, axis=0)
    spread = np.sqrt(covariance.spread(columns) ** 2 + unknown)
    return np.asarray(spread + np.abs(covariance.to_least_cost @ columns))


def _noise(model: IdentifiedModel, pairs: list[tuple[Dataset, float]]) -> float:
    """Noise of the records: what does not repeat, or else from sample to sample [m]."""
    shares = None if model.covariance is None else model.covariance.shares
    if shares is not None:
        return shares.noise
    noises = [sample_noise(data.counted(data.y - model.simulate(data).x)) for data, _ in pairs]
    return float(np.sqrt(np.mean(np.square(noises))))
