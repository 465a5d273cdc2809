"""CSV of Digilent WaveForms."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

import piezotrack as pt
from format_logs import T, U, Y, is_the_log, refusal
from log_writers import waveforms

if TYPE_CHECKING:
    from pathlib import Path

GIVEN: dict[str, Any] = {
    "drive": "Channel 1",
    "displacement": "Channel 2 (V)",
    "units": {"Channel 2": "um"},
}


def write(path: Path, rate: str = "200Hz", time: bool = True) -> Path:
    channels = {"Channel 1": (U, "V"), "Channel 2": (Y, "V")}
    begins = {"Time": (T - 1.0, "s")} if time else {}
    return waveforms(path, {**begins, **channels}, rate=rate)


def test_the_time_may_begin_before_the_trigger(tmp_path: Path) -> None:
    log = pt.read(write(tmp_path / "log.csv"), **GIVEN)
    assert is_the_log(log, tolerance=1e-8)
    assert log.t[0] == -1.0


@pytest.mark.parametrize("rate", ["200Hz", "0.2 kHz", "2e-4MHz"])
def test_without_times_the_rate_is_that_of_the_comment(tmp_path: Path, rate: str) -> None:
    log = pt.read(write(tmp_path / "log.csv", rate, time=False), **GIVEN)
    assert is_the_log(log, tolerance=1e-8)


def test_a_rate_that_is_none_is_refused(tmp_path: Path) -> None:
    found = refusal(write(tmp_path / "log.csv", "0Hz", time=False))
    assert found == "log.csv:5: the sample rate is '0': expected hertz above 0"


def test_fewer_samples_than_the_comment_says_are_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "log.csv")
    content = path.read_text(encoding="utf-8")
    lines = content.splitlines(keepends=True)
    path.write_text("".join(lines[:-1]), encoding="utf-8")
    assert refusal(path, **GIVEN).startswith("log.csv:6: says 400 samples and has 399: ")
    # Within a sample, whatever field it is.
    for length in range(int(0.6 * len(content)), int(0.6 * len(content)) + 50):
        path.write_text(content[:length], encoding="utf-8")
        assert "cut off" in refusal(path, **GIVEN)


def test_a_fault_is_named_by_its_line(tmp_path: Path) -> None:
    path = write(tmp_path / "log.csv")
    text = path.read_text(encoding="utf-8").replace("-0.995,", "-0.995,x")
    path.write_text(text, encoding="utf-8")
    assert refusal(path, **GIVEN).startswith("log.csv:11: 'x0.")
