"""Parquet, written by pyarrow and by pandas."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt
from format_logs import T, U, Y, is_the_log, refusal, survives
from log_writers import parquet as parquet_log

if TYPE_CHECKING:
    from pathlib import Path

arrow: Any = pytest.importorskip("pyarrow")
parquet: Any = pytest.importorskip("pyarrow.parquet")


def write(path: Path, **options: Any) -> Path:
    table = arrow.table({"time_s": T, "voltage_V": U, "displacement_um": Y})
    parquet.write_table(table, path, **options)
    return path


def test_units_in_titles(tmp_path: Path) -> None:
    assert is_the_log(pt.read(write(tmp_path / "log.parquet")))
    assert is_the_log(pt.read(write(tmp_path / "log.pq", row_group_size=50, compression="gzip")))


def test_units_in_the_metadata_of_the_fields(tmp_path: Path) -> None:
    parquet_log(
        tmp_path / "log.parquet",
        {"time": (T, "s"), "voltage": (U, "V"), "displacement": (Y, "um")},
    )
    assert is_the_log(pt.read(tmp_path / "log.parquet"))


def test_a_frame_of_pandas_with_dates(tmp_path: Path) -> None:
    pd = pytest.importorskip("pandas")
    times = pd.Timestamp("2024-03-12T23:59:59.5", tz="Europe/Berlin") + pd.to_timedelta(T, "s")
    frame = pd.DataFrame({"time": times, "u_V": U, "x_um": Y, "state": "on"})
    frame.to_parquet(tmp_path / "log.parquet")
    log = pt.read(tmp_path / "log.parquet")
    assert is_the_log(log)
    assert dict(log.columns) == {}


def test_a_missing_sample_is_named(tmp_path: Path) -> None:
    values: list[float | None] = list(map(float, Y))
    values[7] = None
    table = arrow.table({"time_s": T, "voltage_V": U, "displacement_um": values, "gain": values})
    parquet.write_table(table, tmp_path / "log.parquet")
    assert "column 'displacement_um' is nan at sample 7" in refusal(tmp_path / "log.parquet")


def test_more_rows_than_the_file_can_hold_are_refused(tmp_path: Path) -> None:
    """A column of one value repeated says nothing of its length: a kilobyte for 100 million."""
    table = arrow.table({"time_s": np.zeros(20_000_000)})
    parquet.write_table(table, tmp_path / "log.parquet", compression="zstd")
    assert (tmp_path / "log.parquet").stat().st_size < 100_000
    assert "each column declares 160000000 bytes" in refusal(tmp_path / "log.parquet")


def test_a_file_that_is_cut_off_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "log.parquet")
    path.write_bytes(path.read_bytes()[:-30])
    assert "is not a sound Parquet file" in refusal(path)


def test_damaged_files_are_refused_in_a_sentence(tmp_path: Path) -> None:
    assert survives(write(tmp_path / "log.parquet")) > 20
