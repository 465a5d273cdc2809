"""Logs of many columns: each of them is backed by the file, and so is their sum."""

from __future__ import annotations

import tracemalloc
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt
from format_logs import refusal
from piezotrack.data.formats import source

if TYPE_CHECKING:
    from pathlib import Path

# 1.2 MB for a column, and what all of them may have where the file is small: a tenth of the
# bound itself, so that the files are written in a moment.
COUNT = 150_000
MOST = 10_000_000


@pytest.fixture(autouse=True)
def _lower_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(source, "BACKED", MOST)


def write(path: Path, columns: dict[str, Any]) -> Path:
    """A compressed file in one of three formats."""
    if path.suffix == ".npz":
        np.savez_compressed(path, **columns)
    elif path.suffix == ".mat":
        from scipy.io import savemat

        savemat(path, columns, do_compression=True)
    else:
        h5py = pytest.importorskip("h5py")
        with h5py.File(path, "w", libver="latest") as file:
            for name, values in columns.items():
                file.create_dataset(name, data=values, chunks=values.shape, compression=9)
    return path


def repeated() -> dict[str, Any]:
    """A log of 24 MB in a file of a thousandth of it; its times are not used."""
    nothing = np.zeros(COUNT)
    names = ("time_s", "voltage_V", "x_um", *(f"c{k}" for k in range(17)))
    return dict.fromkeys(names, nothing)


@pytest.mark.parametrize("ending", [".npz", ".h5"])
def test_further_columns_are_left_out_where_the_file_cannot_hold_them(
    tmp_path: Path, ending: str
) -> None:
    path = write(tmp_path / f"log{ending}", repeated())
    assert path.stat().st_size < MOST // 200
    tracemalloc.start()
    try:
        log = pt.read(path, dt=0.01)
        # Besides drive and displacement, and the times where they come first.
        assert MOST // (8 * COUNT) - len(log.columns) in (2, 3)
        assert any("further columns are left out" in note for note in log.notes)
        assert tracemalloc.get_traced_memory()[1] < 3 * MOST
        del log
        found = pt.data.info(path, dt=0.01)
        assert len(found.columns) == 20
        # One column after the other, and none of them kept.
        assert tracemalloc.get_traced_memory()[1] < 3 * MOST
    finally:
        tracemalloc.stop()


def test_variables_of_matlab_are_refused_together(tmp_path: Path) -> None:
    path = write(tmp_path / "log.mat", repeated())
    assert "the sum of the compressed variables" in refusal(path)


def test_the_columns_that_are_used_are_refused_together(tmp_path: Path) -> None:
    few = np.zeros(600_000)
    path = write(tmp_path / "log.npz", {"time_s": few, "voltage_V": few, "x_um": few})
    assert "the sum of the columns" in refusal(path)


@pytest.mark.parametrize("ending", [".npz", ".h5", ".mat"])
def test_many_columns_of_noise_are_all_read(tmp_path: Path, ending: str) -> None:
    """A tenth of what they are in memory is in the file."""
    rng = np.random.default_rng(1)
    names = ("voltage_V", "x_um", *(f"c{k}" for k in range(100)))
    columns = {name: rng.integers(-9, 9, size=15_000, dtype=np.int8) for name in names}
    assert 8 * 15_000 * len(names) > MOST
    log = pt.read(write(tmp_path / f"log{ending}", columns), dt=0.01)
    assert len(log.columns) == 100
    assert np.array_equal(log.columns["c99"], columns["c99"])
    assert log.notes == ()
