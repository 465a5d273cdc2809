"""GCS arrays as PI's controllers write them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

import piezotrack as pt
from format_logs import DT, U, Y, is_the_log, refusal
from log_writers import gcs

if TYPE_CHECKING:
    from pathlib import Path

GIVEN: dict[str, Any] = {
    "drive": "control voltage of piezo 1",
    "displacement": 1,
    "units": {"drive": "V", 1: "um"},
}


NAMED = {"NAME0": "Control Voltage of piezo 1", "NAME1": "Actual Position of axis 1"}
SIGNALS = {"u": (U, ""), "y": (Y, "")}


def write(path: Path, separator: str = " ", **entries: str | None) -> Path:
    return gcs(path, SIGNALS, separator=separator, **{**NAMED, **entries})


@pytest.mark.parametrize("name", ["log.gcs", "log.dat", "log.txt"])
def test_reads_an_array_by_its_first_line(tmp_path: Path, name: str) -> None:
    log = pt.read(write(tmp_path / name), **GIVEN)
    assert is_the_log(log, tolerance=1e-5)
    assert log.dt == DT


def test_other_separators(tmp_path: Path) -> None:
    for separator in ("\t", ",", ";"):
        path = write(tmp_path / "log.gcs", separator, SEPARATOR=str(ord(separator)))
        assert is_the_log(pt.read(path, **GIVEN), tolerance=1e-5)


def test_units_have_to_be_given(tmp_path: Path) -> None:
    path = write(tmp_path / "log.gcs")
    assert "no column is known to be the drive" in refusal(path)
    found = refusal(path, drive=0, displacement=1)
    assert "column 'Control Voltage of piezo 1' has no unit" in found


def test_without_names_columns_go_by_number(tmp_path: Path) -> None:
    path = write(tmp_path / "log.gcs", NAME0=None, NAME1=None)
    assert "name the columns by number" in refusal(path)
    log = pt.read(path, drive=0, displacement=1, units={0: "V", 1: "um"})
    assert is_the_log(log, tolerance=1e-5)


@pytest.mark.parametrize(
    ("entries", "said"),
    [
        ({"NDATA": "1000000000000"}, "log.gcs:6: says NDATA = 1000000000000 and has 400 samples"),
        ({"NDATA": "399"}, "log.gcs:6: says NDATA = 399 and has 400 samples"),
        ({"NDATA": "many"}, "log.gcs:6: NDATA is 'many': expected a whole number"),
        ({"DIM": "3"}, "log.gcs:4: says DIM = 3 and has 2 columns"),
        ({"DIM": "99999999999"}, "log.gcs:4: DIM is '99999999999': expected a whole number, 10000"),
        ({"SAMPLE_TIME": "-1"}, "log.gcs:5: SAMPLE_TIME is '-1': expected seconds above 0"),
        ({"SEPARATOR": "9999"}, "log.gcs:3: SEPARATOR is '9999'"),
    ],
)
def test_a_header_that_is_not_true_is_refused(
    tmp_path: Path, entries: dict[str, str], said: str
) -> None:
    assert refusal(write(tmp_path / "log.gcs", **entries)).startswith(said)


def test_a_header_without_an_end_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "log.gcs")
    text = path.read_text(encoding="ascii")
    path.write_text(text.replace("# END_HEADER", "#"), encoding="ascii")
    assert "no line '# END_HEADER'" in refusal(path)


def test_a_fault_is_named_by_its_line(tmp_path: Path) -> None:
    path = write(tmp_path / "log.gcs")
    lines = path.read_text(encoding="ascii").splitlines()
    lines[20] = "1.0 x "
    path.write_text("\n".join(lines), encoding="ascii")
    found = refusal(path, **GIVEN)
    assert found.startswith("log.gcs:21: 'x' in column 'Actual Position of axis 1'")
