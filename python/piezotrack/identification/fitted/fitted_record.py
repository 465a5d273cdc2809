"""Quantities of each of the records of an identification alone, in a result and in a file."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from ... import _core
from ..._support.files.json_text import object_of
from ...errors import ParameterError
from .drift import Drift, drift_entry, drift_of
from .start import Start, same_beginning, start_entry, start_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from ...data.dataset import Dataset
    from ...stages.motion import StageState
    from .estimates import Estimate

__all__ = ["FittedRecord", "record_entries", "record_of", "records_of_file"]


@dataclass(frozen=True, kw_only=True)
class FittedRecord:
    """One of the records that a model was identified from, and what it has of its own.

    Attributes
    ----------
    data : Dataset or None
        The record; None of a model that was read from a file.
    weight : float
        How much each of its samples counted beside those of the others.
    delay : float
        Delay of the displacement [s].
    offset : float
        Reading of the sensor at rest without drive [m].
    offset_fitted : bool
        Whether the offset was fitted.
    drift : Drift or None
        Drift of the sensor along the record.
    start : Start or None
        Where the record begins.
    cost : float
        RMS deviation in its window [m].
    stroke : float
        Stroke in its window [m].
    parameters : dict of str to Estimate
        The delay, the voltage before the record and the time constant of the drift, where they are
        searched or not 0. Empty of a model that was read from a file.
    origin : mapping
        Entries of the model file on the record: source, window, fingerprint, drive.
    """

    data: Dataset | None = field(default=None, repr=False)
    weight: float = 1.0
    delay: float = 0.0
    offset: float = 0.0
    offset_fitted: bool = True
    drift: Drift | None = None
    start: Start | None = field(default=None, repr=False)
    cost: float
    stroke: float
    parameters: Mapping[str, Estimate] = field(default_factory=dict, repr=False)
    origin: Mapping[str, Any] = field(default_factory=dict, repr=False)

    @property
    def cost_percent(self) -> float:
        """The cost in per cent of the record's stroke."""
        return 100.0 * self.cost / self.stroke


def record_of(records: Sequence[FittedRecord], data: Dataset) -> FittedRecord | None:
    """Return which of several records another one is, or is a window of.

    Parameters
    ----------
    records : sequence of FittedRecord
        The records identified.
    data : Dataset
        A record.

    Returns
    -------
    FittedRecord or None
        The one of the same numbers, else one of the same beginning, whose window overlaps if any
        does.
    """
    alike = [one for one in records if same_beginning(one.start, data)]
    if len(alike) < 2:
        return next(iter(alike), None)
    first, last = float(data.t[0]), float(data.t[-1])

    def apart(record: FittedRecord) -> tuple[bool, bool]:
        low, high = record.origin.get("window_s") or (first, last)
        return record.origin.get("sha256") != data.sha256, high < first or last < low

    return min(alike, key=apart)


def record_entries(records: Sequence[FittedRecord], unit: str) -> dict[str, Any]:
    """Entries of a model file on its records; none where there is one, whose are the model's.

    Parameters
    ----------
    records : sequence of FittedRecord
        The records identified.
    unit : str
        Unit of the drive.

    Returns
    -------
    dict
        Of numbers, texts, lists and dicts only.
    """
    if len(records) < 2:
        return {}
    entries = [
        {
            "weight": record.weight,
            "delay": {"value": record.delay, "unit": "s"},
            "offset": {"value": record.offset, "unit": "m", "fitted": record.offset_fitted},
            "cost": {"value": record.cost, "unit": "m"},
            "stroke": {"value": record.stroke, "unit": "m"},
            "start": start_entry(record.start, unit),
            **drift_entry(record.drift),
            "data": dict(record.origin),
        }
        for record in records
    ]
    return {"records": entries}


def records_of_file(entries: Any, state: type[StageState]) -> tuple[FittedRecord, ...]:
    """Read the records of a model file.

    Parameters
    ----------
    entries : Any
        The entries; None where there is one record, whose are the model's.
    state : type
        State of the model.

    Returns
    -------
    tuple of FittedRecord
        Without their data.

    Raises
    ------
    ParameterError
        The entries are not those of records.
    """
    if entries is None:
        return ()
    if not isinstance(entries, list):
        raise ParameterError("records", type(entries).__name__, "a list of records")
    return tuple(_record(f"records[{i}]", one, state) for i, one in enumerate(entries))


def _record(name: str, entry: Any, state: type[StageState]) -> FittedRecord:
    record = object_of(name, entry)

    def number(key: str, unit: str) -> float:
        value = record[key]
        if value.get("unit") != unit:
            raise ParameterError(
                f"the unit of {name}: {key}", f"{value.get('unit')!r}", f"{unit!r}"
            )
        return _core.as_number(f"{name}: {key}", value["value"])

    return FittedRecord(
        weight=_core.as_number(f"{name}: weight", record["weight"]),
        delay=number("delay", "s"),
        offset=number("offset", "m"),
        offset_fitted=_core.as_truth(f"{name}: offset fitted", record["offset"]["fitted"]),
        start=start_of(record["start"], state),
        drift=drift_of(record.get("drift")),
        cost=number("cost", "m"),
        stroke=number("stroke", "m"),
        origin=object_of(f"{name}: data", record["data"]),
    )
