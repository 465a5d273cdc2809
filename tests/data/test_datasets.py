"""The measured logs that come with the package are those of their source, digit by digit."""

from __future__ import annotations

import gzip
import hashlib
import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

import piezotrack as pt
from folders import MEASURED
from piezotrack.data import datasets

if TYPE_CHECKING:
    from collections.abc import Callable

FOLDER = Path(datasets.__file__).parent
LOGS = {"dbo_training": datasets.dbo_training, "dbo_tracking": datasets.dbo_tracking}
# Of the text inside, as in the README beside the files.
SHA256 = {
    "dbo_training": "10074cbed70e4bbcb58cda7a756c8d4560df216e892f62a35f9d1a8e087889d3",
    "dbo_tracking": "fe71a47764ef51e7fa7d982ab782f58b912f7263a723a428e1b7c489daaf7929",
}

each_log = pytest.mark.parametrize("name", LOGS)


def text(name: str) -> bytes:
    return gzip.decompress((FOLDER / f"{name}.csv.gz").read_bytes())


@each_log
def test_the_text_is_that_of_the_readme(name: str) -> None:
    assert hashlib.sha256(text(name)).hexdigest() == SHA256[name]
    assert SHA256[name] in (FOLDER / "README.md").read_text(encoding="utf-8")


@each_log
def test_the_files_hold_no_name_and_no_time(name: str) -> None:
    # So that packing the same text again gives the same bytes.
    head = (FOLDER / f"{name}.csv.gz").read_bytes()[:10]
    flags, time = head[3], head[4:8]
    assert (flags, time) == (0, bytes(4))


@each_log
def test_the_text_is_that_of_the_source(name: str) -> None:
    path = MEASURED / f"{name.removeprefix('dbo_')}.csv"
    if not path.is_file():
        pytest.skip(f"the files they were made of are not in {MEASURED}")
    assert text(name) == path.read_bytes()


@each_log
def test_reading_the_text_gives_the_same(name: str, tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_bytes(text(name))
    read, log = pt.read(path), LOGS[name]()
    assert log.sha256 == read.sha256
    assert np.array_equal(log.t, read.t)
    assert dict(log.column_units) == dict(read.column_units)
    assert log.columns.keys() == read.columns.keys()
    for column, values in read.columns.items():
        assert np.array_equal(log.columns[column], values)


@pytest.mark.parametrize(
    ("load", "rows", "volts", "micrometres"),
    [
        (datasets.dbo_training, 8027, (0.0, 3.6), (-123.059139, -73.635739)),
        (datasets.dbo_tracking, 14155, (0.168871, 3.510374), (-121.662284, -75.702495)),
    ],
)
def test_rows_units_and_ranges(
    load: Callable[[], pt.Dataset],
    rows: int,
    volts: tuple[float, float],
    micrometres: tuple[float, float],
) -> None:
    log = load()
    assert len(log) == rows
    assert log.warmup == 0
    assert math.isclose(log.dt, 0.005, rel_tol=1e-12)
    assert log.t[0] == 0.0
    assert (log.u.min(), log.u.max()) == volts
    assert (log.y.min(), log.y.max()) == pytest.approx([1e-6 * y for y in micrometres], rel=1e-14)
    assert log.source == load.__name__


def test_the_reference_comes_along() -> None:
    assert not datasets.dbo_training().columns
    log = datasets.dbo_tracking()
    assert dict(log.column_units) == {"reference": "m"}
    reference = log.columns["reference"]
    assert (reference.min(), reference.max()) == (-20e-6, 20e-6)
    # Before row 7432 the drive is a straight line of it, 1.83 V + 0.0797 V/um.
    line = 1.83 + 0.0797e6 * reference
    assert np.abs(log.u - line)[:7432].max() < 1e-3
    assert np.abs(log.u - line)[7432:].max() > 0.1


def test_the_data_come_with_their_licence() -> None:
    licence = (FOLDER / "LICENSE").read_text(encoding="utf-8")
    assert licence.startswith("MIT License")
    assert "Yan Naing Aye" in licence
