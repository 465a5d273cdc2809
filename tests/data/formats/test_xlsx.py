"""Spreadsheets, and files that are known for what they are."""

from __future__ import annotations

import datetime
import gzip
import pickle
import zipfile
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt
from format_logs import T, U, Y, damaged, is_the_log, refusal

if TYPE_CHECKING:
    from pathlib import Path

openpyxl: Any = pytest.importorskip("openpyxl")
TITLES = ("Time (s)", "voltage [V]", "x_um")


def write(path: Path, rows: list[tuple[Any, ...]], *, sheets: tuple[str, ...] = ("log",)) -> Path:
    book = openpyxl.Workbook()
    book.remove(book.active)
    for name in sheets:
        sheet = book.create_sheet(name)
        for row in rows:
            sheet.append(row)
    book.save(path)
    return path


def samples() -> list[tuple[Any, ...]]:
    return list(zip(T.tolist(), U.tolist(), Y.tolist(), strict=True))


def test_a_sheet_is_a_log(tmp_path: Path) -> None:
    log = pt.read(write(tmp_path / "log.xlsx", [TITLES, *samples()]))
    assert is_the_log(log, tolerance=1e-9)
    # The ending does not matter.
    (tmp_path / "log.xlsx").rename(tmp_path / "log.dat")
    assert is_the_log(pt.read(tmp_path / "log.dat"), tolerance=1e-9)
    assert pt.data.info(tmp_path / "log.dat").format == "XLSX"


def test_rows_above_are_skipped_and_empty_ones_left_out(tmp_path: Path) -> None:
    rows = [("Measured by", "A. Nother"), (), TITLES, (), *samples(), (None, None, None)]
    path = write(tmp_path / "log.xlsx", rows)
    refusal(path)
    assert is_the_log(pt.read(path, skip=2), tolerance=1e-9)


def test_sheets_are_groups(tmp_path: Path) -> None:
    path = write(tmp_path / "log.xlsx", [TITLES, *samples()], sheets=("up", "down"))
    assert "'up/voltage [V]'" in refusal(path)
    log = pt.read(path, drive="down/voltage", displacement="down/x_um")
    assert is_the_log(log, tolerance=1e-9)


def test_times_may_be_dates_and_cells_text_or_empty(tmp_path: Path) -> None:
    start = datetime.datetime(2024, 3, 12, 10)
    rows: list[tuple[Any, ...]] = [
        (start + datetime.timedelta(seconds=k), 10.0 * k, 1.5 * k, "ok", None if k == 2 else 1)
        for k in range(20)
    ]
    path = write(tmp_path / "log.xlsx", [("time", "voltage_V", "x_um", "state", "flag"), *rows])
    log = pt.read(path, units={"time": "s"})
    assert log.dt == pytest.approx(1.0)
    assert np.array_equal(log.u, 10.0 * np.arange(20))
    assert np.isnan(log.columns["flag"][2])
    # A missing reading is named, and can be filled.
    rows[5] = (rows[5][0], None, *rows[5][2:])
    write(path, [("time", "voltage_V", "x_um", "state", "flag"), *rows])
    assert "sample 5" in refusal(path, units={"time": "s"})
    assert pt.read(path, units={"time": "s"}, missing="fill").u[5] == pytest.approx(50.0)


def test_without_titles_columns_have_numbers(tmp_path: Path) -> None:
    path = write(tmp_path / "log.xlsx", samples())
    assert "name the columns by number" in refusal(path)
    given: dict[str, Any] = {
        "time": 0,
        "drive": 1,
        "displacement": 2,
        "units": {0: "s", 1: "V", 2: "um"},
    }
    assert is_the_log(pt.read(path, **given), tolerance=1e-9)


def test_a_damaged_sheet_is_refused_in_a_sentence(tmp_path: Path) -> None:
    content = write(tmp_path / "log.xlsx", [TITLES, *samples()[:30]]).read_bytes()
    path = tmp_path / "damaged.xlsx"
    for part in damaged(content, 1)[::4]:
        path.write_bytes(part)
        # It is read, or refused in a sentence.
        with suppress(pt.PiezotrackError):
            assert pt.read(path).u.size


def test_a_sheet_that_expands_beyond_measure_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "log.xlsx", [TITLES, *samples()])
    with zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("xl/worksheets/sheet9.xml", bytes(110_000_000))
    assert "bytes" in refusal(path)


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("log.pkl", pickle.dumps({"u": [1.0, 2.0]}), "is a pickle of Python"),
        ("log.feather", b"ARROW1\0\0" + bytes(50), "is a feather file"),
        ("log.csv.gz", gzip.compress(b"time_s,voltage_V,x_um\n", mtime=0), "is compressed by gzip"),
        ("log.xls", b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(50), "a spreadsheet of an old"),
        ("log.csv", b"%PDF-1.7\n", "is a PDF"),
    ],
    ids=("pickle", "feather", "gzip", "xls", "pdf"),
)
def test_what_is_no_log_is_named(tmp_path: Path, name: str, content: bytes, words: str) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    said = refusal(path)
    assert words in said
    assert "expected" in said


def test_archives_are_named(tmp_path: Path) -> None:
    path = tmp_path / "logs.zip"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("log.csv", "time_s,voltage_V,x_um\n")
    assert "is a zip archive: expected the log in it, unpacked" in refusal(path)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("mimetype", "application/vnd.oasis.opendocument.spreadsheet")
    assert "(.ods)" in refusal(path)


def test_hdf5_called_mat_is_read_and_said(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "log.mat"
    with h5py.File(path, "w") as file:
        for name, values in (("time_s", T), ("voltage_V", U), ("x_um", Y)):
            file[name] = values
    log = pt.read(path)
    assert is_the_log(log, tolerance=1e-12)
    assert any("HDF5 without MATLAB's header" in note for note in log.notes)
