"""Spreadsheets of Excel (.xlsx), with openpyxl: a table in each sheet."""

from __future__ import annotations

import datetime
import zipfile
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ...text_fields import are_titles
from ..table import Channel, ChannelTable, Format

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from ..source import Source

__all__ = ["FORMAT"]

ENDINGS = (".xlsx", ".xlsm")


def _opens(source: Source) -> ChannelTable:
    library = source.library("openpyxl", "xlsx")
    with source.decoding("XLSX"):
        with zipfile.ZipFile(source.path) as archive:
            total = sum(info.file_size for info in archive.infolist())
            source.check_size("the sum of the members", total)
        with source.opened() as file:
            book = library.load_workbook(file, read_only=True, data_only=True)
            sheets = {sheet.title: list(_rows(source, sheet)) for sheet in book.worksheets}
    filled = {name: rows for name, rows in sheets.items() if len(rows) > 1}
    titled = all(_has_titles(rows[0]) for rows in filled.values())
    channels = [
        channel
        for name, rows in filled.items()
        for channel in _channels(rows, name if len(filled) > 1 else "", titled=titled)
    ]
    return ChannelTable(source, channels, titled=titled)


def _rows(source: Source, sheet: Any) -> Iterator[tuple[Any, ...]]:
    """Yield the rows that hold something, without those that are skipped."""
    for row in sheet.iter_rows(min_row=source.skip + 1, values_only=True):
        if any(cell is not None for cell in row):
            yield row


def _has_titles(row: Sequence[Any]) -> bool:
    return are_titles(["" if cell is None else str(cell) for cell in row if cell is not None])


def _channels(rows: list[tuple[Any, ...]], group: str, *, titled: bool) -> Iterator[Channel]:
    body = rows[1:] if titled else rows
    for k, title in enumerate(rows[0]):
        if titled and title is None:
            continue
        values = [row[k] if k < len(row) else None for row in body]
        name = " ".join(str(title).split()) if titled else ""
        yield Channel(name, len(values), partial(_values, values), group)


def _values(cells: list[Any]) -> Any:
    """Return numbers or instants; an empty cell is NaN, and so is a text among numbers."""
    if any(isinstance(cell, datetime.datetime) for cell in cells):
        return np.array(
            [cell if isinstance(cell, datetime.datetime) else None for cell in cells],
            dtype="datetime64[us]",
        )
    numbers = [isinstance(cell, (int, float)) and not isinstance(cell, bool) for cell in cells]
    if not any(numbers) and any(cell is not None for cell in cells):
        return np.array([str(cell) for cell in cells])
    return np.array(
        [cell if fits else np.nan for cell, fits in zip(cells, numbers, strict=True)],
        dtype=np.float64,
    )


def _begins(head: bytes) -> bool:
    parts = (b"xl/", b"[Content_Types].xml", b"docProps/")
    return head.startswith(b"PK\x03\x04") and any(part in head[30:4000] for part in parts)


FORMAT = Format(name="XLSX", endings=ENDINGS, opens=_opens, begins=_begins)
