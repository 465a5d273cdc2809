"""The records of a problem, each with what is fitted of it alone."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import KW_ONLY, dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ... import _core
from ..._support.arguments import has_entries
from ..._support.messages import quoted
from ...data.dataset import Dataset
from ...errors import ParameterError, PiezotrackError
from ..fitted.drift import time_constant
from ..fitted.start import checked_history
from .parameter import bounds_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from ..fitted.start import History

    Delay = bool | float | tuple[float, float] | None
    Drift = bool | float | None

__all__ = ["Record", "label_of", "labels_of", "of_record", "records_of"]


@dataclass(frozen=True, eq=False)
class Record:
    """A record for `identify`, with the arguments that are its own.

    Parameters
    ----------
    data : Dataset
        The record.
    offset : bool, optional
        Whether a constant offset of the displacement is fitted too.
    delay : bool, float or (float, float), optional
        Delay of the displacement with respect to the drive [s]: none (False), fitted (True), known
        (a number), or fitted between two bounds; see `identify` for where it is not given.
    drift : bool or float, optional
        Slow drift of the sensor along the record: none (False), with a time constant that the
        record shows (True), or with this one [s]; see `identify` for where it is not given.
    history : {"virgin", "settled", "fit", "rest"}, optional
        What the stage went through before the record; what the record shows where not given.
    weight : float, optional
        How much each of its samples counts beside those of the other records: only the ratios
        matter, and a weight of 2 is that record given twice.

    Raises
    ------
    ParameterError
        One is of another type, or a drift is fitted without an offset.

    Examples
    --------
    >>> import piezotrack as pt
    >>> log = pt.datasets.dbo_training()
    >>> pt.Record(log[3.0:23.0], delay=True).weight
    1.0
    """

    data: Dataset
    _: KW_ONLY
    offset: bool = True
    delay: Delay = None
    drift: Drift = None
    history: History | None = None
    weight: float = 1.0

    def __post_init__(self) -> None:
        if not isinstance(self.data, Dataset):
            raise ParameterError(
                "data",
                type(self.data).__name__,
                "a Dataset, as pt.read or pt.Dataset.from_frame make it",
            )
        checked_history(self.history)
        offset = _core.as_truth("offset", self.offset)
        drift = _drift_of(self.drift)
        if not offset and drift:
            raise ParameterError("drift", quoted(self.drift), "none with offset=False")
        object.__setattr__(self, "offset", offset)
        object.__setattr__(self, "drift", drift)
        object.__setattr__(self, "delay", _delay_of(self.delay))
        object.__setattr__(self, "weight", _core.as_number("weight", self.weight))

    @property
    def fits_delay(self) -> bool:
        """Whether the delay is fitted."""
        return self.delay is True or (
            isinstance(self.delay, tuple) and self.delay[0] < self.delay[1]
        )

    @property
    def fits_drift_time(self) -> bool:
        """Whether the time constant of a drift is fitted, where there is one."""
        return self.drift is None or self.drift is True


def _delay_of(delay: object) -> Delay:
    """Check the type of a delay."""
    if delay is None or isinstance(delay, (bool, np.bool_)):
        return None if delay is None else bool(delay)
    return bounds_of("delay", delay) if has_entries(delay) else _core.as_number("delay", delay)


def _drift_of(drift: object) -> Drift:
    """Check the type of a drift."""
    if drift is None or isinstance(drift, (bool, np.bool_)):
        return None if drift is None else bool(drift)
    return time_constant("drift", drift)


def records_of(
    data: object, *, offset: object, delay: object, drift: object, history: object
) -> tuple[Record, ...]:
    """Check the records of an identification.

    Parameters
    ----------
    data : object
        A Dataset or a Record, or several of them in a list.
    offset, delay, drift, history : object
        Values for each Dataset; a Record has its own.

    Returns
    -------
    tuple of Record
        At least one.

    Raises
    ------
    ParameterError
        No record, what is no record, records whose drives have different units, a value that cannot
        be used, or one that no Dataset takes.
    """
    given = [data] if isinstance(data, (Dataset, Record)) else _listed(data)
    values = {"offset": offset, "delay": delay, "drift": drift, "history": history}
    if all(isinstance(one, Record) for one in given):
        for name, value in values.items():
            if value is not None and not (name == "offset" and value is True):
                raise ParameterError(name, quoted(value), f"it in pt.Record, as {name}=")
    records = tuple(
        entry if isinstance(entry, Record) else Record(entry, **values)  # type: ignore[arg-type]
        for entry in given
    )
    records = tuple(_without_faulty_readings(one) for one in records)
    datasets = [one.data for one in records]
    for i, dataset in enumerate(datasets):
        if dataset.drive_unit != datasets[0].drive_unit:
            raise ParameterError(
                f"the drive of {label_of(dataset, i)}",
                f"in {dataset.drive_unit}",
                f"{datasets[0].drive_unit}, as that of {label_of(datasets[0], 0)}",
                argument="data",
            )
    return records


def _without_faulty_readings(record: Record) -> Record:
    """Leave single readings far off out of a record; the same record where there are none."""
    data = record.data.without_faulty_readings()
    return record if data is record.data else replace(record, data=data)


def _listed(data: object) -> list[Dataset | Record]:
    """Check that records are a list of at least one."""
    if not isinstance(data, (list, tuple)):
        raise ParameterError(
            "data",
            type(data).__name__,
            "a Dataset, as pt.read or pt.Dataset.from_frame make it, or several in a list",
        )
    if not data:
        raise ParameterError("data", "an empty list", "at least one Dataset")
    for i, entry in enumerate(data):
        if not isinstance(entry, (Dataset, Record)):
            raise ParameterError(
                "data",
                f"a {type(data).__name__} whose record {i + 1} is {type(entry).__name__}",
                "a Dataset, as pt.read or pt.Dataset.from_frame make it, or a pt.Record",
            )
    return list(data)


@contextmanager
def of_record(label: str) -> Iterator[None]:
    """Put the label of a record before the message of an error; nothing where it is the only one.

    Parameters
    ----------
    label : str
        How messages call the record.
    """
    try:
        yield
    except PiezotrackError as error:
        raise error.of(label) from None


def labels_of(records: Sequence[Record]) -> tuple[str, ...]:
    """Return how messages call each record; nothing where there is one."""
    if len(records) == 1:
        return ("",)
    return tuple(label_of(one.data, i) for i, one in enumerate(records))


def label_of(data: Dataset, i: int) -> str:
    """Return how messages call a record."""
    return f"record {i + 1}" + (f" ({data.source})" if data.source else "")
