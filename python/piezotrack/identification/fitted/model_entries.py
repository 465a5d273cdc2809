"""Entries of model files: parameters, fit and origin, as they are written."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from ... import _core
from ..._support.units import of_drive
from ...errors import ParameterError
from .notes import drive_rate, fit_percent

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from ...data.dataset import Dataset
    from ...stages.inverse import InvertibleStage
    from ...stages.model_info import ModelInfo
    from .estimates import Constraint

__all__ = [
    "FORMAT",
    "SCHEMA_VERSION",
    "SENSOR",
    "constraint_entries",
    "drive_unit_of",
    "fit_entry",
    "origin_of",
    "parameter_entries",
    "provenance",
    "sensor_number",
]

FORMAT = "piezotrack-model"
SCHEMA_VERSION = 2
# Unit and limits of the numbers that go with a stage. What is beyond them is in another unit.
SENSOR: dict[str, tuple[str, Callable[[float], bool], str]] = {
    "offset": ("m", lambda value: abs(value) < 1.0, "a finite number between -1 and 1"),
    "stroke": ("m", lambda value: value > 0.0, "a finite number above 0"),
    "delay": ("s", lambda value: 0.0 <= value <= 1000.0, "a finite number from 0 to 1000"),
}


def parameter_entries(stage: InvertibleStage, drive: str) -> dict[str, dict[str, Any]]:
    """Entries of a file on the parameters of a stage.

    Parameters
    ----------
    stage : Stage
        The stage.
    drive : str
        Unit of its drive.

    Returns
    -------
    dict
        Value, unit and symbol of each parameter, by its name.
    """
    return {
        parameter.name: {
            "value": _plain(getattr(stage, parameter.name)),
            "unit": of_drive(parameter.unit, drive),
            "symbol": parameter.symbol,
        }
        for parameter in stage.info.parameters
    }


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value


def drive_unit_of(details: Mapping[str, Any], info: ModelInfo) -> str:
    """Return the unit of the drive of a model: that of its record, or else that of its class.

    Parameters
    ----------
    details : mapping
        Entries of its file.
    info : ModelInfo
        The model.

    Returns
    -------
    str
        ``"V"``, ``"N"`` or ``"m"``.
    """
    origin = details.get("provenance") or {}
    found = (origin.get("data") or {}).get("drive_unit")
    return info.drive_unit if found is None else str(found)


def constraint_entries(constraints: Iterable[Constraint]) -> dict[str, Any]:
    """Entries of a file on the inequalities of a fit; none where it had none.

    Parameters
    ----------
    constraints : iterable of Constraint
        The inequalities.

    Returns
    -------
    dict
        Of texts and truth values only.
    """
    found = [{"text": one.text, "active": one.active} for one in constraints]
    return {"constraints": found} if found else {}


def fit_entry(
    cost: float, data: Dataset, with_priors: float | None = None, spread: float | None = None
) -> dict[str, Any]:
    """Entries of a file on the residual of a fit.

    Parameters
    ----------
    cost : float
        Its root mean square [m].
    data : Dataset
        The record.
    with_priors : float or None, optional
        What was minimised, where there were priors [m].
    spread : float or None, optional
        Standard deviation of the measured displacement [m]; that of the record where not given.

    Returns
    -------
    dict
        Of numbers, texts and dicts only.
    """
    spread = float(data.y.std()) if spread is None else spread
    known = {} if with_priors is None else {"cost_with_priors": {"value": with_priors, "unit": "m"}}
    return {
        "cost": {"value": cost, "unit": "m"},
        **known,
        "fit_percent": {"value": fit_percent(cost, spread), "unit": "%"},
    }


def provenance(data: Dataset, **settings: Any) -> dict[str, Any]:
    """Entries of a file on the origin of a model: version, record and settings."""
    return {
        "package": "piezotrack",
        "version": _core.__version__,
        **settings,
        "data": origin_of(data),
    }


def origin_of(data: Dataset) -> dict[str, Any]:
    """Entries of a file on a record."""
    return {
        "source": data.source,
        "sha256": data.sha256,
        "samples": len(data),
        "warmup_samples": data.warmup,
        "window_s": [float(data.t[0]), float(data.t[-1])],
        "dt_s": data.dt,
        "drive_range": [float(data.full.u.min()), float(data.full.u.max())],
        "drive_rate": drive_rate(data.full.u, data.dt),
        "drive_unit": data.drive_unit,
        "hold": data.hold,
    }


def sensor_number(name: str, value: object) -> float:
    """Check a number of the sensor, when it is saved and when it is loaded.

    Parameters
    ----------
    name : {"offset", "stroke", "delay"}
        Which one.
    value : object
        Its value, SI.

    Returns
    -------
    float
        The value.

    Raises
    ------
    ParameterError
        It is no number that such a sensor can have.
    """
    unit, fits, expected = SENSOR[name]
    number = _core.as_number(name, value)
    if not (math.isfinite(number) and fits(number)):
        raise ParameterError(name, f"{number} {unit}", expected)
    return number
