"""LabVIEW measurement files, as the specification of version 2 has them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

import piezotrack as pt
from format_logs import DT, T, U, Y, is_the_log, refusal
from log_writers import lvm_header, lvm_segment

if TYPE_CHECKING:
    from pathlib import Path


SIGNALS = {"time": (T, "s"), "Voltage": (U, "Volts"), "Position": (Y, "um")}
HALVED = {**SIGNALS, "Voltage": (U / 2, "Volts"), "Position": (Y / 2, "um")}


def write(path: Path, text: str) -> Path:
    path.write_text(text, encoding="ascii")
    return path


@pytest.mark.parametrize("columns", ["No", "One", "Multi"])
@pytest.mark.parametrize("comma", [False, True])
def test_one_segment(tmp_path: Path, columns: str, comma: bool) -> None:
    body = lvm_segment(SIGNALS, columns)
    text = lvm_header(columns, comma) + (body.replace(".", ",") if comma else body)
    log = pt.read(write(tmp_path / "log.lvm", text))
    assert is_the_log(log, tolerance=1e-6)
    assert log.dt == pytest.approx(DT, rel=1e-12)


def test_of_several_segments_one_is_named(tmp_path: Path) -> None:
    text = lvm_header("No") + lvm_segment(SIGNALS, "No") + lvm_segment(HALVED, "No")
    path = write(tmp_path / "log.lvm", text)
    assert "'segment 1/Voltage' [V] (400 samples), 'segment 2/Voltage' [V] (400" in refusal(path)
    log = pt.read(path, drive="segment 2/Voltage")
    assert np.abs(log.u - U / 2).max() < 1e-6
    assert np.abs(log.y - Y / 2e6).max() < 1e-12


def test_times_that_are_not_those_of_delta_x_are_used(tmp_path: Path) -> None:
    path = write(tmp_path / "log.lvm", lvm_header("One") + lvm_segment(SIGNALS, "One", delta=1.0))
    log = pt.read(path)
    assert log.dt == pytest.approx(DT)


def test_times_with_a_gap_are_not_taken_for_those_of_delta_x(tmp_path: Path) -> None:
    late = T + 0.5 * (np.arange(T.size) >= 200)
    for columns in ("One", "Multi"):
        body = lvm_segment({**SIGNALS, "time": (late, "s")}, columns)
        path = write(tmp_path / "log.lvm", lvm_header(columns) + body)
        assert "it goes 0.505 s forward to sample 200" in refusal(path)
        assert pt.read(path, resample=DT).duration == pytest.approx(2.5)


def test_times_with_jitter_are_those_of_delta_x(tmp_path: Path) -> None:
    jittery = T + 0.3 * DT * (np.arange(T.size) % 2)
    body = lvm_segment({**SIGNALS, "time": (jittery, "s")}, "One")
    log = pt.read(write(tmp_path / "log.lvm", lvm_header("One") + body))
    assert log.dt == DT


def test_blocks_of_other_programs_are_skipped(tmp_path: Path) -> None:
    special = "***Start_Special***\t\nX_Value\tanything\n***End_Special***\t\n"
    text = lvm_header("No") + special + lvm_segment(SIGNALS, "No")
    assert is_the_log(pt.read(write(tmp_path / "log.lvm", text)), tolerance=1e-6)


def test_fewer_samples_than_the_header_says_are_refused(tmp_path: Path) -> None:
    text = lvm_header("One") + lvm_segment(SIGNALS, "One", samples=10**9)
    found = refusal(write(tmp_path / "log.lvm", text))
    assert "says 1000000000 samples and has 400: expected equally many" in found


def test_more_samples_than_the_header_says_are_read_with_a_note(tmp_path: Path) -> None:
    """LabVIEW writes one header before several blocks, where it is told to."""
    text = lvm_header("No") + lvm_segment(SIGNALS, "No", samples=100)
    log = pt.read(write(tmp_path / "log.lvm", text))
    assert is_the_log(log, tolerance=1e-6)
    (note,) = log.notes
    assert "says 100 samples" in note
    assert "400" in note
    # Cut off behind that number, it is told by its last line.
    cut = text.rstrip()[:-3]
    assert "cut off" in refusal(write(tmp_path / "log.lvm", cut))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("columns", ["No", "One"])
@pytest.mark.parametrize("delta", [math.inf, math.nan])
def test_an_interval_that_is_none_is_not_stated(tmp_path: Path, columns: str, delta: float) -> None:
    text = lvm_header(columns) + lvm_segment(SIGNALS, columns, delta=delta)
    path = write(tmp_path / "log.lvm", text)
    if columns == "No":
        assert "sampling interval" in refusal(path)
    else:
        assert pt.read(path).dt == pytest.approx(DT)
    assert pt.data.info(path).summary()


def test_a_file_without_a_second_header_is_refused(tmp_path: Path) -> None:
    found = refusal(write(tmp_path / "log.lvm", lvm_header("One")))
    assert "has 1 lines '***End_of_Header***'" in found
    text = lvm_header("One") + lvm_segment(SIGNALS, "One")
    cut = text[: text.rindex("***End_of_Header***") + 25]
    refusal(write(tmp_path / "log.lvm", cut))


def test_a_fault_is_named(tmp_path: Path) -> None:
    text = lvm_header("One") + lvm_segment(SIGNALS, "One").replace("0.100000", "late", 1)
    found = refusal(write(tmp_path / "log.lvm", text), time="X_Value")
    assert "X_Value" in found
