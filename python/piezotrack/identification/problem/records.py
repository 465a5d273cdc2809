"""The records of an identification, each with what is asked of it alone."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

from ... import _core
from ..._support.messages import quoted
from ...data.dataset import Dataset
from ...errors import ParameterError, PiezotrackError
from ..fitted.start import checked_history

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from ..fitted.start import History

__all__ = ["Asked", "Own", "asked_of", "of_record"]


@dataclass(frozen=True, kw_only=True)
class Asked:
    """A record, and what is asked of it alone.

    Attributes
    ----------
    data : Dataset
        The record.
    offset : bool
        Whether an offset of the sensor is fitted.
    history : {"virgin", "settled", "fit"} or None
        What the stage went through before; None for what the record shows.
    delay : object
        As for `identify`, not yet checked.
    weight : float
        How much each of its samples counts beside those of the others.
    label : str
        How messages call it; empty where it is the only one.
    drift : object
        As for `identify`, not yet checked.
    """

    data: Dataset
    offset: bool = True
    history: History | None = None
    delay: object = None
    drift: object = None
    weight: float = 1.0
    label: str = ""


class Own(NamedTuple):
    """Arguments of `identify` that each record may have of its own, not yet checked."""

    offset: object
    history: object
    delay: object
    weights: object
    drift: object = None


def asked_of(data: object, own: Own) -> tuple[Asked, ...]:
    """Check the records of an identification, and what is asked of each alone.

    Parameters
    ----------
    data : object
        A Dataset, or several in a list.
    own : Own
        A value for all records, or a list with one for each.

    Returns
    -------
    tuple of Asked
        At least one.

    Raises
    ------
    ParameterError
        No record, what is no record, records whose drives have different units, a list of another
        length, or a value that cannot be used.
    """
    if isinstance(data, Dataset):
        if own.weights is not None:
            raise ParameterError(
                f"weights is {quoted(own.weights)}: expected none with one record, as it is beside "
                "others that a weight counts"
            )
        history, offset = checked_history(own.history), _core.as_truth("offset", own.offset)
        one = Asked(data=data, offset=offset, history=history, delay=own.delay, drift=own.drift)
        return (one,)
    records = _records(data)
    count = len(records)
    offsets, histories = _each("offset", own.offset, count), _each("history", own.history, count)
    delays, weights = _each("delay", own.delay, count), _each("weights", own.weights, count)
    drifts = _each("drift", own.drift, count)
    asked = []
    for i, record in enumerate(records):
        label = _label(record, i) if count > 1 else ""
        with of_record(label):
            weight = 1.0 if weights[i] is None else _core.as_number("weight", weights[i])
            history = checked_history(histories[i])
            offset = _core.as_truth("offset", offsets[i])
        asked.append(
            Asked(
                data=record,
                offset=offset,
                history=history,
                delay=delays[i],
                drift=drifts[i],
                weight=weight,
                label=label,
            )
        )
    return tuple(asked)


def _records(data: object) -> list[Dataset]:
    """Check that records are a list of at least one, with drives in one unit."""
    if not isinstance(data, (list, tuple)):
        raise ParameterError(
            f"data is {type(data).__name__}: expected a Dataset, as pt.read "
            "or pt.Dataset.from_frame make it, or several in a list"
        )
    if not data:
        raise ParameterError("data is an empty list: expected at least one Dataset")
    for i, record in enumerate(data):
        if not isinstance(record, Dataset):
            raise ParameterError(
                f"data is a {type(data).__name__} whose record {i + 1} is "
                f"{type(record).__name__}: expected a Dataset, as pt.read or "
                "pt.Dataset.from_frame make it"
            )
        if record.drive_unit != data[0].drive_unit:
            raise ParameterError(
                f"the drive of {_label(record, i)} is in {record.drive_unit}: expected "
                f"{data[0].drive_unit}, as that of {_label(data[0], 0)}"
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
        if not label:
            raise
        raise type(error)(f"{label}: {error}") from None


def _label(record: Dataset, i: int) -> str:
    """How messages call a record."""
    return f"record {i + 1}" + (f" ({record.source})" if record.source else "")


def _each(name: str, value: object, count: int) -> Sequence[Any]:
    """Return the value of an argument for each record: a list has one for each."""
    if not isinstance(value, list):
        if name == "weights" and isinstance(value, tuple):
            return _each(name, list(value), count)
        return [value] * count
    if len(value) != count:
        raise ParameterError(
            f"{name} has {len(value)} entries: expected {count}, one for each record"
        )
    return value
