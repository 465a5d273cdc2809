"""Text of instruments that have lines above the titles, in the layouts that they write.

The layouts, not files, are public: Keysight's "x-axis,1" and units in words (readers of
InfiniiVision exports), Tektronix's settings above TIME (as of MDO and TBS) or beside the samples
(as of TDS), Rigol's "X,CH1,Start,Increment" with the interval in line 2 (DS1000Z) and "Time,X(CH1)"
(DS1000E), PicoScope 6's units in brackets and a blank line, and AFM Workshop's settings above
"Extend Z-Sense(nm)" (docstring of afmformats' loader). NT-MDT's Nova exports columns without
titles, with decimal commas.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt
from format_logs import DT, T, U, Y, is_the_log, refusal

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

# The sensor gives a volt for each micrometre.
GIVEN: dict[str, Any] = {"drive": "CH1", "displacement": "CH2", "units": {"CH2": "um"}}


def rows(*columns: Any, mark: str = ",", end: str = "") -> str:
    lines = zip(*columns, strict=True)
    return "".join(f"{mark.join(f'{x:.9e}' for x in line)}{end}\n" for line in lines)


def keysight() -> str:
    return "x-axis,1,2\nsecond,Volt,Volt\n" + rows(T, U, Y)


def rigol() -> str:
    head = f"X,CH1,CH2,Start,Increment,\nSequence,Volt,Volt,-1.0e-03,{DT:e}\n"
    samples = zip(range(T.size), U, Y, strict=True)
    return head + "".join(f"{k},{u:.9e},{y:.9e},\n" for k, u, y in samples)


def older_rigol() -> str:
    return "Time,X(CH1),X(CH2)\nSecond,Volt,Volt\n" + rows(T, U, Y)


def tektronix() -> str:
    settings = [
        "Model,MDO3014", "Firmware Version,1.26", "", "Waveform Type,ANALOG,", "Point Format,Y,",
        "Horizontal Units,s,", "Horizontal Scale,0.2,", f"Sample Interval,{DT},",
        "Record Length,400,", "Vertical Units,V,V", "Vertical Scale,10,10", ",,", ",,", "Label,,",
    ]  # fmt: skip
    return "\n".join(settings) + "\nTIME,CH1,CH2\n" + rows(T, U, Y)


def picoscope(times: float = 1e3, unit: str = "ms") -> str:
    return f"Time,Channel A,Channel B\n({unit}),(V),(V)\n\n" + rows(times * T, U, Y)


CHANNELS: dict[str, Any] = {
    "drive": "Channel A", "displacement": "Channel B", "units": {"Channel B": "um"}
}  # fmt: skip
LOGS: list[tuple[Callable[[], str], dict[str, Any]]] = [
    (keysight, GIVEN),
    (rigol, GIVEN),
    (older_rigol, GIVEN),
    (tektronix, GIVEN),
    (picoscope, CHANNELS),
]


@pytest.mark.parametrize(("text", "given"), LOGS, ids=[text.__name__ for text, _ in LOGS])
def test_a_capture_is_read_with_the_units_of_the_file(
    tmp_path: Path, text: Callable[[], str], given: dict[str, Any]
) -> None:
    path = tmp_path / "capture.csv"
    path.write_text(text(), encoding="utf-8")
    log = pt.read(path, **given)
    assert is_the_log(log, tolerance=1e-7)
    assert log.drive_unit == "V"
    assert any("by units=, V in the file" in note for note in log.notes)
    assert pt.data.info(path, **given).format == "oscilloscope"


@pytest.mark.parametrize(("text", "given"), LOGS, ids=[text.__name__ for text, _ in LOGS])
def test_a_fault_is_named_by_the_line_of_the_file(
    tmp_path: Path, text: Callable[[], str], given: dict[str, Any]
) -> None:
    lines = text().splitlines()
    fields = lines[-5].split(",")
    fields[1] = "x"
    lines[-5] = ",".join(fields)
    path = tmp_path / "capture.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    assert refusal(path, **given).startswith(f"capture.csv:{len(lines) - 4}: 'x' in column")


def test_one_channel_beside_its_settings(tmp_path: Path) -> None:
    """As of Tektronix TDS: it has a drive alone."""
    settings = ["Record Length,4.0e+02", "Sample Interval,5.0e-03", "Trigger Point,0.0",
                "Source,CH1", "Vertical Units,V", "Horizontal Units,s"]  # fmt: skip
    begins = [*settings, *([","] * (T.size - len(settings)))]
    path = tmp_path / "F0000CH1.CSV"
    samples = zip(begins, T, U, strict=True)
    path.write_text("".join(f"{one},,{t:.6f}, {u:.8f},\n" for one, t, u in samples))
    t, u = pt.data.read_drive(path, drive="CH1")
    assert np.abs(t - T).max() < 1e-9
    assert np.abs(u - U).max() < 1e-7
    assert "displacement" in refusal(path, drive="CH1")


def test_a_curve_of_afm_workshop(tmp_path: Path) -> None:
    path = tmp_path / "curve.csv"
    head = (
        "Force-Distance Curve\nFile Format:    3\n\nDate:    Wednesday, August 1, 2018\n"
        "Mode:    Single\nX, um:    27.25\nLight Lever Gain, mV/nm:    1.0\n\n"
        "Extend Z-Sense(nm),Extend T-B(V),Retract Z-Sense(nm),Retract T-B(V)\n"
    )
    path.write_text(head + rows(1e3 * Y, U, 1e3 * Y[::-1], U[::-1]), encoding="utf-8")
    log = pt.read(path, drive="Extend T-B", displacement="Extend Z-Sense", dt=DT)
    assert is_the_log(log, tolerance=1e-5)
    assert np.abs(log.columns["Retract Z-Sense"] - 1e-6 * Y[::-1]).max() < 1e-12


def test_a_text_of_nt_mdt(tmp_path: Path) -> None:
    path = tmp_path / "curve.txt"
    lines = rows(1e3 * U, 1e3 * Y, np.zeros(T.size), mark="\t").replace(".", ",")
    path.write_text(lines, encoding="utf-8")
    log = pt.read(path, drive=0, displacement=1, units={0: "nm", 1: "nm"}, dt=DT)
    assert log.drive_unit == "m"
    assert np.abs(log.u - 1e-6 * U).max() < 1e-12
    assert np.abs(log.y - 1e-6 * Y).max() < 1e-12


@pytest.mark.parametrize("mark", ["\n", "\r\n"])
def test_lines_above_the_titles_are_skipped(tmp_path: Path, mark: str) -> None:
    path = tmp_path / "log.csv"
    text = "Setup 7, amplifier A\nrange,high\ntime_s,voltage_V,x_um\n" + rows(T, U, Y)
    path.write_text(text.replace("\n", mark), encoding="utf-8", newline="")
    assert "skip=2" in refusal(path)
    assert is_the_log(pt.read(path, skip=2), tolerance=1e-7)
    assert pt.data.info(path, skip=2).problem == ""
    assert np.abs(pt.data.read_drive(path, skip=2).u - U).max() < 1e-7
    broken = text.replace(f"{T[4]:.9e},", "no,")
    path.write_text(broken, encoding="utf-8")
    assert refusal(path, skip=2).startswith("log.csv:8: 'no' in column 'time_s'")
    for wrong in (-1, 2.5, True, "2"):
        with pytest.raises(pt.ParameterError, match=r"skip is .* expected a number of lines"):
            pt.read(path, skip=wrong)  # type: ignore[arg-type]


def test_columns_without_a_reading_are_no_candidates(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    samples = zip(T, U, Y, strict=True)
    lines = "".join(f",{t:.6f},{u:.9e},,{y:.9e}\n" for t, u, y in samples)
    path.write_text(f"t_ms,time_s,voltage_V,input_V,x_um\n{lines}", encoding="utf-8")
    assert is_the_log(pt.read(path), tolerance=1e-7)
    path.write_text(f"t_ms,time_s,a_V,b_V,x_um\n{lines}", encoding="utf-8")
    said = refusal(path)
    assert "'a_V'" in said
    assert "'b_V'" not in said
