"""Parquet with pyarrow; units from the titles or from the metadata ``unit`` of a field."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

from ..apart import read_apart
from ..table import Channel, ChannelTable, Format

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from ..source import Source
    from ..table import WrittenColumn

__all__ = ["FORMAT"]

EXTRA = "parquet"
UNIT_NAMES = (b"unit", b"units")


@read_apart("pyarrow", EXTRA)
def _opens(source: Source) -> ChannelTable:
    parquet = source.library("pyarrow.parquet", EXTRA)
    types = source.library("pyarrow", EXTRA).types
    with source.decoding("Parquet"), parquet.ParquetFile(source.path) as file:
        rows = file.metadata.num_rows
        if rows < 0:
            raise source.error(f"declares {rows} rows: expected a number above 0")
        source.check_size("each column", 8 * rows)
        _check_groups(source, file.metadata)
        channels = []
        for field in file.schema_arrow:
            kind, names = field.type, field.metadata or {}
            number = types.is_integer(kind) or types.is_floating(kind) or types.is_boolean(kind)
            number = number or types.is_decimal(kind)
            if number or types.is_timestamp(kind) or types.is_duration(kind):
                unit = next((names[name].decode() for name in UNIT_NAMES if name in names), None)
                if unit is None and not number:
                    unit = "s"
                channels.append(
                    Channel(field.name, rows, partial(_read, source, field.name), unit=unit)
                )
    return ChannelTable(source, channels)


def _check_groups(source: Source, metadata: Any) -> None:
    """Refuse parts that are said to be larger than the file."""
    for number in range(metadata.num_row_groups):
        part = metadata.row_group(number)
        source.check_size(f"row group {number}", part.total_byte_size)
        source.check_size(f"row group {number}", 8 * part.num_rows)


def _read(source: Source, name: str) -> Any:
    parquet = source.library("pyarrow.parquet", EXTRA)
    with source.decoding("Parquet"), parquet.ParquetFile(source.path) as file:
        column = file.read(columns=[name], use_threads=False).column(name)
        if str(column.type).startswith("decimal"):
            column = column.cast("float64")
        # Nulls become NaN.
        return column.to_numpy()


def _writes(path: Path, columns: Sequence[WrittenColumn]) -> None:
    try:
        import pyarrow as arrow
        import pyarrow.parquet as parquet
    except ImportError:
        from ....errors import DataError

        raise DataError(
            f"{path.suffix} is written with pyarrow, which is not installed: expected "
            f"pip install 'piezotrack[{EXTRA}]'"
        ) from None
    fields = [
        arrow.field(column.title, arrow.float64(), metadata={"unit": column.unit})
        for column in columns
    ]
    arrays = [arrow.array(column.values) for column in columns]
    parquet.write_table(arrow.table(arrays, schema=arrow.schema(fields)), path)


FORMAT = Format(
    name="Parquet",
    endings=(".parquet", ".pq"),
    opens=_opens,
    begins=lambda head: head.startswith(b"PAR1"),
    writes=_writes,
)
