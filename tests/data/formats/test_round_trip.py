"""What `Dataset.save` writes is read back to the last bit."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

import piezotrack as pt
from piezotrack.data.formats import FORMATS

if TYPE_CHECKING:
    from pathlib import Path

ENDINGS = ["csv", "npz", "mat", "parquet"]
RNG = np.random.default_rng(5)


def record(drive_unit: str = "V") -> pt.Dataset:
    n = 300
    return pt.Dataset(
        u=RNG.standard_normal(n) * 10.0 ** RNG.integers(-3, 2, n),
        y=1e-5 * RNG.standard_normal(n),
        t=0.1 + np.arange(n) / 3.0,
        drive_unit=drive_unit,
        columns={
            "temperature (room)": RNG.standard_normal(n),
            "reference_um": np.where(np.arange(n) % 7, 1e-6 / 3.0, np.nan),
            "gain/um": RNG.standard_normal(n),
            "y": RNG.standard_normal(n),
            'a, "quoted" name': RNG.standard_normal(n),
        },
        column_units={"temperature (room)": "K", "reference_um": "m"},
    )


@pytest.fixture(autouse=True)
def _has_pyarrow(request: pytest.FixtureRequest) -> None:
    if "parquet" in request.node.name:
        pytest.importorskip("pyarrow")


@pytest.mark.parametrize("drive_unit", ["V", "m"])
@pytest.mark.parametrize("ending", ENDINGS)
def test_every_number_comes_back(tmp_path: Path, ending: str, drive_unit: str) -> None:
    log = record(drive_unit)
    path = log.save(tmp_path / f"log.{ending}")
    again = pt.read(path)
    assert again.drive_unit == drive_unit
    assert np.array_equal(again.t, log.t)
    assert np.array_equal(again.u, log.u)
    assert np.array_equal(again.y, log.y)
    assert again.notes == ()
    pairs = list(zip(log.columns.items(), again.columns.items(), strict=True))
    assert all(np.array_equal(a, b, equal_nan=True) for (_, a), (_, b) in pairs)
    assert list(again.column_units.values()) == list(log.column_units.values())
    if ending != "mat":
        names = [name if name != "y" else "column y" for name in log.columns]
        assert list(again.columns) == names


@pytest.mark.parametrize("ending", ENDINGS)
def test_the_same_log_is_the_same_file(tmp_path: Path, ending: str) -> None:
    log = record()
    first = log.save(tmp_path / f"a.{ending}").read_bytes()
    assert log.save(str(tmp_path / f"b.{ending}")).read_bytes() == first


def test_the_window_is_written_without_its_warm_up(tmp_path: Path) -> None:
    log = record()[10.0:50.0]
    again = pt.read(log.save(tmp_path / "log.npz"))
    assert np.array_equal(again.u, log.u)
    assert len(pt.read(log.full.save(tmp_path / "log.npz"))) == len(log) + log.warmup


def test_matlab_takes_the_names(tmp_path: Path) -> None:
    from scipy.io import whosmat

    names = [name for name, _, _ in whosmat(record().save(tmp_path / "log.mat"))]
    assert all(name.isidentifier() and name.isascii() for name in names)
    assert names[:3] == ["time", "voltage", "displacement"]


def test_an_ending_that_is_not_written_is_refused(tmp_path: Path) -> None:
    for name in ("log.h5", "log", "log.xlsx"):
        with pytest.raises(pt.ParameterError, match=rf"^{name}: .*: \.npz, \.mat, \.parquet"):
            record().save(tmp_path / name)
    with pytest.raises(pt.ParameterError, match="path is None"):
        record().save(None)  # type: ignore[arg-type]
    assert not any(tmp_path.iterdir())


def test_a_folder_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(pt.DataError, match="cannot be written"):
        record().save(tmp_path / "gone" / "log.npz")


def test_every_format_that_is_written_is_tested() -> None:
    assert sorted(known.endings[0] for known in FORMATS if known.writes) == sorted(
        f".{ending}" for ending in ENDINGS
    )


def test_no_two_formats_have_an_ending_in_common() -> None:
    endings = [ending for known in FORMATS for ending in known.endings]
    assert len(set(endings)) == len(endings)
    assert all(ending == ending.lower() and ending.startswith(".") for ending in endings)
