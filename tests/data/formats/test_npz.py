"""NPZ and NPY, written by NumPy."""

from __future__ import annotations

import io
import zipfile
from typing import TYPE_CHECKING

import numpy as np
import pytest

import piezotrack as pt
from format_logs import DT, T, U, Y, is_the_log, refusal, survives
from log_writers import archive, npy_header

if TYPE_CHECKING:
    from pathlib import Path


def test_reads_what_numpy_saved(tmp_path: Path) -> None:
    path = tmp_path / "log.npz"
    np.savez(path, time_s=T, voltage_V=U, displacement_um=Y)
    assert is_the_log(pt.read(path))
    np.savez_compressed(path, time_s=T, voltage_V=U, displacement_um=Y)
    log = pt.read(path)
    assert is_the_log(log)
    assert log.source == "log.npz"


def test_units_are_not_guessed(tmp_path: Path) -> None:
    path = tmp_path / "log.npz"
    np.savez(path, time=T, voltage=U, displacement=Y)
    assert "column 'time' has no unit" in refusal(path)
    units: dict[str | int, str] = {"time": "s", "drive": "V", "displacement": "um"}
    assert is_the_log(pt.read(path, units=units))


def test_a_rate_with_its_unit_takes_the_place_of_the_time(tmp_path: Path) -> None:
    for name, value in (("fs_Hz", 200.0), ("sample_rate_kHz", 0.2), ("dt_ms", 5)):
        path = tmp_path / "log.npz"
        np.savez(path, **{"voltage_V": U, "displacement_um": Y, name: np.array(value)})
        log = pt.read(path)
        assert is_the_log(log)
        assert log.dt == pytest.approx(DT, rel=1e-15)
    np.savez(path, voltage_V=U, displacement_um=Y, fs=np.float64(200.0))
    assert "give the sampling interval with dt=" in refusal(path)


def test_the_interval_of_the_caller_comes_before_that_of_the_file(tmp_path: Path) -> None:
    path = tmp_path / "log.npz"
    np.savez(path, voltage_V=U, displacement_um=Y, fs_Hz=np.float64(200.0))
    assert pt.read(path, dt=0.1).dt == 0.1


def test_columns_of_a_matrix_are_numbered(tmp_path: Path) -> None:
    path = tmp_path / "log.npz"
    for matrix in (np.column_stack([T, U, Y]), np.vstack([T, U, Y])):
        np.savez(path, data=matrix)
        log = pt.read(
            path,
            time="data[0]",
            drive="data[1]",
            displacement=2,
            units={"time": "s", "drive": "V", "displacement": "um"},
        )
        assert is_the_log(log)


def test_a_structured_array_has_named_columns(tmp_path: Path) -> None:
    rows = np.zeros(T.size, dtype=[("time_s", "f8"), ("voltage_V", "f8"), ("x_um", "f8")])
    rows["time_s"], rows["voltage_V"], rows["x_um"] = T, U, Y
    np.save(tmp_path / "log.npy", rows)
    assert is_the_log(pt.read(tmp_path / "log.npy"))
    np.savez(tmp_path / "log.npz", rows=rows)
    assert is_the_log(pt.read(tmp_path / "log.npz"))


def test_an_array_alone_is_named_by_numbers(tmp_path: Path) -> None:
    np.save(tmp_path / "log.npy", np.column_stack([T, U, Y]))
    assert "name the columns by number" in refusal(tmp_path / "log.npy")
    log = pt.read(
        tmp_path / "log.npy", time=0, drive=1, displacement=2, units={0: "s", 1: "V", 2: "um"}
    )
    assert is_the_log(log)


def test_dates_are_seconds_from_the_first(tmp_path: Path) -> None:
    dates = np.datetime64("2024-03-12T23:59:59.5") + np.rint(1e9 * T).astype("timedelta64[ns]")
    np.savez(tmp_path / "log.npz", time_s=dates, voltage_V=U, displacement_um=Y)
    assert is_the_log(pt.read(tmp_path / "log.npz"))


def test_lengths_that_differ_are_named(tmp_path: Path) -> None:
    path = tmp_path / "log.npz"
    np.savez(path, time_s=T, voltage_V=U, displacement_um=Y[:-1], slow=np.arange(7.0))
    found = refusal(path)
    assert "'time_s' has 400 samples and column 'displacement_um' has 399" in found
    np.savez(path, time_s=T, voltage_V=U, displacement_um=Y, slow=np.arange(7.0))
    assert dict(pt.read(path).columns) == {}


def test_objects_are_never_unpickled(tmp_path: Path) -> None:
    path = tmp_path / "log.npz"
    things = np.array([{"a": 1}] * 3, dtype=object)
    np.savez(path, allow_pickle=True, time_s=T, voltage_V=things, displacement_um=Y)
    assert "'voltage_V'" not in refusal(path, drive="voltage_V").partition("the columns are")[2]


@pytest.mark.parametrize("count", ["10000000000", "400", "9" * 30, "-5"])
def test_an_array_that_lies_about_its_size_is_refused(tmp_path: Path, count: str) -> None:
    short = npy_header(f"({count},)") + T[:100].tobytes()
    found = refusal(archive(tmp_path / "log.npz", time_s=short))
    assert "array 'time_s'" in found
    assert f"declares {8 * int(count)} bytes: expected 800" in found or "shape (-5,)" in found
    (tmp_path / "log.npy").write_bytes(short)
    refusal(tmp_path / "log.npy")


def test_an_archive_that_expands_beyond_measure_is_refused(tmp_path: Path) -> None:
    zeros = bytes(1 << 20)
    path = tmp_path / "log.npz"
    with (
        zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file,
        file.open("time_s.npy", "w", force_zip64=True) as member,
    ):
        member.write(npy_header(f"({110 * (1 << 17)},)"))
        for _ in range(110):
            member.write(zeros)
    assert path.stat().st_size < 200_000
    found = refusal(path)
    assert "array 'time_s' declares 115343360 bytes" in found


def test_a_long_constant_signal_beside_a_measured_one_is_read(tmp_path: Path) -> None:
    """What compresses well is no lie where the rest of the file is as long."""
    count = 200_000
    y = np.random.default_rng(1).standard_normal(count)
    t = DT * np.arange(count)
    path = tmp_path / "log.npz"
    np.savez_compressed(path, time_s=t, voltage_V=np.zeros(count), displacement_um=y)
    assert len(pt.read(path)) == count


def test_an_entry_that_is_encrypted_or_no_array_is_refused(tmp_path: Path) -> None:
    assert "NPZ" in refusal(archive(tmp_path / "log.npz", time_s=b"not an array"))
    (tmp_path / "empty.npz").write_bytes(b"")
    assert refusal(tmp_path / "empty.npz") == "empty.npz: is empty: expected a log"
    path = archive(tmp_path / "none.npz")
    assert "no column of numbers" in refusal(path)


def test_damaged_files_are_refused_in_a_sentence(tmp_path: Path) -> None:
    content = io.BytesIO()
    np.savez_compressed(content, time_s=T, voltage_V=U, displacement_um=Y)
    path = tmp_path / "log.npz"
    path.write_bytes(content.getvalue())
    assert survives(path) > 30
