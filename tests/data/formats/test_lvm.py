"""LabVIEW measurement files, as the specification of version 2 has them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

import piezotrack as pt
from format_logs import DT, T, U, Y, is_the_log, refusal

if TYPE_CHECKING:
    from pathlib import Path


def header(columns: str, comma: bool = False) -> str:
    return (
        "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\n"
        f"Decimal_Separator\t{',' if comma else '.'}\nMulti_Headings\tYes\nX_Columns\t{columns}\n"
        "Time_Pref\tRelative\nOperator\tme\nDate\t2024/03/12\nTime\t10:00:00,5\n"
        "***End_of_Header***\t\n\t\n"
    )


def segment(columns: str, samples: int = 400, delta: float = DT, scale: float = 1.0) -> str:
    titles = {
        "No": "X_Value\tVoltage\tPosition\tComment",
        "One": "X_Value\tVoltage\tPosition\tComment",
        "Multi": "X_Value\tVoltage\tX_Value\tPosition\tComment",
    }[columns]
    lines = [
        "Channels\t2\t\t",
        f"Samples\t{samples}\t{samples}\t",
        "Date\t2024/03/12\t2024/03/12\t",
        "Y_Unit_Label\tVolts\tum\t",
        "X_Dimension\tTime\tTime\t",
        "X0\t0.0000000000000000E+0\t0.0000000000000000E+0\t",
        f"Delta_X\t{delta:.6f}\t{delta:.6f}\t",
        "***End_of_Header***\t\t\t",
        titles,
    ]
    for k, (t, u, y) in enumerate(zip(T, scale * U, scale * Y, strict=True)):
        x = "" if columns == "No" else f"{t:.6f}"
        second = f"{x}\t" if columns == "Multi" else ""
        lines.append(f"{x}\t{u:.6f}\t{second}{y:.6f}" + ("\tbegun" if k == 0 else ""))
    return "\n".join(lines) + "\n\n"


def write(path: Path, text: str) -> Path:
    path.write_text(text, encoding="ascii")
    return path


@pytest.mark.parametrize("columns", ["No", "One", "Multi"])
@pytest.mark.parametrize("comma", [False, True])
def test_one_segment(tmp_path: Path, columns: str, comma: bool) -> None:
    body = segment(columns)
    text = header(columns, comma) + (body.replace(".", ",") if comma else body)
    log = pt.read(write(tmp_path / "log.lvm", text))
    assert is_the_log(log, tolerance=1e-6)
    assert log.dt == pytest.approx(DT, rel=1e-12)


def test_of_several_segments_one_is_named(tmp_path: Path) -> None:
    text = header("No") + segment("No") + segment("No", scale=0.5)
    path = write(tmp_path / "log.lvm", text)
    assert "'segment 1/Voltage' [V] (400 samples), 'segment 2/Voltage' [V] (400" in refusal(path)
    log = pt.read(path, drive="segment 2/Voltage")
    assert np.abs(log.u - U / 2).max() < 1e-6
    assert np.abs(log.y - Y / 2e6).max() < 1e-12


def test_times_that_are_not_those_of_delta_x_are_used(tmp_path: Path) -> None:
    path = write(tmp_path / "log.lvm", header("One") + segment("One", delta=1.0))
    log = pt.read(path)
    assert log.dt == pytest.approx(DT)


def test_blocks_of_other_programs_are_skipped(tmp_path: Path) -> None:
    special = "***Start_Special***\t\nX_Value\tanything\n***End_Special***\t\n"
    text = header("No") + special + segment("No")
    assert is_the_log(pt.read(write(tmp_path / "log.lvm", text)), tolerance=1e-6)


def test_fewer_samples_than_the_header_says_are_refused(tmp_path: Path) -> None:
    text = header("One") + segment("One", samples=10**9)
    found = refusal(write(tmp_path / "log.lvm", text))
    assert "says 1000000000 samples and has 400: expected equally many" in found


def test_a_file_without_a_second_header_is_refused(tmp_path: Path) -> None:
    found = refusal(write(tmp_path / "log.lvm", header("One")))
    assert "has 1 lines '***End_of_Header***'" in found
    text = header("One") + segment("One")
    cut = text[: text.rindex("***End_of_Header***") + 25]
    refusal(write(tmp_path / "log.lvm", cut))


def test_a_fault_is_named(tmp_path: Path) -> None:
    text = header("One") + segment("One").replace("0.100000", "late", 1)
    found = refusal(write(tmp_path / "log.lvm", text), time="X_Value")
    assert "X_Value" in found
