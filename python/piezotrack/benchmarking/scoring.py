"""One result: a contender fitted to a record, and judged on all of its parts."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import _core
from ..errors import PiezotrackError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..data.dataset import Dataset
    from .contender import Contender, Fitted
    from .record import BenchmarkRecord

    Array = NDArray[np.float64]

__all__ = ["FORMAT", "SCHEMA_VERSION", "result_of"]

FORMAT = "piezotrack-benchmark-result"
SCHEMA_VERSION = 1
# A displacement that an inverse is asked for is smoothed above so many times the drive's mean
# frequency, where that is below this share of the sampling rate.
SMOOTHED, HIGHEST = 15.0, 0.4


def result_of(contender: Contender, record: BenchmarkRecord) -> dict[str, Any]:
    """Fit a contender to a record, and judge it.

    Parameters
    ----------
    contender : Contender
        What fits.
    record : BenchmarkRecord
        The record.

    Returns
    -------
    dict
        Content of the result's file. Where the model does not suit the record, ``error`` has the
        sentence, and there are no figures.
    """
    document: dict[str, Any] = {
        "format": FORMAT,
        "schema_version": SCHEMA_VERSION,
        "version": _core.__version__,
        "record": record.document(),
        "model": {"name": contender.name, "title": contender.title},
        "error": None,
    }
    began = time.perf_counter()
    try:
        fitted = contender.fit(record.fitted)
        seconds = time.perf_counter() - began
        return document | _figures(fitted, record, seconds)
    except PiezotrackError as error:
        return document | {"error": str(error), "seconds": time.perf_counter() - began}


def _figures(fitted: Fitted, record: BenchmarkRecord, seconds: float) -> dict[str, Any]:
    parts, carried = [], 0.0
    for name, data in record.parts():
        error = data.y - fitted.predict(data)
        if record.own_offsets:
            if data is not record.rest:
                offset = float(np.mean(error))
            if data is record.fitted:
                carried = offset
            error = error - (carried if data is record.rest else offset)
        rms = float(np.sqrt(np.mean(error**2)))
        parts.append(
            {
                "part": name,
                "rms_m": rms,
                "max_error_m": float(np.abs(error).max()),
                "rms_percent": 100.0 * rms / record.fitted.stroke,
            }
        )
    return {
        "seconds": seconds,
        "values": fitted.values,
        "chosen": fitted.chosen,
        "parts": parts,
        "inverse": _inverse(fitted, record),
        "parameters": _against_truth(fitted, record),
    }


def _against_truth(fitted: Fitted, record: BenchmarkRecord) -> dict[str, Any]:
    """Parameters beside those of the stage that made the record."""
    parameters = fitted.parameters
    if not record.truth or not record.truth.keys() <= parameters.keys():
        return {}
    return {
        name: {
            "true": true,
            "found": parameters[name],
            "percent": 100.0 * (parameters[name] / true - 1.0),
        }
        for name, true in record.truth.items()
    }


def _inverse(fitted: Fitted, record: BenchmarkRecord) -> dict[str, Any]:
    """Judge the inverse on a part that was not fitted, where there is one."""
    name, data = next(iter(record.others.items()), ("rest", record.rest))
    if data is None:
        name, data = "fitted", record.fitted
    wanted = _smoothed(data)
    try:
        inverse = fitted.invert(data, wanted)
    except PiezotrackError as error:
        return {"part": name, "error": str(error)}
    if inverse is None:
        return {"part": name, "error": "it has no inverse"}
    u, x = (values[data.warmup :] for values in inverse)
    there, away = x - wanted[data.warmup :], u - data.u
    if record.own_offsets:
        away = away - np.mean(away)
    rms = float(np.sqrt(np.mean(away**2)))
    return {
        "part": name,
        "error": None,
        "drive_rms": rms,
        "drive_percent": 100.0 * rms / float(np.ptp(data.u)),
        "identity_rms_m": float(np.std(there)),
    }


def _smoothed(data: Dataset) -> Array:
    """Measured displacement from the first sample on, with the sensor's noise filtered out."""
    from scipy.signal import butter, sosfiltfilt

    full = data.full
    speed = np.diff(full.u) / full.dt
    frequency = float(np.std(speed) / np.std(full.u)) / (2.0 * np.pi)
    share = SMOOTHED * frequency * full.dt
    if not 0.0 < share < HIGHEST or len(full) < 100:
        return full.y
    smooth: Array = sosfiltfilt(butter(4, 2.0 * share, output="sos"), full.y)
    return smooth
