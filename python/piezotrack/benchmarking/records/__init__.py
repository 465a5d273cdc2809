"""The records of the benchmark by name; each is made when it is first used."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..._support.messages import quoted
from ...errors import ParameterError
from ..record import BenchmarkRecord
from . import bouc_wen_benchmark, made_up, measured

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

__all__ = ["RECORDS", "records_named"]

RECORDS: dict[str, Callable[[], BenchmarkRecord]] = {
    **measured.RECORDS,
    **bouc_wen_benchmark.RECORDS,
    **made_up.RECORDS,
}


def records_named(records: Iterable[str | BenchmarkRecord] | None) -> list[BenchmarkRecord]:
    """Find records by name.

    Parameters
    ----------
    records : iterable of str or BenchmarkRecord, or None
        Names, and records as they are; None for all of the package.

    Returns
    -------
    list of BenchmarkRecord
        In this order.

    Raises
    ------
    ParameterError
        There is no such record, or two have one name.
    """
    wanted = list(RECORDS) if records is None else records
    if isinstance(wanted, (str, BenchmarkRecord)):
        wanted = [wanted]
    chosen: dict[str, BenchmarkRecord] = {}
    for name in wanted:
        if isinstance(name, BenchmarkRecord):
            record = name
        elif name in RECORDS:
            record = RECORDS[name]()
        else:
            raise ParameterError(
                "records",
                quoted(name),
                f"some of {', '.join(map(repr, RECORDS))}, or a pt.BenchmarkRecord",
                verb="has",
            )
        if record.name in chosen:
            raise ParameterError("records", f"{record.name} twice", "each name once", verb="has")
        chosen[record.name] = record
    if not chosen:
        raise ParameterError("records", "empty", "one or more")
    return list(chosen.values())
